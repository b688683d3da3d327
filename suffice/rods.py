"""Cylinders and cones among the walls of a scene, where they stand at a time: vessels, hoppers, shafts and pins."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import Scene
from sim.assembly import walls_of
from sim.motion import move_bodies, rotation_about
from sim.vessel import Cone, Cylinder, Rotation, WallTable

Array = NDArray[np.float64]


class Rod(NamedTuple):
    """A cylinder or a truncated cone with flat ends: solid, or the hollow of a vessel."""

    wall: str  # name of the body
    centre: Array  # (3,) m, middle of its axis
    axis: Array  # (3,) unit vector
    radius: float  # m; of a cone at the end that the axis comes from
    length: float | None  # m; None: endless
    hollow: bool  # particles are inside
    turns: bool  # its body rotates
    open: tuple[str, ...]  # ends left out, "+" where the axis points to
    other_radius: float | None = None  # m, of a cone, at the end that the axis points to

    @property
    def widens(self) -> float:
        """Radius gained per length along the axis; 0 for a cylinder."""
        return (self.other_radius - self.radius) / self.length if self.other_radius is not None and self.length else 0.0

    @property
    def widest(self) -> float:
        """Largest radius."""
        return max(self.radius, self.other_radius or 0.0)

    def radius_at(self, along: Array) -> Array:
        """Return the radius at places along the axis, from the middle; beyond the ends as the mantle goes on."""
        return np.asarray(self.radius + self.widens * (along + 0.5 * (self.length or 0.0)))

    def thicker(self, by: float) -> "Rod":
        """Return the same with larger radii."""
        other = None if self.other_radius is None else self.other_radius + by
        return self._replace(radius=self.radius + by, other_radius=other)

    def longer(self, by: Mapping[str, float]) -> "Rod":
        """Return the same with its mantle going on beyond the ends "-" and "+" of the axis."""
        if self.length is None:
            return self
        low, high = by.get("-", 0.0), by.get("+", 0.0)
        other = None if self.other_radius is None else self.other_radius + self.widens * high
        centre, length = self.centre + 0.5 * (high - low) * self.axis, self.length + low + high
        return self._replace(centre=centre, length=length, radius=self.radius - self.widens * low, other_radius=other)

    def scaled(self, scale: float, frame: Array, centre: Array) -> "Rod":
        """Return the same in other units and another frame (3, 3), its middle at a place there."""
        length = None if self.length is None else scale * self.length
        other = None if self.other_radius is None else scale * self.other_radius
        turned = self._replace(centre=centre, axis=frame @ self.axis, other_radius=other)
        return turned._replace(radius=scale * self.radius, length=length)


class Rods(NamedTuple):
    """The cylinders and cones of a scene, and in words what else it has."""

    rods: list[Rod]
    others: list[str]  # such as "cone of wall hopper"


def rods_of(scene: Scene, time: float = 0.0) -> Rods:
    """Return the cylinders and cones of a scene at a time (s), each copy by itself, and what other shapes there are."""
    walls = walls_of(scene)
    if walls is None:
        return Rods([], [])
    move_bodies(walls, time)
    rods, others = [], []
    for b, wall in enumerate(scene.walls):
        for shape in wall.shapes:
            if not isinstance(shape, Cylinder | Cone):
                others.append(f"{shape.shape} of wall {wall.name}")
                continue
            for copy in _copies(wall, shape):
                centre = walls.rotation[b] @ (np.array(copy.centre) - walls.centre[b]) + walls.centre[b]
                axis = walls.rotation[b] @ (np.array(copy.axis) / np.linalg.norm(copy.axis))
                turns, hollow = isinstance(wall.motion, Rotation), copy.particles == "inside"
                ends, place = tuple(copy.open), centre + walls.shift[b]
                first, other = (copy.radius, None) if isinstance(copy, Cylinder) else copy.radii
                rods.append(Rod(wall.name, place, axis, first, copy.length, hollow, turns, ends, other))
    return Rods(rods, list(dict.fromkeys(others)))


def _copies(wall: WallTable, shape: Cylinder | Cone) -> Iterator[Cylinder | Cone]:
    """Yield the copies of a cylinder about the axis that its body rotates about, or the one shape there is."""
    if isinstance(shape, Cone) or not isinstance(wall.motion, Rotation):
        yield shape
        return
    point, axis, turn = np.array(wall.motion.point), np.array(wall.motion.axis), np.zeros((3, 3))
    for k in range(shape.copies):
        rotation_about(axis / np.linalg.norm(axis), 2.0 * np.pi * k / shape.copies, turn)
        centre = turn @ (np.array(shape.centre) - point) + point
        yield shape.model_copy(update={"centre": tuple(centre), "axis": tuple(turn @ np.array(shape.axis))})
