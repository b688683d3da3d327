"""Contact of particles with walls given as signed distance functions.

The particles' side of every shape has φ > 0. Each shape that a particle overlaps acts by itself, so a bead in a corner
rests on both faces; the force is the gradient of ½ k (φ − r)² (paper eqs. (13)–(17)): with |∇φ| = 1 that is k (r − φ),
and k |∇φ| (r − φ) on an interpolated φ.
"""

from sim.collisions import count_impact
from sim.contact import APART, contact_force, part
from sim.kernel import Array, Indices, Vector, inlined, kernel
from sim.law import law_of_row
from sim.motion import Bodies
from sim.near_walls import NearWalls
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
from sim.surface import body_turn, steepness_and_normal, wall_distance, wall_motion

BODY_TALLY = 7  # impulse (3), angular impulse about the body's centre (3), work


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


@inlined
def tally_couple(body_tally: Array, c: int, b: int, dt: float, couple: Vector, turn: Vector) -> None:
    """Count the moment (N m) against rolling that body b put on a particle: it turns without pushing, and works."""
    body_tally[c, b, 3] += couple[0] * dt
    body_tally[c, b, 4] += couple[1] * dt
    body_tally[c, b, 5] += couple[2] * dt
    body_tally[c, b, 6] += (couple[0] * turn[0] + couple[1] * turn[1] + couple[2] * turn[2]) * dt


@kernel
def add_wall_forces(
    c: int,
    seen: Array,
    chunks: Indices,
    walls: Bodies,
    near: NearWalls,
    spring: Array | None,
    rolls: bool | None,
    laws: Array,
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
            law = law_of_row(laws, b)
            x, y, z, radius = seen[i, X], seen[i, Y], seen[i, Z], seen[i, RADIUS]
            distance, gx, gy, gz = wall_distance(walls, s, x, y, z)
            if distance >= radius:
                lost += part(entry, near.touching, spring, law, radius)
                continue
            deepest = max(deepest, (radius - distance) / radius)
            steepness, (nx, ny, nz) = steepness_and_normal(walls.blocks, gx, gy, gz)
            normal, overlap = (nx, ny, nz), steepness * (radius - distance)
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
            push, torque, couple, taken = contact_force(
                entry, overlap, normal, approach, spin, body_turn(walls, b), distance, near.touching, spring, rolls,
                1.0 / seen[i, INVERSE_MASS], mobility, law, dt,
            )  # fmt: skip
            lost += taken
            for axis in range(3):
                wrench[i, axis] += push[axis]
                if spring is not None:
                    wrench[i, 3 + axis] += torque[axis]
            tally_body(body_tally, c, b, dt, push, arm, wall)
            if rolls is not None:
                tally_couple(body_tally, c, b, dt, couple, body_turn(walls, b))
    tally[c, 0] += lost
    tally[c, 1] = deepest
