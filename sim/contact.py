"""Contact of two bodies: linear spring, dashpot and Coulomb slider.

The force of paper eq. (4) is evaluated with the velocities that the particles will have at its moment: the half-step
velocity plus half a step of the last acceleration. A dashpot jumps from zero to η v at the two ends of a contact; there
its force is weighted by the part of the step that was spent in contact. Both keep velocity Verlet second order, so that
a pair set to restitution e rebounds with e, and neither acts on particles at rest.
"""

from math import log, pi, sqrt
from typing import NamedTuple

from sim.kernel import Array, Flags, Vector, inlined

STEPS_PER_CONTACT = 50  # the default time step
FEWEST_STEPS_PER_CONTACT = 20  # above this a step is refused; below restitution 0.9 the default is also the limit
NEARLY_ELASTIC = 0.9
APART, TOUCHING, LEAVING = range(3)  # phase of a contact at the last moment
TANGENTIAL_COMPLIANCE = 3.5  # 1/m* + r²/I of each of two solid spheres is 7/2 of 1/m*


class ContactLaw(NamedTuple):
    """Constants of one kind of contact."""

    stiffness: float  # N/m
    damping: float  # η / sqrt(m*), sqrt(N/m)
    tangential_stiffness: float  # N/m
    tangential_damping: float  # η_t / sqrt(m*), sqrt(N/m)
    friction: float


def contact_law(
    stiffness: float, restitution: float, friction: float, stiffness_ratio: float = 1.0, damping_ratio: float = 1.0
) -> ContactLaw:
    """Return the law whose rebound has the given restitution.

    η = −2 ln(e) sqrt(k m* / (ln²e + π²)), with m* the reduced mass of the pair (paper eq. (5), see docs/notation.md);
    tangential spring and dashpot are the given multiples of the normal ones.
    """
    damping = -2.0 * log(restitution) * sqrt(stiffness / (log(restitution) ** 2 + pi**2))
    return ContactLaw(stiffness, damping, stiffness_ratio * stiffness, damping_ratio * damping, friction)


def contact_time(stiffness: float, restitution: float, reduced_mass: float) -> float:
    """Duration of a binary contact, t_c = sqrt(π² + ln²e) sqrt(m*/k), s."""
    return sqrt(pi**2 + log(restitution) ** 2) * sqrt(reduced_mass / stiffness)


def tangential_time(tangential_stiffness: float, reduced_mass: float) -> float:
    """Half a period of the tangential spring of two solid spheres, π sqrt(2 m* / (7 k_t)), s."""
    return pi * sqrt(reduced_mass / (TANGENTIAL_COMPLIANCE * tangential_stiffness))


@inlined
def normal_contact(
    overlap: float, separation_speed: float, phase: float, reduced_mass: float, law: ContactLaw, dt: float
) -> tuple[float, float, float, float, float]:
    """Return the normal force of a contact at this moment, F_n = k δ − w η v_n, its ends resolved within the step.

    A force stands for half a step before and half a step after its moment. But a new contact began overlap / approach
    speed ago, a time that no earlier force covered; and one that will have separated before the next moment ends
    overlap / separation speed from now. Returns the force (N), the energy its dashpot takes (J), the share w of a step
    that it stands for, the time in contact since the last moment (s), and the phase for the next.
    """
    begins = phase == APART
    first = min(-overlap / (separation_speed * dt), 1.0) if begins and separation_speed < 0.0 else 0.5
    elapsed = first * dt if begins else dt
    before = 0.0 if phase == LEAVING else first  # the last force stood for that time too
    damping = law.damping * sqrt(reduced_mass) * separation_speed
    elastic = law.stiffness * overlap
    load = elastic - (before + 0.5) * damping
    ahead = (separation_speed + 0.5 * dt * load / reduced_mass) * dt
    leaves = ahead > overlap
    share = before + (overlap / ahead if leaves else 0.5)
    load = elastic - share * damping
    return load, share * damping * separation_speed * dt, share, elapsed, LEAVING if leaves else TOUCHING


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

    Trial F* = −k_t δ_t − w η_t v_t; where |F*| > μ|F_n| the force is μ|F_n| F*/|F*| and the spring is reset so that
    −k_t δ_t − w η_t v_t equals it. The spring grows by the trapezoidal rule: half a step of this slip velocity now and
    half a step for the next moment, but by the time in contact, `elapsed` (s), where that is less than a step. It is
    first turned into the present contact plane without changing its length.
    """
    nx, ny, nz = normal
    vx, vy, vz = slip
    sx, sy, sz = spring
    k = law.tangential_stiffness
    compliance = 1.0 / k
    stored = sx * sx + sy * sy + sz * sz
    along = sx * nx + sy * ny + sz * nz
    px, py, pz = sx - along * nx, sy - along * ny, sz - along * nz
    kept = px * px + py * py + pz * pz
    stretch = sqrt(stored / kept) if kept > 0.0 else 0.0
    grows = 0.5 * dt if elapsed == dt else elapsed
    px, py, pz = px * stretch + vx * grows, py * stretch + vy * grows, pz * stretch + vz * grows

    damping = share * law.tangential_damping * sqrt(reduced_mass)
    fx, fy, fz = -k * px - damping * vx, -k * py - damping * vy, -k * pz - damping * vz
    limit = law.friction * abs(normal_load)
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
    return (fx, fy, fz), (px, py, pz), work + 0.5 * k * (stored - px * px - py * py - pz * pz)


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


@inlined
def contact_force(
    entry: int,
    overlap: float,
    normal: Vector,
    approach: Vector,
    turning: Vector,
    touching: Flags,
    spring: Array | None,
    reduced_mass: float,
    law: ContactLaw,
    dt: float,
) -> tuple[Vector, Vector, float]:
    """Return the force of a contact in N, n × F_t in N, and the energy dissipated this step in J.

    `approach` is the relative velocity of the centres and `turning` the sum of lever arm times spin (m/s): the slip is
    the tangential part of v − Σ l ω × n. Phase and spring of the list's entry are brought up to date; without springs
    (None) there is no friction.
    """
    nx, ny, nz = normal
    speed = approach[0] * nx + approach[1] * ny + approach[2] * nz
    load, lost, share, elapsed, phase = normal_contact(overlap, speed, touching[entry], reduced_mass, law, dt)
    touching[entry] = phase
    fx, fy, fz = load * nx, load * ny, load * nz
    moment = (0.0, 0.0, 0.0)
    if spring is not None:
        slip = slip_of(normal, approach, speed, turning)
        old = (spring[entry, 0], spring[entry, 1], spring[entry, 2])
        rub, new, rubbed = tangential_force(normal, slip, old, load, share, reduced_mass, law, dt, elapsed)
        spring[entry, 0], spring[entry, 1], spring[entry, 2] = new
        lost += rubbed
        fx, fy, fz = fx + rub[0], fy + rub[1], fz + rub[2]
        moment = cross(normal, rub)
    return (fx, fy, fz), moment, lost


@inlined
def part(entry: int, touching: Flags, spring: Array | None, law: ContactLaw) -> float:
    """End a contact that there may have been, and return the energy (J) that was left in its tangential spring."""
    if touching[entry] == APART:
        return 0.0
    touching[entry] = APART
    left = 0.0
    if spring is not None:
        for axis in range(3):
            left += 0.5 * law.tangential_stiffness * spring[entry, axis] ** 2
            spring[entry, axis] = 0.0
    return left
