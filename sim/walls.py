"""Contact of particles with walls given as signed distance functions.

The particles' side of every shape has φ > 0. Each shape that a particle overlaps acts by itself, so a bead in a corner
rests on both faces; the force is the gradient of ½ k (φ − r)² (paper eqs. (13)–(17)): with |∇φ| = 1 that is k (r − φ),
and k |∇φ| (r − φ) on an interpolated φ.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from sim.combination import shape_distance
from sim.contact import ContactLaw, contact_force, part
from sim.kernel import Array, Flags, Indices, Vector, add_to_row, inlined, kernel, parallel_kernel
from sim.motion import FIXED, ROTATING, Bodies
from sim.shapes import SHELL

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
def law_of_body(laws: Array, b: int) -> ContactLaw:
    """Constants of the contacts of body b."""
    return ContactLaw(laws[b, 0], laws[b, 1], laws[b, 2], laws[b, 3], laws[b, 4])


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
                if new_spring.shape[0] > 0:
                    for axis in range(3):
                        new_spring[entry, axis] = old_spring[e, axis]
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
    walls: Bodies,
    skin: float,
    order: Indices,
    old: NearWalls,
    old_spring: Array | None,
) -> tuple[NearWalls, Array | None, Array]:
    """Return the list with the contacts of the old one, its springs, and every particle's least distance φ (m)."""
    near, least = count_near_walls(position, radius, walls, skin)
    last = np.cumsum(near)
    entries = int(last[-1])
    new = NearWalls(last - near, last, np.zeros(entries, np.int64), np.zeros(entries, np.uint8))
    none = np.zeros((0, 3))
    spring = None if old_spring is None else np.zeros((entries, 3))
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


def beyond_shells(position: Array, walls: Bodies) -> NDArray[np.bool_]:
    """Tell which points (n, 3) m are beside a thin wall, out of what it encloses; φ alone does not tell its sides."""
    beyond = np.zeros(len(position), np.bool_)
    for p in walls.parameter[walls.kind == SHELL]:
        if p[8] > 0.0:
            along = (position - p[:3]) @ p[3:6]
            distance = np.linalg.norm(position - p[:3] - along[:, None] * p[3:6], axis=1)
            beyond |= (np.abs(along) < p[8]) & (distance > 0.5 * (p[6] + p[7] + (p[7] - p[6]) * along / p[8]))
    return beyond


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
    position: Array,
    velocity: Array,
    spin: Array | None,
    radius: Array,
    inverse_mass: Array,
    chunks: Indices,
    walls: Bodies,
    near: NearWalls,
    spring: Array | None,
    laws: Array,
    dt: float,
    force: Array,
    torque: Array | None,
    tally: Array,
    body_tally: Array,
) -> None:
    """Add the forces of the walls on the particles of chunk c, and to each body's impulse and work.

    `tally` (chunks, 2) collects dissipated energy (J) and the largest overlap in radii; `body_tally`
    (chunks, bodies, 7) what each body gave to the particles. Spin, spring and torque are None in frictionless scenes.
    """
    lost, deepest = 0.0, tally[c, 1]
    for i in range(chunks[c], chunks[c + 1]):
        for entry in range(near.first[i], near.last[i]):
            s = near.surface[entry]
            law = law_of_body(laws, walls.body[s])
            distance, gx, gy, gz = wall_distance(walls, s, position[i, 0], position[i, 1], position[i, 2])
            overlap = radius[i] - distance
            if overlap <= 0.0:
                lost += part(entry, near.touching, spring, law)
                continue
            if overlap > deepest * radius[i]:
                deepest = overlap / radius[i]
            b = walls.body[s]
            steepness, (nx, ny, nz) = steepness_and_normal(walls.blocks, gx, gy, gz)
            normal = (nx, ny, nz)
            overlap *= steepness
            foot = (position[i, 0] - distance * nx, position[i, 1] - distance * ny, position[i, 2] - distance * nz)
            arm, wall = wall_motion(walls, b, foot)
            approach = (velocity[i, 0] - wall[0], velocity[i, 1] - wall[1], velocity[i, 2] - wall[2])
            turning = (0.0, 0.0, 0.0)
            if spin is not None:
                turning = (distance * spin[i, 0], distance * spin[i, 1], distance * spin[i, 2])
            push, moment, taken = contact_force(
                entry, overlap, normal, approach, turning, near.touching, spring, 1.0 / inverse_mass[i], law, dt
            )
            lost += taken
            add_to_row(force, i, 1.0, push)
            if torque is not None:
                add_to_row(torque, i, -distance, moment)
            tally_body(body_tally, c, b, dt, push, arm, wall)
    tally[c, 0] += lost
    tally[c, 1] = deepest
