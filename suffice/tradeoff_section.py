"""Section of the report: what accuracy costs, every choice of Δτ, surrogate, modes, basis and precision."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from suffice.pareto import Point, Quantity, pareto_figure
from suffice.plots import error_field
from suffice.precision import PRECISIONS
from suffice.section import Section
from suffice.winners import OF_BOTH
from suffice.wording import bytes_text, escape, number, seconds_text

Row = Mapping[str, Any]

COSTS = {
    "storage_bytes": Quantity("storage", bytes_text),
    "single_seconds": Quantity("time for a snapshot", seconds_text),
}
SYMBOLS = {"plain": "circle", "enriched": "diamond", None: "square"}
FINE = 1.1  # errors nearer to each other than that are one step of the table

TEXT = (
    "A mark is one way to keep the snapshots between: a surrogate on some modes of positions (circle) or of positions "
    "and velocities (diamond), or the stored snapshots themselves (square), at one Δτ, in one precision: open where "
    "numbers are kept in fewer bits than those of the run. Lower left is better; no other choice beats those on the "
    "line, all others are pale. The error is against the true snapshots, rounding included; in 8-bit integers a model "
    "keeps its mean, its coefficients and as many leading modes in 16 bits as rounding would show. Seconds are counted "
    "once a model is read."
)


def tradeoff_section(results: Mapping[str, Any]) -> Section | None:
    """Error against bytes and against seconds for each variable, with the choice made; None where none was compared.

    results["compare"]: as `compare` answers.
    """
    compared = results.get("compare") or {}
    by_variable: dict[str, list[Row]] = {}
    for row in compared.get("rows") or []:
        by_variable.setdefault(row["variable"], []).append(row)
    if not by_variable:
        return None
    figures = {name: tradeoff_figure(rows) for name, rows in by_variable.items()}
    sentences = [escape(str(found["sentence"])) for found in (compared.get("choice") or {}).values()]
    chosen = f'<ul class="verdicts">{"".join(f"<li>{text}</li>" for text in sentences)}</ul>' if sentences else ""
    tables = "".join(_front_table(name, rows) for name, rows in by_variable.items())
    below = f"<details><summary>What no other choice beats in bytes, in numbers</summary>{tables}</details>"
    pickers = {"variable": {name: name for name in by_variable}}
    return Section("What accuracy costs", f'{chosen}<p class="quiet">{TEXT}</p>', figures, pickers, below)


def tradeoff_figure(rows: Sequence[Row]) -> dict[str, Any]:
    """Error against bytes to keep and against seconds for a snapshot; a mark per row, a colour per surrogate."""
    field, unit = error_field(rows)
    widest = _widest(rows)
    points = [
        Point(
            row["surrogate"],
            row["surrogate"],
            row[field],
            tuple(row[cost] for cost in COSTS),
            _hover(row),
            SYMBOLS[_basis(row)] + ("-open" if row.get("precision") != widest else ""),
        )
        for row in rows
    ]
    return pareto_figure(points, Quantity(f"error ({unit})"), list(COSTS.values()))


def _basis(row: Row) -> str | None:
    return None if row["modes"] is None else str(row.get("basis") or "plain")


def _widest(rows: Iterable[Row]) -> str | None:
    """Return the precision of the run."""
    known = {row.get("precision") for row in rows}
    return next((name for name in PRECISIONS if name in known), None)


def _modes(row: Row) -> str:
    if row["modes"] is None:
        return "the snapshots themselves"
    return f"{row['modes']} modes" + (OF_BOTH if _basis(row) == "enriched" else "")


def _kept(row: Row) -> str:
    known, fine = PRECISIONS.get(str(row.get("precision"))), row.get("finer_modes")
    return (f" in {known.text}" if known else "") + (f", the first {fine} in 16 bits" if fine else "")


def _hover(row: Row) -> str:
    in_diameters = f" = {number(row['rmse_diameters'])} d" if row.get("rmse_diameters") is not None else ""
    return "\n".join(
        (
            f"{_modes(row)}{_kept(row)}",
            f"Δτ {seconds_text(row['interval'])}, {row['n_snapshots']} snapshots",
            f"error {number(row['rmse'])} {row.get('unit', '')}{in_diameters}, {number(row['ratio_to_floor'])} × floor",
            f"{bytes_text(row['storage_bytes'])}; {seconds_text(row['single_seconds'])} a snapshot",
            f"({seconds_text(row['batch_seconds'])} among many), fitted in {seconds_text(row['fit_seconds'])}",
        )
    )


def _front_table(variable: str, rows: Sequence[Row]) -> str:
    """Tabulate the rows on the front of error and bytes, the most accurate first, one for each step of the error."""
    shown: list[Row] = []
    for row in sorted((r for r in rows if (r.get("on_front") or {}).get("storage_bytes")), key=lambda r: -r["rmse"]):
        if shown and shown[-1]["rmse"] < FINE * row["rmse"]:
            continue
        shown.append(row)
    unit = escape(str(rows[0].get("unit", "")))
    heads = ("Δτ", "modes", "kept as", f"error ({unit})", "× floor", "a snapshot", "to keep")
    head = "".join(f'<th class="number">{text}</th>' for text in heads)
    body = "".join(_table_row(row) for row in reversed(shown))
    table = f'<table class="plain"><tr><th>{escape(variable)}</th>{head}</tr>{body}</table>'
    return f'<div class="scroll">{table}</div>'


def _table_row(row: Row) -> str:
    modes = "–" if row["modes"] is None else str(row["modes"]) + (" + v" if _basis(row) == "enriched" else "")
    cells = (
        seconds_text(row["interval"]),
        modes,
        escape(str(row.get("precision") or "–")),
        number(row["rmse"]),
        number(row.get("ratio_to_floor")),
        seconds_text(row["single_seconds"]),
        bytes_text(row["storage_bytes"]),
    )
    shown = "".join(f'<td class="number">{text}</td>' for text in cells)
    return f"<tr><td>{escape(str(row['surrogate']))}</td>{shown}</tr>"
