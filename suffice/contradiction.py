"""How far a predicted velocity is from the slope of the predicted position."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from suffice.alternatives import case_of, fitted, judged_subsets, reduced_case
from suffice.condensed import Array, Condensed
from suffice.run import Run
from suffice.selecting import thresholds_of

Parts = Mapping[str, Mapping[str, Any]]  # variable: interval, modes, surrogate
Pairs = Mapping[str, str]  # velocity: position


def contradiction(run: Run, data: Mapping[str, Condensed], pairs: Pairs, parts: Parts) -> float | None:
    """RMSE in m/s of dx/dt - v of what parts predict at the dense times, None where no velocity has its position.

    Over the rows, mean over the times that all parts know; dx/dt by central differences at the dense interval. A
    velocity without a part of its own is the derivative of its position. data: both condensed to the same rows.
    """
    if not pairs:
        return None
    last = min(int(_training(run, part)[-1]) for part in parts.values()) + 1
    found = []
    for velocity, position in pairs.items():
        own = velocity in parts
        x = _predicted(run, data[position], parts[position], last, moving=False)
        name = velocity if own else position
        found.append((x, _predicted(run, data[name], parts[name], last, moving=not own)))
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


def _training(run: Run, part: Mapping[str, Any]) -> Any:
    (subset,) = judged_subsets(run, [part["interval"]])
    return subset.training


def _predicted(run: Run, data: Condensed, part: Mapping[str, Any], last: int, *, moving: bool) -> Array:
    """Prediction (r, last) at the first dense times, in condensed rows; `moving` gives its derivative instead."""
    (subset,) = judged_subsets(run, [part["interval"]])
    times, n = run.times[:last], part["modes"]
    case = case_of(data, run.times, subset)
    reduced = reduced_case(data, case, thresholds_of(data.variable).energy)
    surrogate, modes = fitted(part["surrogate"], case, reduced, n), reduced.basis.modes[:, :n]
    if moving:
        return np.asarray(modes @ surrogate.derivative(times).T)
    return np.asarray(reduced.basis.mean[:, None] + modes @ surrogate.predict(times).T)
