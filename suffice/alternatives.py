"""What each Δτ and number of modes would cost a variable, and how wrong it would be."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import InputError as UnfitSnapshots
from selection.intervals import Subset
from suffice.compare import CONSISTENCY
from suffice.condensed import Array, Condensed
from suffice.derived import velocity_squares
from suffice.making import is_trained, made
from suffice.reconstruction import Case, Reduced, consistent_level, reduce
from suffice.refusal import Refusal
from surrogates import SURROGATES, Surrogate

LEVELS = 12  # numbers of modes tried, where each takes a fit of its own


class Alternatives(NamedTuple):
    """All that one variable can be given, as columns (k,), coarse Δτ first and few modes first."""

    variable: str
    unit: str
    rows: int
    surrogate: str
    interval: Array  # s, Δτ
    modes: NDArray[np.intp]  # n
    rmse: Array  # over the rows, mean over the unseen times, unit of the variable
    velocity_rmse: Array | None  # m/s, of the derivative of a position in place of its velocity
    model_bytes: Array  # mean, modes and coefficients
    snapshot_bytes: Array  # of the training snapshots, velocities included where they are learnt from
    by_rule: NDArray[np.bool_]  # n is n_c, no fewer than n_lr

    def at(self, interval: float) -> "Alternatives":
        """Those of one Δτ (s) alone."""
        which = self.interval == interval
        columns = {name: column[which] for name, column in self._asdict().items() if isinstance(column, np.ndarray)}
        return self._replace(**columns)


def check_judged(surrogate: str) -> None:
    """Refuse surrogates whose error is not known before a training, or not between the snapshots."""
    known = [name for name, one in SURROGATES.items() if not one.raw and one.bridges and one.kind == "time"]
    known = [name for name in known if not is_trained(name)]
    if surrogate not in known:
        raise Refusal(
            f"--surrogate {surrogate}: its error at every Δτ and number of modes is not known without training it; "
            f"use {', '.join(known)}, or give one --interval"
        )


def alternatives(
    data: Condensed, times: Array, subsets: Sequence[Subset], surrogate: str, energy: float
) -> Alternatives:
    """Judge every Δτ and every number of modes by the snapshots between those trained on.

    A surrogate that fits each column by itself is fitted once for each Δτ; one that does not, for `LEVELS` numbers of
    modes. energy: that n_lr modes hold. Raises Refusal where nothing moves.
    """
    found = [_at(data, times, subset, surrogate, energy) for subset in subsets]
    columns = [np.concatenate(parts) for parts in zip(*found, strict=True)]
    interval, modes, rmse, velocity_rmse, model_bytes, snapshot_bytes, by_rule = columns
    return Alternatives(
        data.variable, data.unit, data.rows, surrogate, interval, modes.astype(np.intp), rmse,
        None if np.isnan(velocity_rmse).any() else velocity_rmse, model_bytes, snapshot_bytes, by_rule.astype(bool),
    )  # fmt: skip


def case_of(data: Condensed, times: Array, subset: Subset) -> Case:
    """Return the condensed snapshots as what is kept and what is left to predict at one Δτ."""
    return Case(data.values, data.rates, times, subset.training, np.setdiff1d(subset.testing, subset.training))


def reduced_case(data: Condensed, case: Case, energy: float) -> Reduced:
    """Decompose the training snapshots. Raises Refusal naming the variable where nothing moves."""
    try:
        return reduce(case, energy)
    except UnfitSnapshots as error:
        raise Refusal(f"{data.variable}: {error}") from None


def _at(data: Condensed, times: Array, subset: Subset, name: str, energy: float) -> tuple[NDArray[Any], ...]:
    """Columns at one Δτ."""
    case = case_of(data, times, subset)
    reduced = reduced_case(data, case, energy)
    full = reduced.basis.modes.shape[1]
    by_rule = max(consistent_level(reduced, case, CONSISTENCY), reduced.basis.n_lr or full)
    if SURROGATES[name].columnwise:
        modes, squares, sizes = _every_number(name, case, reduced)
    else:
        some = np.unique(np.round(np.geomspace(1, full, LEVELS)).astype(int))
        modes, squares, sizes = _some_numbers(name, case, reduced, np.union1d(some, [by_rule]))
    velocity = np.full(len(modes), np.nan)
    if SURROGATES[name].differentiable and data.rates is not None:
        which, surrogate = case.unseen, fitted(name, case, reduced, full)
        velocity = _rms(velocity_squares(surrogate, reduced.basis, data.rates, times[which], which), data.rows)
    learns_rates = data.rates is not None and (SURROGATES[name].needs_rates or SURROGATES[name].uses_rates)
    kept = len(subset.training) * data.rows * data.itemsize * (2 if learns_rates else 1)
    ones = np.ones(len(modes))
    model_bytes = data.rows * (modes + 1.0) * data.itemsize + sizes
    return subset.interval * ones, modes, _rms(squares, data.rows), velocity, model_bytes, kept * ones, modes == by_rule


def fitted(name: str, case: Case, reduced: Reduced, n: int) -> Surrogate:
    """Fit a surrogate to the first n coefficients."""
    rates = None if reduced.rates is None else reduced.rates[:, :n]
    return made(name).fit(case.times[case.training], reduced.coefficients[case.training, :n], rates)


def _rms(squares: Array, rows: int) -> Array:
    """RMSE over the rows, mean over the times. squares: (times, k)."""
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / rows).mean(axis=0))


def _every_number(name: str, case: Case, reduced: Reduced) -> tuple[NDArray[np.intp], Array, Array]:
    """Numbers of modes 1 … p, squared errors (u, p) and bytes of the coefficients (p,) from a single fit.

    ‖w - ŵ‖² = ‖outside‖² + Σ_{i>n} c_i² + Σ_{i≤n} (c_i - ĉ_i)².
    """
    p = reduced.basis.modes.shape[1]
    c, surrogate = reduced.coefficients[case.unseen], fitted(name, case, reduced, p)
    missed = np.square(c - surrogate.predict(case.times[case.unseen])).cumsum(axis=1)
    tail = np.square(c)[:, ::-1].cumsum(axis=1)[:, ::-1]
    left = np.hstack([tail[:, 1:], np.zeros((len(c), 1))])
    modes = np.arange(1, p + 1)
    one, all_ = _bytes(fitted(name, case, reduced, 1)), _bytes(surrogate)
    sizes = one + (all_ - one) * (modes - 1.0) / max(p - 1, 1)  # every mode adds a column
    return modes, reduced.outside[:, None] + left + missed, sizes


def _some_numbers(
    name: str, case: Case, reduced: Reduced, modes: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the same for some numbers of modes, from a fit for each."""
    c, squares, sizes = reduced.coefficients[case.unseen], [], []
    for n in modes:
        surrogate = fitted(name, case, reduced, int(n))
        miss = c[:, :n] - surrogate.predict(case.times[case.unseen])
        squares.append(reduced.outside + np.square(c[:, n:]).sum(axis=1) + np.square(miss).sum(axis=1))
        sizes.append(_bytes(surrogate))
    return modes, np.array(squares).T, np.array(sizes, dtype=np.float64)


def _bytes(surrogate: Surrogate) -> int:
    return sum(array.nbytes for array in surrogate.arrays().values())
