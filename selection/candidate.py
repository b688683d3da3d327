"""One snapshot interval Δτ and all that inner products tell about it."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from selection.consistency import (
    Consistency,
    Projection,
    consistency,
    modes_known,
    project_from_factor,
    unseen_error,
)
from selection.feasibility import (
    FEWEST_SNAPSHOTS,
    Evidence,
    Thresholds,
    consistent_mode,
    feasibility_index,
    least_reconstructable_mode,
    verdict,
)
from selection.intervals import Subset
from selection.resampling import half_width_of_feasibility
from selection.resolution import interpolated, promise_ratio, resolution_ratio
from selection.routes import Routes, project
from selection.shown import table_of
from selection.table import Table

Array = NDArray[np.float64]
ACCURACY = 1e-6  # error of R_c above which inner products are not good enough
DECIDED = 2.0  # times its limit: beyond it R_c runs to infinity at full rank, and its digits decide nothing
MARGIN = 5.0  # times the predicted error of R_c: the most that was met beside direct projections is 3


class Candidate(NamedTuple):
    """One snapshot interval Δτ and all that is known about it."""

    interval: float  # s
    n_snapshots: int
    n_lr: int  # least reconstructable mode, exact total energy
    n_lr_paper: int  # the same with the paper's denominator, the leading 80 % of the eigenvalues
    n_c: int  # consistent mode
    K_f: float | None  # n_c / n_lr; None where it is undefined
    K_f_interval: tuple[float, float] | None  # from leaving out groups of particles; None under ten snapshots
    n_c_gap: int | None  # consistent mode by the gaps alone; None where there are none
    K_f_gap: float | None
    R_a: float | None  # resolution ratio at n = n_c
    sufficient: bool  # the paper's rule alone
    verdict: str  # sufficient, insufficient or undecidable: ours
    reasons: list[str]
    error_n_lr: float | None  # RMSE of n_lr modes at unseen times, unit of W; None where there are none
    error_n_c: float | None  # the same of n_c modes
    K_f_groups: int | None  # groups of particles behind K_f_interval
    R_lr: float | None  # error at unseen times of a spline on n_lr modes over their error at training times
    eigenvalues: Array  # (p,) of A, descending, unit of W squared, summed over rows
    curves: Consistency  # against n = 0, 1, …

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> Table:
        return table_of(f"{self.verdict}: {'; '.join(self.reasons)}", [self])

    def as_dict(self) -> dict[str, Any]:
        """Numbers and verdict in plain Python types; the curves are left to `curves_as_dict`."""
        numbers = self._asdict()
        del numbers["eigenvalues"], numbers["curves"]
        numbers["K_f_interval"] = None if self.K_f_interval is None else list(self.K_f_interval)
        return numbers

    def curves_as_dict(self) -> dict[str, list[float | None]]:
        """Curves against n = 0, 1, … in plain Python types, for plots; `energy_ratio` is I(n), None is not a number."""
        total = self.eigenvalues.sum()
        ratio = np.append(0.0, np.cumsum(self.eigenvalues) / total) if total > 0 else np.zeros(0)
        curves = {**self.curves._asdict(), "eigenvalues": self.eigenvalues, "energy_ratio": ratio}
        return {name: [float(x) if math.isfinite(x) else None for x in values] for name, values in curves.items()}


def judged(
    subset: Subset, known: Routes, factor: Callable[[], Array] | None, limits: Thresholds, *, scarce: bool
) -> Candidate:
    """All there is to say about one Δτ; factor and scarce as in `sweep.judge`."""
    projection, curves, blurred = _project(subset, known, factor, limits.consistency)
    m = len(subset.training)
    n_lr = least_reconstructable_mode(projection.eigenvalues, limits.energy)
    n_lr_paper = least_reconstructable_mode(projection.eigenvalues, limits.energy, math.ceil(0.8 * m))
    crossing = consistent_mode(curves.R_c, limits.consistency)
    unseen = len(subset.testing) - m
    # without unseen snapshots R_c is 1 by construction and its crossing, hence K_f, is void
    K_f = feasibility_index(crossing.n_c, n_lr) if unseen else None
    n_c_gap = consistent_mode(curves.R_gap, limits.consistency).n_c if unseen else None
    # an index of a handful of snapshots is not trusted, whatever its particles leave open
    resampled = crossing.exceeded and m >= FEWEST_SNAPSHOTS
    spread = half_width_of_feasibility(known, subset, limits, crossing.n_c) if resampled else None
    K_f_interval = None if spread is None or K_f is None else (max(K_f - spread, 0.0), K_f + spread)
    spline = interpolated(projection, max(crossing.n_c, n_lr))
    R_a = resolution_ratio(spline, crossing.n_c)
    evidence = Evidence(m, unseen, n_lr, crossing, K_f, K_f_interval, R_a, not scarce, blurred)
    return Candidate(
        subset.interval,
        m,
        n_lr,
        n_lr_paper,
        crossing.n_c,
        K_f,
        K_f_interval,
        n_c_gap,
        None if n_c_gap is None else feasibility_index(n_c_gap, n_lr),
        R_a,
        K_f is not None and limits.feasibility <= K_f,
        *verdict(evidence, limits),
        unseen_error(projection, known.products.rows, n_lr),
        unseen_error(projection, known.products.rows, crossing.n_c),
        None if K_f_interval is None or known.products.groups is None else len(known.products.groups),
        promise_ratio(spline, n_lr),
        projection.eigenvalues,
        curves,
    )


def suffices(subset: Subset, known: Routes, factor: Callable[[], Array] | None, limits: Thresholds) -> bool:
    """Tell whether `judged` would call one Δτ sufficient if there were no groups; no more is looked at than that takes.

    The spline of R_a takes longer than the projection, and most Δτ fall short in K_f before.
    """
    projection, curves, blurred = _project(subset, known, factor, limits.consistency)
    m = len(subset.training)
    n_lr = least_reconstructable_mode(projection.eigenvalues, limits.energy)
    crossing = consistent_mode(curves.R_c, limits.consistency)
    unseen = len(subset.testing) - m
    K_f = feasibility_index(crossing.n_c, n_lr) if unseen else None
    if K_f is None or K_f < limits.feasibility:
        return False
    R_a = resolution_ratio(interpolated(projection, crossing.n_c), crossing.n_c)
    evidence = Evidence(m, unseen, n_lr, crossing, K_f, None, R_a, resampled=True, blurred=blurred)
    return verdict(evidence, limits).verdict == "sufficient"


class _Found(NamedTuple):
    """Projection of one Δτ, its errors, and whether rounding in R_c may move n_c."""

    projection: Projection
    curves: Consistency
    blurred: bool


def _project(subset: Subset, known: Routes, factor: Callable[[], Array] | None, limit: float) -> _Found:
    """Project by inner products, or by the square root where those are not good enough up to twice the limit of R_c."""
    gram, rows = known.products.gram, known.products.rows
    motion = math.sqrt(np.trace(gram) / (len(gram) * rows))
    projection = project(known, subset)
    curves = consistency(projection, rows, motion, exact=False)
    if not ((curves.predicted_error > ACCURACY) & (curves.R_c <= DECIDED * limit)).any():
        return _Found(projection, curves, False)
    if factor is None:
        return _Found(projection, curves, _blurred(projection, curves, limit))
    projection = project_from_factor(factor()[:, : len(subset.testing)], subset.training)
    return _Found(projection, consistency(projection, rows, motion, exact=True), False)


def _blurred(projection: Projection, curves: Consistency, limit: float) -> bool:
    """Tell whether the rounding in R_c, or a mode whose direction is not known, may move n_c."""
    error = MARGIN * curves.predicted_error * curves.R_c
    least, most = (consistent_mode(curves.R_c + sign * error, limit).n_c for sign in (-1.0, 1.0))
    return bool(least != most or most + 1 > modes_known(projection))
