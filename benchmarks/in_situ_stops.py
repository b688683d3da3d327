"""Would runs have ended in time, and rightly? The rule of `simulate --until-sufficient`, replayed on finished runs.

    python benchmarks/in_situ_stops.py RUN... [--held 1.25,1.5,2,3] [--json FILE]

Every RUN is dense and even in time. For every variable the run is judged at the numbers of snapshots at which it would
have been judged while it was made, and would have ended when a Δτ has been sufficient while the number of snapshots
grew `held` times (the rule itself: selection/settled.py). What the whole run says of that Δτ: whether K_f is still at
its threshold, and our verdict, which asks for R_a as well.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from selection import sweep
from selection.intervals import stride as stride_of
from selection.settled import HELD, Settling, checks
from suffice.in_situ import sufficient_strides
from suffice.run import Run
from suffice.selecting import default_variables, thresholds_of


def history(run, variable):
    """Numbers of snapshots, the strides that are sufficient there; and all candidates of the whole run by stride."""
    W = run.variable(variable)[:].astype(np.float64)
    found = []
    for n in checks(run.n_snapshots):
        table = sweep(W[:, :n], run.times[:n], None, thresholds_of(variable), groups=None)
        found.append((n, sufficient_strides(table)))
    dense = table.dense_interval
    return found, {stride_of(c.interval, dense, run.n_snapshots): c for c in table.candidates}


def stop(seen, held):
    """Snapshots at which the run would have ended and the Δτ in dense intervals; None where it would not."""
    strides = dict(seen)
    settling = Settling(list(strides), lambda stride, n: stride in strides[n], held)
    return next(((n, s) for n in strides for s in strides[n] if settling.settled(s, n)), None)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--held", default=f"1.25,1.5,{HELD:g},3")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    helds, rows = [float(held) for held in asked.held.split(",")], []
    for path in asked.runs:
        with Run(path) as run:
            for variable in default_variables(run):
                seen, whole = history(run, variable)
                for held in helds:
                    found = stop(seen, held)
                    if found is None:
                        continue
                    at = whole[found[1]]
                    rows.append({
                        "run": f"{path.parent.name}/{path.stem}", "variable": variable, "held": held,
                        "snapshots": run.n_snapshots, "ended_at": found[0], "stride": found[1],
                        "K_f": at.K_f, "R_a": at.R_a, "verdict": at.verdict, "sufficient": at.sufficient,
                    })  # fmt: skip
                    print(rows[-1], flush=True)
    for held in helds:
        ended = [row for row in rows if row["held"] == held]
        share = np.mean([row["ended_at"] / row["snapshots"] for row in ended]) if ended else float("nan")
        later = {word: sum(row["verdict"] == word for row in ended) for word in ("insufficient", "undecidable")}
        below = sum(not row["sufficient"] for row in ended)
        said = f"on the whole run K_f is too low for {below}, {later}"
        print(f"held {held:g}: {len(ended)} end, at {100 * share:.0f} %; {said}")
    if asked.json:
        asked.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
