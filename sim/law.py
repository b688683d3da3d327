"""Constants of a contact: what stiffness, restitution and friction of a scene mean for spring, dashpot and slider."""

from math import atan2, exp, inf, log, pi, sqrt
from typing import NamedTuple

from scipy.optimize import brentq

from sim.kernel import Array, inlined

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
    least_load: float  # N; −inf, or 0 where contacts never attract
    rolling_friction: float
    rolling_stiffness: float  # k_r / R*², N/m; 0: the moment is constant
    rolling_damping: float  # of the critical one


def contact_law(
    stiffness: float,
    restitution: float,
    friction: float = 0.0,
    stiffness_ratio: float = 1.0,
    damping_multiple: float = 1.0,
    attracts: bool = True,
    rolling: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> ContactLaw:
    """Return the law whose rebound has the given restitution.

    η = 2 ζ sqrt(k m*), with m* the reduced mass of the pair (paper eq. (5), see docs/notation.md); tangential spring
    and dashpot are the given multiples of the normal ones. `rolling` holds friction, k_r / R*² and the share of
    critical damping.
    """
    damping = 2.0 * damping_ratio(restitution, attracts) * sqrt(stiffness)
    least = -inf if attracts else 0.0
    return ContactLaw(
        stiffness, damping, stiffness_ratio * stiffness, damping_multiple * damping, friction, least, *rolling
    )


def damping_ratio(restitution: float, attracts: bool) -> float:
    """Return ζ = η / (2 sqrt(k m*)) at which a binary contact rebounds with the given restitution.

    Where the dashpot may attract at the end of a contact, −ln e / sqrt(π² + ln²e). Where contacts never attract they
    end as the force vanishes, and e(ζ) of Schwager and Pöschel (2007, doi 10.1007/s10035-007-0065-z) is inverted.
    """
    if attracts:
        return -log(restitution) / sqrt(pi**2 + log(restitution) ** 2)
    return float(brentq(lambda ratio: log(rebound(ratio)) - log(restitution), 0.0, 1.0 / restitution))


def rebound(ratio: float) -> float:
    """Restitution of a contact without attraction at the damping ratio ζ.

    e = exp(−ζ/s · atan2(2 ζ s, ζ² − s²)), s = sqrt(1 − ζ²); above ζ = 1 the angle is 2 ln(ζ + s), s = sqrt(ζ² − 1).
    """
    if abs(ratio - 1.0) < 1e-7:
        return exp(-2.0)
    s = sqrt(abs(1.0 - ratio**2))
    if ratio < 1.0:
        return exp(-ratio / s * atan2(2.0 * ratio * s, ratio**2 - s**2))
    return exp(-2.0 * ratio / s * log(ratio + s))


def contact_time(stiffness: float, restitution: float, reduced_mass: float) -> float:
    """Duration of a binary contact, t_c = sqrt(π² + ln²e) sqrt(m*/k), s."""
    return sqrt(pi**2 + log(restitution) ** 2) * sqrt(reduced_mass / stiffness)


def tangential_time(tangential_stiffness: float, reduced_mass: float) -> float:
    """Half a period of the tangential spring of two solid spheres, π sqrt(2 m* / (7 k_t)), s."""
    return pi * sqrt(reduced_mass / (TANGENTIAL_COMPLIANCE * tangential_stiffness))


@inlined
def law_of_row(laws: Array, b: int) -> ContactLaw:
    """Constants in row b of `laws` (bodies, constants)."""
    return ContactLaw(
        laws[b, 0], laws[b, 1], laws[b, 2], laws[b, 3], laws[b, 4], laws[b, 5], laws[b, 6], laws[b, 7], laws[b, 8]
    )


@inlined
def law_between(laws: Array, a: int, b: int) -> ContactLaw:
    """Constants of a contact of species a with species b, from `laws` (species, species, constants)."""
    return ContactLaw(
        laws[a, b, 0],
        laws[a, b, 1],
        laws[a, b, 2],
        laws[a, b, 3],
        laws[a, b, 4],
        laws[a, b, 5],
        laws[a, b, 6],
        laws[a, b, 7],
        laws[a, b, 8],
    )
