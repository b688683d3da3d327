"""Drag of the fluid on a sphere among others (paper eqs. (6)–(9)).

F_d = β V_p/(1 − ε) (u − v). The coefficient κ = β V_p/(1 − ε), kg/s, is one expression in which 1 − ε cancels.
"""

from math import exp, expm1, log10, pi, sqrt

from sim.kernel import Array, Vector, inlined, kernel

ERGUN_WEN_YU, BLENDED, DI_FELICE = range(3)
DRAG_LAWS = {"ergun-wen-yu": ERGUN_WEN_YU, "blended": BLENDED, "di-felice": DI_FELICE}
DENSE = 0.8  # void fraction up to which Ergun's equation holds
BLENDING = 0.05  # half width, in void fraction, of the blended change from one to the other
LARGEST_CHANGE = 2.0  # factor by which κ may change within a step of the fluid that is longer than m/κ
HALVINGS = 50


@inlined
def reynolds(slip: float, diameter: float, void: float, density: float, viscosity: float) -> float:
    """Re_p = |u − v| ρ ε d / μ (paper eq. (9))."""
    return slip * density * void * diameter / viscosity


@inlined
def ergun(slip: float, diameter: float, void: float, density: float, viscosity: float) -> float:
    """β/(1 − ε) = 150 μ (1 − ε)/(ε d²) + 1.75 ρ |u − v|/d, kg/(m³ s) (paper eq. (7))."""
    return 150.0 * viscosity * (1.0 - void) / (void * diameter * diameter) + 1.75 * density * slip / diameter


@inlined
def resistance(re: float) -> float:
    """C_D Re_p: 24 (1 + 0.15 Re_p^0.687) up to 1000, then 0.44 Re_p (paper eq. (8)), 24 as Re_p vanishes."""
    drawn: float = 24.0 * (1.0 + 0.15 * re**0.687) if re <= 1000.0 else 0.44 * re
    return drawn


@inlined
def wen_yu(slip: float, diameter: float, void: float, density: float, viscosity: float) -> float:
    """β/(1 − ε) = ¾ C_D |u − v| ρ ε/d ε^−2.65, kg/(m³ s) (paper eq. (7)), by C_D Re_p: it needs no slip."""
    re = reynolds(slip, diameter, void, density, viscosity)
    lone = 0.75 * resistance(re) * viscosity / (diameter * diameter)
    crowded: float = lone * void**-2.65
    return crowded


@inlined
def di_felice(slip: float, diameter: float, void: float, density: float, viscosity: float) -> float:
    """β/(1 − ε) = ¾ C_D |u − v| ρ ε²/d ε^−χ, χ = 3.7 − 0.65 exp(−½ (1.5 − log₁₀ Re_p)²), C_D = (0.63 + 4.8/√Re_p)².

    Di Felice (1994), doi 10.1016/0301-9322(94)90011-6; C_D Re_p = (0.63 √Re_p + 4.8)².
    """
    re = reynolds(slip, diameter, void, density, viscosity)
    away = 1.5 - log10(max(re, 1e-12))
    power = 3.7 - 0.65 * exp(-0.5 * away * away)
    lone = 0.75 * (0.63 * re**0.5 + 4.8) ** 2 * viscosity / (diameter * diameter)
    crowded: float = lone * void ** (1.0 - power)
    return crowded


@kernel
def drag_coefficient(law: int, slip: float, diameter: float, void: float, density: float, viscosity: float) -> float:
    """κ = β V_p/(1 − ε) in kg/s: the force (N) for each m/s of slip, at a void fraction in (0, 1]."""
    volume = pi / 6.0 * diameter**3
    if law == DI_FELICE:
        return volume * di_felice(slip, diameter, void, density, viscosity)
    if law == ERGUN_WEN_YU and void <= DENSE:
        return volume * ergun(slip, diameter, void, density, viscosity)
    if law == ERGUN_WEN_YU:
        return volume * wen_yu(slip, diameter, void, density, viscosity)
    share = min(max(0.5 + 0.5 * (void - DENSE) / BLENDING, 0.0), 1.0)
    share = share * share * (3.0 - 2.0 * share)
    packed = ergun(slip, diameter, void, density, viscosity)
    return volume * (packed + share * (wen_yu(slip, diameter, void, density, viscosity) - packed))


@inlined
def length(a: Vector) -> float:
    """Length of a vector."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@inlined
def slip_left(slip: Vector, fall: Vector, pace: float, dt: float) -> float:
    """|w e^(−λΔt) − a (1 − e^(−λΔt))/λ|, m/s, of a slip w and an acceleration a after a step of pace λ Δt."""
    share = -expm1(-pace) / pace if pace > 1e-8 else 1.0
    kept, fallen = exp(-pace), share * dt
    return length(
        (kept * slip[0] - fallen * fall[0], kept * slip[1] - fallen * fall[1], kept * slip[2] - fallen * fall[2])
    )


@kernel
def coefficient_over(
    law: int, slip: Vector, fall: Vector, mobility: float, dt: float, diameter: float, void: float, density: float,
    viscosity: float,
) -> float:  # fmt: skip
    """κ for a step of `dt` (s): of the slip w at its beginning, or at its end where drag would outrun the step.

    `mobility` is 1/m of a particle (1/kg), 0 where others hold it. Where κ Δt/m > 1 and κ at the end is another by more
    than `LARGEST_CHANGE`, that of the beginning would throw a light particle from far too fast to far too slow and
    back; κ = κ(|w(κ)|) of the end, found by bisection, leads it to its terminal velocity.
    """
    before = drag_coefficient(law, length(slip), diameter, void, density, viscosity)
    if mobility == 0.0:
        return before
    after = drag_coefficient(law, slip_left(slip, fall, before * mobility * dt, dt), diameter, void, density, viscosity)
    low, high = min(before, after), max(before, after)
    if high * mobility * dt <= 1.0 or high <= LARGEST_CHANGE * low:
        return before
    for _ in range(HALVINGS):
        middle = sqrt(low * high)
        left = slip_left(slip, fall, middle * mobility * dt, dt)
        if drag_coefficient(law, left, diameter, void, density, viscosity) > middle:
            low = middle
        else:
            high = middle
    return sqrt(low * high)


@kernel
def fill_coefficients(
    law: int, velocity: Array, radius: Array, fluid: Array, void: Array, density: float, viscosity: float,
    fall: Array, mobility: Array, dt: float, coefficient: Array,
) -> None:  # fmt: skip
    """Fill κ (n,), kg/s, of particles of velocity (n, 3) in a fluid of velocity (n, 3), m/s, and void fraction (n,).

    For a step of `dt` (s), in which they fall by `fall` (n, 3) m/s² with `mobility` (n,) 1/kg: `coefficient_over`.
    """
    for i in range(radius.shape[0]):
        slip = (fluid[i, 0] - velocity[i, 0], fluid[i, 1] - velocity[i, 1], fluid[i, 2] - velocity[i, 2])
        acting = (fall[i, 0], fall[i, 1], fall[i, 2])
        coefficient[i] = coefficient_over(
            law, slip, acting, mobility[i], dt, 2.0 * radius[i], void[i], density, viscosity
        )
