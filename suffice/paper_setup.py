"""What two cases are made of, as the paper's Tables 1 and 2 list it."""

from collections.abc import Iterator, Mapping, Sequence
from math import pi
from typing import Any, NamedTuple

from sim import Scene
from sim.species import Contact
from sim.vessel import Rotation
from suffice.swept import swept_radius


class Property(NamedTuple):
    """One row of a table."""

    name: str
    unit: str
    value: Any  # number or words; None where the scene has no such thing


def properties(scene: Scene, cost: Mapping[str, Any]) -> list[Property]:
    """Return properties of particles and fluid and the conditions of the calculation. cost: as `simulate_to` says."""
    return [
        *_particles(scene),
        *_contact(scene.contact),
        *_fluid(scene),
        Property("time step of the particles", "s", cost["time_step"]),
        Property("testing interval", "s", scene.output.interval),
    ]


def setup(scene: Scene, cost: Mapping[str, Any]) -> list[Property]:
    """Return how a case is set up and run."""
    turning = [(wall, wall.motion.rpm) for wall in scene.walls if isinstance(wall.motion, Rotation)]
    rotor, rpm = turning[-1] if turning else (None, None)
    reach = None if rotor is None else swept_radius(rotor)
    turns = None if rpm is None else abs(rpm) / 60.0
    return [
        Property("particles", "", cost["n_particles"]),
        Property("volume fraction of particles", "", cost["volume_fraction"]),
        Property("rotor speed", "1/min", rpm),
        Property("radius swept by the rotor", "m", reach),
        Property("tip speed", "m/s", None if turns is None or reach is None else 2.0 * pi * turns * reach),
        Property("duration", "s", scene.time.duration),
        Property("turns of the rotor", "", None if turns is None else turns * scene.time.duration),
        Property("packing", "", f"at random, seed {scene.seed}"),
    ]


def beside(names: Sequence[str], lists: Sequence[Sequence[Property]]) -> list[dict[str, Any]]:
    """Return a row for each property with its value in every case; one that no case has is left out.

    names: keys of the cases; lists: their properties, alike in kind and order.
    """
    known = [{(one.name, one.unit): one.value for one in own} for own in lists]
    keys = dict.fromkeys(key for own in known for key in own)
    rows = [
        {"property": name, "unit": unit} | {case: own.get((name, unit)) for case, own in zip(names, known, strict=True)}
        for name, unit in keys
    ]
    return [row for row in rows if any(row[case] is not None for case in names)]


def _particles(scene: Scene) -> Iterator[Property]:
    for k, table in enumerate(scene.particles):
        of = "" if len(scene.particles) == 1 else f" of {scene.species[k]}"
        yield Property(f"particle diameter{of}", "m", table.diameter)
        yield Property(f"particle density{of}", "kg/m³", table.density)


def _contact(contact: Contact) -> Iterator[Property]:
    yield Property("spring constant", "N/m", contact.stiffness)
    yield Property("restitution coefficient", "", contact.restitution)
    yield Property("friction coefficient", "", contact.friction)
    if contact.rolling is not None:
        yield Property("rolling friction coefficient", "", contact.rolling.friction)


def _fluid(scene: Scene) -> Iterator[Property]:
    fluid = scene.fluid
    if fluid is None:
        return
    yield Property("fluid density", "kg/m³", fluid.density)
    yield Property("fluid viscosity", "Pa s", fluid.viscosity)
    yield Property("fluid cells", "", " × ".join(map(str, fluid.cells)))
    sizes = [(b - a) / n for a, b, n in zip(fluid.lowest, fluid.highest, fluid.cells, strict=True)]
    yield Property("size of a cell", "mm", " × ".join(f"{1e3 * size:.3g}" for size in sizes))
    if scene.drag is not None:
        yield Property("drag", "", f"{scene.drag.law}, {scene.drag.coupling}")
