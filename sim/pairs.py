"""Forces between touching particles."""

from math import sqrt

from sim.contact import ContactLaw, normal_contact, tangential_force
from sim.kernel import Array, kernel
from sim.neighbors import Neighbors

TALLY = 2  # of a chunk: dissipated energy (J), largest overlap in radii


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
    lost, deepest = 0.0, tally[c, 1]
    for i in range(begin, end):
        x, y, z = position[i, 0], position[i, 1], position[i, 2]
        fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for entry in range(listed.first[i], listed.last[i]):
            j = listed.partner[entry]
            nx, ny, nz = x - position[j, 0], y - position[j, 1], z - position[j, 2]
            square = nx * nx + ny * ny + nz * nz
            reach = radius[i] + radius[j]
            inside = begin <= j < end
            count = 1.0 if inside else 0.5
            if square >= reach * reach:
                if listed.touching[entry]:
                    listed.touching[entry] = 0
                    if spring is not None:
                        for axis in range(3):
                            lost += count * 0.5 * law.tangential_stiffness * spring[entry, axis] ** 2
                            spring[entry, axis] = 0.0
                continue
            distance = sqrt(square)
            overlap = reach - distance
            nx, ny, nz = nx / distance, ny / distance, nz / distance
            deepest = max(deepest, overlap / min(radius[i], radius[j]))
            reduced = 1.0 / (inverse_mass[i] + inverse_mass[j])
            vx = velocity[i, 0] - velocity[j, 0]
            vy = velocity[i, 1] - velocity[j, 1]
            vz = velocity[i, 2] - velocity[j, 2]
            speed = vx * nx + vy * ny + vz * nz
            load, taken, share, elapsed, phase = normal_contact(
                overlap, speed, listed.touching[entry], reduced, law, dt
            )
            listed.touching[entry] = phase
            lost += count * taken
            px, py, pz = load * nx, load * ny, load * nz
            if spin is not None and spring is not None and torque is not None:
                arm_i, arm_j = radius[i] - 0.5 * overlap, radius[j] - 0.5 * overlap
                sx = arm_i * spin[i, 0] + arm_j * spin[j, 0]
                sy = arm_i * spin[i, 1] + arm_j * spin[j, 1]
                sz = arm_i * spin[i, 2] + arm_j * spin[j, 2]
                ux = vx - speed * nx - (sy * nz - sz * ny)
                uy = vy - speed * ny - (sz * nx - sx * nz)
                uz = vz - speed * nz - (sx * ny - sy * nx)
                (gx, gy, gz), (hx, hy, hz), taken = tangential_force(
                    (nx, ny, nz),
                    (ux, uy, uz),
                    (spring[entry, 0], spring[entry, 1], spring[entry, 2]),
                    load,
                    share,
                    reduced,
                    law,
                    dt,
                    elapsed,
                )
                spring[entry, 0], spring[entry, 1], spring[entry, 2] = hx, hy, hz
                lost += count * taken
                px, py, pz = px + gx, py + gy, pz + gz
                tx, ty, tz = ny * gz - nz * gy, nz * gx - nx * gz, nx * gy - ny * gx
                mx, my, mz = mx - arm_i * tx, my - arm_i * ty, mz - arm_i * tz
                if inside:
                    torque[j, 0] -= arm_j * tx
                    torque[j, 1] -= arm_j * ty
                    torque[j, 2] -= arm_j * tz
            fx, fy, fz = fx + px, fy + py, fz + pz
            if inside:
                force[j, 0] -= px
                force[j, 1] -= py
                force[j, 2] -= pz
        force[i, 0] += fx
        force[i, 1] += fy
        force[i, 2] += fz
        if torque is not None:
            torque[i, 0] += mx
            torque[i, 1] += my
            torque[i, 2] += mz
    tally[c, 0] += lost
    tally[c, 1] = deepest
