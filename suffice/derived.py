"""Velocities as the derivative of a surrogate of positions: nothing more is stored."""

import numpy as np
from numpy.typing import NDArray

from pod import Basis, RowSource, SnapshotMatrix
from suffice.reconstruction import Array
from surrogates import Surrogate


def velocity_squares(
    surrogate: Surrogate, basis: Basis, velocity: RowSource, times: Array, which: NDArray[np.intp]
) -> Array:
    """Squared errors (u, p), summed over rows, of Σ_{i≤n} ċ_i φ_i in place of the stored velocity, n = 1 … p.

    With a = φᵀv, modes of length one leave ‖v - Σ ċ_i φ_i‖² = ‖v‖² - Σ_{i≤n} a_i² + Σ_{i≤n} (a_i - ċ_i)².
    basis: the p modes of the positions; velocity: (rows, snapshots) m/s; which: (u,) snapshots, at times (u,) s.
    """
    matrix = SnapshotMatrix(velocity).columns(which)
    a = basis._replace(mean=np.zeros_like(basis.mean)).project(matrix)  # the mean position stands still
    whole = np.zeros(len(which))
    for block in matrix.row_blocks():
        whole += np.einsum("ij,ij->j", block, block)
    missed = np.square(a - surrogate.derivative(times)) - np.square(a)
    return np.asarray(np.maximum(whole[:, None] + missed.cumsum(axis=1), 0.0))


def velocity_rmse(
    surrogate: Surrogate, basis: Basis, velocity: RowSource, times: Array, which: NDArray[np.intp]
) -> float:
    """RMSE over the rows in m/s, mean over the times, with all modes of this basis."""
    squares = velocity_squares(surrogate, basis, velocity, times, which)[:, -1]
    return float(np.sqrt(squares / len(basis.mean)).mean())
