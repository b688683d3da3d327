"""Every surrogate and baseline on the snapshots between the training snapshots: error against cost."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from pod import InputError as UnfitSnapshots
from selection.errors import InputError as UnfitIntervals
from selection.intervals import Subset, candidates, dense_interval
from selection.tradeoff import pareto_front
from suffice.choice import Limits, cheapest, check_limits
from suffice.making import is_trained, made
from suffice.reconstruction import (
    Array,
    Case,
    Reconstruction,
    Reduced,
    consistent_level,
    measure_reconstruction,
    modal,
    projection_errors,
    raw,
    reduce,
)
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.uneven import unfit
from suffice.variables import default_variables, held, held_rates, mean_diameter
from suffice.winners import winners
from surrogates import SURROGATES
from surrogates import InputError as UnfitSeries

CONSISTENCY = 1.05  # of R_c up to n_c
COSTS = ("single_seconds", "storage_bytes")

Table = list[dict[str, Any]]


class Comparison(NamedTuple):
    """The three tables of the answer, as they grow."""

    rows: Table
    bases: Table
    left_out: Table


class Place(NamedTuple):
    """Which variable at which Δτ, in which units."""

    variable: str
    interval: float  # s
    unit: str
    diameter: float | None  # m


class Effort(NamedTuple):
    """How networks are trained."""

    seed: int
    seeds: int
    max_seconds: float | None


class Level(NamedTuple):
    """A number of modes, its projection errors (u,), and the seconds that reconstruction adds to any surrogate."""

    n: int
    floor: Array
    seconds: tuple[float, float]  # of one snapshot alone, and of each among many


def compare(
    run: Run,
    variables: Sequence[str] | None = None,
    intervals: Sequence[float] | None = None,
    surrogates: Sequence[str] | None = None,
    *,
    max_error: float | None = None,
    error_unit: str = "m",
    max_seconds: float | None = None,
    energy: float = 0.999,
    seed: int = 0,
    seeds: int = 1,
    training_seconds: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Train every surrogate at every Δτ and reconstruct the dense snapshots in between; plain types, ready for JSON.

    variables: names, default the components of position and velocity. intervals: Δτ in s, default ten to two dense
    intervals. surrogates: names in `SURROGATES`, default all that answer between snapshots and need no training. Each
    is fitted with n_lr modes (the least that hold `energy`), with n_c (R_c up to 1.05) and with all; raw baselines have
    no modes. Networks are trained with `seeds` seeds from `seed` on, each for `training_seconds` at most. max_error:
    RMSE, in `error_unit`, a unit of the run or "d" for particle diameters; max_seconds: to reconstruct one snapshot.
    progress is called with (done, all).

    The answer holds `rows`, one per variable, Δτ, surrogate and n; `bases`, the decompositions and their cost;
    `left_out` with reasons; and with a limit `choice`, per variable the cheapest row that keeps it, or the closest.
    Errors are in the variable's unit: RMSE over the rows, mean over the unseen times. `projection_rmse` is the floor of
    the same n; for raw baselines that of all modes, which they may well undercut (then `ratio_to_floor` is below 1).
    Raises `Refusal` for unknown names, a Δτ that is no multiple of the dense interval or leaves nothing to predict, too
    few snapshots, limits that cannot be applied, or when nothing at all can be compared.
    """
    names = known_surrogates(surrogates)
    asked = default_variables(run) if variables is None else list(dict.fromkeys(variables))
    diameter, limits = mean_diameter(run), Limits(max_error, error_unit, max_seconds)
    if not 0 < energy <= 1:
        raise Refusal(f"energy is {energy:g}; it must be a share above 0 and at most 1, for example 0.999")
    check_limits(limits, {run.variable(name).unit for name in asked}, diameter)
    subsets = _subsets(run, intervals)
    if seeds < 1:
        raise Refusal(f"seeds is {seeds}; give at least 1")
    found, effort = Comparison([], [], []), Effort(seed, seeds, training_seconds)
    _compare_all(found, run, (asked, subsets, names), (energy, effort), progress)
    if not found.rows:
        raise Refusal(f"nothing can be compared: {found.left_out[0]['reason']}")
    mark_fronts(found.rows)
    return {
        "task": "between",
        "kind": "time",
        "dense_interval": dense_interval(run.times),
        "energy": energy,
        "seed": seed,
        "seeds": seeds,
        "diameter": diameter,
        **found._asdict(),
        "winners": winners(found.rows),
        "limits": limits._asdict(),
        "choice": {name: cheapest(name, found.rows, limits, diameter) for name in asked} if limits.any else {},
    }


def _compare_all(
    found: Comparison,
    run: Run,
    asked: tuple[Sequence[str], Sequence[Subset], Sequence[str]],
    how: tuple[float, Effort],
    progress: Callable[[int, int], None] | None,
) -> None:
    """Add every case to the tables. asked: variables, training sets and surrogates."""
    variables, subsets, names = asked
    for i, name in enumerate(variables):
        values, rates = held(run, name), held_rates(run, name, names)
        for j, subset in enumerate(subsets):
            if progress:
                progress(i * len(subsets) + j, len(variables) * len(subsets))
            unseen = np.setdiff1d(subset.testing, subset.training)
            place = Place(name, subset.interval, run.variable(name).unit, mean_diameter(run))
            _compare_case(found, Case(values, rates, run.times, subset.training, unseen), place, names, how)
    if progress:
        progress(len(variables) * len(subsets), len(variables) * len(subsets))


def known_surrogates(asked: Sequence[str] | None) -> list[str]:
    """Return the surrogates to compare, default all that answer between snapshots and need no training.

    Raises `Refusal` for a name that is not among those that answer between snapshots, or for none.
    """
    known = [name for name, member in SURROGATES.items() if member.bridges]
    if asked is None:
        return [name for name in known if not is_trained(name)]
    for name in asked:
        if name not in known:
            raise Refusal(f"surrogate {name!r} is not known here; use {', '.join(known)}")
    if not asked:
        raise Refusal(f"surrogates: none is named; use {', '.join(known)}, or leave the list out for all")
    return list(dict.fromkeys(asked))


def _subsets(run: Run, intervals: Sequence[float] | None) -> list[Subset]:
    """Training and testing sets of every Δτ, coarse to fine."""
    try:
        subsets = candidates(run.times, intervals)
    except UnfitIntervals as error:
        raise unfit(run, error) from None
    for subset in subsets:
        if len(subset.testing) == len(subset.training):
            raise Refusal(
                f"interval: {subset.interval:g} s is the dense interval of {run.path}, which leaves no snapshot to "
                f"predict; take at least {2 * subset.interval:g} s"
            )
    return subsets


def _compare_case(found: Comparison, case: Case, place: Place, names: Sequence[str], how: tuple[float, Effort]) -> None:
    """Add what one variable at one Δτ has to say to the tables. how: energy that n_lr modes hold, and the effort."""
    energy, effort = how
    try:
        reduced = reduce(case, energy)
    except UnfitSnapshots as error:
        found.left_out.append(_omission(place, None, f"{place.variable}: {error}"))
        return
    basis, label = reduced.basis, {**_label(place), "n_snapshots": len(case.training)}
    n_c = consistent_level(reduced, case, CONSISTENCY)
    counts = {"n_lr": basis.n_lr, "n_c": n_c, "modes": basis.modes.shape[1], "seconds": reduced.seconds}
    found.bases.append({**label, **counts, "reason": basis.reason})
    levels = _levels(reduced, case, n_c)
    for name in names:
        if SURROGATES[name].needs_rates and case.rates is None:
            reason = f"{name} needs the derivative of {place.variable}, which the run does not hold"
            found.left_out.append(_omission(place, name, reason))
            continue
        try:
            for ones, floor in _tried(name, reduced, case, levels, effort):
                found.rows.append({**label, **_figures(ones[0], floor, case, place), **_over_seeds(ones, floor, place)})
        except UnfitSeries as error:
            found.left_out.append(_omission(place, name, f"{name}: {error}"))


def _label(place: Place) -> dict[str, Any]:
    return {"variable": place.variable, "interval": place.interval, "unit": place.unit}


def _omission(place: Place, surrogate: str | None, reason: str) -> dict[str, Any]:
    return {"variable": place.variable, "interval": place.interval, "surrogate": surrogate, "reason": reason}


def _levels(reduced: Reduced, case: Case, n_c: int) -> list[Level]:
    """Numbers of modes to compare at, n_lr, n_c if that is more, and all, with what each number has in common."""
    full = reduced.basis.modes.shape[1]
    least = reduced.basis.n_lr or full
    return [
        Level(
            n,
            projection_errors(reduced, case, n),
            measure_reconstruction(reduced.basis, reduced.coefficients[case.unseen, :n]),
        )
        for n in sorted({least, max(n_c, least), full})  # fewer than n_lr are not enough, consistent or not
    ]


def _tried(
    name: str, reduced: Reduced, case: Case, levels: Sequence[Level], effort: Effort
) -> Iterator[tuple[list[Reconstruction], Array]]:
    """Each way of using this surrogate, once for every seed, with the projection error that it is held against."""
    if SURROGATES[name].raw:
        yield [raw(name, case)], levels[-1].floor
        return
    seeds = range(effort.seed, effort.seed + (effort.seeds if is_trained(name) else 1))
    for n, floor, seconds in levels:
        yield [modal(made(name, seed, effort.max_seconds), reduced, case, n, seconds) for seed in seeds], floor


def _over_seeds(ones: Sequence[Reconstruction], floor: Array, place: Place) -> dict[str, Any]:
    """Return what several seeds change in a row: the errors are means, and that of each seed stands beside them."""
    if not ones[0].remark:
        return {}
    errors = [float(one.errors.mean()) for one in ones]
    mean, least, found = sum(errors) / len(errors), float(floor.mean()), {"remark": ones[0].remark, "seeds": errors}
    in_diameters = mean / place.diameter if place.diameter is not None and place.unit == "m" else None
    ratio = mean / least if least > 0 else None
    return found | {"rmse": mean, "rmse_diameters": in_diameters, "ratio_to_floor": ratio}


def _figures(one: Reconstruction, floor: Array, case: Case, place: Place) -> dict[str, Any]:
    """Errors and costs of one row, in plain types."""
    rmse, least = float(one.errors.mean()), float(floor.mean())
    worst = int(one.errors.argmax())
    return {
        "surrogate": one.surrogate,
        "modes": one.modes,
        "rmse": rmse,
        "rmse_diameters": rmse / place.diameter if place.diameter is not None and place.unit == "m" else None,
        "worst_rmse": float(one.errors[worst]),
        "worst_time": float(case.times[case.unseen[worst]]),
        "projection_rmse": least,
        "ratio_to_floor": rmse / least if least > 0 else None,
        "fit_seconds": one.fit_seconds,
        "single_seconds": one.single_seconds,
        "batch_seconds": one.batch_seconds,
        "storage_bytes": one.storage_bytes,
    }


def mark_fronts(rows: Table) -> None:
    """Mark the rows that none of the same variable beats in error and in each cost."""
    for name in {row["variable"] for row in rows}:
        own = [row for row in rows if row["variable"] == name]
        fronts = {cost: pareto_front([row["rmse"] for row in own], [row[cost] for row in own]) for cost in COSTS}
        for i, row in enumerate(own):
            row["on_front"] = {cost: bool(front[i]) for cost, front in fronts.items()}
