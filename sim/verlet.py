"""Velocity Verlet: many steps of all terms of a scene in one compiled call."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import prange

from sim.kernel import Array, Indices, Vector, inlined, kernel, parallel_kernel, signed
from sim.law import ContactLaw
from sim.motion import Bodies, move_bodies
from sim.near_walls import NearWalls
from sim.neighbors import Neighbors
from sim.pairs import add_pair_forces
from sim.state import INVERSE_INERTIA, INVERSE_MASS, SPIN_X, VELOCITY_X, X
from sim.suspended import Suspended, carry, foreseen
from sim.walls import add_wall_forces

OLDEST_LIST = 1000  # steps; particles that hardly move get a new list too, with a thinner skin


class Step(NamedTuple):
    """Where a run stands in time, and what bounds its steps."""

    number: int  # steps done
    listed: int  # step at which the neighbours were listed
    dt: float  # s
    skin: float  # m
    wall_speed: float  # m/s
    max_overlap: float  # radii


# The terms of a scene as `fill_forces` takes them: springs of the pairs, whether they resist rolling, species, law,
# laws; walls, the list of near ones, their springs, whether they resist rolling, law; what is tallied. A term that is
# None does not exist in the compiled program.
Terms = tuple[
    Array | None, bool | None, Indices | None, ContactLaw, Array | None,
    Bodies | None, NearWalls, Array | None, bool | None, Array,
    Array, Array, Array | None, Array | None,
]  # fmt: skip


@parallel_kernel
def fill_forces(
    dt: float,
    seen: Array,
    wrench: Array,
    listed: Neighbors,
    pair_spring: Array | None,
    pairs_roll: bool | None,
    species: Indices | None,
    pair_law: ContactLaw,
    pair_laws: Array | None,
    walls: Bodies | None,
    near: NearWalls,
    wall_spring: Array | None,
    walls_roll: bool | None,
    wall_laws: Array,
    tally: Array,
    body_tally: Array,
    impacts: Array | None,
    wall_impacts: Array | None,
) -> None:
    """Add all contact terms to `wrench` (n + boxes, 3 or 6), N and N m."""
    chunks = listed.chunks
    for c in prange(chunks.shape[0] - 1):
        add_pair_forces(
            signed(c), seen, listed, pair_spring, pairs_roll, species, pair_law, pair_laws, dt, wrench, tally, impacts
        )
        if walls is not None:
            add_wall_forces(
                signed(c), seen, chunks, walls, near, wall_spring, walls_roll, wall_laws, dt, wrench, tally, body_tally,
                wall_impacts,
            )  # fmt: skip


@inlined
def empty_boxes(c: int, listed: Neighbors, wrench: Array) -> None:
    """Add what the pairs of other chunks owe to the particles of chunk c, and empty its letter boxes."""
    n = listed.first.shape[0]
    for box in range(listed.boxes[c], listed.boxes[c + 1]):
        for column in range(wrench.shape[1]):
            wrench[listed.receiver[box], column] += wrench[n + box, column]
            wrench[n + box, column] = 0.0


@kernel
def kick_chunk(
    c: int,
    dt: float,
    gravity: Vector | None,
    suspended: Suspended | None,
    velocity: Array,
    spin: Array | None,
    seen: Array,
    wrench: Array,
    listed: Neighbors,
) -> None:
    """Kick the particles of chunk c by half a step: dv = (F/m + g) dt/2, dω = T/I dt/2 (paper eqs. (1), (2)).

    Of `suspended` particles the fluid takes part in dv.
    """
    empty_boxes(c, listed, wrench)
    half = 0.5 * dt
    for i in range(listed.chunks[c], listed.chunks[c + 1]):
        for axis in range(3):
            gained = seen[i, INVERSE_MASS] * wrench[i, axis]
            if gravity is not None:
                gained += gravity[axis] if seen[i, INVERSE_MASS] > 0.0 else 0.0
            if suspended is not None:
                velocity[i, axis] = carry(suspended, i, axis, half, gained, velocity[i, axis])
            else:
                velocity[i, axis] += half * gained
            if spin is not None:
                spin[i, axis] += half * (seen[i, INVERSE_INERTIA] * wrench[i, 3 + axis])


@kernel
def drift_chunk(
    c: int,
    kicks: int,
    dt: float,
    gravity: Vector | None,
    suspended: Suspended | None,
    position: Array,
    velocity: Array,
    spin: Array | None,
    seen: Array,
    wrench: Array,
    listed: Neighbors,
    listed_at: Array,
) -> float:
    """Kick the particles of chunk c by `kicks` half steps and move them by a step; empty their wrench.

    Returns the square of how far (m) any of them is from where it was listed. In `seen` velocities become what they
    will be at the end of the step if accelerations last: forces are evaluated with them.
    """
    empty_boxes(c, listed, wrench)
    half = 0.5 * dt
    farthest = 0.0
    for i in range(listed.chunks[c], listed.chunks[c + 1]):
        moved = 0.0
        for axis in range(3):
            gained = seen[i, INVERSE_MASS] * wrench[i, axis]
            if gravity is not None:
                gained += gravity[axis] if seen[i, INVERSE_MASS] > 0.0 else 0.0
            if suspended is not None:
                now = carry(suspended, i, axis, half, gained, velocity[i, axis])
                if kicks == 2:
                    now = carry(suspended, i, axis, half, gained, now)
                seen[i, VELOCITY_X + axis] = foreseen(suspended, i, axis, gained, now)
            else:
                now = velocity[i, axis] + half * gained
                if kicks == 2:
                    now += half * gained
                seen[i, VELOCITY_X + axis] = now + half * gained
            velocity[i, axis] = now
            position[i, axis] += dt * now
            seen[i, X + axis] = position[i, axis]
            moved += (position[i, axis] - listed_at[i, axis]) ** 2
            wrench[i, axis] = 0.0
        if spin is not None:
            for axis in range(3):
                gained = seen[i, INVERSE_INERTIA] * wrench[i, 3 + axis]
                now = spin[i, axis] + half * gained
                if kicks == 2:
                    now += half * gained
                spin[i, axis] = now
                seen[i, SPIN_X + axis] = now + half * gained
                wrench[i, 3 + axis] = 0.0
        if moved > farthest or moved != moved:  # not a number stays, and stops the run
            farthest = moved
    return farthest


@parallel_kernel
def advance(
    step: Step,
    steps: int,
    drifted: bool,
    gravity: Vector | None,
    suspended: Suspended | None,
    position: Array,
    velocity: Array,
    spin: Array | None,
    seen: Array,
    wrench: Array,
    listed: Neighbors,
    listed_at: Array,
    walls: Bodies | None,
    tally: Array,
    terms: Terms,
) -> tuple[int, bool, float]:
    """Do up to `steps` steps of half kick, drift, forces, half kick.

    Returns how many, whether the list is stale, and how far (m) its particles have moved towards each other or a wall.
    Returns early when a particle may have left its listed neighbourhood: positions are then drifted and the next call
    begins with the forces (`drifted`); or when the largest overlap in `tally` passes the limit.
    """
    done = 0
    kicks = 1  # the second half kick of a step and the first of the next are done in one sweep
    chunks = listed.chunks.shape[0] - 1
    travel = np.zeros(chunks)
    closer = 0.0
    while done < steps:
        if not drifted:
            for c in prange(chunks):
                travel[c] = drift_chunk(
                    signed(c), kicks, step.dt, gravity, suspended, position, velocity, spin, seen, wrench, listed,
                    listed_at,
                )  # fmt: skip
            if walls is not None:
                move_bodies(walls, (step.number + done + 1) * step.dt)
            moved, age = sqrt(travel.max()), step.number + done + 1 - step.listed
            closer = max(2.0 * moved, moved + step.wall_speed * step.dt * age)
            if not closer <= step.skin or age >= OLDEST_LIST:
                return done, True, closer
        drifted = False
        fill_forces(step.dt, seen, wrench, listed, *terms)
        kicks = 2
        done += 1
        if tally[:, 1].max() > step.max_overlap:
            break
    for c in prange(chunks):
        kick_chunk(signed(c), step.dt, gravity, suspended, velocity, spin, seen, wrench, listed)
    return done, False, closer
