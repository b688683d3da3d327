"""Does Δτ resolve the coefficients in time? The subspace may be right and the time axis too coarse."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from selection.consistency import Projection

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
