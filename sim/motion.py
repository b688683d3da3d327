"""Rigid motion of the bodies that walls belong to."""

from math import cos, sin
from typing import NamedTuple

from sim.kernel import Array, Indices, kernel

FIXED, ROTATING, OSCILLATING, TRANSLATING = range(4)
MOTION_PARAMETERS = 8


class Bodies(NamedTuple):
    """Shapes of a scene, the b rigid bodies that carry them, and how these move; shapes are given as at time zero."""

    kind: Indices  # (s,) shape constants
    parameter: Array  # (s, 10) in the body's frame
    side: Array  # (s,) 1 where particles are outside of the solid, −1 inside
    body: Indices  # (s,)
    motion: Indices  # (b,) one of the constants above
    law: Array  # (b, 8) rotating: axis, point, rad/s; oscillating: amplitude vector, rad/s, phase; translating: m/s
    rotation: Array  # (b, 3, 3) from the body's frame to the scene's
    centre: Array  # (b, 3) m, the point the body turns about
    shift: Array  # (b, 3) m, how far that point has moved
    velocity: Array  # (b, 3) m/s of that point
    turn: Array  # (b, 3) rad/s
    program: Array | None  # (steps, 13) how combinations are evaluated; absent where there is none
    blocks: Array | None  # (blocks, 2) of the grids of meshes; absent where there is none
    spline: Array | None  # (stored, 10, 10, 10) m, coefficients of the distance to meshes


@kernel
def rotation_about(axis: Array, angle: float, rotation: Array) -> None:
    """Fill the matrix of a turn by an angle about a unit axis (Rodrigues)."""
    x, y, z = axis[0], axis[1], axis[2]
    c, s = cos(angle), sin(angle)
    d = 1.0 - c
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = c + x * x * d, x * y * d - z * s, x * z * d + y * s
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = y * x * d + z * s, c + y * y * d, y * z * d - x * s
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = z * x * d - y * s, z * y * d + x * s, c + z * z * d


@kernel
def move_bodies(bodies: Bodies, time: float) -> None:
    """Put every body where it is at this time (s), and set its velocity and turn."""
    for b in range(bodies.motion.shape[0]):
        p = bodies.law[b]
        if bodies.motion[b] == ROTATING:
            rotation_about(p[0:3], p[6] * time, bodies.rotation[b])
            for axis in range(3):
                bodies.turn[b, axis] = p[6] * p[axis]
        elif bodies.motion[b] == OSCILLATING:
            phase = p[3] * time + p[4]
            for axis in range(3):
                bodies.shift[b, axis] = p[axis] * (sin(phase) - sin(p[4]))
                bodies.velocity[b, axis] = p[axis] * p[3] * cos(phase)
        elif bodies.motion[b] == TRANSLATING:
            for axis in range(3):
                bodies.shift[b, axis] = p[axis] * time
                bodies.velocity[b, axis] = p[axis]
