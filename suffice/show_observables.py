"""Errors in observables on a terminal."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Column, Table

from suffice.wording import number
from suffice.worth import FLOOR, heads_of, shown_error, truth_text

COLUMNS = 6  # of observables in one table


def show_observables(answer: Mapping[str, Any]) -> None:
    """Print what `compare_observables` answered: a row per surrogate, the truth's own values first."""
    console, heads = Console(), heads_of(answer)
    for some in batched(heads, COLUMNS):
        console.print(_table(answer, {name: heads[name] for name in some}))
    for left in answer["left_out"]:
        console.print(
            f"left out: {left['observable'] or left['surrogate']}: {left['reason']}", highlight=False, markup=False
        )
    for note in answer["notes"]:
        console.print(note, highlight=False, markup=False)


def _table(answer: Mapping[str, Any], heads: Mapping[str, str]) -> Table:
    """Return a table of some of the observables, so many that a terminal of 80 columns shows them."""
    described = {name: answer["observables"][name] for name in heads}
    title = f"observables, Δτ = {answer['interval']:g} s, means over {len(answer['times'])} unseen times"
    rmse_head = "RMSE\n(d)" if answer["diameter"] else "RMSE\n(m)"
    shown = [head.replace(" ", "\n") for head in heads.values()]
    table = Table(Column("surrogate", no_wrap=True), "modes", rmse_head, *shown, title=title, padding=(0, 0))
    truth = (truth_text(what).replace(" ", "\n", 1) for what in described.values())
    table.add_row("truth", "", "", *truth, style="italic", end_section=True)
    for row in answer["rows"]:
        rmse = row["rmse_diameters"] if row["rmse_diameters"] is not None else row["rmse"]
        errors = (shown_error(row, name, what) for name, what in described.items())
        style = "dim" if row["surrogate"] == FLOOR else None
        table.add_row(row["surrogate"], number(row["modes"]), number(rmse), *errors, style=style)
    return table


def batched(names: Iterable[str], count: int) -> Iterator[list[str]]:
    """Names in lists of so many, as `itertools.batched` of Python 3.12."""
    left = list(names)
    yield from (left[k : k + count] for k in range(0, len(left), count))
