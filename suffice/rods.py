"""Cylinders among the walls of a scene, where they stand at a time: vessels, shafts and pins."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import Scene
from sim.assembly import walls_of
from sim.motion import move_bodies, rotation_about
from sim.vessel import Cylinder, Rotation, WallTable

Array = NDArray[np.float64]


class Rod(NamedTuple):
    """A cylinder with flat ends: solid, or the hollow of a vessel."""

    wall: str  # name of the body
    centre: Array  # (3,) m, middle of its axis
    axis: Array  # (3,) unit vector
    radius: float  # m
    length: float | None  # m; None: endless
    hollow: bool  # particles are inside
    turns: bool  # its body rotates
    open: tuple[str, ...]  # ends left out, "+" where the axis points to


class Rods(NamedTuple):
    """The cylinders of a scene, and in words what else it has."""

    rods: list[Rod]
    others: list[str]  # such as "cone of wall hopper"


def rods_of(scene: Scene, time: float = 0.0) -> Rods:
    """Return the cylinders of a scene at a time (s), each copy by itself, and what other shapes there are."""
    walls = walls_of(scene)
    if walls is None:
        return Rods([], [])
    move_bodies(walls, time)
    rods, others = [], []
    for b, wall in enumerate(scene.walls):
        for shape in wall.shapes:
            if not isinstance(shape, Cylinder):
                others.append(f"{shape.shape} of wall {wall.name}")
                continue
            for copy in _copies(wall, shape):
                centre = walls.rotation[b] @ (np.array(copy.centre) - walls.centre[b]) + walls.centre[b]
                axis = walls.rotation[b] @ (np.array(copy.axis) / np.linalg.norm(copy.axis))
                turns, hollow = isinstance(wall.motion, Rotation), copy.particles == "inside"
                ends, place = tuple(copy.open), centre + walls.shift[b]
                rods.append(Rod(wall.name, place, axis, copy.radius, copy.length, hollow, turns, ends))
    return Rods(rods, list(dict.fromkeys(others)))


def _copies(wall: WallTable, shape: Cylinder) -> Iterator[Cylinder]:
    """Yield the copies of a cylinder about the axis that its body rotates about."""
    if not isinstance(wall.motion, Rotation):
        yield shape
        return
    point, axis, turn = np.array(wall.motion.point), np.array(wall.motion.axis), np.zeros((3, 3))
    for k in range(shape.copies):
        rotation_about(axis / np.linalg.norm(axis), 2.0 * np.pi * k / shape.copies, turn)
        centre = turn @ (np.array(shape.centre) - point) + point
        yield shape.model_copy(update={"centre": tuple(centre), "axis": tuple(turn @ np.array(shape.axis))})
