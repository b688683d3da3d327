"""From a scene's tables to the arrays and laws that compiled code takes."""

from math import pi

import numpy as np

from sim.combination import rows_of
from sim.grid import grid_of
from sim.kernel import Array
from sim.law import ContactLaw, contact_law
from sim.motion import FIXED, MOTION_PARAMETERS, OSCILLATING, ROTATING, TRANSLATING, Bodies, move_bodies
from sim.repeating import check_repeating
from sim.scene import Scene
from sim.solids import Meshes, direction, solids_of
from sim.species import Contact
from sim.vessel import Oscillation, Rotation, WallTable


def law_of(contact: Contact) -> ContactLaw:
    """Return the constants of a contact table."""
    return contact_law(
        contact.stiffness,
        contact.restitution,
        contact.friction,
        contact.tangential_stiffness_ratio,
        contact.tangential_damping_ratio,
        contact.attraction,
        rolling_constants(contact),
    )


def rolling_constants(contact: Contact) -> tuple[float, float, float]:
    """Return μ_r, k_r / R*² = 2.25 k μ_r² (0: a constant moment) and the share of critical damping."""
    if contact.rolling is None:
        return 0.0, 0.0, 0.0
    friction = contact.rolling.friction
    if contact.rolling.model == "constant":
        return friction, 0.0, 0.0
    return friction, 2.25 * contact.stiffness * friction**2, contact.rolling.damping


def laws_of(scene: Scene) -> Array | None:
    """Return the constants of every pair of species, shape (species, species, constants); None where all are equal."""
    if not scene.pair_contact:
        return None
    names = scene.species
    laws = np.zeros((len(names), len(names), len(ContactLaw._fields)))
    laws[:] = law_of(scene.contact)
    for table in scene.pair_contact:
        i, j = (names.index(name) for name in table.between)
        laws[i, j] = laws[j, i] = law_of(table)
    return laws


def laws_of_walls(scene: Scene) -> Array:
    """Return the constants of every body's contacts, shape (bodies, constants), in the order of ContactLaw."""
    return np.array([law_of(contact) for contact in scene.contacts_with_walls]).reshape(-1, len(ContactLaw._fields))


def _sizes_to_resolve(scene: Scene) -> list[float]:
    """Return the sizes (m) of what meets meshes: the particles, and where the fluid does, its cells' diagonals."""
    sizes = [size for table in scene.particles for size in (table.smallest, table.largest)]
    if scene.fluid is None:
        return sizes
    spacing = grid_of(scene.fluid, scene.repeats).spacing
    sizes = sizes or [min(spacing)]
    if any(wall.immersed for wall in scene.walls):
        sizes.append(max(2.0 * max(spacing), min(sizes)))
    return sizes


def walls_of(scene: Scene) -> Bodies | None:
    """Return the walls of a scene at time zero, or None where it has none.

    Raises InputError for a shape that is none: without a direction or a volume, or an STL file that is refused, and for
    one that a periodic box cuts.
    """
    if not scene.walls:
        return None
    meshes = Meshes(_sizes_to_resolve(scene))
    solids = [(b, solid) for b, table in enumerate(scene.walls) for solid in solids_of(b, table, meshes)]
    rows, program = rows_of([solid for _, solid in solids])
    blocks, spline = meshes.arrays()
    n = len(scene.walls)
    motion, law, centre = np.full(n, FIXED, np.int64), np.zeros((n, MOTION_PARAMETERS)), np.zeros((n, 3))
    for b, table in enumerate(scene.walls):
        motion[b], law[b], centre[b] = _motion_of(b, table)
    zero = np.zeros((n, 3))
    walls = Bodies(
        np.array([row.kind for row in rows], np.int64),
        np.array([row.parameter for row in rows]),
        np.array([row.side for row in rows]),
        np.array([b for b, _ in solids], np.int64),
        motion,
        law,
        np.tile(np.eye(3), (n, 1, 1)),
        centre,
        zero,
        zero.copy(),
        zero.copy(),
        program,
        blocks,
        spline,
    )
    check_repeating(scene)
    move_bodies(walls, 0.0)
    return walls


def _motion_of(b: int, table: WallTable) -> tuple[int, Array, Array]:
    """Return kind, law and centre of the motion of a body."""
    moves, law, centre = table.motion, np.zeros(MOTION_PARAMETERS), np.zeros(3)
    if isinstance(moves, Rotation):
        law[:7] = *direction(f"walls.{b}.motion.axis", moves.axis), *moves.point, moves.rpm * 2.0 * pi / 60.0
        return ROTATING, law, np.array(moves.point)
    if isinstance(moves, Oscillation):
        law[:5] = *moves.amplitude, 2.0 * pi * moves.frequency, moves.phase
        return OSCILLATING, law, centre
    if moves is not None:
        law[:3] = moves.velocity
        return TRANSLATING, law, centre
    return FIXED, law, centre
