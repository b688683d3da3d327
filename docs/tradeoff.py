"""Tables of `docs/tradeoff.md` from what `suffice compare RUN --variable V --json FILE` writes.

python docs/tradeoff.py costs.json
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

Rows = Sequence[dict[str, Any]]


def precision_table(rows: Rows) -> str:
    """Compare bytes and error of each precision with those of the run's own, over all ways of keeping the snapshots."""
    ways: dict[tuple[Any, ...], dict[str, dict[str, Any]]] = {}
    for row in rows:
        way = tuple(row[key] for key in ("interval", "surrogate", "basis", "modes"))
        ways.setdefault(way, {})[row["precision"]] = row
    own, *narrower = dict.fromkeys(row["precision"] for row in rows)
    lines = [f"| kept as | storage over {own} | error over {own}: median | largest |", "|---" * 4 + "|"]
    for name in narrower:
        pairs = [(by[name], by[own]) for by in ways.values() if by[own]["rmse"] > 0]
        size = median(one["storage_bytes"] / other["storage_bytes"] for one, other in pairs)
        more = sorted(one["rmse"] / other["rmse"] - 1 for one, other in pairs)
        lines.append(f"| {name} | {size:.2f} | {median(more):+.2%} | {more[-1]:+.2%} |")
    return "\n".join(lines)


def basis_table(rows: Rows) -> str:
    """List errors in diameters and kB: Hermite on plain modes, on as many of both, on all of both, and without any."""
    own = [row for row in rows if row["precision"] == rows[0]["precision"]]
    heads = (
        "Δτ",
        "plain modes",
        "as many of both",
        "all of both",
        "stored snapshots",
        "floor plain",
        "floor all of both",
    )
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for interval in dict.fromkeys(row["interval"] for row in own):
        here = [row for row in own if row["interval"] == interval]
        on = {(row["basis"], row["modes"]): row for row in here if row["surrogate"] == "hermite"}
        most = max(modes for basis, modes in on if basis == "plain")
        all_modes = max(modes for basis, modes in on)
        chosen = [on["plain", most], on["enriched", most], on["enriched", all_modes]]
        chosen += [row for row in here if row["surrogate"] == "raw-hermite"]
        shown = [f"{row['rmse_diameters']:.4f}, {row['storage_bytes'] / 1e3:.0f} kB" for row in chosen]
        unit = chosen[0]["rmse_diameters"] / chosen[0]["rmse"]
        floors = [f"{row['projection_rmse'] * unit:.4f}" for row in (chosen[0], chosen[2])]
        lines.append(f"| {1e3 * interval:g} ms | {' | '.join(shown + floors)} |")
    return "\n".join(lines)


def front_table(rows: Rows, apart: float = 1.1) -> str:
    """List what no other choice beats in error and bytes, one row for each step of so much in the error."""
    lines = ["| error (d) | storage | Δτ | surrogate | modes | kept as |", "|---" * 6 + "|"]
    front = sorted((row for row in rows if row["on_front"]["storage_bytes"]), key=lambda row: -float(row["rmse"]))
    last = float("inf")
    for row in front:
        if last < apart * row["rmse"]:
            continue
        last = row["rmse"]
        modes = "–" if row["modes"] is None else f"{row['modes']}{' of both' * (row['basis'] == 'enriched')}"
        cells = (
            f"{row['rmse_diameters']:.3g}",
            f"{row['storage_bytes'] / 1e3:.0f} kB",
            f"{1e3 * row['interval']:g} ms",
        )
        lines.append(f"| {' | '.join((*cells, row['surrogate'], modes, row['precision']))} |")
    return "\n".join(lines)


def main() -> None:
    """Print the tables of the first variable in the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("costs", type=Path, help="what compare --json wrote")
    rows = json.loads(parser.parse_args().costs.read_text(encoding="utf-8"))["rows"]
    own = [row for row in rows if row["variable"] == rows[0]["variable"]]
    for table in (precision_table, basis_table, front_table):
        print(table(own), end="\n\n")


if __name__ == "__main__":
    main()
