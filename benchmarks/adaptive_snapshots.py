"""Snapshots that error-controlled spacing keeps, against evenly spaced ones of the same error in between.

    python benchmarks/adaptive_snapshots.py RUN... [--tolerances 0.01,0.02,0.05,0.1] [--json FILE]

Every RUN is dense and even in time. For each tolerance (RMSE of positions over the rows, in particle diameters) the
snapshots are chosen by `selection.spacing`, which sees them one after another. The error of a choice is the RMSE over
the rows at the snapshots left out: its mean and its largest. The evenly spaced choices take every k-th snapshot and the
last; their number at the error of the adaptive choice is interpolated between whole k, both on logarithmic scales.
Methods: cubic Hermite through stored positions and velocities; POD (all modes of the kept snapshots) with Hermite, and
with a cubic spline, of the coefficients. `saved` is 1 - adaptive / even: negative where even spacing needs fewer.
"""

import argparse
import json
from itertools import pairwise
from pathlib import Path

import numpy as np

from selection.spacing import Moment, hermite_errors, kept_of
from suffice.run import Run
from suffice.variables import mean_diameter
from surrogates import SURROGATES

METHODS = ("hermite", "pod + hermite", "pod + spline")
LARGEST_STRIDE = 40


def snapshots_of(run):
    """Positions and velocities, (N_t, n, 3) m and m/s."""
    parts = [run.variable(name)[:].T.reshape(run.n_snapshots, -1, 3) for name in ("position", "velocity")]
    return [part.astype(np.float64) for part in parts]


def errors(method, times, x, v, kept):
    """RMSE over the rows at every snapshot that is left out, m."""
    if method == "hermite":
        moments = [Moment(times[k], x[k], v[k]) for k in kept]
        gaps = [np.arange(a + 1, b) for a, b in pairwise(kept)]
        found = [
            hermite_errors(one, other, times[gap], x[gap])
            for (one, other), gap in zip(pairwise(moments), gaps, strict=True)
            if len(gap)
        ]
        return np.concatenate(found) if found else np.zeros(0)
    out = np.setdiff1d(np.arange(len(times)), kept)
    W = x.reshape(len(times), -1).T
    mean = W[:, kept].mean(axis=1, keepdims=True)
    modes, sigma, _ = np.linalg.svd(W[:, kept] - mean, full_matrices=False)
    modes = modes[:, sigma > 1e-12 * sigma[0]]
    surrogate = SURROGATES[method.removeprefix("pod + ")]()
    rates = v[kept].reshape(len(kept), -1) @ modes if surrogate.needs_rates else None
    surrogate.fit(times[kept], (W[:, kept] - mean).T @ modes, rates)
    miss = surrogate.predict(times[out]) @ modes.T - (W[:, out] - mean).T
    return np.sqrt(np.square(miss).mean(axis=1))


def even(n, stride):
    """Every stride-th snapshot, and the last."""
    return np.unique(np.append(np.arange(0, n, stride), n - 1))


def even_count(counts, levels, error):
    """How many evenly spaced snapshots have this error; None outside of what whole strides reach."""
    if not min(levels) <= error <= max(levels):
        return None
    above = np.maximum.accumulate(levels)  # a larger stride is now and then a little better by chance
    return float(np.exp(np.interp(np.log(error), np.log(above), np.log(counts))))


def rows_of(path, tolerances):
    """Figures of one run."""
    with Run(path) as run:
        (x, v), times, d = snapshots_of(run), run.times, mean_diameter(run)
    n = len(times)
    strides = range(2, min(LARGEST_STRIDE, (n - 1) // 4) + 1)
    evenly = {}
    for method in METHODS:
        found = [errors(method, times, x, v, even(n, stride)) / d for stride in strides]
        evenly[method] = {"mean": [e.mean() for e in found], "worst": [e.max() for e in found]}
    counts = [len(even(n, stride)) for stride in strides]
    rows = []
    for tolerance in tolerances:
        kept = kept_of(times, x, v, tolerance * d)
        if len(kept) in (2, n):  # nothing to compare: the tolerance is too loose, or tighter than the dense snapshots
            rows.append({"run": path.stem, "tolerance": tolerance, "snapshots": n, "kept": len(kept)})
            continue
        for method in METHODS:
            e = errors(method, times, x, v, kept) / d
            for measure, value in (("mean", e.mean()), ("worst", e.max())):
                count = even_count(counts, evenly[method][measure], value)
                rows.append({
                    "run": path.stem, "tolerance": tolerance, "snapshots": n, "kept": len(kept), "method": method,
                    "measure": measure, "error": float(value), "even": count,
                    "saved": None if count is None else 1.0 - len(kept) / count,
                })  # fmt: skip
    return rows


def show(row):
    """Print one line."""
    head = f"{row['run']:<18} {row['tolerance']:>6g} d  kept {row['kept']:>4} of {row['snapshots']:<5}"
    if "method" not in row:
        print(f"{head} nothing to compare")
        return
    count = "   –" if row["even"] is None else f"{row['even']:6.1f}"
    saved = "" if row["saved"] is None else f"{100 * row['saved']:+5.0f} %"
    print(
        f"{head} {row['method']:<14} {row['measure']:<5} {row['error']:.2e} d  even {count}  saved {saved}", flush=True
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--tolerances", default="0.01,0.02,0.05,0.1")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    tolerances, rows = [float(t) for t in asked.tolerances.split(",")], []
    for path in asked.runs:
        found = rows_of(path, tolerances)
        rows += found
        for row in found:
            show(row)
    if asked.json:
        asked.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
