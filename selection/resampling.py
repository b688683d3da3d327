"""How far the feasibility index moves when some of the particles are left out."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from selection.consistency import consistency, project_from_gram
from selection.feasibility import Crossing, Thresholds, consistent_mode
from selection.gram import InnerProducts
from selection.intervals import Subset

Array = NDArray[np.float64]
CONFIDENCE = 0.95  # two-sided, of the spread alone
ACCURACY = 1e-2  # error of R_c above which inner products alone say nothing about its crossing


def smooth_index(eigenvalues: Array, crossing: Crossing, energy: float) -> float:
    """K_f with both mode numbers interpolated to real numbers, so that it answers to small changes of the data.

    A ratio of integers stays put or jumps when a few particles are left out; its spread says nothing. NaN where nothing
    moves.
    """
    total = eigenvalues.sum()
    if total <= 0:
        return math.nan
    ratio = np.append(0.0, np.cumsum(eigenvalues) / total)
    n = int(np.argmax(ratio >= min(energy, ratio[-1])))
    return crossing.position / float(n - 1 + (energy - ratio[n - 1]) / (ratio[n] - ratio[n - 1]))


def half_width_of_feasibility(products: InnerProducts, subset: Subset, limits: Thresholds) -> float | None:
    """Half the interval of K_f: Student's t at 95 % times its delete-one-group jackknife error.

    It tells how much these particles leave open, not how far K_f is from that of infinitely many: K_f falls with the
    number of particles, and with a hundred of them that bias can exceed the interval.

    s² = (k-1)/k Σ_g (θ_g - θ̄)², θ_g the interpolated K_f without the particles of group g. None without groups, and
    where R_c crosses its limit so near round-off that the inner products cannot tell.
    """
    if products.groups is None:
        return None
    last, k = len(subset.testing), len(products.groups)
    without = []
    for part in products.groups:
        gram = (products.gram - part)[:last, :last]
        motion = math.sqrt(np.trace(gram) / (last * products.rows))
        projection = project_from_gram(gram, subset.training)
        curves = consistency(projection, products.rows, motion, exact=False)
        crossing = consistent_mode(curves.R_c, limits.consistency)
        if not crossing.exceeded or curves.predicted_error[crossing.n_c] > ACCURACY:
            return None
        without.append(smooth_index(projection.eigenvalues, crossing, limits.energy))
    width = float(np.std(without) * math.sqrt(k - 1) * stdtrit(k - 1, 0.5 + CONFIDENCE / 2))
    return width if math.isfinite(width) else None
