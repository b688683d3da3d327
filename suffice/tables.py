"""What commands say on a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.verdicts import promise_text
from suffice.wording import bytes_text, errors_text, number, seconds_text

ENRICHED = "+ v: modes of positions and velocities; bold: no other choice beats it in error and cost"
FOUND = ("in_situ", "kept", "summary")  # parts of an answer on a simulation that are told otherwise
MARKS = {"sufficient": "green", "insufficient": "red", "undecidable": "yellow"}
SECONDS = ("interval", "duration", "times", "window", "time_step", "seconds", "fit_seconds")
UNITS = dict.fromkeys(SECONDS, "s") | {
    "diameter": "m",
    "velocity_rmse": "m/s",
    "rmse_diameters": "d",
    "bytes": "B",
    "storage_bytes": "B",
}
ERRORS = ("rmse", "projection_rmse")  # in the unit of the variable
SIGNS = {"sufficient": "✓", "undecidable": "?"}  # where colours are not seen


def show_selection(answer: Mapping[str, Any]) -> None:
    """Print K_f per variable and Δτ, coloured by verdict, what is left at unseen times, and the Δτ chosen for each."""
    console, variables = Console(), answer["variables"]
    console.print(_indices(variables))
    console.print(_errors(variables))
    for name, found in variables.items():
        console.print(f"{name}: {_chosen(found)}", highlight=False, soft_wrap=True)


def _indices(variables: Mapping[str, Any]) -> Table:
    """Tabulate K_f per variable and Δτ, coloured and marked by verdict."""
    table = _per_interval(variables, "K_f = n_c / n_lr, ✓ sufficient, ? undecidable")
    for name, found in variables.items():
        cells = [(MARKS[c["verdict"]], number(c["K_f"]), SIGNS.get(c["verdict"], "")) for c in found["candidates"]]
        table.add_row(name, *(f"[{colour}]{text}{sign}[/]" for colour, text, sign in cells))
    return table


def _per_interval(variables: Mapping[str, Any], title: str) -> Table:
    """Return an empty table, a column for each Δτ; where the terminal is narrow names are folded, not numbers."""
    table = Table(title=title, padding=(0, 0))
    table.add_column("Δτ (s)", overflow="fold")
    for candidate in next(iter(variables.values()))["candidates"]:
        table.add_column(f"{candidate['interval']:g}", no_wrap=True, overflow="fold")
    return table


def _short(value: Any) -> str:
    """Return two digits of an error in six characters: 0.0012 as it is, 0.00046 as 4.6e-4."""
    text = number(value, 2)
    return text if len(text) <= 6 else f"{value:.1e}".replace("e-0", "e-")


def _errors(variables: Mapping[str, Any]) -> Table:
    """Tabulate the errors of n_lr and of n_c modes at unseen times, in diameters where these are known."""
    table = _per_interval(variables, "error of n_lr modes and of n_c modes at unseen times")
    for name, found in variables.items():
        in_diameters = any(c["error_n_c_diameters"] is not None for c in found["candidates"])
        keys = [f"error_{n}{'_diameters' if in_diameters else ''}" for n in ("n_lr", "n_c")]
        cells = ["\n".join(_short(c[key]) for key in keys) for c in found["candidates"]]
        unit = "diameters" if in_diameters else found["unit"]
        table.add_row(name if unit == "1" else f"{name}\nin {unit}", *cells)
    return table


def show_facts_and_found(title: str, answer: Mapping[str, Any]) -> None:
    """Print facts, and what a simulation was asked to find: K_f per Δτ, when and why it ended, what it kept."""
    told = (*FOUND, "seconds", "particle_steps_per_second") if "summary" in answer else FOUND
    show_facts(title, {name: value for name, value in answer.items() if name not in told})
    console, found, kept = Console(), answer.get("in_situ"), answer.get("kept")
    if found and kept:  # of no other run is every Δτ judged
        console.print(_indices(found["variables"]))
    for sentence in [*(found["sentences"] if found else []), *([kept_sentence(kept)] if kept else [])]:
        console.print(sentence, highlight=False, markup=False, soft_wrap=True)


def kept_sentence(kept: Mapping[str, Any]) -> str:
    """Say how a run was thinned."""
    between = f"{seconds_text(kept['shortest_interval'])} to {seconds_text(kept['longest_interval'])} apart"
    unchecked = kept["unchecked_intervals"]
    doubt = f"; nothing was looked at within {unchecked} of these intervals" if unchecked else ""
    return (
        f"kept {kept['kept']} snapshots, {between}, for {kept['seen']} output times: interpolated positions are within "
        f"{kept['tolerance']:.3g} m (RMSE) wherever the run was looked at{doubt}"
    )


def _chosen(found: Mapping[str, Any]) -> str:
    """Say in one line which Δτ the paper's rule chooses, and what our verdict adds to it."""
    limit = found["thresholds"]["feasibility"]
    chosen = found["chosen_interval"]
    if chosen is None:
        best = max(found["candidates"], key=lambda c: (c["K_f"] or 0.0, -c["interval"]))
        if best["K_f"] is None:
            return f"undecidable at any Δτ considered: {'; '.join(best['reasons'])}"
        promise = promise_text(found)
        best_text = f"best K_f {number(best['K_f'])} at {best['interval']:g} s"
        if best["verdict"] == "undecidable":
            best_text += f" (undecidable: {best['reasons'][0]})"
        return f"not sufficient at any Δτ considered; {best_text}{promise and '; ' + promise}"
    candidate = next(c for c in found["candidates"] if c["interval"] == chosen)
    index = f"K_f {number(candidate['K_f'])} ≥ {limit:g}"
    suffices = f"Δτ = {chosen:g} s suffices ({index})"
    if candidate["verdict"] != "sufficient":
        rule = f"{candidate['verdict']}: Δτ = {chosen:g} s by the paper's rule alone ({index})"
        suffices = f"{rule}, but {'; '.join(candidate['reasons'])}"
    left = f"{candidate['n_lr']} … {candidate['n_c']} modes leave {errors_text(candidate, found['unit'])}"
    promise = promise_text(found)
    return f"{suffices}; {left}{promise and '; ' + promise}"


def show_comparison(answer: Mapping[str, Any]) -> None:
    """Print error and cost of every surrogate, one table per variable and Δτ, the Pareto front marked.

    Of the narrower precisions only what stands on a front is shown.
    """
    console = Console()
    widest = _widest(answer["rows"])
    for base in (base for base in answer["bases"] if base["basis"] == "plain"):
        rows = [r for r in answer["rows"] if (r["variable"], r["interval"]) == (base["variable"], base["interval"])]
        rows = [r for r in rows if r["precision"] == widest[r["variable"]] or any(r["on_front"].values())]
        title = f"{base['variable']}, Δτ = {base['interval']:g} s"
        heads = ("surrogate", "modes", "kept as", f"RMSE ({base['unit']})", "in d", "× floor", "snapshot", "storage")
        table = Table(*heads, title=title, padding=(0, 0), caption=ENRICHED if _has_enriched(rows) else None)
        for r in sorted(rows, key=lambda r: float(r["rmse"])):
            table.add_row(
                r["surrogate"],
                number(r["modes"]) + (" + v" if r["basis"] == "enriched" else ""),
                r["precision"],
                number(r["rmse"]),
                number(r["rmse_diameters"]),
                number(r["ratio_to_floor"]),
                seconds_text(r["single_seconds"]),
                bytes_text(r["storage_bytes"]),
                style="bold" if any(r["on_front"].values()) else None,
            )
        console.print(table)
    for r in (r for r in answer["rows"] if r.get("remark") and r["precision"] == widest[r["variable"]]):
        place = f"{r['variable']}, Δτ = {r['interval']:g} s, {r['surrogate']} on {r['modes']} modes"
        console.print(f"{place}: {r['remark']}", highlight=False)
    for found in [*answer.get("winners", []), *answer["choice"].values()]:
        console.print(found["sentence"], highlight=False)


def _has_enriched(rows: Sequence[Mapping[str, Any]]) -> bool:
    return any(row["basis"] == "enriched" for row in rows)


def _widest(rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return for each variable the precision of the run, which its first row is in."""
    found: dict[str, str] = {}
    for row in rows:
        found.setdefault(row["variable"], row["precision"])
    return found


def show_combined(title: str, card: Mapping[str, Any]) -> None:
    """Print what a combined model is made of, a line for each variable, and then its other facts."""
    table = Table("variable", "Δτ", "modes", "n_lr", "n_c", "RMSE", "diameters", "storage", padding=(0, 0))
    for name, part in card["parts"].items():
        table.add_row(
            name,
            seconds_text(part["interval"]),
            *(number(part[key]) for key in ("n_modes", "n_lr", "n_c")),
            f"{number(part['rmse'])} {part['unit']}",
            number(part["rmse_diameters"]),
            bytes_text(part["storage_bytes"]),
        )
    for name, told in card["derived"].items():
        table.add_row(name, "d/dt", *[""] * 3, f"{number(told['rmse'])} {told['unit']}", "", "none")
    facts = {key: card[key] for key in ("run", "surrogate", "window") if key in card}
    kept = {f"limit in {unit}": value for unit, value in card.get("limits", {}).items()}
    show_facts(title, {**facts, **kept, "storage": bytes_text(card.get("storage_bytes"))})
    Console().print(table)


def show_facts(title: str, facts: Mapping[str, Any]) -> None:
    """Print names and values with their units, one a line."""
    console = Console()
    console.print(title, style="bold", highlight=False, markup=False)
    width = max((len(name) for name in facts), default=0)
    for name, value in facts.items():
        if isinstance(value, Mapping):
            text = ", ".join(f"{key}: {_plain(one)}" for key, one in value.items())
        elif isinstance(value, Sequence) and not isinstance(value, str):
            text = ", ".join(map(_plain, value))
        else:
            text = _plain(value)
        if value not in (None, "") and (unit := facts.get("unit") if name in ERRORS else UNITS.get(name)):
            text += f" {unit}"
        for k, line in enumerate(text.splitlines() or [""]):
            console.print(
                f"  {(name if k == 0 else ''):<{width}}  {line}", highlight=False, markup=False, soft_wrap=True
            )


def _plain(value: Any) -> str:
    """Return a value as people write it: 0.003, not 0.0029999999999999996."""
    return f"{value:.6g}" if isinstance(value, float) else "–" if value is None else str(value)
