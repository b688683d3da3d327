"""Forces between touching particles, batch by batch.

The touching pairs of a chunk are gathered into a batch, quantity by quantity, so that the processor evaluates the
contact law of several pairs at once (the loop of `resolve_contacts` has no branch); then the forces are dealt out.
"""

from math import sqrt

import numpy as np

from sim.collisions import count_impact
from sim.contact import APART, normal_contact, part
from sim.friction import cross, rolling_moment, slip_of, tangential_force
from sim.kernel import Array, Indices, Partners, inlined, kernel
from sim.law import ContactLaw, law_between
from sim.neighbors import Neighbors, nearest_image
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

TALLY = 2  # of a chunk: dissipated energy (J), largest overlap in radii
BATCH = 64  # contacts; small enough for the fastest cache

# where each quantity of a batch begins: what was gathered ...
DX, DY, DZ, SQUARE, RADIUS_I, RADIUS_J, MOBILITY, VX, VY, VZ = range(0, 10 * BATCH, BATCH)
TX, TY, TZ, OX, OY, OZ, SX, SY, SZ, PHASE = range(10 * BATCH, 20 * BATCH, BATCH)
# ... and what follows from it
FX, FY, FZ, MX, MY, MZ, OVERLAP, LOST = range(20 * BATCH, 28 * BATCH, BATCH)
# rolling: relative spin, its spring, 1/I of both; and the moment
WX, WY, WZ, AX, AY, AZ, TURNABILITY, RX, RY, RZ = range(28 * BATCH, 38 * BATCH, BATCH)
QUANTITIES = 38
FIRST, SECOND, ENTRY, SPECIES_I, SPECIES_J = range(0, 5 * BATCH, BATCH)  # and of whom


@inlined
def reduced_radius(a: float, b: float) -> float:
    """R* = a b / (a + b), m."""
    return a * b / (a + b)


@inlined
def gather(
    m: int,
    pair: Partners,
    seen: Array,
    listed: Neighbors,
    spring: Array | None,
    rolls: bool | None,
    species: Indices | None,
    batch: Array,
) -> None:
    """Gather what the contact law needs of m touching pairs besides their distance."""
    for k in range(m):
        i, j, entry = pair[FIRST + k], pair[SECOND + k], pair[ENTRY + k]
        batch[PHASE + k] = listed.touching[entry]
        batch[MOBILITY + k] = seen[i, INVERSE_MASS] + seen[j, INVERSE_MASS]
        batch[VX + k] = seen[i, VELOCITY_X] - seen[j, VELOCITY_X]
        batch[VY + k] = seen[i, VELOCITY_Y] - seen[j, VELOCITY_Y]
        batch[VZ + k] = seen[i, VELOCITY_Z] - seen[j, VELOCITY_Z]
        if spring is not None:
            ri, rj = batch[RADIUS_I + k], batch[RADIUS_J + k]
            batch[TX + k] = ri * seen[i, SPIN_X] + rj * seen[j, SPIN_X]
            batch[TY + k] = ri * seen[i, SPIN_Y] + rj * seen[j, SPIN_Y]
            batch[TZ + k] = ri * seen[i, SPIN_Z] + rj * seen[j, SPIN_Z]
            batch[OX + k] = seen[i, SPIN_X] + seen[j, SPIN_X]
            batch[OY + k] = seen[i, SPIN_Y] + seen[j, SPIN_Y]
            batch[OZ + k] = seen[i, SPIN_Z] + seen[j, SPIN_Z]
            batch[SX + k], batch[SY + k], batch[SZ + k] = spring[entry, 0], spring[entry, 1], spring[entry, 2]
            if rolls is not None:
                batch[WX + k] = seen[i, SPIN_X] - seen[j, SPIN_X]
                batch[WY + k] = seen[i, SPIN_Y] - seen[j, SPIN_Y]
                batch[WZ + k] = seen[i, SPIN_Z] - seen[j, SPIN_Z]
                batch[AX + k], batch[AY + k], batch[AZ + k] = spring[entry, 3], spring[entry, 4], spring[entry, 5]
                batch[TURNABILITY + k] = seen[i, INVERSE_INERTIA] + seen[j, INVERSE_INERTIA]
        if species is not None:
            pair[SPECIES_I + k], pair[SPECIES_J + k] = species[i], species[j]


@kernel
def resolve_contacts(
    m: int,
    pair: Partners,
    batch: Array,
    spring: Array | None,
    rolls: bool | None,
    law: ContactLaw,
    laws: Array | None,
    dt: float,
) -> None:
    """Evaluate the contact law of m gathered pairs (paper eqs. (3)–(5)); without springs there is no friction.

    The normal points from j to i. Lever arms r − δ/2 sum to the distance of the centres, in slip and in torque alike,
    so angular momentum is conserved.
    """
    for k in range(m):
        if laws is not None:
            law = law_between(laws, pair[SPECIES_I + k], pair[SPECIES_J + k])
        distance = sqrt(batch[SQUARE + k])
        nearness = 1.0 / distance
        overlap = batch[RADIUS_I + k] + batch[RADIUS_J + k] - distance
        normal = (batch[DX + k] * nearness, batch[DY + k] * nearness, batch[DZ + k] * nearness)
        nx, ny, nz = normal
        approach = (batch[VX + k], batch[VY + k], batch[VZ + k])
        speed = approach[0] * nx + approach[1] * ny + approach[2] * nz
        reduced = 1.0 / batch[MOBILITY + k]
        load, lost, share, elapsed, phase = normal_contact(overlap, speed, batch[PHASE + k], reduced, law, dt)
        batch[PHASE + k] = phase
        batch[OVERLAP + k] = overlap
        fx, fy, fz = load * nx, load * ny, load * nz
        if spring is not None:
            half = 0.5 * overlap
            turning = (
                batch[TX + k] - half * batch[OX + k],
                batch[TY + k] - half * batch[OY + k],
                batch[TZ + k] - half * batch[OZ + k],
            )
            slip = slip_of(normal, approach, speed, turning)
            old = (batch[SX + k], batch[SY + k], batch[SZ + k])
            rub, new, rubbed = tangential_force(normal, slip, old, load, share, reduced, law, dt, elapsed)
            batch[SX + k], batch[SY + k], batch[SZ + k] = new
            batch[MX + k], batch[MY + k], batch[MZ + k] = cross(normal, rub)
            fx, fy, fz = fx + rub[0], fy + rub[1], fz + rub[2]
            lost += rubbed
            if rolls is not None:
                turning = (batch[WX + k], batch[WY + k], batch[WZ + k])
                old = (batch[AX + k], batch[AY + k], batch[AZ + k])
                radius = reduced_radius(batch[RADIUS_I + k], batch[RADIUS_J + k])
                turnability = batch[TURNABILITY + k]
                moment, new, rubbed = rolling_moment(
                    normal, turning, old, load, share, radius, turnability, law, dt, elapsed
                )
                batch[AX + k], batch[AY + k], batch[AZ + k] = new
                batch[RX + k], batch[RY + k], batch[RZ + k] = moment
                lost += rubbed
        batch[FX + k], batch[FY + k], batch[FZ + k] = fx, fy, fz
        batch[LOST + k] = lost


@inlined
def deal_out(
    m: int,
    pair: Partners,
    batch: Array,
    listed: Neighbors,
    spring: Array | None,
    rolls: bool | None,
    impacts: Array | None,
    law: ContactLaw,
    laws: Array | None,
    wrench: Array,
    lost: float,
    deepest: float,
) -> tuple[float, float]:
    """Add the forces of m pairs to their particles, or to the letter box of a partner in another chunk."""
    for k in range(m):
        i, entry = pair[FIRST + k], pair[ENTRY + k]
        j = listed.target[entry]
        if impacts is not None and listed.touching[entry] == APART:
            if laws is not None:
                law = law_between(laws, pair[SPECIES_I + k], pair[SPECIES_J + k])
            speed = (
                batch[VX + k] * batch[DX + k] + batch[VY + k] * batch[DY + k] + batch[VZ + k] * batch[DZ + k]
            ) / sqrt(batch[SQUARE + k])
            count_impact(impacts, speed, batch[OVERLAP + k], law.stiffness, 1.0 / batch[MOBILITY + k])
        listed.touching[entry] = np.uint8(batch[PHASE + k])
        lost += batch[LOST + k]
        smaller = min(batch[RADIUS_I + k], batch[RADIUS_J + k])
        if batch[OVERLAP + k] > deepest * smaller:
            deepest = batch[OVERLAP + k] / smaller
        push = (batch[FX + k], batch[FY + k], batch[FZ + k])
        for axis in range(3):
            wrench[i, axis] += push[axis]
            wrench[j, axis] -= push[axis]
        if spring is not None:
            spring[entry, 0], spring[entry, 1], spring[entry, 2] = batch[SX + k], batch[SY + k], batch[SZ + k]
            moment = (batch[MX + k], batch[MY + k], batch[MZ + k])
            half = 0.5 * batch[OVERLAP + k]
            arm_i, arm_j = batch[RADIUS_I + k] - half, batch[RADIUS_J + k] - half
            for axis in range(3):
                wrench[i, 3 + axis] -= arm_i * moment[axis]
                wrench[j, 3 + axis] -= arm_j * moment[axis]
            if rolls is not None:
                spring[entry, 3], spring[entry, 4], spring[entry, 5] = batch[AX + k], batch[AY + k], batch[AZ + k]
                roll = (batch[RX + k], batch[RY + k], batch[RZ + k])
                for axis in range(3):
                    wrench[i, 3 + axis] += roll[axis]
                    wrench[j, 3 + axis] -= roll[axis]
    return lost, deepest


@kernel
def add_batch(
    m: int,
    pair: Partners,
    batch: Array,
    seen: Array,
    listed: Neighbors,
    spring: Array | None,
    rolls: bool | None,
    species: Indices | None,
    law: ContactLaw,
    laws: Array | None,
    dt: float,
    wrench: Array,
    tally: Array,
    impacts: Array | None,
) -> None:
    """Add the forces of a batch of m touching pairs."""
    gather(m, pair, seen, listed, spring, rolls, species, batch)
    resolve_contacts(m, pair, batch, spring, rolls, law, laws, dt)
    tally[0], tally[1] = deal_out(m, pair, batch, listed, spring, rolls, impacts, law, laws, wrench, tally[0], tally[1])


@kernel
def add_pair_forces(
    c: int,
    seen: Array,
    listed: Neighbors,
    spring: Array | None,
    rolls: bool | None,
    species: Indices | None,
    law: ContactLaw,
    laws: Array | None,
    dt: float,
    wrench: Array,
    tally: Array,
    impacts: Array | None,
) -> None:
    """Add the contact forces of the pairs of chunk c to `wrench` (n + boxes, 3 or 6): forces in N, torques in N m.

    `tally` (chunks, 2) is added to, its largest overlap raised. Without springs (None) there is no friction and no
    torque, without `rolls` no rolling resistance; with `laws` every pair of species has its own constants; with
    `impacts` (chunks, bins) new contacts are counted by their energy.
    """
    begin, end = listed.chunks[c], listed.chunks[c + 1]
    batch = np.empty(QUANTITIES * BATCH)
    pair = np.empty(5 * BATCH, np.uint32)
    own = tally[c]
    counted = None if impacts is None else impacts[c]
    wraps = listed.image.shape[0] > 0
    m = 0
    for entry in range(listed.first[begin], listed.last[end - 1]):
        i, j = listed.owner[entry], listed.partner[entry]
        dx, dy, dz = seen[i, X] - seen[j, X], seen[i, Y] - seen[j, Y], seen[i, Z] - seen[j, Z]
        if wraps:
            dx, dy, dz = nearest_image(dx, dy, dz, listed, entry)
        radius, other = seen[i, RADIUS], seen[j, RADIUS]
        square = dx * dx + dy * dy + dz * dz
        pair[FIRST + m], pair[SECOND + m], pair[ENTRY + m] = i, j, entry
        batch[DX + m], batch[DY + m], batch[DZ + m], batch[SQUARE + m] = dx, dy, dz, square
        batch[RADIUS_I + m], batch[RADIUS_J + m] = radius, other
        near = square < (radius + other) * (radius + other)
        if listed.touching[entry] != APART and not near:
            if laws is not None and species is not None:
                law = law_between(laws, species[i], species[j])
            own[0] += part(entry, listed.touching, spring, law, reduced_radius(radius, other))
        m += near  # what is not near is overwritten by the next
        if m == BATCH:
            add_batch(m, pair, batch, seen, listed, spring, rolls, species, law, laws, dt, wrench, own, counted)
            m = 0
    add_batch(m, pair, batch, seen, listed, spring, rolls, species, law, laws, dt, wrench, own, counted)
