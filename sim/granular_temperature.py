"""Granular temperature: how much particles move against their neighbours."""

import numpy as np

from sim.averaging import sums_over
from sim.kernel import Array, Indices

FEWEST = 5  # particles of a cell: one more than the numbers in a linear field of velocity


def granular_temperature(position: Array, velocity: Array, mass: Array, cell: Indices) -> float:
    """T = Σ m |c|² / (3 Σ m (1 − q/n)), m²/s²: c is what velocity differs by from its cell's linear field.

    Each cell of n ≥ 5 particles has a field u + G·(x − x̄) of least squares, weighted by mass, so that neither a stream
    nor shear or rotation heats; its q = 1 + rank numbers per component (4 in space) are taken off the degrees of
    freedom. NaN where no cell has that many. Fixed particles, of no mass, do not count.
    """
    moves = mass > 0.0
    position, velocity, mass, cell = position[moves], velocity[moves], mass[moves], cell[moves]
    full = np.bincount(cell) >= FEWEST
    rows = full[cell]
    if not rows.any():
        return float("nan")
    _, cell = np.unique(cell[rows], return_inverse=True)
    x, v, m = position[rows], velocity[rows], mass[rows]
    number, total = np.bincount(cell), sums_over(cell, m)
    dx = x - (sums_over(cell, m[:, None] * x) / total[:, None])[cell]
    dv = v - (sums_over(cell, m[:, None] * v) / total[:, None])[cell]
    gradient, rank = _linear_fields(cell, dx, dv, m)
    noise = dv - np.einsum("nj,njk->nk", dx, gradient[cell])
    freedom = float(np.sum(total * np.maximum(1.0 - (1.0 + rank) / number, 0.0)))
    if freedom == 0.0:
        return float("nan")
    return float(np.sum(m[:, None] * noise**2)) / (3.0 * freedom)


def _linear_fields(cell: Indices, dx: Array, dv: Array, mass: Array) -> tuple[Array, Indices]:
    """Return ∂v_k/∂x_j of every cell, shape (cells, 3, 3), and in how many directions its particles spread."""
    weighted = mass[:, None, None] * dx[:, :, None]
    spread = sums_over(cell, weighted * dx[:, None, :])
    slope = sums_over(cell, weighted * dv[:, None, :])
    value, direction = np.linalg.eigh(spread)
    kept = value > 1e-6 * value[:, -1:]  # a flat layer says nothing about the gradient across it
    inverse = np.where(kept, 1.0 / np.where(kept, value, 1.0), 0.0)
    gradient = np.einsum("cij,cj,ckj,ckl->cil", direction, inverse, direction, slope, optimize=True)
    return gradient, kept.sum(axis=1)
