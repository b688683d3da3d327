"""Does Δτ resolve the coefficients in time? The subspace may be right and the time axis too coarse."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from selection.consistency import Projection, squared_errors

Array = NDArray[np.float64]
KEPT_PROMISE = 1.10  # of R_lr: the paper's 1.05 of a mean over all times, of which half are unseen at two dense ones


def resolution_ratio(projection: Projection, n: int) -> float | None:
    """R_a = E_total / E_proj over unseen times, the coefficients between training times taken from a cubic spline.

    E_total² = E_proj² + |c - c_spline|² on the first n modes, at every testing time that is not a training time; both
    errors are averaged over those times first, as in paper eq. (35). None where it is undefined: no mode (n = 0), no
    unseen time, or nothing left outside the modes.
    """
    if n == 0 or not len(_unseen(projection)):
        return None
    left, total = _left_and_total(projection, n)
    mean_left = float(np.sqrt(left).mean())
    return float(np.sqrt(total).mean()) / mean_left if mean_left > 0 else None


def promise_ratio(projection: Projection, n_lr: int) -> float | None:
    """R_lr = E_total(n_lr) / E_train(n_lr): whether a model on n_lr modes keeps at unseen times what n_lr promises.

    E_total as in `resolution_ratio`, E_train what n_lr modes leave at the training times. So it tries a reduced order
    model, a cubic spline in time on n_lr modes, without fitting one. None where it is undefined: no mode, no unseen
    time, or n_lr modes leave nothing at the training times.
    """
    if n_lr == 0 or not len(_unseen(projection)):
        return None
    promised = np.square(projection.coefficients[projection.training, n_lr:]).sum(axis=1)
    mean = float(np.sqrt(promised).mean())
    return float(np.sqrt(_left_and_total(projection, n_lr)[1]).mean()) / mean if mean > 0 else None


def _unseen(projection: Projection) -> NDArray[np.intp]:
    return np.setdiff1d(np.arange(len(projection.outside)), projection.training)


def _left_and_total(projection: Projection, n: int) -> tuple[Array, Array]:
    """Squared errors at the unseen times of the first n modes, and of a spline of their coefficients, (u,) each."""
    c, unseen = projection.coefficients, _unseen(projection)
    spline = CubicSpline(projection.training, c[projection.training, :n])(unseen)
    left = projection.outside[unseen] + np.square(c[unseen, n:]).sum(axis=1)
    return left, left + np.square(c[unseen, :n] - spline).sum(axis=1)


def spline_errors(projection: Projection, rows: int) -> Array:
    """Error of a ROM with a cubic spline in time at the unseen times, for every number of modes n = 0 … p; (p + 1,).

    E_total(n) = mean over unseen times of √((‖r_n‖² + Σ_{i≤n} (c_i - c_i,spline)²) / rows), r_n what n modes leave, in
    the unit of W. So a ROM is tried on every n without a model; compare it with E_train(n_lr). rows: number of rows
    that the RMSE is taken over. NaN where there is no unseen time.
    """
    testing, training = len(projection.outside), projection.training
    unseen, c = np.setdiff1d(np.arange(testing), training), projection.coefficients
    if unseen.size == 0:
        return np.full(c.shape[1] + 1, np.nan)
    missed = np.square(c[unseen] - CubicSpline(training, c[training])(unseen)).cumsum(axis=1)
    missed = np.column_stack([np.zeros(unseen.size), missed])
    return np.asarray(np.sqrt((squared_errors(projection)[unseen] + missed) / rows).mean(axis=0))
