"""Errors in observables on a terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.wording import number
from suffice.worth import FLOOR, heads_of, shown_error


def show_observables(answer: Mapping[str, Any]) -> None:
    """Print what `compare_observables` answered: a row per surrogate, the truth's own values first."""
    console, described = Console(), answer["observables"]
    title = f"observables, Δτ = {answer['interval']:g} s, means over {len(answer['times'])} unseen times"
    table = Table(
        "surrogate", "modes", "RMSE (d)" if answer["diameter"] else "RMSE (m)", *heads_of(answer).values(), title=title
    )
    table.add_row(
        "truth", "", "", *(number(what["truth"]) for what in described.values()), style="italic", end_section=True
    )
    for row in answer["rows"]:
        rmse = row["rmse_diameters"] if row["rmse_diameters"] is not None else row["rmse"]
        errors = (shown_error(row, name, what) for name, what in described.items())
        style = "dim" if row["surrogate"] == FLOOR else None
        table.add_row(row["surrogate"], number(row["modes"]), number(rmse), *errors, style=style)
    console.print(table)
    for left in answer["left_out"]:
        console.print(
            f"left out: {left['observable'] or left['surrogate']}: {left['reason']}", highlight=False, markup=False
        )
    for note in answer["notes"]:
        console.print(note, highlight=False, markup=False)
