"""How many modes are enough: by their number, their energy, or the error that they leave."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from pod.errors import InputError
from pod.lanczos import Wanted

DEFAULT_ENERGY = 0.999


class Truncation(NamedTuple):
    """At most one criterion is set; by default 0.999 of the energy."""

    energy: float | None = None  # share of the total that the modes hold
    modes: int | None = None  # their number
    tolerance: float | None = None  # largest RMSE over the rows that any one snapshot keeps, unit of W
    error: float | None = None  # RMSE over rows and snapshots that is left, unit of W


def checked(criterion: Truncation) -> Truncation:
    """Return a criterion that can be met, the default one where none is given. Raises InputError."""
    energy, modes, tolerance, error = criterion
    if sum(x is not None for x in criterion) > 1:
        raise InputError("energy, modes, tolerance, error: more than one is given; give one")
    if energy is not None and not 0 < energy <= 1:
        raise InputError(f"energy: {energy}; give a share above 0 and at most 1, for example 0.999")
    if modes is not None and not (isinstance(modes, int | np.integer) and modes >= 1):
        raise InputError(f"modes: {modes}; give at least 1, a whole number")
    for name, value in (("tolerance", tolerance), ("error", error)):
        if value is not None and not value > 0:
            raise InputError(f"{name}: {value}; give a positive RMSE in the unit of the snapshots")
    return criterion if any(x is not None for x in criterion) else Truncation(energy=DEFAULT_ENERGY)


def wanted_by(criterion: Truncation, energies: Tensor, rows: float) -> Wanted:
    """Return how many leading pairs the criterion needs.

    energies: (N_t,) the diagonal of W̃ᵀW̃ / N_t; rows: of W, or the sum of their weights.
    p modes leave Σ_t K_tt - Σ_{i≤p} λ_i (Eckart-Young).
    """
    total, n = float(energies.sum()), len(energies)

    def by_number(ritz: Tensor, _: Callable[[], Tensor]) -> int | None:
        return criterion.modes if criterion.modes is not None and criterion.modes <= len(ritz) else None

    def by_energy(ritz: Tensor, _: Callable[[], Tensor]) -> int | None:
        least = (criterion.energy or 0.0) * total
        if criterion.error is not None:
            least = total - rows * criterion.error**2
        return _first(torch.cumsum(ritz, 0) >= least)

    def by_worst(ritz: Tensor, vectors: Callable[[], Tensor]) -> int | None:
        # what p modes leave of snapshot t: N_t (K_tt - Σ_{i≤p} θ_i v_ti²), squared norm
        left = energies - torch.cumsum(ritz[:, None] * vectors().T ** 2, 0)
        return _first(n * left.amax(dim=1) <= rows * (criterion.tolerance or 0.0) ** 2)

    if criterion.modes is not None:
        return by_number
    return by_worst if criterion.tolerance is not None else by_energy


def _first(true: Tensor) -> int | None:
    """How many until the first that is true, counted from one."""
    return int(true.int().argmax()) + 1 if bool(true.any()) else None
