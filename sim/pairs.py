"""Forces between touching particles."""

from math import sqrt

from sim.contact import ContactLaw, contact_force, part
from sim.kernel import Array, Vector, add_to_row, difference, inlined, kernel
from sim.neighbors import Neighbors

TALLY = 2  # of a chunk: dissipated energy (J), largest overlap in radii


@inlined
def turning_of(spin: Array | None, i: int, arm_i: float, j: int, arm_j: float) -> Vector:
    """Sum of lever arm (m) times spin of two particles, m/s; nothing where nothing turns."""
    if spin is None:
        return 0.0, 0.0, 0.0
    return (
        arm_i * spin[i, 0] + arm_j * spin[j, 0],
        arm_i * spin[i, 1] + arm_j * spin[j, 1],
        arm_i * spin[i, 2] + arm_j * spin[j, 2],
    )


@kernel
def add_pair_forces(
    c: int,
    position: Array,
    velocity: Array,
    spin: Array | None,
    radius: Array,
    inverse_mass: Array,
    listed: Neighbors,
    spring: Array | None,
    law: ContactLaw,
    dt: float,
    force: Array,
    torque: Array | None,
    tally: Array,
) -> None:
    """Add the contact forces of the pairs of chunk c (paper eqs. (3)–(5)) to `force` (n, 3) N and `torque` (n, 3) N m.

    The normal points from j to i. Lever arms r − δ/2 sum to the distance of the centres, in slip and in torque alike,
    so angular momentum is conserved. `tally` (chunks, 2) is added to, its largest overlap raised; what a pair
    listed by both partners dissipates counts half each time. Spin, spring and torque are None in frictionless scenes.
    """
    begin, end = listed.chunks[c], listed.chunks[c + 1]
    first, last, partner, touching = listed.first, listed.last, listed.partner, listed.touching
    lost, deepest = 0.0, tally[c, 1]
    for i in range(begin, end):
        for entry in range(first[i], last[i]):
            j = partner[entry]
            nx, ny, nz = difference(position, i, j)
            square = nx * nx + ny * ny + nz * nz
            reach = radius[i] + radius[j]
            inside = begin <= j < end
            count = 1.0 if inside else 0.5
            if square >= reach * reach:
                lost += count * part(entry, touching, spring, law)
                continue
            distance = sqrt(square)
            overlap = reach - distance
            normal = (nx / distance, ny / distance, nz / distance)
            smaller = min(radius[i], radius[j])
            if overlap > deepest * smaller:
                deepest = overlap / smaller
            approach = difference(velocity, i, j)
            arm_i, arm_j = radius[i] - 0.5 * overlap, radius[j] - 0.5 * overlap
            turning = turning_of(spin, i, arm_i, j, arm_j)
            reduced = 1.0 / (inverse_mass[i] + inverse_mass[j])
            push, moment, taken = contact_force(
                entry, overlap, normal, approach, turning, touching, spring, reduced, law, dt
            )
            lost += count * taken
            add_to_row(force, i, 1.0, push)
            if torque is not None:
                add_to_row(torque, i, -arm_i, moment)
            if inside:
                add_to_row(force, j, -1.0, push)
                if torque is not None:
                    add_to_row(torque, j, -arm_j, moment)
    tally[c, 0] += lost
    tally[c, 1] = deepest
