"""Forecasts from the first part of a run against the whole of it.

    python benchmarks/pilot.py RUN... [--shares 8,4,2]

The pilot is the first eighth, quarter and half of each run; `selection.forecast` foresees n_lr, K_f and the Δτ of the
whole from it. Truth is the sweep of the whole run, Δτ of ten to two dense intervals. Only Δτ that the pilot can judge
(ten snapshots or more) count: a coarser truth counts as the coarsest of these.
"""

import argparse
from collections import Counter, defaultdict

import numpy as np

from pod import SnapshotMatrix
from selection import forecast, growth_of_modes, sweep
from suffice.run import Run
from suffice.selecting import default_variables, thresholds_of

HEAD = (
    f"{'run':<22}{'variable':<20}{'pilot':>6}{'a':>12}{'n_lr':>5}{'foreseen':>14}{'Δτ ms':>8}{'expected':>9}{'safe':>8}"
)


def foreseen(W, run, last, limits):
    """Forecast for the whole run from its snapshots up to one."""
    part = W.columns(np.arange(last + 1))
    return forecast(sweep(part, run.times[: last + 1], None, limits, None), np.asarray(part.gram()), duration_of(run))


def duration_of(run):
    return float(run.times[-1] - run.times[0])


def outcome(chosen, truth, intervals):
    """Hit, coarse (optimistic) or fine, among the Δτ that the pilot could judge; None is finer than all."""
    judged = [i for i in intervals if truth is not None and i <= truth * (1 + 1e-9)]
    true, told = max(judged, default=0.0), chosen or 0.0
    return "hit" if abs(true - told) < 1e-9 else "coarse" if told > true else "fine"


def milliseconds(interval):
    return "–" if interval is None else f"{interval * 1e3:.4g}"


def compare(run, name, shares, counts, errors):
    """Print and count what each pilot foresees of one variable."""
    W, limits = SnapshotMatrix(run.variable(name)[:]), thresholds_of(name)
    table = sweep(W, run.times, None, limits, None)
    whole = growth_of_modes(np.asarray(W.gram()), limits.energy)
    if whole is None:
        return
    true = {round(c.interval / run.interval): c for c in table.candidates}
    for share in shares:
        told = foreseen(W, run, (run.n_snapshots - 1) // share, limits)
        if told.growth is None or not told.candidates:
            continue
        quantity, intervals = name.partition(".")[0], [c.interval for c in told.candidates]
        longer = told.duration / told.pilot
        n_lr = [told.growth.n_lr * longer**a for a in (told.growth.least_exponent, told.growth.exponent, 1.0)]
        found = [outcome(i, table.chosen_interval, intervals) for i in (told.expected_interval, told.safe_interval)]
        kind = "found" if table.chosen_interval else "none"
        steady = "transient" if any("transient" in r for r in told.remarks) else "steady"
        for way, what in zip(("expected", "safe"), found, strict=True):
            counts[share, quantity, way, kind, steady][what] += 1
        errors["n_lr", share, quantity].append(n_lr[1] / whole.n_lr)
        errors["n_lr in range", share, quantity].append(float(0.95 * n_lr[0] <= whole.n_lr <= 1.05 * n_lr[2]))
        for c in told.candidates:
            at = true[round(c.interval / run.interval)]
            for way, interval in (("expected", told.expected_interval), ("safe", told.safe_interval)):
                if c.interval == interval:
                    errors[f"K_f there, {way} Δτ", share, quantity].append(at.K_f)
            if at.K_f is not None and at.K_f >= 0.5:  # far below 2 nobody asks how far
                errors["n_c", share, quantity].append(c.n_c / at.n_c)
                errors["K_f", share, quantity].append(c.K_f / at.K_f)
                errors["K_f safe", share, quantity].append(c.K_f_range[0] / at.K_f)
        print(
            f"{run.path.stem:<22}{name:<20}{f'1/{share}':>6}{told.growth.least_exponent:6.2f}"
            f"{told.growth.exponent:6.2f}{whole.n_lr:5.0f}{n_lr[0]:5.0f}{n_lr[1]:4.0f}{n_lr[2]:5.0f}"
            f"{milliseconds(table.chosen_interval):>8}{milliseconds(told.expected_interval):>9}"
            f"{milliseconds(told.safe_interval):>8}  {found[0]}, safe {found[1]}"
            f"{', transient' if steady == 'transient' else ''}",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", metavar="RUN")
    parser.add_argument("--shares", default="8,4,2", help="of the run that the pilots are, one over")
    options = parser.parse_args()
    shares = [int(k) for k in options.shares.split(",")]
    counts, errors = defaultdict(Counter), defaultdict(list)
    print(HEAD)
    for path in options.runs:
        with Run(path) as run:
            for name in default_variables(run):
                compare(run, name, shares, counts, errors)
    for (share, *place), found in sorted(counts.items()):
        print(f"1/{share}", *place, dict(found))
    for (what, share, quantity), values in sorted(errors.items()):
        if what == "n_lr in range":
            print(f"1/{share} {quantity}: n_lr within its range in {sum(values):.0f} of {len(values)}")
        else:
            shown = " ".join(f"{q:.2f}" for q in np.quantile(values, [0, 0.1, 0.5, 0.9, 1]))
            of = "the true" if "there" in what else "foreseen / true"
            print(f"1/{share} {quantity}: {of} {what}, least 10 % median 90 % most: {shown} ({len(values)})")


if __name__ == "__main__":
    main()
