"""The rotating wall of a scene, and how far within its period it is."""

from collections.abc import Iterator, Mapping, Sequence
from math import gcd, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import Scene
from sim.vessel import Capsule, Cone, Cylinder, Plane, Rotation, Sphere, Torus, WallTable
from suffice.refusal import Refusal

MAY_DIFFER = ("seed", "time", "output", "limits", "start")  # tables that are no part of the flow at a speed
PARALLEL = 1e-9  # sine of the angle, or distance from the axis over the size, that is rounding


class Rotor(NamedTuple):
    """A wall that turns steadily."""

    name: str
    rpm: float  # 1/min
    fold: int  # equal positions in a turn; 0 for a body that is round about its axis

    @property
    def turn(self) -> float:
        """Time of one turn, s."""
        return 60.0 / abs(self.rpm)

    @property
    def period(self) -> float:
        """Time after which the body stands where an equal part of it stood, s; of a round one, a turn."""
        return self.turn / max(self.fold, 1)


def rotor_of(scene: Scene, source: str = "") -> Rotor:
    """Return the one wall of a scene that rotates.

    Raises `Refusal` where none does, or several: then it is not clear what the speed of a run is.
    """
    moving = [(wall, wall.motion) for wall in scene.walls if isinstance(wall.motion, Rotation) and wall.motion.rpm]
    if len(moving) != 1:
        found = ", ".join(repr(wall.name) for wall, _ in moving) or "none"
        raise Refusal(f"scene {source}: one wall has to rotate, {found} does; give a scene with a single rotor")
    wall, motion = moving[0]
    return Rotor(wall.name, motion.rpm, fold_of(wall, motion))


def check_one_scene(scenes: Sequence[Scene]) -> None:
    """Raise `Refusal` unless the scenes of all runs are the same but for the speed of their rotors.

    Time, output, limits, the start, the seed and the steps of the fluid may differ.
    """
    first, *others = [_at_any_speed(scene) for scene in scenes]
    for other in others:
        for place, one, another in _differing(first, other):
            raise Refusal(
                f"runs: they differ in more than the speed of the rotor, {place} is {one} and {another}; give runs of "
                "one scene at several speeds"
            )


def _at_any_speed(scene: Scene) -> dict[str, Any]:
    told = scene.model_dump(mode="json", exclude=set(MAY_DIFFER))
    for wall in told["walls"]:
        (wall["motion"] or {}).pop("rpm", None)
    for step in ("step", "largest_step"):
        (told["fluid"] or {}).pop(step, None)
    return told


def _differing(one: Any, another: Any, place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Every place at which two trees of tables and lists differ, with what stands there."""
    if isinstance(one, Mapping) and isinstance(another, Mapping):
        pairs = [(key, one.get(key), another.get(key)) for key in {**one, **another}]
    elif isinstance(one, list) and isinstance(another, list) and len(one) == len(another):
        pairs = [(str(k), a, b) for k, (a, b) in enumerate(zip(one, another, strict=True))]
    else:
        if one != another:
            yield place, one, another
        return
    for key, a, b in pairs:
        yield from _differing(a, b, f"{place}.{key}" if place else key)


def fold_of(wall: WallTable, motion: Rotation) -> int:
    """How many turns of 2π/n, n the result, map a body onto itself: the greatest common divisor of its shapes' n."""
    return gcd(*(_fold(shape, motion) for shape in wall.shapes))


def _fold(shape: Any, motion: Rotation) -> int:
    if _is_round(shape, motion):
        return 0
    return shape.copies if isinstance(shape, Cylinder) else 1


def _is_round(shape: Any, motion: Rotation) -> bool:
    """Whether a turn by any angle about the axis of the motion leaves a shape as it is."""
    if isinstance(shape, Plane):
        return _along(shape.normal, motion.axis)
    if isinstance(shape, Sphere):
        return _along(_from_axis(shape.centre, motion), motion.axis)
    if isinstance(shape, Cylinder | Cone | Capsule | Torus):
        return _along(shape.axis, motion.axis) and _along(_from_axis(shape.centre, motion), motion.axis)
    return False


def _from_axis(centre: Sequence[float], motion: Rotation) -> NDArray[np.float64]:
    return np.asarray(np.asarray(centre) - np.asarray(motion.point), np.float64)


def _along(vector: ArrayLike, axis: ArrayLike) -> bool:
    """Whether a vector is parallel to an axis, or none at all."""
    a, b = np.asarray(vector, np.float64), np.asarray(axis, np.float64)
    across = float(np.linalg.norm(np.cross(a, b)))
    return across <= PARALLEL * float(np.linalg.norm(a) * np.linalg.norm(b))


def angle(phase: ArrayLike) -> NDArray[np.float64]:
    """Cosine and sine (phases, 2) of shares of a period: neighbours in phase are neighbours there, 0 and 1 the same."""
    turned = 2.0 * pi * np.asarray(phase, np.float64)
    return np.column_stack([np.cos(turned), np.sin(turned)])
