"""A scene as a LAMMPS deck: the commands, and the particles as a data file."""

from pathlib import Path

import numpy as np

from sim import Scene
from sim.kernel import Array, Indices
from sim.motion import Bodies
from sim.species import Contact
from suffice.engine.regions import number, numbers, wall_commands

DATA, DUMP, LOG, DECK = "start.data", "run.dump", "run.log", "deck.in"  # files of a working folder
SKIN = 0.15  # of the largest diameter: of 0.04, 0.1 and 0.3 the best differ between decks by less than runs do
COLUMNS = "id x y z vx vy vz omegax omegay omegaz"


def contact_law(contact: Contact) -> str:
    """Arguments of the style granular for a contact: Hooke, restitution e as ours, tangential history where it rubs.

    η = −2 ln(e) sqrt(k m* / (ln²e + π²)) is what `coeff_restitution` makes of e; η_t = x_t η.
    """
    normal = f"hooke {number(contact.stiffness)} {number(contact.restitution)} damping coeff_restitution"
    if contact.friction == 0.0:
        return f"{normal} tangential linear_nohistory 0.0 0.0"
    spring = contact.tangential_stiffness_ratio * contact.stiffness
    return (
        f"{normal} tangential linear_history {number(spring)} {number(contact.tangential_damping_ratio)} "
        f"{number(contact.friction)}"
    )


def deck_of(scene: Scene, walls: Bodies | None, dt: float, every: int, steps: int, ranks: int) -> str:
    """Return the commands that run a scene for `steps` of dt (s) and dump all particles every so many."""
    weight = ""
    if scene.gravity is not None and any(scene.gravity.acceleration):
        g = np.array(scene.gravity.acceleration)
        weight = f"fix weight all gravity {number(float(np.linalg.norm(g)))} vector {numbers(g)}\n"
    skin = SKIN * max(table.largest for table in scene.particles)
    spread = "fix spread all balance 1000 1.1 shift xyz 10 1.05\n" if ranks > 1 else ""
    return f"""units si
atom_style sphere
boundary m m m
newton off
comm_modify vel yes
read_data {DATA}
neighbor {number(skin)} bin
neigh_modify delay 0 every 1 check yes
pair_style granular
pair_coeff * * {contact_law(scene.contact)}
timestep {number(dt)}
fix move all nve/sphere
{weight}{wall_commands(scene, walls, [contact_law(contact) for contact in scene.contacts_with_walls])}
{spread}dump out all custom {every} {DUMP} {COLUMNS}
dump_modify out format float %.17g
thermo {every}
thermo_style custom step
thermo_modify flush yes
run {steps}
"""


def write_data(
    path: Path, diameter: Array, density: Array, kind: Indices, position: Array, velocity: Array, spin: Array | None
) -> None:
    """Write spheres of n diameters (m) and densities (kg/m³) as a data file; atom ids are their rows plus one."""
    n = len(position)
    ids, margin = np.arange(1, n + 1), diameter.max()
    lowest, highest = position.min(axis=0) - margin, position.max(axis=0) + margin
    turning = np.zeros((n, 3)) if spin is None else spin
    with path.open("w", encoding="ascii") as file:
        file.write(f"spheres\n\n{n} atoms\n{kind.max() + 1} atom types\n\n")
        for axis, low, high in zip("xyz", lowest, highest, strict=True):
            file.write(f"{number(low)} {number(high)} {axis}lo {axis}hi\n")
        file.write("\nAtoms # sphere\n\n")
        np.savetxt(file, np.column_stack([ids, kind + 1, diameter, density, position]), fmt=["%d"] * 2 + ["%.17g"] * 5)
        file.write("\nVelocities\n\n")
        np.savetxt(file, np.column_stack([ids, velocity, turning]), fmt=["%d"] + ["%.17g"] * 6)
