"""Is a run dense enough that has no denser truth beside it? What its own snapshots can tell."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.candidate import Candidate
from selection.consistency import project_from_gram
from selection.errors import InputError
from selection.feasibility import FEWEST_SNAPSHOTS, Thresholds
from selection.intervals import dense_interval
from selection.resolution import interpolated, resolution_ratio
from selection.sweep import Sweep

MOST_GROWTH = 1.5  # of n_c as Δτ is halved: less than what was measured on every flow, see docs/selection.md


class Bounded(NamedTuple):
    """A snapshot interval Δτ whose index K_f is known within bounds only."""

    interval: float  # s
    n_snapshots: int
    n_lr: int
    n_c_range: tuple[int, int]  # the dense answer lies between
    K_f_range: tuple[float, float] | None  # n_c_range / n_lr, wider by the interval of K_f; None where nothing moves
    R_a: float | None  # at the greatest n_c foreseen of this Δτ, by the gaps of 2Δτ; None where it is undefined
    verdict: str  # sufficient, insufficient or undecidable
    reasons: list[str]


class Coarse(NamedTuple):
    """What a run recorded every Δτ tells of Δτ, and of every second of its snapshots."""

    recorded: Bounded
    doubled: Bounded

    def as_dict(self) -> dict[str, Any]:
        """Plain Python types, ready for JSON."""
        return {name: _plain(bounded) for name, bounded in self._asdict().items()}


def intervals_without_truth(times: ArrayLike) -> list[float]:
    """Return the Δτ that `without_truth` needs to be judged: 4, 2 and 1 recorded intervals, in s, as far as they fit.

    Raises InputError for times that are not uniform and for fewer than three snapshots.
    """
    own, n = dense_interval(times), np.size(np.asarray(times))
    if n < 3:
        raise InputError(f"times: {n} snapshots; a verdict without dense truth leaves out every second of at least 3")
    return [float(f"{k * own:.12g}") for k in (4, 2, 1) if k <= n - 1]


def without_truth(table: Sweep, gram: NDArray[np.float64]) -> Coarse:
    """Decide from a run recorded every Δτ, and nothing denser, whether Δτ and 2Δτ suffice.

    2Δτ: the modes of every second snapshot are tested on those between, which lie farthest from the training times. By
    these gaps alone n_c is too small; by the paper's R_c, half of whose testing times are training times here, too
    large. The dense answer, n_c of the same training set tested everywhere, lies between.

    Δτ: n_lr is known from all snapshots, n_c is at least that of 2Δτ by the gaps, times the root of what n_c grew by
    from 4Δτ to 2Δτ, 1.5 at most, and at most m - 2, the last n at which m snapshots leave an error. R_a grows with n,
    so that of Δτ is bounded by that of 2Δτ on twice as many modes.

    table: the Δτ of `intervals_without_truth` judged on this run; gram: (N_t, N_t) inner products of its snapshots.
    Raises InputError where a Δτ is missing.
    """
    by_stride = {round(c.interval / table.dense_interval): c for c in table.candidates}
    if not {1, 2} <= set(by_stride):
        raise InputError("candidates: judge the Δτ of intervals_without_truth, 4, 2 and 1 recorded intervals")
    doubled = by_stride[2]
    growth = _growth(doubled, by_stride.get(4))
    R_a = _resolution_of_twice(gram, doubled.n_c)
    return Coarse(_recorded(by_stride[1], doubled, growth, R_a, table.thresholds), _doubled(doubled, table.thresholds))


def _plain(bounded: Bounded) -> dict[str, Any]:
    K_f_range = None if bounded.K_f_range is None else list(bounded.K_f_range)
    return bounded._asdict() | {"n_c_range": list(bounded.n_c_range), "K_f_range": K_f_range}


def _growth(doubled: Candidate, fourfold: Candidate | None) -> float:
    """Take the root of what n_c grew by when Δτ was last halved, 1 to 1.5; 1 where 4Δτ has too few snapshots.

    Near a floor of noise n_c stops growing; the root keeps below that.
    """
    if fourfold is None or fourfold.n_snapshots < FEWEST_SNAPSHOTS or not fourfold.n_c_gap:
        return 1.0
    return min(max(math.sqrt((doubled.n_c_gap or 0) / fourfold.n_c_gap), 1.0), MOST_GROWTH)


def _resolution_of_twice(gram: NDArray[np.float64], n_c: int) -> float | None:
    """R_a of every second snapshot on twice its consistent modes, or on all that it has."""
    training = np.arange(0, len(gram), 2)
    last = training[-1] + 1
    projection = project_from_gram(gram[:last, :last], training)
    n = min(2 * n_c, len(projection.eigenvalues))
    return resolution_ratio(interpolated(projection, n), n)


def _spread(candidate: Candidate) -> float:
    """Half the interval of K_f from leaving out particles, as a share of K_f."""
    if candidate.K_f_interval is None or not candidate.K_f:
        return 0.0
    return candidate.K_f_interval[1] / candidate.K_f - 1.0


def _range(n_c: tuple[int, int], n_lr: int, spread: float) -> tuple[float, float] | None:
    return (max(1.0 - spread, 0.0) * n_c[0] / n_lr, (1.0 + spread) * n_c[1] / n_lr) if n_lr else None


def _doubled(candidate: Candidate, limits: Thresholds) -> Bounded:
    """Judge every second snapshot by the two ratios between which the dense one lies."""
    n_c = candidate.n_c_gap or 0, candidate.n_c
    K_f = _range(n_c, candidate.n_lr, _spread(candidate))
    facts = candidate.interval, candidate.n_snapshots, candidate.n_lr, n_c, K_f, candidate.R_a
    if candidate.verdict == "undecidable" or K_f is None:
        return Bounded(*facts, "undecidable", candidate.reasons)
    return Bounded(*facts, *_verdict(K_f, candidate.R_a, limits))


def _recorded(
    candidate: Candidate, doubled: Candidate, growth: float, R_a: float | None, limits: Thresholds
) -> Bounded:
    """Judge all snapshots: they are at least as good as every second one, and hold no more modes than they are."""
    m = candidate.n_snapshots
    n_c = math.floor((doubled.n_c_gap or 0) * growth), max(m - 2, 0)
    K_f = _range(n_c, candidate.n_lr, 0.0)
    if K_f is not None:
        K_f = max(1.0 - _spread(doubled), 0.0) * K_f[0], K_f[1]
    facts = candidate.interval, m, candidate.n_lr, n_c, K_f, R_a
    if K_f is None or _untold(doubled, limits):
        return Bounded(*facts, "undecidable", doubled.reasons)
    if K_f[1] < limits.feasibility:
        few = f"{m} snapshots have at most {n_c[1]} consistent modes, {limits.feasibility:g} n_lr = "
        return Bounded(*facts, "insufficient", [f"{few}{limits.feasibility * candidate.n_lr:g} are needed"])
    return Bounded(*facts, *_verdict(K_f, R_a, limits))


def _untold(doubled: Candidate, limits: Thresholds) -> bool:
    """Whether 2Δτ is undecidable for a cause that holds at Δτ too: any but that its K_f is near the limit."""
    near = doubled.K_f_interval is not None and doubled.K_f_interval[0] < limits.feasibility <= doubled.K_f_interval[1]
    return doubled.verdict == "undecidable" and not (near and doubled.n_snapshots >= FEWEST_SNAPSHOTS)


def _verdict(K_f: tuple[float, float], R_a: float | None, limits: Thresholds) -> tuple[str, list[str]]:
    """Sufficient where even the least K_f is, insufficient where even the greatest is not."""
    low, high = K_f
    limit = limits.feasibility
    if high < limit:
        return "insufficient", [f"K_f at most {high:.2f}, below {limit:g}"]
    reasons = [f"K_f at least {low:.2f}"]
    if low < limit:
        reasons = [f"K_f between {low:.2f} and {high:.2f}, either side of {limit:g}"]
    if R_a is None:
        return "undecidable", [*reasons, "R_a undefined: no consistent mode, or no error left"]
    resolved = R_a <= limits.resolution
    reasons.append(f"R_a {R_a:.2f} {'at most' if resolved else 'above'} {limits.resolution:g}")
    return ("sufficient" if low >= limit and resolved else "undecidable"), reasons
