"""A linear map of a state and its past, as one matrix of the delayed state."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur
from scipy.linalg.lapack import dtrsyl

from surrogates.past import Past

Array = NDArray[np.float64]


def companion(past: Past, linear: Array) -> Array:
    """Matrix (memory · modes, the same) that steps (c_i, c_{i-1}, …) - c̄ where c_{i+1} = c_i + z_iᵀ B.

    linear: B (memory · modes, modes), rows in the order of the points z of `past`.
    """
    modes = len(past.centre)
    by_order = linear.reshape(past.memory, modes, modes)  # order, of which mode, to which mode
    by_delay = np.einsum("kd,kij->jdi", past.point_of_delays(), by_order)
    matrix = np.eye(past.memory * modes, k=-modes)
    matrix[:modes] = by_delay.reshape(modes, -1)
    matrix[:modes, :modes] += np.eye(modes)
    return matrix


def drawn_back(matrix: Array, limit: float) -> tuple[Array, int]:
    """Matrix with its eigenvalues of modulus above `limit` moved onto the unit circle, phase kept, and their number.

    A = Q [[G, C], [0, R]] Qᵀ, the real Schur form with the growing ones G first; G X - X R = -C parts their invariant
    subspace from the rest, and only there each eigenvalue, or conjugate pair, is divided by its modulus. What does not
    grow goes on as before.
    """
    triangle, vectors, count = schur(matrix, output="real", sort=lambda re, im: np.hypot(re, im) > limit)
    growing, rest = triangle[:count, :count], triangle[count:, count:]
    bounded = _onto_circle(growing)
    if 0 < count < len(triangle):
        solved, scale, _ = dtrsyl(growing, rest, -triangle[:count, count:], isgn=-1)
        triangle[:count, count:] = (solved @ rest - bounded @ solved) / scale
    triangle[:count, :count] = bounded
    return vectors @ triangle @ vectors.T, int(count)


def _onto_circle(triangle: Array) -> Array:
    """Each diagonal block of a real Schur form, an eigenvalue or a conjugate pair, divided by its modulus."""
    bounded, first = triangle.copy(), 0
    while first < len(bounded):
        pair = first + 1 < len(bounded) and bounded[first + 1, first] != 0
        block = slice(first, first + 1 + pair)
        bounded[block, block] /= np.abs(np.linalg.eigvals(bounded[block, block])).max()
        first += 1 + pair
    return bounded
