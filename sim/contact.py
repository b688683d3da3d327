"""Contact of two bodies: linear spring, dashpot and Coulomb slider.

The force of paper eq. (4) is evaluated by velocity Verlet with half-step velocities. Two measures keep it second order
in time, so that a pair set to restitution e rebounds with e:

- the dashpot acts on the velocity at the end of the step, which in a binary contact is the half-step velocity plus
  dt F / (2 m): solved for F, this divides the force by 1 + w η dt / (2 m);
- a dashpot jumps from zero to η v at the ends of a contact; there it is weighted by w, the part of the step that was
  spent in contact.
"""

from math import log, pi, sqrt
from typing import NamedTuple

from sim.kernel import kernel

STEPS_PER_CONTACT = 50  # the default time step
FEWEST_STEPS_PER_CONTACT = 20  # above this a step is refused; below restitution 0.9 the default is also the limit
NEARLY_ELASTIC = 0.9
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


@kernel
def contact_shares(overlap: float, separation_speed: float, dt: float, is_new: bool) -> tuple[float, float]:
    """Parts of a step, before and after this moment, that this force stands for: a half each but at a contact's ends.

    A new contact began overlap / approach speed ago, and no earlier force covered that time; a contact that separates
    ends overlap / separation speed from now, and no later force will.
    """
    before, after = 0.5, 0.5
    if is_new and separation_speed < 0.0:
        before = min(-overlap / (separation_speed * dt), 1.0)
    if separation_speed > 0.0:
        remaining = overlap / (separation_speed * dt)
        if remaining < 1.0:
            after = remaining
    return before, after


@kernel
def normal_force(
    overlap: float, separation_speed: float, share: float, reduced_mass: float, law: ContactLaw, dt: float
) -> tuple[float, float]:
    """Repulsion F_n = (k δ − w η v_n) / (1 + w η dt / (2 m*)) in N, and the energy its dashpot takes this step in J."""
    damping = share * law.damping * sqrt(reduced_mass)
    lag = 0.5 * dt / reduced_mass
    force = (law.stiffness * overlap - damping * separation_speed) / (1.0 + damping * lag)
    speed = separation_speed + lag * force
    return force, damping * speed * speed * dt


@kernel
def tangential_force(
    normal: tuple[float, float, float],
    slip: tuple[float, float, float],
    spring: tuple[float, float, float],
    normal_load: float,
    share: float,
    reduced_mass: float,
    law: ContactLaw,
    dt: float,
    elapsed: float,
) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Friction in N, the new tangential spring in m, and the energy dissipated this step in J.

    Trial F* = −k_t δ_t − η_t v_t; where |F*| > μ|F_n| the force is μ|F_n| F*/|F*| and the spring is reset so that
    −k_t δ_t − η_t v_t equals it. `slip` is the tangential half-step velocity; the spring is first turned into the
    present contact plane without changing its length; `elapsed` is the time in s that it grows by.
    """
    nx, ny, nz = normal
    vx, vy, vz = slip
    sx, sy, sz = spring
    k = law.tangential_stiffness
    stored = 0.5 * k * (sx * sx + sy * sy + sz * sz)
    along = sx * nx + sy * ny + sz * nz
    px, py, pz = sx - along * nx, sy - along * ny, sz - along * nz
    kept = px * px + py * py + pz * pz
    if kept > 0.0:
        stretch = sqrt((kept + along * along) / kept)
        px, py, pz = px * stretch, py * stretch, pz * stretch
    px, py, pz = px + vx * elapsed, py + vy * elapsed, pz + vz * elapsed

    damping = share * law.tangential_damping * sqrt(reduced_mass)
    lag = 0.5 * dt * TANGENTIAL_COMPLIANCE / reduced_mass
    scale = -1.0 / (1.0 + damping * lag)
    fx, fy, fz = (k * px + damping * vx) * scale, (k * py + damping * vy) * scale, (k * pz + damping * vz) * scale
    limit = law.friction * abs(normal_load)
    trial = sqrt(fx * fx + fy * fy + fz * fz)
    slides = trial > limit
    if slides:
        cut = limit / trial
        fx, fy, fz = fx * cut, fy * cut, fz * cut
    ux, uy, uz = vx + lag * fx, vy + lag * fy, vz + lag * fz
    if slides:
        px, py, pz = -(fx + damping * ux) / k, -(fy + damping * uy) / k, -(fz + damping * uz) / k
    work = -(fx * ux + fy * uy + fz * uz) * dt
    lost = work + stored - 0.5 * k * (px * px + py * py + pz * pz)
    return (fx, fy, fz), (px, py, pz), lost
