"""Which snapshot interval suffices, for every variable of a run."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import floor, inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pod import ALONE, Ranks, SnapshotMatrix
from selection import InputError as UnfitIntervals
from selection import Sweep, Thresholds, dense_interval, judge, square_root
from selection.feasibility import LEAST
from selection.intervals import candidates
from suffice.answers import Selection
from suffice.products import read_products
from suffice.progress import Advance
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.uneven import unfit
from suffice.variables import mean_diameter

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
    for name, low in zip(Thresholds._fields, LEAST, strict=True):
        high = 1.0 if name == "energy" else inf
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
) -> Selection:
    """Judge every Δτ for every variable, in one pass over the rows of each stored quantity (paper 2.3).

    variables: names of the run, components or whole vectors, default the components of all but spins. intervals: Δτ in
    s, default ten to two dense intervals. Of several ranks each reads its own rows.
    Raises Refusal for unknown variables, for times or intervals that cannot be used, and values that are not finite.

    >>> with Run("run.h5") as run:
    ...     select_run(run, ["position.x"], intervals=[0.004, 0.002])["position.x"].chosen_interval
    0.004
    """
    names = list(dict.fromkeys(variables)) if variables else default_variables(run)
    judged = judge_variables(run, names, intervals, thresholds, progress, ranks)
    found = {name: table for name, table, _ in judged}
    return Selection({name: found[name] for name in names})


def judge_variables(
    run: Run,
    names: Sequence[str],
    intervals: Sequence[float] | None,
    thresholds: Mapping[str, float] | None,
    progress: Advance | None,
    ranks: Ranks,
) -> Iterator[tuple[str, Sweep, NDArray[np.float64]]]:
    """Yield the sweep and the inner products of each variable, those of one stored quantity together.

    Raises Refusal as `select_run` does.
    """
    limits = {name: thresholds_of(name, thresholds) for name in names}
    try:
        candidates(run.times, intervals)  # what is wrong with them is said before the rows are read
        for name in names:
            run.variable(name)
        if progress:
            progress(0, len(names))
        for done, (name, products, scarce) in enumerate(read_products(run, names, ranks), start=1):
            factor = partial(_square_root, run, name, products.gram, ranks)
            yield name, judge(products, run.times, intervals, limits[name], factor, scarce=scarce), products.gram
            if progress:
                progress(done, len(names))
    except UnfitIntervals as error:
        raise unfit(run, error) from None


def _square_root(run: Run, name: str, gram: NDArray[np.float64], ranks: Ranks) -> NDArray[np.float64]:
    return square_root(SnapshotMatrix(run.variable(name), ranks=ranks), gram)


def select_json(run: Run, table: dict[str, Sweep]) -> dict[str, Any]:
    """Return the verdicts as `suffice select --json` writes them."""
    return {
        "run": str(run.path),
        "dense_interval": dense_interval(run.times),
        "variables": {name: _in_diameters(run, name, found.as_dict()) for name, found in table.items()},
    }


def _in_diameters(run: Run, name: str, found: dict[str, Any]) -> dict[str, Any]:
    """Add to each candidate its errors in bead diameters, None for other units than m or unknown radii."""
    diameter = mean_diameter(run) if run.variable(name).unit == "m" else None
    for candidate in found["candidates"]:
        for error in ("error_n_lr", "error_n_c"):
            known = diameter is not None and candidate[error] is not None
            candidate[f"{error}_diameters"] = candidate[error] / diameter if known else None
    return found | {"unit": run.variable(name).unit}


def select_curves(table: dict[str, Sweep]) -> dict[str, dict[str, dict[str, list[float | None]]]]:
    """Return the curves against n for plots, by variable and Δτ."""
    return {name: {f"{c.interval:g}": c.curves_as_dict() for c in found.candidates} for name, found in table.items()}
