"""The next state as a weighted sum of those before, the same weights for all modes."""

import numpy as np
from numpy.typing import NDArray

RIDGE = 1e-10  # of the largest squared singular value


def autoregression(values: NDArray[np.float64], memory: int) -> NDArray[np.float64]:
    """Weights a (memory,), oldest first, of c_{n+1} = Σ_j a_j c_{n-memory+1+j}, by least squares over all modes.

    values: (snapshots, modes) about their mean. Roots of the characteristic polynomial beyond the unit circle are put
    onto it, so that a rollout cannot grow exponentially (roots that meet on it let it grow like a line).
    """
    windows = np.stack([values[k : len(values) - memory + k] for k in range(memory)], axis=-1).reshape(-1, memory)
    targets = values[memory:].reshape(-1)
    normal = windows.T @ windows
    size = float(np.trace(normal))
    if not size > 0.0:
        return np.asarray(np.eye(memory)[-1])
    weights = np.linalg.solve(normal + RIDGE * size * np.eye(memory), windows.T @ targets)
    roots = np.roots(np.concatenate([[1.0], -weights[::-1]]))
    if np.abs(roots).max(initial=0.0) <= 1.0:
        return np.asarray(weights)
    kept = np.poly(roots / np.maximum(np.abs(roots), 1.0)).real
    stable = np.zeros(memory)
    stable[memory - len(kept) + 1 :] = -kept[1:][::-1]
    return stable
