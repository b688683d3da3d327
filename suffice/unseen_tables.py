"""What `compare --task unseen` says on a terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Column, Table

from suffice.unseen_verdicts import OVERALL
from suffice.wording import number

TITLES = {"phase": "phase averages", "time": "time means"}


def title_of(case: Mapping[str, Any]) -> str:
    """Name a case: what is averaged, and whether fields were scaled by the tip speed."""
    scaled = "as measured" if case["scaling"] == "none" else f"scaled by {case['scaling']}"
    return f"{TITLES[case['average']]}, {scaled}"


def show_unseen(answer: Mapping[str, Any]) -> None:
    """Print the error of every surrogate at the unseen speeds, one table per case, with its floors and sentences."""
    console = Console()
    speeds = ", ".join(f"{rpm:g}" for rpm in answer["held_out"])
    fields = [*answer["fields"], OVERALL]
    for case in answer["cases"]:
        title = f"Error at {speeds} rpm in parts of the spread over speeds: {title_of(case)}"
        heads = [key.replace("_", "\n") for key in fields]
        table = Table(Column("surrogate", no_wrap=True), *heads, title=title, padding=(0, 0))
        for row in sorted(case["rows"], key=lambda row: float(row["errors"][OVERALL])):
            shown = [number(row["errors"][key]) for key in fields]
            shown[-1] = _with_scatter(row["errors"][OVERALL], row["seed_spread"][OVERALL])
            table.add_row(row["surrogate"], *shown)
        for name in ("statistical_floor", "projection_floor"):
            table.add_row(name.replace("_", " "), *(number(case[name][key]) for key in fields), style="dim")
        console.print(table)
        for key in fields:
            console.print(case["sentences"][key], highlight=False, markup=False)


def _with_scatter(error: float, scatter: float) -> str:
    return f"{number(error)}±{number(scatter, 1)}" if scatter else number(error)
