"""Contact of particles with walls given as signed distance functions.

The particles' side of every shape has φ > 0. Each shape that a particle overlaps acts by itself, so a bead in a corner
rests on both faces; the force is the gradient of ½ k (φ − r)² (paper eqs. (13)–(17)).
"""

from typing import NamedTuple

import numpy as np
from numba import prange

from sim.collisions import count_impact
from sim.contact import APART, contact_force, part
from sim.kernel import Array, Flags, Indices, Vector, inlined, kernel, parallel_kernel
from sim.law import ContactLaw
from sim.motion import FIXED, ROTATING, Bodies
from sim.shapes import signed_distance
from sim.state import (
    INVERSE_INERTIA,
    INVERSE_MASS,
    RADIUS,
    SPIN_X,
    SPIN_Y,
    SPIN_Z,
    VELOCITY_X,
    VELOCITY_Y,
    VELOCITY_Z,
    X,
    Y,
    Z,
)

BODY_TALLY = 7  # impulse (3), angular impulse about the body's centre (3), work


class NearWalls(NamedTuple):
    """Entries of particle i are first[i] to last[i] (excluded): shapes it may touch before the next rebuild."""

    first: Indices  # (n,)
    last: Indices  # (n,)
    surface: Indices  # (capacity,)
    touching: Flags  # (capacity,) phase of the contact, 0 while apart


@inlined
def wall_distance(walls: Bodies, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance φ of a point to shape s where its body stands now (positive on the particles' side), and ∇φ."""
    b = walls.body[s]
    side = walls.side[s]
    if walls.motion[b] == FIXED:
        d, nx, ny, nz = signed_distance(walls.kind[s], walls.parameter, s, x, y, z)
        return side * d, side * nx, side * ny, side * nz
    c, r = walls.centre, walls.rotation
    px = x - c[b, 0] - walls.shift[b, 0]
    py = y - c[b, 1] - walls.shift[b, 1]
    pz = z - c[b, 2] - walls.shift[b, 2]
    qx = r[b, 0, 0] * px + r[b, 1, 0] * py + r[b, 2, 0] * pz + c[b, 0]
    qy = r[b, 0, 1] * px + r[b, 1, 1] * py + r[b, 2, 1] * pz + c[b, 1]
    qz = r[b, 0, 2] * px + r[b, 1, 2] * py + r[b, 2, 2] * pz + c[b, 2]
    d, gx, gy, gz = signed_distance(walls.kind[s], walls.parameter, s, qx, qy, qz)
    nx = r[b, 0, 0] * gx + r[b, 0, 1] * gy + r[b, 0, 2] * gz
    ny = r[b, 1, 0] * gx + r[b, 1, 1] * gy + r[b, 1, 2] * gz
    nz = r[b, 2, 0] * gx + r[b, 2, 1] * gy + r[b, 2, 2] * gz
    return side * d, side * nx, side * ny, side * nz


@parallel_kernel
def count_near_walls(position: Array, radius: Array, walls: Bodies, skin: float) -> tuple[Indices, Array]:
    """Return how many shapes each particle is near, and its least distance φ to any (m)."""
    n = radius.shape[0]
    near = np.zeros(n, np.int64)
    least = np.full(n, np.inf)
    for i in prange(n):
        for s in range(walls.kind.shape[0]):
            d = wall_distance(walls, s, position[i, 0], position[i, 1], position[i, 2])[0]
            least[i] = min(least[i], d)
            if d < radius[i] + skin:
                near[i] += 1
    return near, least


@kernel
def list_walls(
    i: int,
    position: Array,
    radius: Array,
    walls: Bodies,
    skin: float,
    before: int,
    old: NearWalls,
    old_spring: Array,
    new: NearWalls,
    new_spring: Array,
) -> None:
    """List the shapes near particle i, with the contacts that its row `before` of the old list had."""
    entry = new.first[i]
    for s in range(walls.kind.shape[0]):
        d = wall_distance(walls, s, position[i, 0], position[i, 1], position[i, 2])[0]
        if d >= radius[i] + skin or entry >= new.last[i]:
            continue
        new.surface[entry] = s
        for e in range(old.first[before], old.last[before]):
            if old.surface[e] == s and old.touching[e]:
                new.touching[entry] = old.touching[e]
                for column in range(old_spring.shape[1]):
                    new_spring[entry, column] = old_spring[e, column]
        entry += 1


@parallel_kernel
def fill_near_walls(
    position: Array,
    radius: Array,
    walls: Bodies,
    skin: float,
    order: Indices,
    old: NearWalls,
    old_spring: Array,
    new: NearWalls,
    new_spring: Array,
) -> None:
    """Fill the list, and carry contacts over from the old one, which numbers the particles in another order."""
    for i in prange(radius.shape[0]):
        list_walls(i, position, radius, walls, skin, order[i], old, old_spring, new, new_spring)


def no_near_walls(n: int) -> NearWalls:
    """Return a list without entries for n particles."""
    none = np.zeros(n, np.int64)
    return NearWalls(none, none.copy(), np.zeros(0, np.int64), np.zeros(0, np.uint8))


def rebuilt_near_walls(
    position: Array,
    radius: Array,
    inverse_mass: Array,
    walls: Bodies,
    skin: float,
    order: Indices,
    old: NearWalls,
    old_spring: Array | None,
) -> tuple[NearWalls, Array | None, Array]:
    """Return the list with the contacts of the old one, its springs, and every particle's least distance φ (m)."""
    radius = np.where(inverse_mass > 0.0, radius, -np.inf)  # a fixed particle takes no notice of walls
    near, least = count_near_walls(position, radius, walls, skin)
    last = np.cumsum(near)
    entries = int(last[-1])
    new = NearWalls(last - near, last, np.zeros(entries, np.int64), np.zeros(entries, np.uint8))
    none = np.zeros((0, 0))
    spring = None if old_spring is None else np.zeros((entries, old_spring.shape[1]))
    fill_near_walls(
        position,
        radius,
        walls,
        skin,
        order,
        old,
        none if old_spring is None else old_spring,
        new,
        none if spring is None else spring,
    )
    return new, spring, least


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


@inlined
def tally_body(body_tally: Array, c: int, b: int, dt: float, push: Vector, arm: Vector, wall: Vector) -> None:
    """Count what body b gave to a particle in this step: impulse, angular impulse and work."""
    body_tally[c, b, 0] += push[0] * dt
    body_tally[c, b, 1] += push[1] * dt
    body_tally[c, b, 2] += push[2] * dt
    body_tally[c, b, 3] += (arm[1] * push[2] - arm[2] * push[1]) * dt
    body_tally[c, b, 4] += (arm[2] * push[0] - arm[0] * push[2]) * dt
    body_tally[c, b, 5] += (arm[0] * push[1] - arm[1] * push[0]) * dt
    body_tally[c, b, 6] += (push[0] * wall[0] + push[1] * wall[1] + push[2] * wall[2]) * dt


@kernel
def add_wall_forces(
    c: int,
    seen: Array,
    chunks: Indices,
    walls: Bodies,
    near: NearWalls,
    spring: Array | None,
    rolls: bool | None,
    law: ContactLaw,
    dt: float,
    wrench: Array,
    tally: Array,
    body_tally: Array,
    impacts: Array | None,
) -> None:
    """Add the forces of the walls on the particles of chunk c, and to each body's impulse and work.

    `tally` (chunks, 2) collects dissipated energy (J) and the largest overlap in radii; `body_tally`
    (chunks, bodies, 7) what each body gave to the particles. Without springs (None) there is no friction and no torque,
    without `rolls` no rolling resistance; with `impacts` (chunks, bins) new contacts are counted by their energy.
    """
    lost, deepest = 0.0, tally[c, 1]
    for i in range(chunks[c], chunks[c + 1]):
        for entry in range(near.first[i], near.last[i]):
            s = near.surface[entry]
            b = walls.body[s]
            x, y, z, radius = seen[i, X], seen[i, Y], seen[i, Z], seen[i, RADIUS]
            distance, nx, ny, nz = wall_distance(walls, s, x, y, z)
            overlap = radius - distance
            if overlap <= 0.0:
                lost += part(entry, near.touching, spring, law, radius)
                continue
            deepest = max(deepest, overlap / radius)
            normal = (nx, ny, nz)
            arm, wall = wall_motion(walls, b, (x - distance * nx, y - distance * ny, z - distance * nz))
            approach = (
                seen[i, VELOCITY_X] - wall[0],
                seen[i, VELOCITY_Y] - wall[1],
                seen[i, VELOCITY_Z] - wall[2],
            )
            if impacts is not None and near.touching[entry] == APART:
                speed = approach[0] * nx + approach[1] * ny + approach[2] * nz
                count_impact(impacts[c], speed, overlap, law.stiffness, 1.0 / seen[i, INVERSE_MASS])
            spin, mobility = (0.0, 0.0, 0.0), 1.0
            if spring is not None:
                spin, mobility = (seen[i, SPIN_X], seen[i, SPIN_Y], seen[i, SPIN_Z]), seen[i, INVERSE_INERTIA]
            push, torque, taken = contact_force(
                entry, overlap, normal, approach, spin, body_turn(walls, b), distance, near.touching, spring, rolls,
                1.0 / seen[i, INVERSE_MASS], mobility, law, dt,
            )  # fmt: skip
            lost += taken
            for axis in range(3):
                wrench[i, axis] += push[axis]
                if spring is not None:
                    wrench[i, 3 + axis] += torque[axis]
            tally_body(body_tally, c, b, dt, push, arm, wall)
    tally[c, 0] += lost
    tally[c, 1] = deepest
