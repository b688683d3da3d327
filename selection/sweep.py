"""One pass over the snapshots decides every snapshot interval Δτ."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.candidate import Candidate, judged, suffices
from selection.errors import InputError
from selection.feasibility import Thresholds, checked
from selection.gram import InnerProducts, as_snapshots, inner_products, square_root
from selection.intervals import candidates, dense_interval
from selection.routes import Routes, routes
from selection.shown import chosen_text, table_of
from selection.table import Table
from selection.threads import once, shared

MANY = 500  # snapshots, above which the intervals share the cores
WORTH_FACTOR = 3  # a Δτ of up to so many dense intervals

Array = NDArray[np.float64]


class Sweep(NamedTuple):
    """Every candidate, coarse to fine, and the Δτ chosen by the paper's rule."""

    dense_interval: float  # s
    chosen_interval: float | None  # s, the largest sufficient Δτ
    thresholds: Thresholds
    candidates: list[Candidate]

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> Table:
        return table_of(self.sentence(), self.candidates)

    def at(self, interval: float) -> Candidate:
        """Return the candidate of a Δτ in s. Raises InputError for one that was not judged."""
        found = next((c for c in self.candidates if math.isclose(c.interval, interval, rel_tol=1e-6)), None)
        if found is None:
            known = ", ".join(f"{c.interval:g}" for c in self.candidates)
            raise InputError(f"interval: {interval:g} s was not judged; there are {known} s")
        return found

    def sentence(self) -> str:
        """Which Δτ the paper's rule chooses, and what our verdict adds to it."""
        return chosen_text(self.candidates, self.chosen_interval, self.thresholds.feasibility)

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

    >>> times, k = 1e-3 * np.arange(201), np.arange(1, 25)[:, None]  # s
    >>> shapes = np.random.default_rng(0).normal(size=(50, 24))
    >>> W = shapes @ (0.5**k * np.sin(80.0 * k * times + k**2))  # 24 motions, each faster and smaller than the last
    >>> table = sweep(W, times, intervals=[0.010, 0.005, 0.002])
    >>> [(c.interval, c.n_lr, c.n_c) for c in table.candidates]
    [(0.01, 5, 2), (0.005, 6, 7), (0.002, 6, 19)]
    >>> table.chosen_interval, table.at(0.005).verdict
    (0.002, 'insufficient')
    """
    snapshots = as_snapshots(W)
    n_times = np.size(np.asarray(times))
    candidates(times, intervals)  # what is wrong with them is said before the rows are read
    if snapshots.shape[1] != n_times:
        raise InputError(f"times: {n_times} of them for {snapshots.shape[1]} snapshots; give one per snapshot")
    if groups is not None and groups < 2:
        raise InputError(f"groups: {groups}; leaving one out needs at least 2, or None for no interval")
    products = inner_products(snapshots, groups)
    scarce = products.groups is None and groups is not None and hasattr(snapshots, "gram_groups")
    return judge(products, times, intervals, thresholds, lambda: square_root(snapshots, products.gram), scarce=scarce)


def is_sufficient(W: Any, times: ArrayLike, interval: float, thresholds: Thresholds | None = None) -> bool:
    """Tell whether `sweep` without groups would call a Δτ (s) sufficient by our verdict, in less time.

    Other arguments and errors as there.
    """
    snapshots = as_snapshots(W)
    (subset,) = candidates(times, [interval])
    products = inner_products(snapshots, None)
    _check(products, np.size(np.asarray(times)))
    factor = partial(square_root, snapshots, products.gram)
    # a factor of all snapshots, if they have one, pays for a single Δτ only where that keeps many of them
    many = WORTH_FACTOR * len(subset.training) >= len(products.gram)
    known = routes(products) if many else Routes(products, None, None)
    return suffices(subset, known, factor, checked(thresholds))


def judge(
    products: InnerProducts,
    times: ArrayLike,
    intervals: Sequence[float] | None = None,
    thresholds: Thresholds | None = None,
    factor: Callable[[], Array] | None = None,
    *,
    scarce: bool = False,
) -> Sweep:
    """Judge every candidate Δτ from inner products that are known already, whoever made them; see `InnerProducts`.

    times: (N_t,) s, uniform. intervals: Δτ in s, default ten down to two dense intervals. factor: gives F, (any,
    N_t), with FᵀF = gram to ε‖W‖ (`square_root`); it is asked once at most, where rounding in the inner products
    would err in R_c by more than 1e-6 before that is twice its limit. Without it they must do, and where rounding may
    then move n_c the verdict is undecidable. scarce: groups are missing because there are too few particles.
    Raises InputError for times and intervals as `sweep` does, and for products that are not finite or do not fit.
    """
    limits = checked(thresholds)
    subsets = candidates(times, intervals)
    _check(products, np.size(np.asarray(times)))
    asked = None if factor is None else once(factor)
    known = routes(products)
    # the groups of the jackknife share the cores themselves
    each = shared if products.groups is None and len(products.gram) >= MANY else map
    table = list(each(lambda subset: judged(subset, known, asked, limits, scarce=scarce), subsets))
    chosen = next((c.interval for c in table if c.sufficient), None)
    return Sweep(dense_interval(times), chosen, limits, table)


def _check(products: InnerProducts, n_times: int) -> None:
    """Refuse products that are not those of so many snapshots."""
    gram, groups = products.gram, products.groups
    if gram.shape != (n_times, n_times) or (groups is not None and groups.shape[1:] != gram.shape):
        raise InputError(
            f"products: gram {gram.shape}, groups {None if groups is None else groups.shape} for {n_times} times; "
            "give inner products of every two snapshots, and as many times"
        )
    if not np.isfinite(gram).all():
        column = int(np.argwhere(~np.isfinite(gram))[0, 0])
        raise InputError(f"W: snapshot {column} holds a value that is not finite; repair or drop it")
    if products.rows < 1 or (groups is not None and len(groups) < 2):
        raise InputError(
            f"products: {products.rows} rows, {0 if groups is None else len(groups)} groups; give at least 1 row, and "
            "2 groups or None"
        )
