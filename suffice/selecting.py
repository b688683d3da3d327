"""Which snapshot interval suffices, for every variable of a run."""

from collections.abc import Mapping, Sequence
from math import floor, inf, isfinite
from typing import Any

from pod import ALONE, Ranks, SnapshotMatrix
from selection import InputError as UnfitIntervals
from selection import Sweep, Thresholds, dense_interval, sweep
from suffice.progress import Advance
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.uneven import unfit

FLUID_ENERGY = 0.99


def default_variables(run: Run) -> list[str]:
    """Return the components of position and of velocity, and the fluid's fields if there are any."""
    return [name for name in run.variables if not name.startswith("angular_velocity")]


def thresholds_of(variable: str, changed: Mapping[str, float] | None = None) -> Thresholds:
    """Return the paper's thresholds, energy 0.999 for particles and 0.99 for the fluid, with those given replaced.

    Raises Refusal for one outside its range.
    """
    energy = {"energy": FLUID_ENERGY} if variable.startswith("fluid.") else {}
    if unknown := set(changed or {}) - set(Thresholds._fields):
        raise Refusal(f"threshold {min(unknown)!r} is not known; there are {', '.join(Thresholds._fields)}")
    limits = Thresholds(**{**energy, **(changed or {})})
    for name, low, high in (("energy", 0.0, 1.0), ("consistency", 1.0, inf), ("feasibility", 0.0, inf)):
        value = getattr(limits, name)
        if not (isfinite(value) and low < value <= high):
            raise Refusal(
                f"--{name} is {value:g}; it must be above {low:g}"
                + (" and finite" if high == inf else " and at most 1")
            )
    return limits


def parse_intervals(text: str) -> list[float]:
    """Return the Δτ (s) of 'coarse:fine:step', of a list with commas, or of a single number.

    Raises Refusal for text that is neither.
    """
    try:
        if ":" not in text:
            return [float(part) for part in text.split(",")]
        first, last, step = (float(part) for part in text.split(":"))
        count = floor(abs(first - last) / step + 1e-9) + 1
        if not (step > 0.0 and first > 0.0 and last > 0.0 and count < 10_000):
            raise ValueError
        sign = -1.0 if first > last else 1.0
        return [round(first + sign * k * step, 12) for k in range(count)]
    except (ValueError, ZeroDivisionError, OverflowError):
        raise Refusal(
            f"--intervals {text!r}: not intervals in s; give coarse:fine:step such as 0.010:0.002:0.001, or a list "
            "such as 0.004,0.002"
        ) from None


def select_run(
    run: Run,
    variables: Sequence[str] | None = None,
    intervals: Sequence[float] | None = None,
    thresholds: Mapping[str, float] | None = None,
    progress: Advance | None = None,
    ranks: Ranks = ALONE,
) -> dict[str, Sweep]:
    """Judge every Δτ for every variable, in one pass over the rows of each (paper 2.3).

    variables: names of the run, default all but spins. intervals: Δτ in s, default ten to two dense intervals. Of
    several ranks each reads its own rows.
    Raises Refusal for unknown variables and for times or intervals that cannot be used.
    """
    names = list(dict.fromkeys(variables)) if variables else default_variables(run)
    sources = [run.variable(name) for name in names]
    table = {}
    for done, (name, rows) in enumerate(zip(names, sources, strict=True)):
        if progress:
            progress(done, len(names))
        try:
            table[name] = sweep(
                SnapshotMatrix(rows, ranks=ranks), run.times, intervals, thresholds_of(name, thresholds)
            )
        except UnfitIntervals as error:
            raise unfit(run, error) from None
    if progress:
        progress(len(names), len(names))
    return table


def select_json(run: Run, table: dict[str, Sweep]) -> dict[str, Any]:
    """Return the verdicts as `suffice select --json` writes them."""
    return {
        "run": str(run.path),
        "dense_interval": dense_interval(run.times),
        "variables": {name: found.as_dict() for name, found in table.items()},
    }


def select_curves(table: dict[str, Sweep]) -> dict[str, dict[str, dict[str, list[float | None]]]]:
    """Return the curves against n for plots, by variable and Δτ."""
    return {name: {f"{c.interval:g}": c.curves_as_dict() for c in found.candidates} for name, found in table.items()}
