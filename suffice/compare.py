"""Every surrogate and baseline on the snapshots between the training snapshots: error against cost."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from selection.errors import InputError as UnfitIntervals
from selection.intervals import Subset, candidates, dense_interval
from selection.tradeoff import pareto_front
from suffice.answers import Tradeoff
from suffice.cases import Comparison, Criteria, Effort, Place, Table, add_case
from suffice.choice import Limits, cheapest, check_limits
from suffice.making import is_trained
from suffice.precision import precisions_from
from suffice.reconstruction import Case
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.uneven import unfit
from suffice.variables import default_variables, held, held_rates, mean_diameter
from suffice.winners import winners
from surrogates import SURROGATES

CONSISTENCY = 1.05  # of R_c up to n_c
COSTS = ("single_seconds", "storage_bytes")


def compare(
    run: Run,
    variables: Sequence[str] | None = None,
    intervals: Sequence[float] | None = None,
    surrogates: Sequence[str] | None = None,
    *,
    max_error: float | None = None,
    error_unit: str = "m",
    max_seconds: float | None = None,
    max_bytes: float | None = None,
    precisions: Sequence[str] | None = None,
    energy: float | None = None,
    consistency: float = CONSISTENCY,
    seed: int = 0,
    seeds: int = 1,
    training_seconds: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Tradeoff:
    """Train every surrogate at every Δτ and reconstruct the dense snapshots in between; plain types, ready for JSON.

    variables: names, default the components of position and velocity. intervals: Δτ in s, default ten to two dense
    intervals. surrogates: names in `SURROGATES`, default all that answer between snapshots and need no training. Each
    is fitted with n_lr modes (the least that hold `energy`, default 0.999, of fluid fields 0.99), with n_c (R_c to
    `consistency`) and with all; raw baselines have no modes. Positions whose velocities are stored are also compared on
    the modes of both, the `enriched` basis: with as many as there are modes of positions, and where rates are used with
    n_lr and with all; networks are not. precisions: names in `PRECISIONS` in which all is kept beside that of the run,
    default integers of 16 and 8 bits. Networks are trained with `seeds` seeds from `seed` on, each for
    `training_seconds` at most. max_error: RMSE, in `error_unit`, a unit of the run or "d" for particle diameters;
    max_seconds: to reconstruct one snapshot; max_bytes: to keep. progress is called with (done, all).

    The answer holds `rows`, one per variable, Δτ, surrogate, `basis` (None for raw baselines), n and `precision`, the
    widest first; `bases`, the decompositions and their cost; `left_out` with reasons; and with a limit `choice`, per
    variable the cheapest row that keeps it, or the closest.
    Errors are in the variable's unit: RMSE over the rows, mean over the unseen times. `projection_rmse` is the floor of
    the same n; for raw baselines that of all modes, which they may well undercut (then `ratio_to_floor` is below 1).
    Raises `Refusal` for unknown names, a Δτ that is no multiple of the dense interval or leaves nothing to predict, too
    few snapshots, limits that cannot be applied, or when nothing at all can be compared.
    """
    names = known_surrogates(surrogates)
    asked = default_variables(run) if variables is None else list(dict.fromkeys(variables))
    diameter, limits = mean_diameter(run), Limits(max_error, error_unit, max_seconds, max_bytes)
    check_limits(limits, {run.variable(name).unit for name in asked}, diameter)
    criteria, effort = Criteria(energy, consistency, precisions), Effort(seed, seeds, training_seconds)
    _check(run, asked, criteria, effort)
    subsets, found = subsets_between(run, intervals), Comparison([], [], [])
    _compare_all(found, run, (asked, subsets, names), (criteria, effort), progress)
    if not found.rows:
        raise Refusal(f"nothing can be compared: {found.left_out[0]['reason']}")
    return Tradeoff(
        task="between",
        kind="time",
        dense_interval=dense_interval(run.times),
        **_settings(criteria, effort, asked),
        diameter=diameter,
        **found._asdict(),
        **decided(found.rows, asked if limits.any else [], limits, diameter),
    )


def _settings(criteria: Criteria, effort: Effort, variables: Sequence[str]) -> dict[str, Any]:
    energies = {name: criteria.energy_of(name) for name in variables}
    meant = {"energy": criteria.energy_of(""), "energies": energies, "consistency": criteria.consistency}
    return {**meant, "seed": effort.seed, "seeds": effort.seeds}


def decided(rows: Table, variables: Iterable[str], limits: Limits, diameter: float | None) -> dict[str, Any]:
    """Mark the fronts of the rows, and return who wins and what keeps the limits for each of the variables."""
    mark_fronts(rows)
    choice = {name: cheapest(name, rows, limits, diameter) for name in variables}
    return {"winners": winners(rows), "limits": limits._asdict(), "choice": choice}


def _check(run: Run, variables: Sequence[str], criteria: Criteria, effort: Effort) -> None:
    if criteria.energy is not None and not 0 < criteria.energy <= 1:
        raise Refusal(f"energy is {criteria.energy:g}; it must be a share above 0 and at most 1, for example 0.999")
    if not 1.0 < criteria.consistency < math.inf:
        raise Refusal(f"consistency is {criteria.consistency:g}; it must be above 1 and finite, for example 1.05")
    for name in variables:
        precisions_from(run.variable(name).dtype.itemsize, criteria.precisions)
    if effort.seeds < 1:
        raise Refusal(f"seeds is {effort.seeds}; give at least 1")


def _compare_all(
    found: Comparison,
    run: Run,
    asked: tuple[Sequence[str], Sequence[Subset], Sequence[str]],
    how: tuple[Criteria, Effort],
    progress: Callable[[int, int], None] | None,
) -> None:
    """Add every case to the tables. asked: variables, training sets and surrogates."""
    variables, subsets, names = asked
    for i, name in enumerate(variables):
        # a basis of positions and velocities serves surrogates that ask for no rates, too
        serves = any(not SURROGATES[surrogate].raw and not is_trained(surrogate) for surrogate in names)
        values, rates = held(run, name), held_rates(run, name, list(SURROGATES) if serves else names)
        for j, subset in enumerate(subsets):
            if progress:
                progress(i * len(subsets) + j, len(variables) * len(subsets))
            unseen = np.setdiff1d(subset.testing, subset.training)
            place = Place(name, subset.interval, run.variable(name).unit, mean_diameter(run))
            add_case(found, Case(values, rates, run.times, subset.training, unseen), place, names, how)
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


def subsets_between(run: Run, intervals: Sequence[float] | None) -> list[Subset]:
    """Training and testing sets of every Δτ, coarse to fine. Raises Refusal where one leaves nothing to predict."""
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


def mark_fronts(rows: Table) -> None:
    """Mark the rows that none of the same variable beats in error and in each cost, whatever basis and precision."""
    for name in {row["variable"] for row in rows}:
        own = [row for row in rows if row["variable"] == name]
        fronts = {cost: pareto_front([row["rmse"] for row in own], [row[cost] for row in own]) for cost in COSTS}
        for i, row in enumerate(own):
            row["on_front"] = {cost: bool(front[i]) for cost, front in fronts.items()}
