"""Radial interpolation of a long series, window by window."""

from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from surrogates.kernel import Kernel
from surrogates.leave_one_out import leave_one_out

STRETCH = 16  # intervals that one window answers for
MARGIN = 8  # snapshots it also sees on either side: what lies farther weighs below 0.27⁸ = 3e-5 (cubic kernel)


class Window(NamedTuple):
    """Part of the series: it answers for snapshots first to last, and is fitted to the snapshots `seen`."""

    first: int
    last: int
    seen: slice


def windows(snapshots: int) -> list[Window]:
    """Windows over `snapshots` - 1 intervals, equally long to one interval; neighbours share a snapshot."""
    intervals = snapshots - 1
    edges = np.linspace(0, intervals, -(-intervals // STRETCH) + 1).astype(int).tolist()
    return [Window(first, last, slice(max(0, first - MARGIN), last + MARGIN + 1)) for first, last in pairwise(edges)]


class WindowedRbf(NamedTuple):
    """c(t) = Σ_i w_i φ(ε|t - t_i|) + polynomial in each window, times in units of Δτ.

    Neighbouring windows meet at a snapshot, where both are exact, so c(t) is continuous. Cost grows with the number of
    snapshots and not with its cube, and the condition number stays that of one window.
    """

    begins: NDArray[np.float64]  # (windows,) first time each answers for
    curves: list[RBFInterpolator]

    @classmethod
    def through(cls, times: NDArray[np.float64], values: NDArray[np.float64], kernel: Kernel) -> Self:
        """Interpolant of `values` (snapshots, modes) at `times` (snapshots,). Raises LinAlgError if singular."""
        parts = windows(len(times))
        name, shape, degree = kernel
        curves = [
            RBFInterpolator(times[w.seen, None], values[w.seen], kernel=name, epsilon=shape, degree=degree)
            for w in parts
        ]
        return cls(times[[w.first for w in parts]], curves)

    def __call__(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (times, modes) at `times`; before the first and after the last snapshot the end windows continue."""
        if not len(times):
            return self.curves[0](times[:, None])
        owner = np.maximum(np.searchsorted(self.begins, times, side="right") - 1, 0)
        order = np.argsort(owner, kind="stable")
        parts = np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)
        curves = [self.curves[owner[part[0]]](times[part, None]) for part in parts]
        predicted = np.empty((len(times), curves[0].shape[1]))
        predicted[order] = np.concatenate(curves)
        return predicted


def interior_error(kernel: Kernel, times: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Root mean square over all snapshots but the two ends of the leave-one-out error's norm over the modes.

    The ends are left out because there it measures extrapolation. Zero if there are only two snapshots.
    """
    count = len(times) - 2
    total = 0.0
    for first, last, seen in windows(len(times)):
        errors = leave_one_out(kernel, times[seen], values[seen])
        total += float((errors[max(first, 1) - seen.start : min(last, count + 1) - seen.start] ** 2).sum())
    return float(np.sqrt(total / max(count, 1)))
