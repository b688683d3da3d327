"""Surfaces of the walls where their bodies stand now: distance and direction to them, and how they move.

The particles' side of every shape has φ > 0.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from sim.combination import shape_distance
from sim.kernel import Array, Vector, inlined, kernel
from sim.motion import FIXED, ROTATING, Bodies
from sim.shapes import SHELL


@inlined
def wall_distance(walls: Bodies, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance φ of a point to shape s where its body stands now (positive on the particles' side), and ∇φ."""
    b, kind, side = walls.body[s], walls.kind[s], walls.side[s]
    shape = (walls.program, walls.blocks, walls.spline)
    if walls.motion[b] == FIXED:
        d, nx, ny, nz = shape_distance(kind, walls.parameter, *shape, s, x, y, z)
        return side * d, side * nx, side * ny, side * nz
    c, r = walls.centre, walls.rotation
    px = x - c[b, 0] - walls.shift[b, 0]
    py = y - c[b, 1] - walls.shift[b, 1]
    pz = z - c[b, 2] - walls.shift[b, 2]
    qx = r[b, 0, 0] * px + r[b, 1, 0] * py + r[b, 2, 0] * pz + c[b, 0]
    qy = r[b, 0, 1] * px + r[b, 1, 1] * py + r[b, 2, 1] * pz + c[b, 1]
    qz = r[b, 0, 2] * px + r[b, 1, 2] * py + r[b, 2, 2] * pz + c[b, 2]
    d, gx, gy, gz = shape_distance(kind, walls.parameter, *shape, s, qx, qy, qz)
    nx = r[b, 0, 0] * gx + r[b, 0, 1] * gy + r[b, 0, 2] * gz
    ny = r[b, 1, 0] * gx + r[b, 1, 1] * gy + r[b, 1, 2] * gz
    nz = r[b, 2, 0] * gx + r[b, 2, 1] * gy + r[b, 2, 2] * gz
    return side * d, side * nx, side * ny, side * nz


@kernel
def distance_to_wall(walls: Bodies, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Do the same as `wall_distance`, called instead of compiled into every loop: for what is not done every step."""
    return wall_distance(walls, s, x, y, z)


@inlined
def steepness_and_normal(blocks: Array | None, gx: float, gy: float, gz: float) -> tuple[float, Vector]:
    """Length of ∇φ, which is 1 unless φ is interpolated, and its direction."""
    if blocks is None:
        return 1.0, (gx, gy, gz)
    steepness = sqrt(gx * gx + gy * gy + gz * gz)
    if steepness == 0.0:  # on a kink that the interpolation has levelled: there is no force
        return 0.0, (0.0, 0.0, 1.0)
    return steepness, (gx / steepness, gy / steepness, gz / steepness)


@inlined
def wall_motion(walls: Bodies, b: int, point: Vector) -> tuple[Vector, Vector]:
    """Return a point's place about the centre that body b turns about (m), and the body's velocity there (m/s)."""
    ax = point[0] - walls.centre[b, 0] - walls.shift[b, 0]
    ay = point[1] - walls.centre[b, 1] - walls.shift[b, 1]
    az = point[2] - walls.centre[b, 2] - walls.shift[b, 2]
    tx, ty, tz = walls.turn[b, 0], walls.turn[b, 1], walls.turn[b, 2]
    wx = walls.velocity[b, 0] + ty * az - tz * ay
    wy = walls.velocity[b, 1] + tz * ax - tx * az
    wz = walls.velocity[b, 2] + tx * ay - ty * ax
    return (ax, ay, az), (wx, wy, wz)


@inlined
def body_turn(walls: Bodies, b: int) -> Vector:
    """Angular velocity of a body, rad/s."""
    return walls.turn[b, 0], walls.turn[b, 1], walls.turn[b, 2]


def wall_speed(walls: Bodies, position: Array) -> float:
    """Upper bound of the speed (m/s) of any wall surface within reach of the particles."""
    fastest = 0.0
    for b, motion in enumerate(walls.motion):
        p = walls.law[b]
        if motion == ROTATING:
            arm = position - walls.centre[b]
            arm -= np.outer(arm @ p[:3], p[:3])
            fastest = max(fastest, abs(p[6]) * float(np.sqrt((arm**2).sum(axis=1).max())))
        elif motion != FIXED:
            fastest = max(fastest, float(np.linalg.norm(p[:3])) * (p[3] if p[3] else 1.0))
    return fastest


def beyond_shells(position: Array, walls: Bodies) -> NDArray[np.bool_]:
    """Tell which points (n, 3) m are beside a thin wall, out of what it encloses; φ alone does not tell its sides."""
    beyond = np.zeros(len(position), np.bool_)
    for p in walls.parameter[walls.kind == SHELL]:
        if p[8] > 0.0:
            along = (position - p[:3]) @ p[3:6]
            distance = np.linalg.norm(position - p[:3] - along[:, None] * p[3:6], axis=1)
            beyond |= (np.abs(along) < p[8]) & (distance > 0.5 * (p[6] + p[7] + (p[7] - p[6]) * along / p[8]))
    return beyond
