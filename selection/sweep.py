"""One pass over the snapshots decides every snapshot interval Δτ."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.consistency import Consistency, Projection, consistency, project_from_factor, project_from_gram
from selection.errors import InputError
from selection.feasibility import (
    Evidence,
    Thresholds,
    consistent_mode,
    feasibility_index,
    least_reconstructable_mode,
    verdict,
)
from selection.gram import InnerProducts, as_snapshots, inner_products, square_root
from selection.intervals import Subset, candidates, dense_interval
from selection.resampling import half_width_of_feasibility
from selection.resolution import resolution_ratio

Array = NDArray[np.float64]
ACCURACY = 1e-6  # error of R_c above which inner products are not good enough
DECIDED = 2.0  # times its limit: beyond it R_c runs to infinity at full rank, and its digits decide nothing


class Candidate(NamedTuple):
    """One snapshot interval Δτ and all that is known about it."""

    interval: float  # s
    n_snapshots: int
    n_lr: int  # least reconstructable mode, exact total energy
    n_lr_paper: int  # the same with the paper's denominator, the leading 80 % of the eigenvalues
    n_c: int  # consistent mode
    K_f: float | None  # n_c / n_lr; None where it is undefined
    K_f_interval: tuple[float, float] | None  # from leaving out groups of particles
    n_c_gap: int | None  # consistent mode by the gaps alone; None where there are none
    K_f_gap: float | None
    R_a: float | None  # resolution ratio at n = n_c
    sufficient: bool  # the paper's rule alone
    verdict: str  # sufficient, insufficient or undecidable: ours
    reasons: list[str]
    eigenvalues: Array  # (p,) of A, descending, unit of W squared, summed over rows
    curves: Consistency  # against n = 0, 1, …

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


class Sweep(NamedTuple):
    """Every candidate, coarse to fine, and the Δτ chosen by the paper's rule."""

    dense_interval: float  # s
    chosen_interval: float | None  # s, the largest sufficient Δτ
    thresholds: Thresholds
    candidates: list[Candidate]

    def as_dict(self) -> dict[str, Any]:
        """Plain Python types, ready for JSON: chosen_interval, thresholds, candidates."""
        return {
            "chosen_interval": self.chosen_interval,
            "thresholds": self.thresholds._asdict(),
            "candidates": [c.as_dict() for c in self.candidates],
        }


def sweep(
    W: Any,
    times: ArrayLike,
    intervals: Sequence[float] | None = None,
    thresholds: Thresholds | None = None,
    groups: int | None = 10,
) -> Sweep:
    """Judge every candidate Δτ from one pass over the dense snapshots (paper 2.3; the Gram matrix decides them all).

    Every training set is a subset of the dense set, so its mean, modes, projections and errors follow from
    G = (W - w₀)ᵀ(W - w₀) by N_t-sized algebra. A second pass, for the square root of G to full precision, is made only
    where the predicted error ε(‖W‖/E_train)² of R_c exceeds 1e-6 before R_c is twice its limit.

    W: array (rows, N_t), or any object with `shape`, `gram()` and `row_blocks()`. times: (N_t,) s, uniform.
    intervals: Δτ in s, default ten down to two dense intervals. groups: the interval of K_f is a delete-one-group
    jackknife over that many groups of particles (needs `gram_groups`, and two particles per group); None leaves it out.
    Raises InputError for times that are not uniform, fewer than two snapshots, a Δτ that is not a multiple of the
    dense interval, or values that are not finite.
    """
    limits = thresholds or Thresholds()
    subsets = candidates(times, intervals)
    snapshots = as_snapshots(W)
    n_times = np.size(np.asarray(times))
    if snapshots.shape[1] != n_times:
        raise InputError(f"times: {n_times} of them for {snapshots.shape[1]} snapshots; give one per snapshot")
    if groups is not None and groups < 2:
        raise InputError(f"groups: {groups}; leaving one out needs at least 2, or None for no interval")
    products = inner_products(snapshots, groups)
    scarce = products.groups is None and groups is not None and hasattr(snapshots, "gram_groups")
    factors = _once(lambda: square_root(snapshots, products.gram))
    table = [_judge(subset, products, factors, limits, resampled=not scarce) for subset in subsets]
    chosen = next((c.interval for c in table if c.sufficient), None)
    return Sweep(dense_interval(times), chosen, limits, table)


def _once(compute: Callable[[], Array]) -> Callable[[], Array]:
    """Keep the value computed at the first call for every later one."""
    value: list[Array] = []

    def known() -> Array:
        if not value:
            value.append(compute())
        return value[0]

    return known


def _judge(
    subset: Subset, products: InnerProducts, factor: Callable[[], Array], limits: Thresholds, *, resampled: bool
) -> Candidate:
    """All there is to say about one Δτ."""
    projection, curves = _project(subset, products, factor, DECIDED * limits.consistency)
    m = len(subset.training)
    n_lr = least_reconstructable_mode(projection.eigenvalues, limits.energy)
    n_lr_paper = least_reconstructable_mode(projection.eigenvalues, limits.energy, math.ceil(0.8 * m))
    crossing = consistent_mode(curves.R_c, limits.consistency)
    unseen = len(subset.testing) - m
    # without unseen snapshots R_c is 1 by construction and its crossing, hence K_f, is void
    K_f = feasibility_index(crossing.n_c, n_lr) if unseen else None
    n_c_gap = consistent_mode(curves.R_gap, limits.consistency).n_c if unseen else None
    spread = half_width_of_feasibility(products, subset, limits) if crossing.exceeded else None
    K_f_interval = None if spread is None or K_f is None else (max(K_f - spread, 0.0), K_f + spread)
    R_a = resolution_ratio(projection, crossing.n_c)
    evidence = Evidence(m, unseen, n_lr, crossing, K_f, K_f_interval, R_a, resampled)
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
        projection.eigenvalues,
        curves,
    )


def _project(
    subset: Subset, products: InnerProducts, factor: Callable[[], Array], decided: float
) -> tuple[Projection, Consistency]:
    """Projection and errors from inner products, or from the square root where those are not good enough."""
    last = len(subset.testing)
    motion = math.sqrt(np.trace(products.gram) / (len(products.gram) * products.rows))
    projection = project_from_gram(products.gram[:last, :last], subset.training)
    curves = consistency(projection, products.rows, motion, exact=False)
    if ((curves.predicted_error > ACCURACY) & (curves.R_c <= decided)).any():
        projection = project_from_factor(factor()[:, :last], subset.training)
        curves = consistency(projection, products.rows, motion, exact=True)
    return projection, curves
