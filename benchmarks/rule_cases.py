"""What the rule says of every variable and Δτ of a run, beside the errors that a finished model makes there."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from rule_flows import Flow

from pod import RowSource, SnapshotMatrix
from selection import Candidate, Thresholds, dense_interval, project_from_gram, spline_errors, sweep
from selection.intervals import candidates
from suffice.cases import PLAIN
from suffice.compare import compare
from suffice.rows import Variable
from suffice.run import Run
from suffice.selecting import default_variables, thresholds_of
from suffice.variables import mean_diameter

Case = dict[str, Any]
DIGITS = 7
STRIDES = range(10, 1, -1)  # the paper's scan, in dense intervals
COARSE = (30, 27, 24, 21, 18, 16, 14, 12)  # beyond it, where only the inner products are asked


def measure(run: Run, flow: Flow) -> list[Case]:
    """Return a case for every variable that moves and every Δτ of the scan, with the errors of all surrogates."""
    cases = []
    for name in default_variables(run):
        found = judged(run, name, flow)
        if found:
            add_errors_(found, run, name)
        cases += found
    return cases


def measure_coarse(run: Run, flow: Flow) -> list[Case]:
    """Return the cases at coarser Δτ, without the errors of surrogates but for the spline."""
    return [case for name in default_variables(run) for case in judged(run, name, flow, strides=COARSE)]


def judged(
    run: Run,
    name: str,
    flow: Flow,
    particles: slice = slice(None),
    snapshots: slice = slice(None),
    strides: Sequence[int] = STRIDES,
) -> list[Case]:
    """Return the cases of one variable without the errors of surrogates, from part of the run if so asked."""
    variable = run.variable(name)
    W, times, limits = variable[:][particles, snapshots], run.times[snapshots], thresholds_of(name)
    if not np.ptp(W, axis=1).any():
        return []
    tau = correlation_time(rate_of(run, name)[:][particles, snapshots]) * np.ptp(run.times) / (len(run.times) - 1)
    label = {
        "run": flow.name,
        "flow": flow.flow,
        "violence": flow.violence,
        "variable": name,
        "correlation_time": tau,
        "diameter": mean_diameter(run) if variable.unit == "m" else None,
    }
    return [
        {**label, "in_unit_of_flow": case["interval"] * flow.units_per_second, **case}
        for case in gram_cases(W, times, limits, strides)
    ]


def rate_of(run: Run, name: str) -> Variable:
    """Return the velocity of a position, any other variable itself."""
    return run.variable(name.replace("position", "velocity", 1))


def gram_cases(W: RowSource, times: Any, limits: Thresholds, strides: Sequence[int] = STRIDES) -> list[Case]:
    """Judge every Δτ of the scan, with the error of the spline at every n; W: (rows, snapshots)."""
    gram, rows = SnapshotMatrix(W).gram(), int(W.shape[0])
    intervals = [float(f"{k * dense_interval(times):.12g}") for k in strides]
    table = sweep(SnapshotMatrix(W), times, intervals, limits)
    cases = []
    for candidate, subset in zip(table.candidates, candidates(times, intervals), strict=True):
        last = len(subset.testing)
        projection = project_from_gram(np.asarray(gram)[:last, :last], subset.training)
        stride = int(subset.training[1])
        cases.append({"stride": stride, **as_case(candidate, spline_errors(projection, rows), rows)})
    return cases


def as_case(candidate: Candidate, spline: Any, rows: int) -> Case:
    """Plain numbers of a candidate: its verdicts, its curves to n where R_c is known, and the spline's beside them."""
    curves = candidate.curves
    count = len(curves.E_train)
    energy = np.append(0.0, np.cumsum(candidate.eigenvalues) / candidate.eigenvalues.sum())
    kept = {"energy": energy, "E_train": curves.E_train, "E_gap": curves.E_gap, "R_c": curves.R_c, "spline": spline}
    numbers = candidate.as_dict()
    del numbers["reasons"]
    return {
        **numbers,
        "deviation": math.sqrt(candidate.eigenvalues.sum() / rows),
        "curves": {name: [float(f"{x:.{DIGITS}g}") for x in values[:count]] for name, values in kept.items()},
    }


def add_errors_(cases: list[Case], run: Run, name: str) -> None:
    """Add to each case the errors of every surrogate without training on n_lr, n_c and all modes, and of raw ones."""
    answer = compare(run, [name], [case["interval"] for case in cases], precisions=[])
    bases = {base["interval"]: base for base in answer["bases"] if base["basis"] == PLAIN}
    rows = [row for row in answer["rows"] if row["basis"] in (PLAIN, None)]
    for case in cases:
        base = bases[case["interval"]]
        least = base["n_lr"]
        levels = {"n_lr": least, "n_c": max(base["n_c"], least), "all": base["modes"]}
        case["errors"], case["raw"] = {}, {}
        for row in (row for row in rows if row["interval"] == case["interval"]):
            if row["modes"] is None:
                case["raw"][row["surrogate"]] = row["rmse"]
            else:
                known = case["errors"].setdefault(row["surrogate"], {})
                known.update({level: row["rmse"] for level, n in levels.items() if n == row["modes"]})


def correlation_time(values: Any) -> float:
    """Return the time, in snapshots, in which the autocorrelation about the mean over time falls to 1/e; inf if never.

    values: (rows, snapshots). C(k) = Σ_rows mean_t v(t) v(t + k) / C(0); linear in between.
    """
    motion = np.asarray(values, np.float64)
    motion = motion - motion.mean(axis=1, keepdims=True)
    products = motion.T @ motion
    lags = np.array([np.diag(products, k).mean() for k in range(len(products) - 1)])
    below = lags < lags[0] / math.e
    if not below.any():
        return math.inf
    k = int(np.argmax(below))
    return float(k - 1 + (lags[k - 1] - lags[0] / math.e) / (lags[k - 1] - lags[k]))
