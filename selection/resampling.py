"""How far the feasibility index moves when some of the particles are left out."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from selection.consistency import modes_known, predicted_error, projection_errors
from selection.feasibility import Crossing, Thresholds, consistent_mode
from selection.intervals import Subset
from selection.routes import Routes, project_without
from selection.threads import shared

Array = NDArray[np.float64]
CONFIDENCE = 0.95  # two-sided, of the spread alone
WORTH_THREADS = 200  # training snapshots; below it threads wait for the interpreter longer than they compute
ACCURACY = 1e-4  # error of R_c above which its crossing, as a real number, is no longer known from inner products
STACK = 2**16  # inner products that are worked on at once: small matrices cost calls, large ones cache
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
    m, k, leading = len(subset.training), len(known.products.groups), math.ceil(MORE * n_c) + 10
    step = max(STACK // (m * len(subset.testing)), 1)
    first, *others = (slice(g, min(g + step, k)) for g in range(0, k, step))
    without = _indices_without(known, first, subset, limits, leading)
    if others and np.isfinite(without).all():
        each = shared if m >= WORTH_THREADS else map
        rest = each(lambda some: _indices_without(known, some, subset, limits, leading), others)
        without = np.concatenate([without, *rest])
    width = float(np.std(without) * math.sqrt(k - 1) * stdtrit(k - 1, 0.5 + CONFIDENCE / 2))
    return width if math.isfinite(width) else None


def _indices_without(known: Routes, groups: slice, subset: Subset, limits: Thresholds, leading: int | None) -> Array:
    """θ_g of some groups, from the leading modes alone if R_c crosses its limit among them; NaN where none is known."""
    projection = project_without(known, groups, subset, leading)
    last, rows = len(subset.testing), known.products.rows
    error, train, counts = projection_errors(projection, rows)
    test, certain = error.mean(axis=-2), modes_known(projection)
    motion = np.sqrt(known.squares_without(groups)[:, :last].mean(axis=-1) / rows)
    found = np.full(len(counts), np.nan)
    for g, count in enumerate(counts):
        crossing = consistent_mode(test[g, :count] / train[g, :count], limits.consistency)
        beyond = crossing.n_c + 1
        if not crossing.exceeded:
            if leading is not None:
                alone = slice(groups.start + g, groups.start + g + 1)
                found[g] = _indices_without(known, alone, subset, limits, None)[0]
        elif beyond <= certain[g] and predicted_error(train[g, beyond], motion[g], exact=False) <= ACCURACY:
            found[g] = smooth_index(projection.eigenvalues[g], crossing, limits.energy)
    return found
