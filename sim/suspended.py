"""What a fluid does to the particles between two of its steps.

m dv/dt = F + κ (u − v) + V_p (−∇p − ρ_f g) (paper eqs. (1), (6)), with coefficient κ, fluid velocity u and pressure
gradient frozen: over half a step of constant F this is solved exactly, v' = v e^(−λ dt/2) + a (1 − e^(−λ dt/2))/λ with
λ = κ/m, so that no step is too long for the drag.
"""

from typing import NamedTuple

import numpy as np

from sim.kernel import Array, inlined


class Suspended(NamedTuple):
    """Drag on particles, a row each, and what the fluid has given them so far."""

    decay: Array  # (n,) e^(−λ dt/2)
    gain: Array  # (n,) s, (1 − e^(−λ dt/2))/λ
    pull: Array  # (n, 3) m/s², λ u
    lift: Array  # (n, 3) m/s², buoyancy and pressure gradient
    given: Array  # (n, 4) by drag, m/s; and the fluid's work per mass, J/kg
    coefficient: Array  # (n,) kg/s, κ
    fluid_velocity: Array  # (n, 3) m/s, u
    square: Array  # (n,) m²/s², mean of u² over the faces that the particle acts on
    slip_square: Array  # (n,) m²/s², mean of |u − v|² over them at the start
    assumed: Array  # (n, 3) N s, drag's impulse as the fluid's step foresaw it


def suspended_in(
    coefficient: Array, inverse_mass: Array, velocity: Array, fluid_velocity: Array, square: Array, lift: Array,
    dt: float, assumed: Array,
) -> Suspended:  # fmt: skip
    """Return the terms of particles of drag coefficient κ (n,), kg/s, in steps of dt (s)."""
    half, rate = 0.5 * dt, coefficient * inverse_mass
    slow = rate * half < 1e-12
    gain = np.where(slow, half, -np.expm1(-rate * half) / np.where(slow, 1.0, rate))
    pull = rate[:, None] * fluid_velocity
    given = np.zeros((len(rate), 4))
    slip = square + (velocity * (velocity - 2.0 * fluid_velocity)).sum(axis=1)
    decay = np.exp(-rate * half)
    return Suspended(decay, gain, pull, lift, given, coefficient, fluid_velocity, square, slip, assumed)


@inlined
def foreseen(fluid: Suspended, i: int, axis: int, gained: float, before: float) -> float:
    """Velocity (m/s) of particle i half a step on, accelerated by `gained` (m/s²) and by the fluid."""
    now: float = fluid.decay[i] * before + fluid.gain[i] * (gained + fluid.pull[i, axis] + fluid.lift[i, axis])
    return now


@inlined
def carry(fluid: Suspended, i: int, axis: int, half: float, gained: float, before: float) -> float:
    """Do the same, and count what the fluid gave in this half step (s)."""
    now = foreseen(fluid, i, axis, gained, before)
    fluid.given[i, axis] += now - before - half * (gained + fluid.lift[i, axis])
    fluid.given[i, 3] += 0.5 * (now + before) * (now - before - half * gained)
    return now
