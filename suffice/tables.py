"""What commands say on a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.wording import bytes_text, errors_text, number, seconds_text

MARKS = {"sufficient": "green", "insufficient": "red", "undecidable": "yellow"}


def show_selection(answer: Mapping[str, Any]) -> None:
    """Print K_f per variable and Δτ, coloured by verdict, what is left at unseen times, and the Δτ chosen for each."""
    console = Console()
    variables = answer["variables"]
    intervals = [c["interval"] for c in next(iter(variables.values()))["candidates"]]
    table = Table("Δτ (s)", *(f"{interval:g}" for interval in intervals), title="K_f = n_c / n_lr", padding=(0, 0))
    for name, found in variables.items():
        table.add_row(name, *(f"[{MARKS[c['verdict']]}]{number(c['K_f'])}[/]" for c in found["candidates"]))
    console.print(table)
    left = "error of n_lr modes and of n_c modes at unseen times"
    table = Table("Δτ (s)", *(f"{interval:g}" for interval in intervals), title=left, padding=(0, 0))
    for name, found in variables.items():
        in_diameters = any(c["error_n_c_diameters"] is not None for c in found["candidates"])
        keys = [f"error_{n}{'_diameters' if in_diameters else ''}" for n in ("n_lr", "n_c")]
        cells = ["\n".join(number(c[key], 2) for key in keys) for c in found["candidates"]]
        unit = "diameters" if in_diameters else found["unit"]
        table.add_row(name if unit == "1" else f"{name}\nin {unit}", *cells)
    console.print(table)
    for name, found in variables.items():
        console.print(f"{name}: {_chosen(found)}", highlight=False, soft_wrap=True)


def _chosen(found: Mapping[str, Any]) -> str:
    """Say in one line which Δτ the paper's rule chooses, and what our verdict adds to it."""
    limit = found["thresholds"]["feasibility"]
    chosen = found["chosen_interval"]
    if chosen is None:
        best = max(found["candidates"], key=lambda c: c["K_f"] or 0.0)
        return f"not sufficient at any Δτ considered; best K_f {number(best['K_f'])} at {best['interval']:g} s"
    candidate = next(c for c in found["candidates"] if c["interval"] == chosen)
    doubt = (
        ""
        if candidate["verdict"] == "sufficient"
        else f"; but {candidate['verdict']}: {'; '.join(candidate['reasons'])}"
    )
    left = f"{candidate['n_lr']} … {candidate['n_c']} modes leave {errors_text(candidate, found['unit'])}"
    return f"Δτ = {chosen:g} s suffices (K_f {number(candidate['K_f'])} ≥ {limit:g}); {left}{doubt}"


def show_comparison(answer: Mapping[str, Any]) -> None:
    """Print error and cost of every surrogate, one table per variable and Δτ, the Pareto front marked."""
    console = Console()
    for base in answer["bases"]:
        rows = [r for r in answer["rows"] if (r["variable"], r["interval"]) == (base["variable"], base["interval"])]
        title = f"{base['variable']}, Δτ = {base['interval']:g} s"
        table = Table("surrogate", "modes", "RMSE", "diameters", "over floor", "one snapshot", "storage", title=title)
        for r in sorted(rows, key=lambda r: float(r["rmse"])):
            table.add_row(
                r["surrogate"],
                number(r["modes"]),
                f"{number(r['rmse'])} {r['unit']}",
                number(r["rmse_diameters"]),
                number(r["ratio_to_floor"]),
                seconds_text(r["single_seconds"]),
                bytes_text(r["storage_bytes"]),
                style="bold" if any(r["on_front"].values()) else None,
            )
        console.print(table)
    for r in (r for r in answer["rows"] if r.get("remark")):
        place = f"{r['variable']}, Δτ = {r['interval']:g} s, {r['surrogate']} on {r['modes']} modes"
        console.print(f"{place}: {r['remark']}", highlight=False)
    for found in [*answer.get("winners", []), *answer["choice"].values()]:
        console.print(found["sentence"], highlight=False)


def show_facts(title: str, facts: Mapping[str, Any]) -> None:
    """Print names and values, one a line."""
    console = Console()
    console.print(title, style="bold", highlight=False, markup=False)
    width = max((len(name) for name in facts), default=0)
    for name, value in facts.items():
        several = isinstance(value, Sequence) and not isinstance(value, str)
        text = ", ".join(map(_plain, value)) if several else _plain(value)
        for k, line in enumerate(text.splitlines() or [""]):
            console.print(
                f"  {(name if k == 0 else ''):<{width}}  {line}", highlight=False, markup=False, soft_wrap=True
            )


def _plain(value: Any) -> str:
    """Return a value as people write it: 0.003, not 0.0029999999999999996."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
