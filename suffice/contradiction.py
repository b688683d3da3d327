"""How far a predicted velocity is from the slope of the predicted position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from suffice.alternatives import case_of, fitted, reduced_case
from suffice.compare import subsets_between
from suffice.condensed import Array, Condensed
from suffice.reconstruction import Case, Reduced
from suffice.run import Run
from suffice.selecting import thresholds_of

Parts = Mapping[str, Mapping[str, Any]]  # variable: interval, modes, surrogate
Pairs = Mapping[str, str]  # velocity: position
Known = dict[tuple[str, float], tuple[Case, Reduced]]  # by variable and Δτ: decompositions that serve again


def contradiction(run: Run, data: Mapping[str, Condensed], pairs: Pairs, parts: Parts, known: Known) -> float | None:
    """RMSE in m/s of dx/dt - v of what parts predict at the dense times, None where no velocity has its position.

    Over the rows, mean over the times that all parts know; dx/dt by central differences at the dense interval. A
    velocity without a part of its own is the derivative of its position. data: both condensed to the same rows; known:
    decompositions made so far, to which new ones are added.
    """
    if not pairs:
        return None
    for name, part in parts.items():
        if (name, part["interval"]) not in known:
            known[name, part["interval"]] = _decomposed(run, data[name], part["interval"])
    cases = {name: known[name, part["interval"]] for name, part in parts.items()}
    times = run.times[: min(int(case.training[-1]) for case, _ in cases.values()) + 1]
    found = []
    for velocity, position in pairs.items():
        name = velocity if velocity in parts else position
        x = _predicted(cases[position], parts[position], times, moving=False)
        found.append((x, _predicted(cases[name], parts[name], times, moving=velocity not in parts)))
    return _apart(run, found, sum(data[position].rows for position in pairs.values()))


def contradiction_of_truth(run: Run, data: Mapping[str, Condensed], pairs: Pairs) -> float | None:
    """Return the same of the run itself: collisions between two snapshots are no central difference."""
    if not pairs:
        return None
    found = [(data[position].values, data[velocity].values) for velocity, position in pairs.items()]
    return _apart(run, found, sum(data[position].rows for position in pairs.values()))


def _apart(run: Run, pairs: Sequence[tuple[Array, Array]], rows: int) -> float | None:
    """RMSE over rows of (x(t + Δt) - x(t - Δt)) / 2Δt - v(t), mean over t. pairs: (r, t) each, condensed rows."""
    if pairs[0][0].shape[1] < 3:
        return None
    step = float(run.times[2] - run.times[0])
    squares = sum(np.square((x[:, 2:] - x[:, :-2]) / step - v[:, 1:-1]).sum(axis=0) for x, v in pairs)
    return float(np.sqrt(np.asarray(squares) / rows).mean())


def _decomposed(run: Run, data: Condensed, interval: float) -> tuple[Case, Reduced]:
    (subset,) = subsets_between(run, [interval])
    case = case_of(data, run.times, subset)
    return case, reduced_case(data, case, thresholds_of(data.variable).energy)


def _predicted(known: tuple[Case, Reduced], part: Mapping[str, Any], times: Array, *, moving: bool) -> Array:
    """Prediction (r, times) in condensed rows; `moving` gives its derivative instead."""
    (case, reduced), n = known, part["modes"]
    surrogate, modes = fitted(part["surrogate"], case, reduced, n), reduced.basis.modes[:, :n]
    if moving:
        return np.asarray(modes @ surrogate.derivative(times).T)
    return np.asarray(reduced.basis.mean[:, None] + modes @ surrogate.predict(times).T)
