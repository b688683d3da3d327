"""Truths, rules and scores: when is a Δτ good enough, who said so, and how often were they right."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from selection import Thresholds, consistent_mode, feasibility_index
from suffice.selecting import thresholds_of

Case = dict[str, Any]
Judge = Callable[[Case], bool]
PROMISE = 1.10  # of E_train(n_lr): what a ROM may err at unseen times
WHOLE_RANGE = 1.25  # the same at n_c
DIAMETERS = 0.05


class Confusion(NamedTuple):
    """How often a rule agrees with the truth, and how it does not."""

    accepted: int  # rightly
    rejected: int  # rightly
    strict: int  # rejected although good enough
    lenient: int  # accepted although not

    @property
    def total(self) -> int:
        """All of them."""
        return sum(self)

    @property
    def balanced(self) -> float:
        """Mean of the shares of good and of bad cases that are judged rightly: ½ is guessing; NaN without either."""
        good, bad = self.accepted + self.strict, self.rejected + self.lenient
        return 0.5 * (self.accepted / good + self.rejected / bad) if good and bad else float("nan")


def limits_of(case: Case, energy: float | None = None) -> Thresholds:
    """Thresholds of a case's variable."""
    return thresholds_of(case["variable"], None if energy is None else {"energy": energy})


def curve(case: Case, name: str, n: int) -> float:
    """Return a curve at n modes; beyond its end E_train is round-off, and n is all modes but for that."""
    values = case["curves"][name]
    if name == "E_train" and n >= len(values):
        return 0.0
    return float(values[min(n, len(values) - 1)])


def promised(case: Case) -> float:
    """Return E_train(n_lr), the error that n_lr modes promise; 0 where these are all modes."""
    return curve(case, "E_train", case["n_lr"])


def breach(case: Case) -> float:
    """Return how many times its promise the best surrogate errs on n_lr modes at unseen times."""
    promise = promised(case)
    return least_error(case) / promise if promise else float("inf")


def least_error(case: Case, levels: Iterable[str] = ("n_lr",)) -> float:
    """Return the least error at unseen times of any surrogate on these numbers of modes."""
    return min(min(found[level] for level in levels) for found in case["errors"].values())


def keeps_promise(case: Case, factor: float = PROMISE, surrogate: str | None = None) -> bool:
    """T1: the best surrogate, or this one, errs on n_lr modes at unseen times by at most `factor` times the promise."""
    error = least_error(case) if surrogate is None else case["errors"][surrogate]["n_lr"]
    return bool(error <= factor * promised(case))


def keeps_promise_up_to_n_c(case: Case, factor: float = WHOLE_RANGE) -> bool:
    """T2: the same on n_c modes, if these are at least n_lr."""
    n_c = case["n_c"]
    if n_c < case["n_lr"]:
        return False
    return bool(least_error(case, ["n_c"]) <= factor * curve(case, "E_train", n_c))


def holds_energy(case: Case) -> bool:
    """T3: some model leaves at unseen times at most the share of the variance that n_lr modes may leave."""
    left = (least_error(case, ("n_lr", "n_c", "all")) / case["deviation"]) ** 2
    return bool(left <= 1 - limits_of(case).energy)


def within_diameters(case: Case, limit: float = DIAMETERS) -> bool:
    """T4, positions: some model errs by at most so many diameters."""
    return bool(least_error(case, ("n_lr", "n_c", "all")) <= limit * case["diameter"])


def spline_breach(case: Case) -> float:
    """Return how many times its promise a ROM with a spline errs, from the inner products alone."""
    promise = promised(case)
    return curve(case, "spline", case["n_lr"]) / promise if promise else float("inf")


def spline_keeps_promise(case: Case, factor: float = PROMISE) -> bool:
    """T1 of the spline alone."""
    return spline_breach(case) <= factor


def unseen_energy(case: Case) -> float:
    """Share of the variance that n_lr modes hold at unseen times."""
    return 1 - (curve(case, "E_gap", case["n_lr"]) / case["deviation"]) ** 2


def raw_left(case: Case) -> float:
    """Share of the variance that interpolation of the stored snapshots leaves at unseen times."""
    raw = case["raw"].get("raw-hermite", case["raw"]["raw-linear"])
    return float((raw / case["deviation"]) ** 2)


RULES: dict[str, Judge] = {
    "paper, K_f ≥ 2": lambda case: case["sufficient"],
    "gap-only K_f ≥ 2": lambda case: (case["K_f_gap"] or 0.0) >= 2,
    "ours, verdict sufficient": lambda case: case["verdict"] == "sufficient",
    "paper, K_f ≥ 1": lambda case: (case["K_f"] or 0.0) >= 1,
    "energy at unseen times": lambda case: unseen_energy(case) >= limits_of(case).energy,
    "raw interpolation": lambda case: raw_left(case) <= 1 - limits_of(case).energy,
    "spline on n_lr modes": spline_keeps_promise,
}

SCORES: dict[str, Callable[[Case], float]] = {  # larger speaks for a Δτ
    "K_f": lambda case: case["K_f"] or 0.0,
    "K_f, gap-only": lambda case: case["K_f_gap"] or 0.0,
    "1/R_a": lambda case: 1 / case["R_a"] if case["R_a"] else 0.0,
    "τ/Δτ": lambda case: case["correlation_time"] / case["interval"],
    "snapshots/n_lr": lambda case: case["n_snapshots"] / case["n_lr"],
    "energy, allowed/left": lambda case: (1 - limits_of(case).energy) / (1 - unseen_energy(case)),
    "raw, allowed/left": lambda case: (1 - limits_of(case).energy) / raw_left(case),
    "E_train/E_spline at n_lr": lambda case: 1 / spline_breach(case),
}


def confusion(decided: Iterable[bool], truth: Iterable[bool]) -> Confusion:
    """Count agreements and both kinds of disagreement."""
    pairs = list(zip(decided, truth, strict=True))
    return Confusion(*(pairs.count(pair) for pair in ((True, True), (False, False), (False, True), (True, False))))


def area(scores: ArrayLike, truth: ArrayLike) -> float:
    """Area under the ROC curve: the chance that a good case scores above a bad one, ties half; NaN without either."""
    s, good = np.asarray(scores, np.float64), np.asarray(truth, bool)
    if good.all() or not good.any():
        return float("nan")
    above = s[good][:, None] - s[~good]
    return float((np.sign(above).mean() + 1) / 2)


def best_threshold(scores: ArrayLike, truth: ArrayLike) -> tuple[float, float]:
    """Return the threshold at which "score ≥ threshold" has the highest balanced accuracy, and that accuracy."""
    s, good = np.asarray(scores, np.float64), np.asarray(truth, bool)
    known = np.unique(s)
    tried = np.append(known[:1], (known[1:] + known[:-1]) / 2)
    found = [(confusion((s >= t).tolist(), good.tolist()).balanced, float(t)) for t in tried]
    accuracy, threshold = max(found, key=lambda one: np.nan_to_num(one[0], nan=-1.0))
    return threshold, accuracy


def across_flows(cases: Sequence[Case], score: Callable[[Case], float], truth: Judge) -> Confusion:
    """Judge each flow with the threshold fitted to all other flows."""
    decided, true = [], []
    for flow in dict.fromkeys(case["flow"] for case in cases):
        others = [case for case in cases if case["flow"] != flow]
        threshold, _ = best_threshold([score(c) for c in others], [truth(c) for c in others])
        own = [case for case in cases if case["flow"] == flow]
        decided += [score(case) >= threshold for case in own]
        true += [truth(case) for case in own]
    return confusion(decided, true)


def largest(cases: Sequence[Case], accepts: Judge) -> int | None:
    """Return the stride at which a scan from coarse to fine stops, the first accepted (paper 2.3), or None."""
    ordered = sorted(cases, key=lambda case: -case["stride"])
    return next((case["stride"] for case in ordered if accepts(case)), None)


def recut(case: Case, energy: float | None = None, consistency: float = 1.05) -> Case:
    """Return a case under other thresholds: n_lr, n_c, K_f and R_a follow from its curves."""
    curves, limits = case["curves"], limits_of(case, energy)
    enough = [n for n, share in enumerate(curves["energy"]) if n and share >= limits.energy]
    n_lr = enough[0] if enough else len(curves["energy"])  # all modes: the curves end where E_train is round-off
    n_c = consistent_mode(np.asarray(curves["R_c"]), consistency).n_c
    R_a = curve(case, "spline", n_c) / curve(case, "E_gap", n_c) if n_c else None
    return {**case, "n_lr": n_lr, "n_c": n_c, "K_f": feasibility_index(n_c, n_lr), "R_a": R_a}


def crossing(intervals: Sequence[float], errors: Sequence[float], limit: float) -> float:
    """Δτ (s) at which an error that grows with Δτ passes a limit, from the fine end, interpolated in logarithms.

    0 where it is above already at the finest Δτ, inf where it never is.
    """
    order = np.argsort(intervals)
    t, e = np.log(np.asarray(intervals)[order]), np.log(np.asarray(errors)[order] / limit)
    above = e > 0
    if not above.any():
        return float("inf")
    k = int(np.argmax(above))
    return float(np.exp(t[k - 1] - e[k - 1] * (t[k] - t[k - 1]) / (e[k] - e[k - 1]))) if k else 0.0
