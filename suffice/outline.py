"""Outlines of the walls of a scene: lines that show where a vessel stands and how a rotor turns."""

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.motion import FIXED, Bodies, move_bodies, rotation_about
from sim.vessel import AnyShape, Box, Capsule, Cone, Cylinder, Rotation, Sphere, Torus, WallTable
from suffice.setting import Setting
from suffice.solids import frame_of

Array = NDArray[np.float64]

STEPS = 48  # of a circle, a multiple of SIDES
SIDES = 4  # lines along a cylinder


class Outline(NamedTuple):
    """The lines of a body, and how it moves."""

    name: str
    ends: Array  # (2 lines, 3) m, of each line where the body stands at time zero
    moved: Array | None  # (times, 3, 4) what takes (x, y, z, 1) to where it is then, m; None for a body at rest


def outlines_of(setting: Setting, times: Array, room: tuple[Array, Array]) -> list[Outline]:
    """Return the outlines of the walls that are primitive shapes, at some times (s).

    room: corners (3,) m of a box beyond which endless cylinders are cut off. Planes, meshes and combinations have no
    outline; neither has anything in a run that does not hold its scene.
    """
    if setting.scene is None or setting.walls is None:
        return []
    moved = _moved(setting.walls, times)
    found = []
    for b, table in enumerate(setting.scene.walls):
        ends = [_ends(line) for shape in table.shapes for line in _turned(_lines(shape, room), shape, table)]
        if ends:
            still = setting.walls.motion[b] == FIXED
            found.append(Outline(table.name, np.concatenate(ends), None if still else moved[:, b]))
    return found


def _moved(walls: Bodies, times: Array) -> Array:
    """Return rotation and shift of every body at each time, (times, bodies, 3, 4)."""
    out = np.empty((len(times), len(walls.motion), 3, 4))
    for k, time in enumerate(times):
        move_bodies(walls, float(time))
        out[k, :, :, :3] = walls.rotation
        out[k, :, :, 3] = walls.centre + walls.shift - np.einsum("bij,bj->bi", walls.rotation, walls.centre)
    return out


def _turned(lines: Sequence[Array], shape: AnyShape, table: WallTable) -> list[Array]:
    """Return the lines of a shape and of its copies about the axis of the body."""
    if not isinstance(shape, Cylinder) or shape.copies == 1 or not isinstance(table.motion, Rotation):
        return list(lines)
    point, axis = np.array(table.motion.point), np.array(table.motion.axis)
    axis = axis / np.linalg.norm(axis)
    turn, found = np.zeros((3, 3)), []
    for k in range(shape.copies):
        rotation_about(axis, 2.0 * pi * k / shape.copies, turn)
        found += [(line - point) @ turn.T + point for line in lines]
    return found


def _ends(line: Array) -> Array:
    """Return the ends of the pieces of a line (k, 3), (2 (k − 1), 3)."""
    return np.stack([line[:-1], line[1:]], axis=1).reshape(-1, 3)


def _lines(shape: AnyShape, room: tuple[Array, Array]) -> list[Array]:
    """Return a shape as lines of points (k, 3) m."""
    if isinstance(shape, Box):
        return _box(np.array(shape.lowest), np.array(shape.highest))
    if not isinstance(shape, Cylinder | Cone | Capsule | Sphere | Torus):
        return []
    centre = np.array(shape.centre)
    if isinstance(shape, Sphere):
        return [_arc(centre, shape.radius * turned[:2]) for turned in (np.roll(np.eye(3), k, axis=0) for k in range(3))]
    first, second, along = frame_of(np.array(shape.axis) / np.linalg.norm(shape.axis))
    if isinstance(shape, Torus):
        wide = [(shape.radius + k * shape.tube_radius, 0.0) for k in (-1, 1)]
        rings = [*wide, *((shape.radius, k * shape.tube_radius) for k in (-1, 1))]
        return [_arc(centre + height * along, radius * np.array([first, second])) for radius, height in rings]
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length * along
        caps = [
            _arc(centre + sign * half, shape.radius * np.array([side, sign * along]), pi)
            for sign in (-1, 1)
            for side in (first, second)
        ]
        return [*_barrel(centre - half, centre + half, (shape.radius, shape.radius), first, second), *caps]
    low, high = _between(shape, centre, along, room)
    radii = shape.radii if isinstance(shape, Cone) else (shape.radius, shape.radius)
    return _barrel(low, high, radii, first, second)


def _between(shape: Cylinder | Cone, centre: Array, along: Array, room: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the middles of the two ends; of an endless cylinder where its axis leaves the room."""
    if shape.length is not None:
        return centre - 0.5 * shape.length * along, centre + 0.5 * shape.length * along
    corners = np.array([[room[i][0], room[j][1], room[k][2]] for i, j, k in np.ndindex(2, 2, 2)])
    height = (corners - centre) @ along
    return centre + height.min() * along, centre + height.max() * along


def _barrel(low: Array, high: Array, radii: tuple[float, float], first: Array, second: Array) -> list[Array]:
    """Return two rings and the lines between them."""
    ends = [_arc(middle, radius * np.array([first, second])) for middle, radius in zip((low, high), radii, strict=True)]
    step = STEPS // SIDES
    return [*ends, *(np.stack([ends[0][k], ends[1][k]]) for k in range(0, STEPS, step))]


def _arc(centre: Array, half_axes: Array, angle: float = 2.0 * pi) -> Array:
    """Return points centre + a cos t + b sin t from 0 to an angle, (STEPS + 1, 3); half_axes: (2, 3) a and b."""
    t = np.linspace(0.0, angle, STEPS + 1)
    return np.asarray(centre + np.outer(np.cos(t), half_axes[0]) + np.outer(np.sin(t), half_axes[1]))


def _box(low: Array, high: Array) -> list[Array]:
    """Return the floor, the ceiling and the four edges between them."""
    x, y, z = np.stack([low, high], axis=1)
    rings = [np.array([[x[i], y[j], z[k]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]) for k in (0, 1)]
    return [*rings, *(np.stack([rings[0][i], rings[1][i]]) for i in range(4))]
