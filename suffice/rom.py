"""A reduced order model of the positions, ready to be asked for whole snapshots at any time."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from pod import InputError as UnfitSnapshots
from pod.gram import compute_device
from suffice.alternatives import fitted
from suffice.compare import CONSISTENCY, subsets_between
from suffice.quantities import AXES
from suffice.reconstruction import Array, Case, consistent_level, reduce
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.variables import held, held_rates
from surrogates import Surrogate


class Component(NamedTuple):
    """One component of the position: its mean, its modes, and the surrogate of their coefficients."""

    mean: Array  # (beads,) m
    modes: Array  # (beads, n) orthonormal
    surrogate: Surrogate  # fitted: times (t,) s -> coefficients (t, n), m
    n_lr: int | None = None
    n_c: int | None = None


class Rom:
    """Modes of all components in single precision on one device, each with its mean as one more mode.

    W(t) = W̄ + Σ c_i(t) φ_i (paper eq. (29)) is then a single product [1, c] [W̄, φ]ᵀ, in which every mode is read once
    and a snapshot written once. copies: beads are repeated so many times, m, as far as numbers go beside each other:
    modes φ/√m stay orthonormal, coefficients are √m c, and n_lr, n_c and K_f are those of one copy.
    device: default a GPU if there is one.
    """

    def __init__(self, components: Sequence[Component], copies: int = 1, device: str | None = None) -> None:
        self.device = compute_device(device)
        self.surrogates = [one.surrogate for one in components]
        self.n_modes = [one.modes.shape[1] for one in components]
        self.beads = copies * len(components[0].mean)
        self.scale = float(copies) ** 0.5
        self._rows = [_rows_of(one, copies, self.device) for one in components]

    @property
    def window(self) -> tuple[float, float]:
        """First and last time (s) that all components were fitted to."""
        first, last = zip(*(one.window_ for one in self.surrogates), strict=True)
        return max(first), min(last)

    @property
    def bytes_read(self) -> int:
        """Bytes of means and modes, all of which are read for every product."""
        return sum(rows.numel() * rows.element_size() for rows in self._rows)

    def empty(self, count: int) -> Tensor:
        """Return room for so many snapshots, (count, components, beads), m, on the device."""
        return torch.empty((count, len(self._rows), self.beads), dtype=torch.float32, device=self.device)

    def coefficients(self, times: ArrayLike) -> list[Tensor]:
        """Predict [1, √m c] (t, 1 + n) of every component at times (t,) s, in single precision on the device."""
        return [self._asked(surrogate, times) for surrogate in self.surrogates]

    def fill_(self, snapshots: Tensor, times: ArrayLike) -> None:
        """Predict the snapshots at times (t,) s into room for t of them, (t, components, beads)."""
        for k, (surrogate, rows) in enumerate(zip(self.surrogates, self._rows, strict=True)):
            torch.mm(self._asked(surrogate, times), rows, out=snapshots[:, k])

    def _asked(self, surrogate: Surrogate, times: ArrayLike) -> Tensor:
        predicted = surrogate.predict(times)
        with_one = np.empty((len(predicted), 1 + predicted.shape[1]), dtype=np.float32)
        with_one[:, 0] = 1.0
        with_one[:, 1:] = self.scale * predicted
        return torch.from_numpy(with_one).to(self.device)


def _rows_of(one: Component, copies: int, device: torch.device) -> Tensor:
    """Mean and modes over √copies as rows (1 + n, copies·beads), each contiguous, single precision."""
    beads, n = one.modes.shape
    rows = torch.empty((1 + n, copies, beads), dtype=torch.float32, device=device)
    rows[0] = torch.from_numpy(np.ascontiguousarray(one.mean, dtype=np.float32))
    for i in range(n):
        rows[1 + i] = torch.from_numpy((one.modes[:, i] / copies**0.5).astype(np.float32))
    return rows.view(1 + n, copies * beads)


def components_of(run: Run, interval: float, surrogate: str) -> list[Component]:
    """Decompose the components of the position at one Δτ (s), and fit a surrogate to n_c, no fewer than n_lr, modes.

    Raises Refusal where the run has no positions, nothing moves, or Δτ leaves nothing to predict, and
    surrogates.InputError where the surrogate cannot be fitted.
    """
    (subset,) = subsets_between(run, [interval])
    unseen: NDArray[np.intp] = np.setdiff1d(subset.testing, subset.training)
    found = []
    for name in (f"position.{axis}" for axis in AXES):
        values, rates = held(run, name), held_rates(run, name, [surrogate])
        case = Case(values, rates, run.times, subset.training, unseen)
        try:
            reduced = reduce(case, thresholds_of(name).energy)
        except UnfitSnapshots as error:
            raise Refusal(f"{name}: {error}") from None
        n_lr, n_c = reduced.basis.n_lr, consistent_level(reduced, case, CONSISTENCY)
        n = max(n_c, n_lr or reduced.basis.modes.shape[1])
        regressor = fitted(surrogate, case, reduced, n)
        found.append(Component(reduced.basis.mean, reduced.basis.modes[:, :n], regressor, n_lr, n_c))
    return found
