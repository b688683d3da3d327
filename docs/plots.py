"""The plot and the tables of README, from the results of a study.

    python docs/plots.py mini/results.json docs

Writes `feasibility.svg` and prints the tables. Needs matplotlib.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

mpl.use("svg")

INK, FAINT, PAPER = "#1d2733", "#8a94a3", "#fbfbfc"  # an opaque ground: the same on a light page and on a dark one
STYLE = {
    "figure.facecolor": PAPER,
    "axes.facecolor": PAPER,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "font.size": 10,
    "lines.linewidth": 1.8,
    "lines.markersize": 4.5,
    "svg.hashsalt": "suffice",  # the same results give the same file
}
VARIABLES = {  # colour, label, candidate that it stands at (-1 the finest), its offset in points
    "position.x": ("#0b6e99", "x", -1, (-10, 2)),
    "position.y": ("#4aa3c7", "y", -1, (-10, -2)),
    "position.z": ("#d1622b", "z, along the axis", 5, (0, 10)),
    "velocity.x": ("#9aa3af", "velocities", 1, (0, 10)),
    "velocity.y": ("#9aa3af", "", 0, (0, 0)),
    "velocity.z": ("#9aa3af", "", 0, (0, 0)),
}
MODELS = {  # surrogate, whether with all modes: colour, line, label
    ("spline", False): ("#d1622b", "-", "spline, $n_{lr}$ modes"),
    ("raw-linear", True): ("#9aa3af", "--", "linear, no modes"),
    ("spline", True): ("#4aa3c7", "-", "spline, all modes"),
    ("hermite", True): ("#0b6e99", "-", "Hermite, all modes"),
    ("raw-hermite", True): ("#1d2733", "--", "Hermite, no modes"),
}


def draw_feasibility(ax: Axes, variables: dict[str, Any]) -> None:
    """K_f against Δτ; a ring where the data cannot tell."""
    limit = next(iter(variables.values()))["thresholds"]["feasibility"]
    ax.axhline(limit, color=INK, linewidth=0.9, linestyle=":")
    ax.text(10.2, limit + 0.05, "sufficient above", ha="right", fontsize=9)
    for name, (colour, label, at, offset) in VARIABLES.items():
        found = variables[name]["candidates"]
        ax.plot([1e3 * c["interval"] for c in found], [c["K_f"] for c in found], "o-", color=colour)
        doubtful = [c for c in found if c["verdict"] == "undecidable"]
        ax.plot([1e3 * c["interval"] for c in doubtful], [c["K_f"] for c in doubtful], "o", color=colour, mfc=PAPER)
        place = (1e3 * found[at]["interval"], found[at]["K_f"])
        ax.annotate(label, place, offset, textcoords="offset points", color=colour, ha="center", va="center")
    ax.set(xlabel="snapshot interval Δτ (ms)", title="$K_f$: does Δτ suffice?", xlim=(0, 10.3), ylim=(0, None))


def of_positions_alone(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows in the precision of the run, the first, without modes of positions and velocities."""
    return [row for row in rows if row["precision"] == rows[0]["precision"] and row["basis"] != "enriched"]


def series(rows: Sequence[dict[str, Any]], surrogate: str, all_modes: bool) -> list[tuple[float, float]]:
    """Δτ (ms) and error (diameters) of one surrogate, with the fewest or the most modes it was tried with."""
    own = [row for row in rows if row["surrogate"] == surrogate]
    chosen = {}
    for row in sorted(own, key=lambda r: r["modes"] or 0, reverse=not all_modes):
        chosen[row["interval"]] = row
    return [(1e3 * interval, row["rmse_diameters"]) for interval, row in sorted(chosen.items())]


def draw_errors(ax: Axes, rows: Sequence[dict[str, Any]], variable: str) -> None:
    """Error at unseen times against Δτ."""
    own = [row for row in rows if row["variable"] == variable]
    for (surrogate, all_modes), (colour, line, label) in MODELS.items():
        interval, error = zip(*series(own, surrogate, all_modes), strict=True)
        ax.plot(interval, error, "o", linestyle=line, color=colour, label=label)
    ax.set(xlabel="snapshot interval Δτ (ms)", ylabel="RMSE between snapshots (bead diameters)")
    ax.set(title=f"What each choice costs: error of {variable}", xlim=(0, 10.3), ylim=(0, None))
    ax.legend(frameon=False, fontsize=9)


def feasibility_table(variables: dict[str, Any]) -> str:
    """K_f = n_c / n_lr of every Δτ, as Markdown."""
    names = list(VARIABLES)[:4]
    lines = [f"| Δτ | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for candidates in zip(*(variables[name]["candidates"] for name in names), strict=True):
        cells = [f"{c['n_c']}/{c['n_lr']} = {c['K_f']:.2f}{' ✓' * c['sufficient']}" for c in candidates]
        lines.append(f"| {1e3 * candidates[0]['interval']:g} ms | {' | '.join(cells)} |")
    return "\n".join(lines)


def cost_table(rows: Sequence[dict[str, Any]], variable: str, interval: float) -> str:
    """Error and cost of every surrogate of a variable at one Δτ, as Markdown; best first."""
    lines = ["| surrogate | modes | RMSE (d) | over projection | one snapshot | storage |", "|---" * 6 + "|"]
    for row in sorted(rows, key=lambda row: float(row["rmse"])):
        if (row["variable"], row["interval"]) == (variable, interval):
            ratio, microseconds = row["ratio_to_floor"], 1e6 * row["single_seconds"]
            cells = (row["surrogate"], row["modes"] or "–", f"{row['rmse_diameters']:.4f}", f"{ratio:.2f}")
            costs = (f"{microseconds:.0f} µs", f"{row['storage_bytes'] / 1e3:.0f} kB")
            lines.append(f"| {' | '.join(map(str, cells + costs))} |")
    return "\n".join(lines)


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path, help="results.json of a study")
    parser.add_argument("folder", type=Path, help="where the plot is written")
    given = parser.parse_args()
    results = json.loads(given.results.read_text(encoding="utf-8"))
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.4, 4.0), layout="constrained")
        draw_feasibility(left, results["select"]["variables"])
        rows = of_positions_alone(results["compare"]["rows"])
        draw_errors(right, rows, "position.x")
        print(feasibility_table(results["select"]["variables"]), end="\n\n")
        print(cost_table(rows, "position.x", 0.003))
        figure.savefig(given.folder / "feasibility.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
