"""Does Δτ resolve the coefficients in time? The subspace may be right and the time axis too coarse."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from selection.consistency import Projection, squared_errors

Array = NDArray[np.float64]


def resolution_ratio(projection: Projection, n: int) -> float | None:
    """R_a = E_total / E_proj over unseen times, the coefficients between training times taken from a cubic spline.

    E_total² = E_proj² + |c - c_spline|² on the first n modes, at every testing time that is not a training time; both
    errors are averaged over those times first, as in paper eq. (35). None where it is undefined: no mode (n = 0), no
    unseen time, or nothing left outside the modes.
    """
    testing, training = len(projection.outside), projection.training
    unseen = np.setdiff1d(np.arange(testing), training)
    if n == 0 or unseen.size == 0:
        return None
    c = projection.coefficients
    spline = CubicSpline(training, c[training, :n])(unseen)
    left = projection.outside[unseen] + np.square(c[unseen, n:]).sum(axis=1)
    total = left + np.square(c[unseen, :n] - spline).sum(axis=1)
    mean_left = float(np.sqrt(left).mean())
    return float(np.sqrt(total).mean()) / mean_left if mean_left > 0 else None


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
