"""What K_f depends on besides Δτ: how many beads, how long, which packing; and networks on a small sample."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rule_cases import STRIDES, Case, add_errors_, judged
from rule_flows import FLOWS, PROVOKED, SEEDS
from rule_intervals import at_feasibility, at_promise, told
from rule_tables import kind_of, table
from rule_truth import breach, curve, keeps_promise_up_to_n_c, least_error, promised, spline_breach

from suffice.cases import PLAIN
from suffice.compare import compare
from suffice.run import Run

SIZES = ("box_medium", "dry_medium")
NETWORK_STRIDES = {"box_medium": (5, 2), "dry_medium": (10, 4)}
WIDE = (20, 16, 14, 12, *STRIDES)
PROVOKED_STRIDES = (30, 26, 25, 24, 22, 20, 18, 16, 14, 13, 12, 10, 8, 6, 5, 4, 3, 2)
TRAINING_SECONDS = 15.0


def line(label: str, cases: Sequence[Case]) -> list[str]:
    """Return n_lr, n_c and K_f at a middle Δτ, and the two critical Δτ in the flow's unit."""
    middle = next(case for case in cases if case["stride"] == 4)
    unit = middle["in_unit_of_flow"] / middle["interval"]
    return [
        label,
        middle["variable"],
        str(middle["n_snapshots"]),
        str(middle["n_lr"]),
        str(middle["n_c"]),
        f"{middle['K_f']:.2f}",
        told(at_feasibility(cases, 2.0), unit),
        told(at_feasibility(cases, 1.0), unit),
        told(at_promise(cases), unit),
    ]


def sizes_table(folder: Path) -> str:
    """Halve and quarter the beads, halve the duration, and change the packing."""
    rows = []
    for name in SIZES:
        with Run(folder / f"{name}.h5") as run:
            n, last = run.n_particles, run.n_snapshots
            parts: dict[str, tuple[slice, slice]] = {
                "all": (slice(None), slice(None)),
                "every second bead": (slice(0, n, 2), slice(None)),
                "every fourth bead": (slice(0, n, 4), slice(None)),
                "first half": (slice(None), slice(0, last // 2 + 1)),
                "second half": (slice(None), slice(last // 2, last)),
            }
            for axis in "xz":
                rows += [
                    line(f"{name}, {part}", judged(run, f"position.{axis}", FLOWS[name](), *slices, strides=WIDE))
                    for part, slices in parts.items()
                ]
    for name in SEEDS:
        with Run(folder / f"{name}.h5") as run:
            rows += [line(name, judged(run, f"position.{axis}", FLOWS[name](), strides=WIDE)) for axis in "xz"]
    head = ["run", "variable", "snapshots", "n_lr", "n_c", "K_f at 4 Δt", "Δτ at K_f = 2", "at K_f = 1", "at T1 = 1.10"]
    return table(head, rows)


def networks_table(folder: Path) -> str:
    """Train the multilayer network on position.x of two runs at two Δτ each, beside the spline."""
    rows = []
    for name, strides in NETWORK_STRIDES.items():
        with Run(folder / f"{name}.h5") as run:
            asked = [float(f"{k * run.interval:.12g}") for k in strides] if run.interval else []
            answer = compare(
                run, ["position.x"], asked, ["spline", "mlp"], precisions=[], training_seconds=TRAINING_SECONDS
            )
            known = {case["interval"]: case for case in judged(run, "position.x", FLOWS[name]())}
        for interval in asked:
            case = min(known.values(), key=lambda one: abs(one["interval"] - interval))
            errors = {
                row["surrogate"]: row["rmse"]
                for row in answer["rows"]
                if (row["interval"], row["modes"], row["basis"]) == (interval, case["n_lr"], PLAIN)
            }
            ratios = [f"{errors[who] / promised(case):.2f}" for who in ("spline", "mlp")]
            rows.append([name, str(case["stride"]), f"{case['K_f']:.2f}", *ratios])
    return table(["run", "Δτ/Δt", "K_f", "spline, E/E_train at n_lr", "mlp"], rows)


def provoked_table(folder: Path) -> str:
    """Sample a box that is shaken too gently for its beads to fly, ever more coarsely."""
    with Run(folder / f"{PROVOKED}.h5") as run:
        cases = judged(run, "position.z", FLOWS[PROVOKED](), strides=PROVOKED_STRIDES)
        add_errors_(cases, run, "position.z")
    rows = []
    for case in cases:
        best = min(case["errors"], key=lambda name: case["errors"][name]["n_lr"])
        R_a = "–" if case["R_a"] is None else f"{case['R_a']:.2f}"
        numbers = [str(case[what]) for what in ("n_snapshots", "n_lr", "n_c")]
        errors = [f"{spline_breach(case):.2f}", f"{breach(case):.2f}, {best}"]
        K_f = f"{case['K_f'] or 0:.2f}"
        rows.append([f"{case['in_unit_of_flow']:g} %", *numbers, K_f, R_a, case["verdict"], *errors])
    head = [
        "Δτ, of a period",
        "snapshots",
        "n_lr",
        "n_c",
        "K_f",
        "R_a",
        "our verdict",
        "E/E_train at n_lr, spline",
        "best",
    ]
    return table(head, rows)


def speeds_table(folder: Path) -> str:
    """Return how fast the beads of every run move: RMS over beads and snapshots, and the path in a dense interval."""
    rows = []
    for name in FLOWS:
        with Run(folder / f"{name}.h5") as run:
            speed = float(np.sqrt(3 * np.square(run.variable("velocity")[:], dtype=np.float64).mean()))
            dense = (run.times[-1] - run.times[0]) / (run.n_snapshots - 1)
            path = speed * dense / (2 * float(run.radius.mean()))
            rows.append([name, str(run.n_particles), f"{1e3 * dense:.4g}", f"{speed:.2f}", f"{path:.2f}"])
    return table(["run", "beads", "Δt, ms", "RMS speed, m/s", "path in Δt, d"], rows)


def quoted_table(cases: Sequence[Case]) -> str:
    """Return the figures that the text quotes: quantiles 10, 50, 90 % and the largest."""
    positions = [case for case in cases if kind_of(case) == "position"]
    consistent = [case for case in positions if (case["K_f"] or 0.0) >= 1]
    near = [case for case in positions if 1.6 <= (case["K_f"] or 0.0) <= 2.4]
    missed = [case for case in cases if case["sufficient"] and not keeps_promise_up_to_n_c(case)]
    figures = {
        "n_c / snapshots, positions": [case["n_c"] / case["n_snapshots"] for case in positions],
        "E(spline, n_lr) / E_gap(n_lr), positions with K_f ≥ 1": [
            curve(case, "spline", case["n_lr"]) / curve(case, "E_gap", case["n_lr"]) for case in consistent
        ],
        "energy at unseen times, spline on n_c modes, positions with K_f 1.6 to 2.4": [
            1 - (curve(case, "spline", case["n_c"]) / case["deviation"]) ** 2 for case in near
        ],
        "E(s, n_c) / E_train(n_c) where K_f ≥ 2 and T2 is missed": [
            least_error(case, ["n_c"]) / curve(case, "E_train", case["n_c"]) for case in missed
        ],
        "R_a of these": [case["R_a"] for case in missed],
    }
    rows = [
        [what, str(len(values)), *(f"{x:.5g}" for x in np.quantile(values, [0.1, 0.5, 0.9, 1.0]))]
        for what, values in figures.items()
        if values
    ]
    of_fields = Counter(f"{case['run']}, {case['variable']}" for case in missed)
    listed = "; ".join(f"{place} {count}" for place, count in of_fields.items())
    return table(["figure", "cases", "10 %", "50 %", "90 %", "largest"], rows) + f"\nT2 is missed in: {listed}\n"


EXTRAS: dict[str, Callable[[Path], str]] = {
    "Speeds": speeds_table,
    "Beads, duration, packing": sizes_table,
    "A box made to deceive the rule, position.z": provoked_table,
    "Networks, a sample": networks_table,
}
