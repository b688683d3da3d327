"""Verdicts of coarse runs alone against the dense answer, on runs that are dense.

    python benchmarks/without_truth.py RUN... [--every 2,3,4,6,8]

Each run is thinned to every k-th snapshot, judged from those alone (`selection.without_truth`: Δτ, the interval of the
thinned run, and 2Δτ), and set beside what all snapshots say of the same training set. Optimistic is a coarse verdict
`sufficient` where the dense one is another; strict is `insufficient` where the dense one is `sufficient`.
"""

import argparse
from collections import Counter, defaultdict

import numpy as np

from pod import SnapshotMatrix
from selection import intervals_without_truth, sweep, without_truth
from suffice.run import Run
from suffice.selecting import default_variables, thresholds_of

FEWEST = 21  # snapshots of a thinned run, so that every second of them are the fewest that a verdict takes
HEAD = f"{'run':<24}{'variable':<21}{'Δτ ms':>8} {'':4}{'m':>5}{'n_lr':>5}{'n_c':>4}{'  K_f':>6} {'verdict':<13}"
HEAD += f"{'n_c':>9}{'K_f':>13} {'verdict':<13}{'n_c ratio':>12}"


def judged_both_ways(run, name, strides):
    """Yield (k, whether 2Δτ, dense candidate, coarse answer) of one variable."""
    W, limits = SnapshotMatrix(run.variable(name)[:]), thresholds_of(name)
    n, own = run.n_snapshots, run.interval
    strides = [k for k in strides if (n - 1) // k + 1 >= FEWEST]
    table = sweep(W, run.times, [k * own for k in {*strides, *(2 * k for k in strides)}], limits)
    dense = {round(c.interval / own): c for c in table.candidates}
    for k in strides:
        times = run.times[::k]
        part = W.columns(np.arange(0, n, k))
        thin = sweep(part, times, intervals_without_truth(times), limits)
        coarse = without_truth(thin, np.asarray(part.gram()))
        yield k, False, dense[k], coarse.recorded
        yield k, True, dense[2 * k], coarse.doubled


def line(run, name, doubled, dense, coarse):
    """One row of the table, and what became of the verdict."""
    low, high = coarse.n_c_range
    K_f = "–" if coarse.K_f_range is None else "{:.2f} to {:.2f}".format(*coarse.K_f_range)
    of_dense = f"{low / dense.n_c:5.2f} {high / dense.n_c:6.2f}" if dense.n_c else ""
    outcome = "same" if coarse.verdict == dense.verdict else "open"
    if coarse.verdict != dense.verdict and coarse.verdict != "undecidable":
        outcome = "OPTIMISTIC" if coarse.verdict == "sufficient" else "told"
        outcome = "STRICT" if dense.verdict == "sufficient" else outcome
    K_dense = "–" if dense.K_f is None else f"{dense.K_f:.2f}"
    print(
        f"{run.path.stem:<24}{name:<21}{dense.interval * 1e3:8.4g} {'2Δτ' if doubled else 'Δτ':<4}{dense.n_snapshots:5}"
        f"{dense.n_lr:5}{dense.n_c:4}{K_dense:>6} {dense.verdict:<13}{low:4} {high:4} {K_f:>12} {coarse.verdict:<13}"
        f"{of_dense:>12} {outcome}",
        flush=True,
    )
    return outcome


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", metavar="RUN")
    parser.add_argument("--every", default="2,3,4,6,8", help="thin each run to every k-th snapshot")
    options = parser.parse_args()
    strides = [int(k) for k in options.every.split(",")]
    outcomes, verdicts, ratios, outside = defaultdict(Counter), defaultdict(Counter), defaultdict(list), []
    print(HEAD)
    for path in options.runs:
        with Run(path) as run:
            for name in default_variables(run):
                for k, doubled, dense, coarse in judged_both_ways(run, name, strides):
                    place = ("2Δτ" if doubled else "Δτ ", name.partition(".")[0])
                    outcomes[place][line(run, name, doubled, dense, coarse)] += 1
                    verdicts[place][f"{dense.verdict} told {coarse.verdict}"] += 1
                    low, high = coarse.n_c_range
                    if dense.n_c > 2:
                        ratios[place].append((low / dense.n_c, high / dense.n_c))
                    if not low <= dense.n_c <= high:
                        outside.append((run.path.stem, name, k, place[0], dense.n_c, coarse.n_c_range))
    for place, counts in sorted(outcomes.items()):
        print(*place, dict(counts), dict(verdicts[place]))
    for place, pairs in sorted(ratios.items()):
        print(*place, len(pairs), "cases of n_c > 2; bounds over the dense n_c, least median most:", end=" ")
        print(*("{:.2f} {:.2f} {:.2f}".format(*np.quantile(b, [0, 0.5, 1])) for b in np.transpose(pairs)), sep=" and ")
    print(len(outside), "where the dense n_c is outside:", *outside, sep="\n  ")


if __name__ == "__main__":
    main()
