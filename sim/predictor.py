"""Velocity before the pressure has corrected it: inertia, viscosity, drag and walls, all implicit.

On every face inside, u/b − ∇·(ετ(u)) = t, with b = (1 − α) / (ρε/Δt + K) the mobility (m³ s/kg) and t = α u_w / b plus
all explicit terms: a symmetric system for the velocities where b > 0, solved by conjugate gradients preconditioned by
its diagonal. Where b = 0 the velocity is prescribed.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.grid import Grid
from sim.kernel import Array

MOST_ITERATIONS = 500


class Prediction(NamedTuple):
    """How the velocity was found."""

    iterations: int
    error: float  # m/s, largest change that one more sweep would make


def stiffness(weight: Array, viscosity: float, grid: Grid) -> Array:
    """Diagonal of −∇·(ετ) on faces, nearly, (3, size), kg/(m³ s); `weight` is ε in the cells."""
    rows = []
    for a, s in enumerate(grid.stride):
        mean = 0.5 * (weight + np.roll(weight, s))
        rows.append(viscosity * mean * sum((8.0 / 3.0 if b == a else 2.0) / h**2 for b, h in enumerate(grid.spacing)))
    return np.stack(rows)


def predict_(
    velocity: Array, target: Array, mobility: Array, diagonal: Array, friction: Callable[[Array, bool], Array],
    tolerance: float,
) -> Prediction:  # fmt: skip
    """Solve for `velocity` (3, size), which holds the first guess and what is prescribed; tolerance in m/s.

    `target` and `mobility` (3, size) are t and b, 0 on all faces that are not solved for; `diagonal` is that of the
    viscous part; `friction` returns ∇·(ετ) of a velocity, with the sides moving or at rest.
    """
    solved = mobility > 0.0
    resistance = np.divide(1.0, mobility, out=np.zeros_like(mobility), where=solved)
    scale = np.divide(1.0, resistance + diagonal, out=np.zeros_like(mobility), where=solved)
    residual = np.where(solved, target - resistance * velocity + friction(velocity, True), 0.0)
    scaled = scale * residual
    search, product = scaled.copy(), float((residual * scaled).sum())
    iterations = 0
    while (error := float(np.abs(scaled).max())) > tolerance and iterations < MOST_ITERATIONS:
        image = np.where(solved, resistance * search - friction(search, False), 0.0)
        length = product / float((search * image).sum())
        velocity += length * search
        residual -= length * image
        scaled = scale * residual
        before, product = product, float((residual * scaled).sum())
        search = scaled + (product / before) * search
        iterations += 1
    return Prediction(iterations, error)
