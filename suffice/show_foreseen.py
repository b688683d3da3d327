"""Errors in observables beyond the window, on a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.watched import FLOOR
from suffice.wording import number


def show_foreseen(answer: Mapping[str, Any]) -> None:
    """Print what `observe_beyond` answered: a table per observable that any surrogate errs in, the truth first."""
    console, rows = Console(), answer["rows"]
    in_diameters = bool(answer["diameter"])
    errors = [(row, row["rmse_diameters" if in_diameters else "rmse"]) for row in rows]
    console.print(_table(f"RMSE of positions ({'d' if in_diameters else 'm'})", answer, None, errors, ""))
    exact = []
    for name, what in answer["observables"].items():
        found = [(row, row["errors"][name]) for row in rows]
        if not any(error for _, curve in found for error in curve):
            exact.append(what["text"])
            continue
        unit = f" ({what['error_unit']})" if what["error_unit"] != "1" else ""
        truths = None if what["error"] == "relative" else what["truths"]
        console.print(_table(f"{what['text']}: error{unit}", answer, truths, found, "" if what["profile"] else "+"))
    console.print(
        f"Δτ = {answer['interval']:g} s, from the end of training at {answer['train_end']:g} s on {answer['modes']} "
        f"modes; {FLOOR}: exact coefficients, the start kept.",
        highlight=False,
    )
    if exact:
        console.print(f"no error: {'; '.join(exact)}", highlight=False, markup=False)
    for left in answer["left_out"]:
        what = left["observable"]
        console.print(
            f"left out: {what}: {left['reason']}" if what else f"left out: {left['reason']}",
            highlight=False,
            markup=False,
        )
    for note in answer["notes"]:
        console.print(note, highlight=False, markup=False)


def _table(
    title: str,
    answer: Mapping[str, Any],
    truths: Sequence[float | None] | None,
    found: Sequence[tuple[Mapping[str, Any], Sequence[float | None]]],
    sign: str,
) -> Table:
    table = Table("surrogate", *(f"+{h}" for h in answer["horizons"]), title=title, padding=(0, 1))
    if truths is not None:
        table.add_row("truth", *map(number, truths), style="italic", end_section=True)
    for row, curve in found:
        lost = [error is None for error in row["rmse"]]
        cells = ("lost" if gone else _signed(error, sign) for gone, error in zip(lost, curve, strict=True))
        table.add_row(row["surrogate"], *cells, style="dim" if row["surrogate"] == FLOOR else None)
    return table


def _signed(error: float | None, sign: str) -> str:
    return f"{error:{sign}.3g}" if error else number(error)
