"""Velocity Verlet: many steps of all terms of a scene in one compiled call."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import prange

from sim.contact import ContactLaw
from sim.kernel import Array, Indices, Vector, inlined, parallel_kernel
from sim.motion import Bodies, move_bodies
from sim.neighbors import Neighbors
from sim.pairs import add_pair_forces
from sim.walls import NearWalls, add_wall_forces


class Step(NamedTuple):
    """Where a run stands in time, and what bounds its steps."""

    number: int  # steps done
    listed: int  # step at which the neighbours were listed
    dt: float  # s
    skin: float  # m
    wall_speed: float  # m/s
    max_overlap: float  # radii


# The terms of a scene as `fill_forces` takes them: pairs, their springs and law, walls, the list of near ones, their
# springs and law, and what is tallied. A term that is None does not exist in the compiled program.
Terms = tuple[
    Neighbors, Array | None, ContactLaw, Bodies | None, NearWalls, Array | None, Array, Array, Array
]  # fmt: skip


@parallel_kernel
def fill_forces(
    dt: float,
    position: Array,
    velocity: Array,
    spin: Array | None,
    radius: Array,
    inverse_mass: Array,
    force: Array,
    torque: Array | None,
    listed: Neighbors,
    pair_spring: Array | None,
    pair_law: ContactLaw,
    walls: Bodies | None,
    near: NearWalls,
    wall_spring: Array | None,
    wall_law: Array,
    tally: Array,
    body_tally: Array,
) -> None:
    """Set force (n, 3) N and torque (n, 3) N m to the sum of all contact terms."""
    chunks = listed.chunks
    for c in prange(chunks.shape[0] - 1):
        force[chunks[c] : chunks[c + 1]] = 0.0
        if torque is not None:
            torque[chunks[c] : chunks[c + 1]] = 0.0
        bulk = (position, velocity, spin, radius, inverse_mass)
        add_pair_forces(c, *bulk, listed, pair_spring, pair_law, dt, force, torque, tally)
        if walls is not None:
            add_wall_forces(c, *bulk, chunks, walls, near, wall_spring, wall_law, dt, force, torque, tally, body_tally)


@inlined
def half_kick(
    i: int,
    half: float,
    gravity: Vector | None,
    velocity: Array,
    spin: Array | None,
    radius: Array,
    inverse_mass: Array,
    force: Array,
    torque: Array | None,
    kicked: Array,
    kicked_spin: Array | None,
) -> None:
    """Put into row i what velocity and spin are half a step later: dv = (F/m + g) dt/2, dω = T/I dt/2 (paper (1), (2)).

    The results may be the arguments themselves.
    """
    for axis in range(3):
        gained = inverse_mass[i] * force[i, axis]
        if gravity is not None:
            gained += gravity[axis]
        kicked[i, axis] = velocity[i, axis] + half * gained
        if spin is not None and torque is not None and kicked_spin is not None:
            inverse_inertia = 2.5 * inverse_mass[i] / (radius[i] * radius[i])
            kicked_spin[i, axis] = spin[i, axis] + half * inverse_inertia * torque[i, axis]


@parallel_kernel
def drift(
    kicks: int,
    dt: float,
    gravity: Vector | None,
    position: Array,
    velocity: Array,
    spin: Array | None,
    coming: Array,
    coming_spin: Array | None,
    radius: Array,
    inverse_mass: Array,
    force: Array,
    torque: Array | None,
    chunks: Indices,
    listed_at: Array,
) -> float:
    """Kick by `kicks` half steps and move by a step; return how far (m) any particle is from where it was listed.

    `coming` and `coming_spin` (n, 3) become what velocity and spin will be at the end of the step if accelerations
    last: the forces are evaluated with them.
    """
    travel = np.zeros(chunks.shape[0] - 1)
    half = 0.5 * dt
    for c in prange(chunks.shape[0] - 1):
        farthest = 0.0
        for i in range(chunks[c], chunks[c + 1]):
            for _ in range(kicks):
                half_kick(i, half, gravity, velocity, spin, radius, inverse_mass, force, torque, velocity, spin)
            half_kick(i, half, gravity, velocity, spin, radius, inverse_mass, force, torque, coming, coming_spin)
            moved = 0.0
            for axis in range(3):
                position[i, axis] += dt * velocity[i, axis]
                moved += (position[i, axis] - listed_at[i, axis]) ** 2
            if moved > farthest or moved != moved:  # not a number stays, and stops the run
                farthest = moved
        travel[c] = farthest
    return sqrt(travel.max())


@parallel_kernel
def advance(
    step: Step,
    steps: int,
    drifted: bool,
    gravity: Vector | None,
    position: Array,
    velocity: Array,
    spin: Array | None,
    coming: Array,
    coming_spin: Array | None,
    radius: Array,
    inverse_mass: Array,
    force: Array,
    torque: Array | None,
    listed_at: Array,
    walls: Bodies | None,
    chunks: Indices,
    tally: Array,
    terms: Terms,
) -> tuple[int, bool]:
    """Do up to `steps` steps of half kick, drift, forces, half kick; return how many, and whether the list is stale.

    Returns early when a particle may have left its listed neighbourhood: positions are then drifted and the next call
    begins with the forces (`drifted`); or when the largest overlap in `tally` passes the limit.
    """
    done = 0
    kicks = 1  # the second half kick of a step and the first of the next are done in one sweep
    while done < steps:
        if not drifted:
            moved = drift(
                kicks, step.dt, gravity, position, velocity, spin, coming, coming_spin, radius, inverse_mass, force,
                torque, chunks, listed_at,
            )  # fmt: skip
            if walls is not None:
                move_bodies(walls, (step.number + done + 1) * step.dt)
            walls_moved = step.wall_speed * step.dt * (step.number + done + 1 - step.listed)
            if not (2.0 * moved <= step.skin and moved + walls_moved <= step.skin):
                return done, True
        drifted = False
        fill_forces(step.dt, position, coming, coming_spin, radius, inverse_mass, force, torque, *terms)
        kicks = 2
        done += 1
        if tally[:, 1].max() > step.max_overlap:
            break
    half = 0.5 * step.dt
    for i in prange(position.shape[0]):
        half_kick(i, half, gravity, velocity, spin, radius, inverse_mass, force, torque, velocity, spin)
    return done, False
