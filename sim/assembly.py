"""From a scene's tables to the arrays and laws that compiled code takes."""

from math import pi

import numpy as np

from sim.errors import InputError
from sim.kernel import Array
from sim.law import ContactLaw, contact_law
from sim.motion import FIXED, MOTION_PARAMETERS, OSCILLATING, ROTATING, TRANSLATING, Bodies, move_bodies, rotation_about
from sim.scene import Scene
from sim.shapes import BOX, CYLINDER, PARAMETERS, PLANE, TUBE
from sim.species import Contact
from sim.vessel import Box, Cylinder, Oscillation, Plane, Rotation, WallTable

Shape = tuple[int, Array, float]  # kind, parameters, side


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


def direction(field: str, vector: tuple[float, float, float]) -> Array:
    """Return the vector at length 1; InputError where it has none."""
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < np.inf:
        raise InputError(f"{field} = {list(vector)}: has no direction; give a vector of finite, non-zero length")
    return np.array(vector) / length


def _row(*values: object) -> Array:
    row = np.zeros(PARAMETERS)
    flat = np.concatenate([np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in values])
    row[: len(flat)] = flat
    return row


def _box_shapes(field: str, box: Box) -> list[Shape]:
    lowest, highest = np.array(box.lowest), np.array(box.highest)
    if not (lowest < highest).all():
        raise InputError(
            f"{field}.highest = {list(box.highest)} m: must exceed lowest = {list(box.lowest)} m in every direction"
        )
    if box.particles == "outside":
        return [(BOX, _row((lowest + highest) / 2, (highest - lowest) / 2), 1.0)]
    shapes = []
    for axis, name in enumerate("xyz"):
        for sign, corner, inward in (("-", lowest, 1.0), ("+", highest, -1.0)):
            if f"{sign}{name}" not in box.open:
                shapes.append((PLANE, _row(corner, inward * np.eye(3)[axis]), 1.0))
    return shapes


def _cylinder_shapes(field: str, cylinder: Cylinder) -> list[Shape]:
    axis, centre = direction(f"{field}.axis", cylinder.axis), np.array(cylinder.centre)
    side = 1.0 if cylinder.particles == "outside" else -1.0
    if cylinder.length is None:
        return [(TUBE, _row(centre, axis, cylinder.radius), side)]
    half = cylinder.length / 2
    if cylinder.particles == "outside":
        return [(CYLINDER, _row(centre, axis, cylinder.radius, half), 1.0)]
    ends = [(PLANE, _row(centre - sign * half * axis, sign * axis), 1.0) for sign in (1.0, -1.0)]
    return [(TUBE, _row(centre, axis, cylinder.radius), -1.0), *ends]


def _copies(field: str, cylinder: Cylinder, motion: object) -> list[Cylinder]:
    if cylinder.copies == 1:
        return [cylinder]
    if not isinstance(motion, Rotation):
        raise InputError(f"{field}.copies = {cylinder.copies}: only a body with a rotation has an axis to copy about")
    axis, point = direction(f"{field}.motion.axis", motion.axis), np.array(motion.point)
    turned = []
    for k in range(cylinder.copies):
        turn = np.zeros((3, 3))
        rotation_about(axis, 2.0 * pi * k / cylinder.copies, turn)
        centre = turn @ (np.array(cylinder.centre) - point) + point
        pointing = turn @ np.array(cylinder.axis)
        turned.append(cylinder.model_copy(update={"centre": tuple(centre), "axis": tuple(pointing), "copies": 1}))
    return turned


def shapes_of(index: int, table: WallTable) -> list[Shape]:
    """Return the signed distance functions of a body, in its frame."""
    shapes: list[Shape] = []
    for k, shape in enumerate(table.shapes):
        field = f"walls.{index}.shapes.{k}"
        if isinstance(shape, Plane):
            shapes.append((PLANE, _row(shape.point, direction(f"{field}.normal", shape.normal)), 1.0))
        elif isinstance(shape, Box):
            shapes += _box_shapes(field, shape)
        else:
            for copy in _copies(field, shape, table.motion):
                shapes += _cylinder_shapes(field, copy)
    return shapes


def walls_of(scene: Scene) -> Bodies | None:
    """Return the walls of a scene at time zero, or None where it has none."""
    if not scene.walls:
        return None
    rows = [(b, *shape) for b, table in enumerate(scene.walls) for shape in shapes_of(b, table)]
    n = len(scene.walls)
    motion, law, centre = np.full(n, FIXED, np.int64), np.zeros((n, MOTION_PARAMETERS)), np.zeros((n, 3))
    for b, table in enumerate(scene.walls):
        moves = table.motion
        if isinstance(moves, Rotation):
            motion[b], centre[b] = ROTATING, moves.point
            law[b, :3] = direction(f"walls.{b}.motion.axis", moves.axis)
            law[b, 3:7] = *moves.point, moves.rpm * 2.0 * pi / 60.0
        elif isinstance(moves, Oscillation):
            motion[b] = OSCILLATING
            law[b, :5] = *moves.amplitude, 2.0 * pi * moves.frequency, moves.phase
        elif moves is not None:
            motion[b] = TRANSLATING
            law[b, :3] = moves.velocity
    zero = np.zeros((n, 3))
    walls = Bodies(
        np.array([kind for _, kind, _, _ in rows], np.int64),
        np.array([parameter for _, _, parameter, _ in rows]),
        np.array([side for _, _, _, side in rows]),
        np.array([b for b, _, _, _ in rows], np.int64),
        motion,
        law,
        np.tile(np.eye(3), (n, 1, 1)),
        centre,
        zero,
        zero.copy(),
        zero.copy(),
    )
    move_bodies(walls, 0.0)
    return walls
