"""Which Δτ and how many modes each variable of a combined model gets: by the rule, or by a limit on the error."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from selection.allocation import Allocation, allocate
from suffice.alternatives import Alternatives, alternatives, check_judged
from suffice.choice import DIAMETERS, parse_error
from suffice.compare import subsets_between
from suffice.condensed import Array, condense
from suffice.progress import Advance
from suffice.quantities import velocity_of, whole_of
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import select_run, thresholds_of
from suffice.variables import mean_diameter
from suffice.wording import number, seconds_text
from surrogates import SURROGATES


class Part(NamedTuple):
    """One variable that is trained."""

    variable: str
    interval: float  # s, Δτ
    modes: int | None  # None: n_c, but no fewer than n_lr


class Plan(NamedTuple):
    """What a combined model is made of."""

    parts: list[Part]
    derived: dict[str, str]  # velocities that are derivatives: `velocity.x` of `position.x`
    limits: Mapping[str, float]  # RMSE of each quantity that was to be kept, by its unit


class Limits(NamedTuple):
    """Largest RMSE over all rows of a quantity, and of its derivative as the velocity."""

    own: float  # in the unit of the quantity
    velocity: float | None = None  # m/s; None: not limited


class Wanted(NamedTuple):
    """What is asked of a plan."""

    variables: Sequence[str]
    surrogate: str
    intervals: Sequence[float] | None  # s, to choose from; None: ten to two dense intervals
    limits: Mapping[str, float]  # largest RMSE of each quantity by its unit; none: the rule decides
    finest: bool  # take the finest Δτ where the rule accepts none
    energy: float | None  # that n_lr modes hold, None: 0.999, 0.99 of the fluid


def parse_limits(texts: Sequence[str] | None, run: Run) -> dict[str, float]:
    """Return limits on errors such as `0.05d` or `0.05d,0.1m/s` by unit, diameters in m. Raises Refusal."""
    found: dict[str, float] = {}
    for text in (part for given in texts or () for part in given.split(",")):
        value, unit = parse_error(text)
        if not 0.0 < value < float("inf"):
            raise Refusal(f"--max-error {text!r}: must be a positive number")
        if unit == DIAMETERS:
            diameter = mean_diameter(run)
            if diameter is None:
                raise Refusal(f"--max-error {text!r}: {run.path} does not know its particle diameters; give it in m")
            value, unit = value * diameter, "m"
        if unit in found:
            raise Refusal(f"--max-error {text!r}: a limit in {unit} is given already; give one for each unit")
        found[unit] = value
    return found


def derived_velocities(variables: Sequence[str], surrogate: str) -> dict[str, str]:
    """Return the velocities that the surrogates of their positions answer: `velocity.x` of `position.x`."""
    if not SURROGATES[surrogate].differentiable:
        return {}
    pairs = {velocity_of(name): name for name in variables if name.startswith("position")}
    return {name: pairs[name] for name in variables if name in pairs}


def plan_parts(run: Run, wanted: Wanted, progress: Advance | None = None) -> Plan:
    """Decide Δτ and number of modes of every variable.

    Velocities whose positions are among the variables are their derivatives, where the surrogate has one. With limits,
    those decide; else one Δτ is taken as it is given, and of several the largest that is sufficient (paper 2.3).
    Raises Refusal for a variable that is sufficient at no Δτ, or limits that nothing keeps.
    """
    derived = derived_velocities(wanted.variables, wanted.surrogate)
    trained = [name for name in wanted.variables if name not in derived]
    if wanted.limits:
        return _by_limits(run, wanted, trained, derived, progress)
    if wanted.intervals is not None and len(wanted.intervals) == 1:
        return Plan([Part(name, wanted.intervals[0], None) for name in trained], derived, {})
    return Plan(_by_rule(run, wanted, trained, progress), derived, {})


def _by_rule(run: Run, wanted: Wanted, trained: Sequence[str], progress: Advance | None) -> list[Part]:
    """Give each variable the largest Δτ with K_f ≥ 2."""
    changed = {} if wanted.energy is None else {"energy": wanted.energy}
    table = select_run(run, trained, wanted.intervals, changed, progress)
    parts, refused = [], []
    for name, found in table.items():
        judged = [c for c in found.candidates if c.K_f is not None]
        if found.chosen_interval is None and not (wanted.finest and judged):
            best = max(judged, key=lambda c: (c.K_f or 0.0, -c.interval), default=None)
            reason = "K_f is undefined" if best is None else f"best K_f {number(best.K_f)} at {best.interval:g} s"
            refused.append(f"{name} ({reason})")
            continue
        chosen = found.chosen_interval or min(c.interval for c in judged)
        parts.append(Part(name, chosen, None))
    if refused:
        raise Refusal(
            f"no Δτ considered is sufficient for {', '.join(refused)}; leave them out, take the finest Δτ for them "
            "with --finest, or limit the error instead with --max-error"
        )
    return parts


def _by_limits(
    run: Run, wanted: Wanted, trained: Sequence[str], derived: Mapping[str, str], progress: Advance | None
) -> Plan:
    """Give each variable what keeps the limits of its quantity at the fewest bytes."""
    check_judged(wanted.surrogate)
    _check_units(run, wanted, trained)
    tables = judged_tables(run, wanted, trained, progress)
    parts: dict[str, Part] = {}
    for whole in dict.fromkeys(map(whole_of, trained)):
        group = [table for table in tables if whole_of(table.variable) == whole]
        moving = set(derived.values())
        limits = Limits(wanted.limits[group[0].unit], wanted.limits.get("m/s") if whole == "position" else None)
        found = allocate_group(group, limits, moving)
        _check_kept(group, found, limits)
        for table, i in zip(group, found.chosen, strict=True):
            parts[table.variable] = Part(table.variable, float(table.interval[i]), int(table.modes[i]))
    return Plan([parts[name] for name in trained], dict(derived), wanted.limits)


def judged_tables(
    run: Run, wanted: Wanted, trained: Sequence[str], progress: Advance | None = None
) -> list[Alternatives]:
    """Return what every Δτ and number of modes costs each variable, from one pass over its rows."""
    found: list[Alternatives] = []
    subsets = subsets_between(run, wanted.intervals)
    changed = {} if wanted.energy is None else {"energy": wanted.energy}
    for name in trained:
        if progress:
            progress(len(found), len(trained))
        energy = thresholds_of(name, changed).energy
        found.append(alternatives(condense(run, name), run.times, subsets, wanted.surrogate, energy))
    if progress:
        progress(len(trained), len(trained))
    return found


def allocate_group(
    group: Sequence[Alternatives], limits: Limits, moving: Collection[str] = (), cost: str = "model_bytes"
) -> Allocation:
    """Allocate Δτ and n to the variables of one quantity at least cost, by the RMSE over all rows of the quantity.

    moving: those whose derivative stands for a velocity, which is limited as well if `limits` says so.
    """
    burdens = burdens_of(group, limits, moving)
    return allocate([getattr(table, cost) for table in group], burdens, np.ones(burdens[0].shape[1]))


def burdens_of(group: Sequence[Alternatives], limits: Limits, moving: Collection[str] = ()) -> list[Array]:
    """Share of the squared limits that each alternative takes, (k, 1 or 2): rows e² / Σ rows E²; they add up."""
    rows = sum(table.rows for table in group)
    columns = [[table.rows / rows * np.square(table.rmse / limits.own)] for table in group]
    if limits.velocity is not None and moving:
        rows = sum(table.rows for table in group if table.variable in moving)
        for table, found in zip(group, columns, strict=True):
            miss = table.velocity_rmse if table.variable in moving else None
            share = np.zeros(len(table.rmse)) if miss is None else np.square(miss / limits.velocity)
            found.append(table.rows / rows * share)
    return [np.column_stack(found) for found in columns]


def _check_units(run: Run, wanted: Wanted, trained: Sequence[str]) -> None:
    units = {name: run.variable(name).unit for name in wanted.variables}
    for name in trained:
        if units[name] not in wanted.limits:
            raise Refusal(
                f"--max-error: {name} is in {units[name]} and no limit is; add one such as '0.1 {units[name]}', or "
                "leave the variable out"
            )
    if unused := set(wanted.limits) - set(units.values()):
        raise Refusal(f"--max-error: no variable is in {min(unused)}; leave that limit out")


def _check_kept(group: Sequence[Alternatives], found: Allocation, limits: Limits) -> None:
    """Refuse limits that no allocation keeps, with the errors of the one that comes closest."""
    if found.kept:
        return
    each = zip((limits.own, limits.velocity), (group[0].unit, "m/s"), found.totals, strict=False)
    closest = " and ".join(
        f"{number((most or 0.0) * total**0.5)} {unit} (limit {number(most)})" for most, unit, total in each
    )
    finest = seconds_text(min(float(table.interval.min()) for table in group))
    names = ", ".join(table.variable for table in group)
    raise Refusal(
        f"--max-error: {names} cannot keep it down to Δτ = {finest}; the closest "
        f"errs by {closest}. Raise the limit, or simulate with a smaller output interval"
    )
