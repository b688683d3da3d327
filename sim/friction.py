"""What acts in the plane of a contact: friction against slip, and resistance against rolling."""

from math import sqrt

from sim.kernel import Vector, inlined
from sim.law import TANGENTIAL_COMPLIANCE, ContactLaw


@inlined
def slider(
    normal: Vector,
    rate: Vector,
    spring: Vector,
    stiffness: float,
    damping: float,
    limit: float,
    dt: float,
    elapsed: float,
) -> tuple[Vector, Vector, float]:
    """Return the force of a spring, a dashpot and a slider in the contact plane, the new spring, and what they take.

    Trial F* = −k s − c v; where |F*| exceeds the limit the force is that long, and the spring is reset so that
    −k s − c v equals it. The spring grows by the trapezoidal rule: half a step of this rate now and half a step for
    the next moment, but by the time in contact, `elapsed` (s), where that is less than a step. It is first turned into
    the present contact plane without changing its length. Slip (m/s) makes forces (N), rolling (rad/s) moments (N m);
    the energy dissipated in this step is in J.
    """
    nx, ny, nz = normal
    vx, vy, vz = rate
    sx, sy, sz = spring
    compliance = 1.0 / stiffness
    stored = sx * sx + sy * sy + sz * sz
    along = sx * nx + sy * ny + sz * nz
    px, py, pz = sx - along * nx, sy - along * ny, sz - along * nz
    kept = px * px + py * py + pz * pz
    stretch = sqrt(stored / kept) if kept > 0.0 else 0.0
    grows = 0.5 * dt if elapsed == dt else elapsed
    px, py, pz = px * stretch + vx * grows, py * stretch + vy * grows, pz * stretch + vz * grows

    fx, fy, fz = -stiffness * px - damping * vx, -stiffness * py - damping * vy, -stiffness * pz - damping * vz
    trial = fx * fx + fy * fy + fz * fz
    slides = trial > limit * limit
    cut = limit / sqrt(trial) if slides else 1.0
    fx, fy, fz = fx * cut, fy * cut, fz * cut
    px = -(fx + damping * vx) * compliance if slides else px
    py = -(fy + damping * vy) * compliance if slides else py
    pz = -(fz + damping * vz) * compliance if slides else pz
    half = 0.5 * dt
    px, py, pz = px + vx * half, py + vy * half, pz + vz * half
    work = -(fx * vx + fy * vy + fz * vz) * dt
    return (fx, fy, fz), (px, py, pz), work + 0.5 * stiffness * (stored - px * px - py * py - pz * pz)


@inlined
def tangential_force(
    normal: Vector,
    slip: Vector,
    spring: Vector,
    normal_load: float,
    share: float,
    reduced_mass: float,
    law: ContactLaw,
    dt: float,
    elapsed: float,
) -> tuple[Vector, Vector, float]:
    """Return friction in N, the tangential spring half a step ahead in m, and the energy dissipated this step in J.

    The slider with k_t, w η_t and the Coulomb limit μ|F_n| (paper eq. (4), see docs/notation.md).
    """
    if law.friction == 0.0:  # among others that rub
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    damping = share * law.tangential_damping * sqrt(reduced_mass)
    limit = law.friction * abs(normal_load)
    return slider(normal, slip, spring, law.tangential_stiffness, damping, limit, dt, elapsed)


@inlined
def rolling_moment(
    normal: Vector,
    turning: Vector,
    spring: Vector,
    normal_load: float,
    share: float,
    reduced_radius: float,
    mobility: float,
    law: ContactLaw,
    dt: float,
    elapsed: float,
) -> tuple[Vector, Vector, float]:
    """Return the moment against rolling in N m, its spring in rad, and the energy dissipated this step in J.

    The slider with k_r = 2.25 k μ_r² R*², a share of the critical dashpot 2 sqrt(k_r I*) and the limit μ_r R* |F_n|
    (Ai et al. 2011, doi 10.1016/j.powtec.2010.09.030), or that limit against the rolling, at most what stops it within
    the step. `turning` is ω_i − ω_j (rad/s), `mobility` 1/I_i + 1/I_j; I* is about the point of contact, 7/2 of it.
    """
    nx, ny, nz = normal
    spun = turning[0] * nx + turning[1] * ny + turning[2] * nz
    rate = (turning[0] - spun * nx, turning[1] - spun * ny, turning[2] - spun * nz)
    limit = law.rolling_friction * reduced_radius * abs(normal_load)
    stiffness = law.rolling_stiffness * reduced_radius * reduced_radius
    elastic = stiffness > 0.0
    stiffness = stiffness if elastic else 1.0
    damping = share * law.rolling_damping * 2.0 * sqrt(stiffness * TANGENTIAL_COMPLIANCE / mobility)
    moment, new, lost = slider(normal, rate, spring, stiffness, damping, limit, dt, elapsed)
    if law.rolling_friction == 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    fastest = sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2])
    pull = min(limit / fastest, 1.0 / (mobility * dt)) if fastest > 0.0 and dt > 0.0 else 0.0
    if elastic:
        return moment, new, lost
    return (-pull * rate[0], -pull * rate[1], -pull * rate[2]), spring, pull * fastest * fastest * dt


@inlined
def slip_of(normal: Vector, approach: Vector, speed: float, turning: Vector) -> Vector:
    """Tangential part of v − Σ l ω × n (m/s), of the velocity of the centres and the sum of lever arm times spin."""
    nx, ny, nz = normal
    sx, sy, sz = turning
    return (
        approach[0] - speed * nx - (sy * nz - sz * ny),
        approach[1] - speed * ny - (sz * nx - sx * nz),
        approach[2] - speed * nz - (sx * ny - sy * nx),
    )


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
