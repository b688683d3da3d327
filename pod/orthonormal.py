"""Modes made orthonormal to rounding, with their signs fixed."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ORTHOGONAL = 1e-14  # entries of φᵀφ - 1 that rounding alone explains
REPAIRABLE = 0.1  # entries of φᵀφ - 1 up to which a Cholesky factor mends the modes


def orthonormalise_(modes: Array) -> int:
    """Orthonormalise the modes (rows, p) in place; returns how many leading ones could be.

    Modes of small eigenvalues lose orthogonality like ε λ₁/λ. φ <- φ L⁻ᵀ with LLᵀ = φᵀφ, repeated: the first modes,
    the most accurate, change least. Where φᵀφ is further than 0.1 from the identity there is no mode to mend.
    """
    inner = modes.T @ modes
    far = np.abs(inner - np.eye(len(inner))) > REPAIRABLE
    p = next((i for i in range(len(inner)) if far[i, : i + 1].any()), len(inner))
    for _ in range(3):
        leading = modes[:, :p]
        inner = leading.T @ leading
        if np.abs(inner - np.eye(p)).max(initial=0.0) <= ORTHOGONAL:
            break
        leading[:] = leading @ np.linalg.inv(np.linalg.cholesky(inner)).T
    return p


def fix_signs_(modes: Array) -> Array:
    """Turn each mode (a column) in place so that its largest entry is positive."""
    for i in range(modes.shape[1]):
        if modes[np.argmax(np.abs(modes[:, i])), i] < 0:
            modes[:, i] *= -1
    return modes
