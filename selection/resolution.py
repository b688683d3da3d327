"""Does Δτ resolve the coefficients in time? The subspace may be right and the time axis too coarse."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from selection.consistency import Projection, squared_errors, unseen_times

Array = NDArray[np.float64]
KEPT_PROMISE = 1.10  # of R_lr: the paper's 1.05 of a mean over all times, of which half are unseen at two dense ones


class Interpolated(NamedTuple):
    """What a cubic spline in time through the leading coefficients misses at the unseen times."""

    left: Array  # (u, p + 1) squared norm of what the first n = 0 … p modes leave
    missed: Array  # (u, k + 1) squared norm of what the spline misses of the first n = 0 … k coefficients
    promised: Array  # (m, p + 1) what the first n modes leave at the training times


def interpolated(projection: Projection, k: int) -> Interpolated | None:
    """Put a cubic spline through the first k coefficients at the training times; None without an unseen time."""
    c, training = projection.coefficients, projection.training
    unseen = unseen_times(len(c), training)
    if unseen.size == 0:
        return None
    tail, missed = squared_errors(projection), np.zeros((len(unseen), k + 1))
    if k:
        # of lower degree through fewer than four
        spline = make_interp_spline(training, c[training, :k], min(3, len(training) - 1))
        np.square(c[unseen, :k] - spline(unseen)).cumsum(axis=1, out=missed[:, 1:])
    return Interpolated(tail[unseen], missed, tail[training])


def resolution_ratio(found: Interpolated | None, n: int) -> float | None:
    """R_a = E_total / E_proj over unseen times, the coefficients between training times taken from a cubic spline.

    E_total² = E_proj² + |c - c_spline|² on the first n modes, at every testing time that is not a training time; both
    errors are averaged over those times first, as in paper eq. (35). None where it is undefined: no mode (n = 0), no
    unseen time, or nothing left outside the modes. found: `interpolated` on n modes or more.
    """
    if found is None or n == 0:
        return None
    return _ratio(found.left[:, n] + found.missed[:, n], found.left[:, n])


def promise_ratio(found: Interpolated | None, n_lr: int) -> float | None:
    """R_lr = E_total(n_lr) / E_train(n_lr): whether a model on n_lr modes keeps at unseen times what n_lr promises.

    E_total as in `resolution_ratio`, E_train what n_lr modes leave at the training times. So it tries a reduced order
    model, a cubic spline in time on n_lr modes, without fitting one. None where it is undefined: no mode, no unseen
    time, or n_lr modes leave nothing at the training times. found: `interpolated` on n_lr modes or more.
    """
    if found is None or n_lr == 0:
        return None
    return _ratio(found.left[:, n_lr] + found.missed[:, n_lr], found.promised[:, n_lr])


def _ratio(above: Array, below: Array) -> float | None:
    """Ratio of mean errors from their squares."""
    mean = float(np.sqrt(below).mean())
    return float(np.sqrt(above).mean()) / mean if mean > 0 else None


def spline_errors(projection: Projection, rows: int) -> Array:
    """Error of a ROM with a cubic spline in time at the unseen times, for every number of modes n = 0 … p; (p + 1,).

    E_total(n) = mean over unseen times of √((‖r_n‖² + Σ_{i≤n} (c_i - c_i,spline)²) / rows), r_n what n modes leave, in
    the unit of W. So a ROM is tried on every n without a model; compare it with E_train(n_lr). rows: number of rows
    that the RMSE is taken over. NaN where there is no unseen time.
    """
    found = interpolated(projection, projection.coefficients.shape[1])
    if found is None:
        return np.full(projection.coefficients.shape[1] + 1, np.nan)
    return np.asarray(np.sqrt((found.left + found.missed) / rows).mean(axis=0))
