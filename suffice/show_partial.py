"""What `select --coarse` and `select --forecast` say on a terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.tables import MARKS
from suffice.wording import number, seconds_text


def show_partial(answer: Mapping[str, Any]) -> None:
    """Print the blocks `coarse` and `forecast` of every variable."""
    variables = answer["variables"]
    if any("coarse" in found for found in variables.values()):
        _show_coarse(variables)
    if any("forecast" in found for found in variables.values()):
        _show_forecast(variables)


def _show_coarse(variables: Mapping[str, Any]) -> None:
    """Bounds of K_f at the recorded Δτ and at twice that, and the verdict on both."""
    console = Console()
    first = next(iter(variables.values()))["coarse"]
    ways = ("recorded", "doubled")
    table = Table("K_f", *(f"Δτ = {seconds_text(first[way]['interval'])}" for way in ways), title="without dense truth")
    for name, found in variables.items():
        table.add_row(name, *(_bounded(found["coarse"][way]) for way in ways))
    console.print(table)
    for name, found in variables.items():
        for way in ways:
            told = found["coarse"][way]
            text = f"{name} at {seconds_text(told['interval'])}: {told['verdict']}: {'; '.join(told['reasons'])}"
            console.print(text, highlight=False, soft_wrap=True)


def _bounded(found: Mapping[str, Any]) -> str:
    between = "–" if found["K_f_range"] is None else " to ".join(number(K_f) for K_f in found["K_f_range"])
    return f"[{MARKS[found['verdict']]}]{between}[/]"


def _show_forecast(variables: Mapping[str, Any]) -> None:
    """Δτ that will suffice, and how many snapshots that is."""
    console = Console()
    first = next(iter(variables.values()))["forecast"]
    title = f"{seconds_text(first['duration'])} foreseen from {seconds_text(first['pilot'])}: Δτ that will suffice"
    table = Table("", "n_lr now", "grows as T^", "expected", "safe", title=title, padding=(0, 0))
    for name, found in variables.items():
        told = found["forecast"]
        growth = told["growth"]
        facts = ("–", "–") if growth is None else (number(growth["n_lr"]), _exponents(growth))
        table.add_row(name, *facts, *(_planned(told, told[f"{way}_interval"]) for way in ("expected", "safe")))
    console.print(table)
    for name, found in variables.items():
        for remark in found["forecast"]["remarks"]:
            console.print(f"{name}: {remark}", highlight=False, soft_wrap=True)


def _exponents(growth: Mapping[str, Any]) -> str:
    return f"{growth['exponent']:.2f} ({growth['least_exponent']:.2f} to 1)"


def _planned(told: Mapping[str, Any], interval: float | None) -> str:
    """Say which Δτ and how many snapshots, or that a finer one is needed than any judged."""
    candidates = told["candidates"]
    if interval is None:
        return f"below {seconds_text(candidates[-1]['interval'])}" if candidates else "–"
    planned = next(c for c in candidates if c["interval"] == interval)
    return f"{seconds_text(interval)}, {planned['n_snapshots']} times"
