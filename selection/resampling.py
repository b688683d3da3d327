"""How far the feasibility index moves when some of the particles are left out."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from selection.consistency import consistency, modes_known
from selection.feasibility import Crossing, Thresholds, consistent_mode
from selection.intervals import Subset
from selection.routes import Routes, project_without
from selection.threads import shared

Array = NDArray[np.float64]
CONFIDENCE = 0.95  # two-sided, of the spread alone
WORTH_THREADS = 200  # training snapshots; below it threads wait for the interpreter longer than they compute
ACCURACY = 1e-4  # error of R_c above which its crossing, as a real number, is no longer known from inner products
MORE = 1.25  # times the modes up to the crossing: how many are looked at first without a group


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


def half_width_of_feasibility(known: Routes, subset: Subset, limits: Thresholds, n_c: int) -> float | None:
    """Half the interval of K_f: Student's t at 95 % times its delete-one-group jackknife error.

    It tells how much these particles leave open, not how far K_f is from that of infinitely many: K_f falls with the
    number of particles, and with a hundred of them that bias can exceed the interval.

    s² = (k-1)/k Σ_g (θ_g - θ̄)², θ_g the interpolated K_f without the particles of group g. None without groups, and
    where R_c crosses its limit so near round-off that the inner products cannot tell. n_c: of all particles.
    """
    if known.products.groups is None:
        return None
    k, leading = len(known.products.groups), math.ceil(MORE * n_c) + 10
    each = shared if len(subset.training) >= WORTH_THREADS else map
    first = _index_without(known, 0, subset, limits, leading)
    if first is None:
        return None
    others = each(lambda g: _index_without(known, g, subset, limits, leading), range(1, k))
    without = [first, *(index for index in others if index is not None)]
    if len(without) < k:
        return None
    width = float(np.std(without) * math.sqrt(k - 1) * stdtrit(k - 1, 0.5 + CONFIDENCE / 2))
    return width if math.isfinite(width) else None


def _index_without(known: Routes, g: int, subset: Subset, limits: Thresholds, leading: int | None) -> float | None:
    """θ_g, from the leading modes alone if R_c crosses its limit among them."""
    projection = project_without(known, g, subset, leading)
    last, rows = len(subset.testing), known.products.rows
    motion = math.sqrt(known.squares_without(g)[:last].mean() / rows)
    curves = consistency(projection, rows, motion, exact=False)
    crossing = consistent_mode(curves.R_c, limits.consistency)
    if not crossing.exceeded:
        return None if leading is None else _index_without(known, g, subset, limits, None)
    beyond = crossing.n_c + 1
    if curves.predicted_error[beyond] > ACCURACY or beyond > modes_known(projection):
        return None
    return smooth_index(projection.eigenvalues, crossing, limits.energy)
