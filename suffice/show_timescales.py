"""What own Δτ and ranks are worth, as tables and sentences on a terminal."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.timescales import ALIKE, BY_RULE, COSTS, DERIVED, FINEST, OWN
from suffice.wording import bytes_text, number, seconds_text

Row = Mapping[str, Any]
Level = Mapping[str, Any]


def show_timescales(answer: Mapping[str, Any]) -> None:
    """Print bytes at equal error, errors at equal bytes, contradictions, and who got what at the last level."""
    console, levels = Console(), answer["levels"]
    model = _rows(levels, lambda row: row["cost"] == COSTS[0] or row["strategy"] == BY_RULE)
    data = _rows(levels, partial(_costs, COSTS[1]))
    equal = _rows(levels, lambda row: row["equal_bytes"] is not None)
    truth = number(answer["contradiction_of_truth"])
    for title, rows, cell in (
        ("fewest bytes of the model within the errors at the left", model, lambda row: bytes_text(row[COSTS[0]])),
        ("fewest bytes of training snapshots within the same errors", data, lambda row: bytes_text(row[COSTS[1]])),
        ("least errors within the bytes that one Δτ needs", equal, lambda row: _errors(answer, row["errors"])),
        (f"RMSE of dx/dt - v in m/s; of the run itself {truth}", model, lambda row: number(row["contradiction"])),
    ):
        console.print(_table(answer, title, levels, rows, cell))
    console.print(_parts(model[-1]))
    for sentence in sentences(answer):
        console.print(sentence, highlight=False)


def sentences(answer: Mapping[str, Any]) -> list[str]:
    """Say over all levels what own Δτ and derived velocities save."""
    levels, found = answer["levels"], []
    for cost, what in zip(COSTS, ("model bytes", "bytes of training snapshots"), strict=True):
        rows = _rows(levels, partial(_costs, cost))
        for fewer, more, words in (
            (OWN, ALIKE, "own Δτ instead of the best one for all"),
            (OWN, FINEST, "own Δτ instead of the finest of them for all"),
            (OWN + DERIVED, ALIKE + DERIVED, "with v = dx/dt, own Δτ instead of the best one for all"),
            (OWN + DERIVED, FINEST + DERIVED, "with v = dx/dt, own Δτ instead of the finest of them for all"),
            (ALIKE + DERIVED, ALIKE, "v = dx/dt instead of modes of their own, one Δτ for all"),
        ):
            saved = [
                1.0 - ways[fewer][cost] / ways[more][cost]
                for ways in rows
                if fewer in ways and more in ways and ways[fewer]["kept"] and ways[more]["kept"]
            ]
            if saved:
                found.append(f"{words}: {_span(saved)} fewer {what}.")
    return found


def _costs(cost: str, row: Row) -> bool:
    return bool(row["cost"] == cost)


def _span(shares: Sequence[float]) -> str:
    low, high = (f"{100 * share:.0f}" for share in (min(shares), max(shares)))
    return f"{low} %" if low == high else f"{low} to {high} %"


def _rows(levels: Iterable[Level], wanted: Callable[[Row], bool]) -> list[dict[str, Row]]:
    """Return for every level the rows that are wanted, by strategy."""
    return [{row["strategy"]: row for row in level["rows"] if wanted(row)} for level in levels]


def _shown(rows: Iterable[Mapping[str, Row]]) -> list[str]:
    """Return the ways that have a column; the finest Δτ for all is told in sentences, the table is wide enough."""
    return [way for way in dict.fromkeys(way for found in rows for way in found) if not way.startswith(FINEST)]


def _table(
    answer: Mapping[str, Any],
    title: str,
    levels: Sequence[Level],
    rows: Sequence[Mapping[str, Row]],
    cell: Callable[[Row], str],
) -> Table:
    """One line for every level of error, one column for every way."""
    ways = _shown(rows)
    table = Table("errors", *ways, title=title, padding=(0, 0))
    for level, found in zip(levels, rows, strict=True):
        cells = [cell(found[way]) if way in found and found[way]["kept"] else "–" for way in ways]
        table.add_row(_errors(answer, level["limits"]), *cells)
    return table


def _errors(answer: Mapping[str, Any], errors: Mapping[str, float]) -> str:
    """Return errors of quantities, those of positions in diameters where they are known."""
    units = {name: part["unit"] for row in answer["levels"][0]["rows"] for name, part in row["parts"].items()}
    told, d = [], answer["diameter"]
    for whole, value in errors.items():
        unit = next(unit for name, unit in units.items() if name == whole or name.rpartition(".")[0] == whole)
        told.append(f"{number(value / d)} d" if unit == "m" and d else f"{number(value)} {unit}")
    return "\n".join(told)


def _parts(rows: Mapping[str, Row]) -> Table:
    """Δτ, modes and error of each variable, in every way, at one level."""
    rows = {way: rows[way] for way in _shown([rows])}
    names = list(dict.fromkeys(name for row in rows.values() for name in (*row["parts"], *row["derived"])))
    title = "Δτ, modes and RMSE of each variable at the last of these errors"
    table = Table("variable", *rows, title=title, padding=(0, 0))
    for name in names:
        table.add_row(name, *(_cell(row, name) for row in rows.values()))
    return table


def _cell(row: Row, name: str) -> str:
    if not row["kept"]:
        return "–"
    if name in row["derived"]:
        return f"derived\n{number(row['derived'][name]['rmse'])}"
    part = row["parts"][name]
    error = part["rmse"] if part["rmse_diameters"] is None else part["rmse_diameters"]
    unit = part["unit"] if part["rmse_diameters"] is None else "d"
    return f"{seconds_text(part['interval'])}, {part['modes']}\n{number(error)} {unit}"
