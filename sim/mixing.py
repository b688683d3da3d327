"""How well two species are mixed."""

import numpy as np

from sim.kernel import Flags, Indices


def lacey_index(first: Flags, cell: Indices) -> float:
    """Lacey's index M = (σ₀² − σ²) / (σ₀² − σ_R²) of two species: 0 where they are apart, 1 as if by chance.

    `first` (n,) tells the particles of one species from the other's, `cell` (n,) where each is. The share x_c of the
    first species has the variance σ² = Σ n_c (x_c − p)² / N over the cells; of pure cells it is σ₀² = p (1 − p), and of
    N particles dealt to C cells by chance σ_R² = p (1 − p) (C − 1) / (N − 1). NaN where a species is absent, or every
    particle has a cell to itself. (P. M. C. Lacey, J. Appl. Chem. 4, 1954.)
    """
    n, cells = len(first), int(cell.max()) + 1
    in_cell = np.bincount(cell, minlength=cells)
    share = np.bincount(cell, weights=first.astype(np.float64), minlength=cells) / np.maximum(in_cell, 1)
    p = float(np.mean(first))
    apart = p * (1.0 - p)
    if apart == 0.0 or np.count_nonzero(in_cell) == n:
        return float("nan")
    by_chance = apart * (np.count_nonzero(in_cell) - 1) / (n - 1)
    found = float(np.sum(in_cell * (share - p) ** 2)) / n
    return (apart - found) / (apart - by_chance)
