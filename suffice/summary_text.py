"""The summary of a run in words."""

from typing import NamedTuple

from suffice.summary import Clamp, Energy, Guard, Lists, Pace, Summary
from suffice.wording import number, plain_number, seconds_text


class Shown(NamedTuple):
    """How a guard is told: its name, and the unit of its values."""

    name: str
    unit: str


GUARDS = {
    "overlap": Shown("overlap", "radii"),
    "speed": Shown("particle speed", "m/s"),
    "courant": Shown("Courant number", "cells per step"),
    "momentum": Shown("fluid momentum", "tolerances"),
    "continuity": Shown("fluid continuity", "tolerances"),
}
NEARLY_WHOLE = 0.95  # a share from which two digits would hide which side of the whole it is on
UNITS = {name: shown.unit for name, shown in GUARDS.items()}
OUTCOMES = {"done": "done", "limit": "stopped by a limit", "interrupted": "interrupted"}


def summary_rows(summary: Summary) -> list[tuple[str, str]]:
    """Return the names and texts of a summary's lines, those that its scene has."""
    rows = [] if summary.pace is None else [("speed", _pace_text(summary, summary.pace))]
    if summary.energy is not None:
        rows.append(("energy", energy_text(summary.energy)))
    names = sorted(summary.guards, key=[*GUARDS, *summary.guards].index)
    rows += [(guard_name(name), guard_text(name, summary.guards[name])) for name in names]
    if summary.neighbours is not None:
        rows.append(("neighbours", _lists_text(summary.neighbours)))
    rows += [(name, clamp_text(found)) for name, found in summary.clamps.items()]
    total = sum(found.count for found in summary.warnings.values())
    return [*rows, ("warnings", f"{total:,}" if total else "none")]


def summary_figures(summary: Summary) -> dict[str, str]:
    """Return one figure for each of these lines, to stand beside those of other runs.

    Of a guard it is the share of its limit, of the energy what is missed at most of that put in, of the neighbours the
    mean steps between lists, of what is clamped how often.
    """
    shown = {} if summary.pace is None else {"speed": f"{plain_number(summary.pace.steps_per_second)} steps/s"}
    if summary.energy is not None:
        shown["energy"] = percent(summary.energy.largest_residual, summary.energy.put_in)
    shown |= {guard_name(name): percent(found.largest, found.limit) for name, found in summary.guards.items()}
    if summary.neighbours is not None:
        shown["neighbours"] = f"{number(summary.neighbours.mean_steps)} steps"
    shown |= {name: f"{found.count:,} times" for name, found in summary.clamps.items()}
    return {name: shown.get(name, text) for name, text in summary_rows(summary)}


def summary_text(title: str, summary: Summary) -> str:
    """Return a summary as aligned lines; its warnings, each kind with the first of it, come last."""
    rows = summary_rows(summary)
    rows += [("", f"{kind}, {found.count:,}: {found.first}") for kind, found in summary.warnings.items()]
    width = max(len(name) for name, _ in rows)
    head = f"{title}: {OUTCOMES[summary.outcome]} at t = {seconds_text(summary.time)}"
    return "\n".join([head, *(f"  {name:<{width}}  {text}" for name, text in rows)])


def _pace_text(summary: Summary, pace: Pace) -> str:
    steps = f"{summary.steps:,} steps"
    if summary.fluid_steps is not None:
        own = summary.fluid_steps != summary.steps
        steps += f" ({summary.fluid_steps:,} of the fluid)" if own else " of the fluid"
    of = {"particle": pace.particle_steps_per_second, "cell": pace.cell_steps_per_second}
    work = "".join(f", {value / 1e6:.3g} million {name}-steps/s" for name, value in of.items() if value is not None)
    compiled = (
        f"; compiling and loading took {seconds_text(pace.compiling_seconds)} more"
        if pace.compiling_seconds >= 0.5
        else ""
    )
    return (
        f"{steps} in {seconds_text(pace.seconds)}: {plain_number(pace.steps_per_second)} steps/s{work}, "
        f"{plain_number(pace.simulated_ms_per_minute)} ms simulated a minute{compiled}"
    )


def energy_text(energy: Energy) -> str:
    """Say what the energy ledger misses."""
    if not energy.put_in and not energy.largest_residual:
        return "nothing was put in"
    share = percent(energy.residual, energy.put_in)
    most = percent(energy.largest_residual, energy.put_in)
    return (
        f"residual {number(energy.residual, 2)} J, {share} of the {number(energy.put_in)} J put in; "
        f"largest {most} at {seconds_text(energy.largest_at)}"
    )


def guard_name(name: str) -> str:
    """Return what a guard watches; one of a newer version goes by its own name."""
    return GUARDS[name].name if name in GUARDS else name


def guard_text(name: str, guard: Guard) -> str:
    """Say how near to its limit a guard came."""
    largest = "not a number" if guard.largest is None else _value(name, guard.largest, guard.unit)
    limit = "no limit"
    if guard.limit is not None:
        limit = f"{percent(guard.largest, guard.limit)} of the limit of {_value(name, guard.limit, guard.unit)}"
    return f"{largest} at {seconds_text(guard.at)}, {limit}"


def _value(name: str, value: float, unit: str) -> str:
    return f"{number(100.0 * value)} % of the radius" if name == "overlap" else f"{number(value)} {unit}"


def _lists_text(lists: Lists) -> str:
    mean = "" if lists.mean_steps is None else f", {number(lists.mean_steps)} steps apart in the mean"
    return f"listed anew {lists.rebuilds:,} times{mean}"


def clamp_text(clamp: Clamp) -> str:
    """Say how often something was held at a bound."""
    if not clamp.count:
        return f"never at its bound of {number(clamp.bound)}"
    share = percent(clamp.count, clamp.of)
    return f"{clamp.count:,} times held at its bound of {number(clamp.bound)}, {share} of the looks at a cell"


def percent(part: float | None, whole: float | None) -> str:
    """Return what share of a whole a part is, `–` where there is none."""
    if part is None or not whole:
        return "–"
    share = abs(part) / abs(whole)
    return f"{number(100.0 * share, 2 if share < NEARLY_WHOLE else 4)} %"
