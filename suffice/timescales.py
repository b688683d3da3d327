"""Each variable at its own Δτ and rank against one Δτ for all: bytes at equal error, error at equal bytes."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from selection.allocation import Allocation, allocate, allocate_alike
from suffice.alternatives import (
    Alternatives,
    alternatives,
    check_judged,
)
from suffice.compare import subsets_between
from suffice.condensed import Array, Condensed, condense
from suffice.contradiction import Known, contradiction, contradiction_of_truth
from suffice.planning import derived_velocities, parse_limits
from suffice.quantities import velocity_of, whole_of
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.variables import default_variables, mean_diameter
from surrogates import SURROGATES

BY_RULE, ALIKE, OWN, DERIVED = "one Δτ, n by the rule", "one Δτ", "own Δτ", ", v = dx/dt"
FINEST = "finest Δτ"  # of those that the variables were given
FALLBACK = "spline"  # of a variable whose derivative no run holds, beside a surrogate that needs it
COSTS = ("model_bytes", "snapshot_bytes")

Tables = Mapping[str, Alternatives]


class Way(NamedTuple):
    """One way of giving Δτ and modes to variables."""

    name: str
    tables: Tables  # of the variables that have modes of their own
    alike: bool  # one Δτ for all


class Study(NamedTuple):
    """All that is known of a run before anything is allocated."""

    run: Run
    data: dict[str, Condensed]
    tables: dict[str, Alternatives]
    derived: dict[str, str]  # velocities that positions answer: `velocity.x` of `position.x`
    diameter: float | None  # m

    def ways(self) -> list[Way]:
        """One Δτ and own ones, for variables with modes of their own, and with velocities as derivatives."""
        few = {name: table for name, table in self.tables.items() if name not in self.derived}
        found = [Way(ALIKE, self.tables, alike=True), Way(OWN, self.tables, alike=False)]
        if self.derived and few:
            found += [Way(ALIKE + DERIVED, few, alike=True), Way(OWN + DERIVED, few, alike=False)]
        return found


def compare_timescales(
    run: Run,
    variables: Sequence[str] | None = None,
    intervals: Sequence[float] | None = None,
    surrogate: str | None = None,
    max_error: Sequence[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Allocate Δτ and modes to variables, alone and alike, and return what each way takes; plain types.

    variables: default the components of position and of velocity. intervals: Δτ in s to choose from, default ten to two
    dense ones. surrogate: default hermite where velocities are stored, else spline; variables whose derivative the run
    does not hold are fitted by splines where it needs one. max_error: limits such as `0.05d` on the RMSE over all rows
    of a quantity, one for each unit; default, in turn, what one Δτ with n_c modes (no fewer than n_lr) errs by.

    Each level of error holds `rows`: `cost` names what is the least, bytes of the model or of the training snapshots;
    or `equal_bytes` the model bytes that were given, and then errors are the least. `contradiction`, of rows of least
    model bytes, is the RMSE of dx/dt - v over the window in m/s, by central differences at the dense interval;
    `contradiction_of_truth` that of the run itself. Raises Refusal for names, intervals or limits that cannot be used.
    """
    study = _study(run, variables, intervals, surrogate, progress)
    limits = parse_limits(list(max_error or ()), run)
    levels = [(None, _checked(study, limits))] if limits else _levels(study)
    return {
        "task": "timescales",
        "run": str(run.path),
        "dense_interval": run.interval,
        "diameter": study.diameter,
        "surrogates": {name: table.surrogate for name, table in study.tables.items()},
        "contradiction_of_truth": contradiction_of_truth(study.run, study.data, study.derived),
        "levels": [_level(study, interval, limits) for interval, limits in levels],
    }


def _study(
    run: Run,
    variables: Sequence[str] | None,
    intervals: Sequence[float] | None,
    surrogate: str | None,
    progress: Callable[[int, int], None] | None,
) -> Study:
    """Read every variable once and judge each Δτ and number of modes."""
    names = default_variables(run) if variables is None else list(dict.fromkeys(variables))
    known = (*run.quantities, *run.variables)
    chosen = surrogate or ("hermite" if any(velocity_of(name) in known for name in names) else FALLBACK)
    check_judged(chosen)
    subsets = subsets_between(run, intervals)
    derived = derived_velocities(names, chosen)
    data: dict[str, Condensed] = {}
    tables: dict[str, Alternatives] = {}
    for name in sorted(names, key=lambda name: name in derived):  # positions first, they hold their velocities
        if progress:
            progress(len(tables), len(names))
        origin = data.get(derived.get(name, ""))
        data[name] = condense(run, name) if origin is None else _velocity_in(origin, name, run)
        own = FALLBACK if SURROGATES[chosen].needs_rates and data[name].rates is None else chosen
        tables[name] = alternatives(data[name], run.times, subsets, own, thresholds_of(name).energy)
    if progress:
        progress(len(names), len(names))
    return Study(run, data, tables, derived, mean_diameter(run))


def _velocity_in(position: Condensed, name: str, run: Run) -> Condensed:
    """Return the velocity in the rows that its position was condensed to, so that the two can be compared."""
    assert position.rates is not None, "a velocity among the variables is stored"
    return position._replace(variable=name, unit=run.variable(name).unit, values=position.rates, rates=None)


def _checked(study: Study, limits: Mapping[str, float]) -> dict[str, float]:
    """Limits by quantity. Raises Refusal for a quantity without one."""
    found = {}
    for name, table in study.tables.items():
        if table.unit not in limits:
            raise Refusal(
                f"--max-error: {name} is in {table.unit} and no limit is; add one such as '0.1 {table.unit}', or "
                "leave the variable out"
            )
        found[whole_of(name)] = limits[table.unit]
    return found


def _levels(study: Study) -> list[tuple[float | None, dict[str, float]]]:
    """Errors of each quantity with one Δτ for all and n by the rule, coarse to fine."""
    intervals = sorted(set.intersection(*(set(t.interval.tolist()) for t in study.tables.values())), reverse=True)
    return [(interval, _errors(study, study.tables, _by_rule(study.tables, interval))) for interval in intervals]


def _by_rule(tables: Tables, interval: float) -> list[int]:
    return [int(np.flatnonzero(table.by_rule & (table.interval == interval))[0]) for table in tables.values()]


def _errors(study: Study, tables: Tables, chosen: Sequence[int]) -> dict[str, float]:
    """RMSE over all rows of each quantity, and of the velocities derived where they have no modes of their own."""
    squares: dict[str, list[tuple[int, float]]] = {}
    for (name, table), i in zip(tables.items(), chosen, strict=True):
        squares.setdefault(whole_of(name), []).append((table.rows, float(table.rmse[i]) ** 2))
        for velocity in _answered(study, tables, name):
            assert table.velocity_rmse is not None, "a velocity is derived where it is stored"
            squares.setdefault(whole_of(velocity), []).append((table.rows, float(table.velocity_rmse[i]) ** 2))
    return {whole: (sum(r * s for r, s in p) / sum(r for r, _ in p)) ** 0.5 for whole, p in squares.items()}


def _answered(study: Study, tables: Tables, position: str) -> list[str]:
    """Velocities that this position answers because they have no modes of their own in these tables."""
    return [velocity for velocity, of in study.derived.items() if of == position and velocity not in tables]


def _burdens(study: Study, tables: Tables, limits: Mapping[str, float]) -> list[Array]:
    """Share of each quantity's squared limit that every alternative takes, per variable (k, quantities)."""
    wholes = list(limits)
    rows = {whole: sum(t.rows for name, t in study.tables.items() if whole_of(name) == whole) for whole in wholes}
    found = []
    for name, table in tables.items():
        burden = np.zeros((len(table.rmse), len(wholes)))
        answers = [(name, table.rmse), *((v, table.velocity_rmse) for v in _answered(study, tables, name))]
        for answered, rmse in answers:
            whole = whole_of(answered)
            assert rmse is not None, "a velocity is derived where it is stored"
            burden[:, wholes.index(whole)] = table.rows / rows[whole] * np.square(rmse / limits[whole])
        found.append(burden)
    return found


def _level(study: Study, interval: float | None, limits: Mapping[str, float]) -> dict[str, Any]:
    """Every way of keeping these errors, and what the bytes of one Δτ for all would buy otherwise."""
    rows: list[dict[str, Any]] = []
    ways = study.ways()
    if interval is not None:
        chosen = tuple(_by_rule(study.tables, interval))
        rows.append(_row(study, Way(BY_RULE, study.tables, alike=True), Allocation(chosen, 0.0, np.zeros(0), True)))
    for cost in COSTS:
        for way in ways:
            found = _row(study, way, _least(study, way, limits, cost))
            rows.append({**found, "cost": cost})
            if not way.alike:
                finest = _finest(way, found["parts"])
                rows.append({**_row(study, finest, _least(study, finest, limits, cost)), "cost": cost})
    known: Known = {}
    for row in rows:
        if row["cost"] != COSTS[1]:
            row["contradiction"] = contradiction(study.run, study.data, study.derived, row["parts"], known)
    rival = next(row for row in rows if row["strategy"] == ALIKE and row["cost"] == COSTS[0])
    if rival["kept"]:
        most = rival["model_bytes"]
        rows += [{**_row(study, way, _within(study, way, limits, most)), "equal_bytes": most} for way in ways]
    return {"interval": interval, "limits": dict(limits), "rows": rows}


def _finest(way: Way, parts: Mapping[str, Mapping[str, Any]]) -> Way:
    """Give every variable the finest Δτ that any of them was given: what one output interval for all comes to."""
    interval = min(part["interval"] for part in parts.values())
    tables = {name: table.at(interval) for name, table in way.tables.items()}
    return Way(way.name.replace(OWN, FINEST), tables, alike=True)


def _least(study: Study, way: Way, limits: Mapping[str, float], cost: str) -> Allocation:
    """Least bytes within the limits."""
    costs = [getattr(table, cost) for table in way.tables.values()]
    return _given(way, costs, _burdens(study, way.tables, limits), np.ones(len(limits)))


def _within(study: Study, way: Way, limits: Mapping[str, float], most: float) -> Allocation:
    """Least sum of squared errors, each quantity's in units of its limit, within a number of bytes."""
    squares = [burden.sum(axis=1) for burden in _burdens(study, way.tables, limits)]
    return _given(way, squares, [table.model_bytes for table in way.tables.values()], np.array([most]))


def _given(way: Way, costs: Sequence[Array], burdens: Sequence[Array], limits: Array) -> Allocation:
    if way.alike:
        return allocate_alike(costs, burdens, limits, [table.interval for table in way.tables.values()])
    return allocate(costs, burdens, limits)


def _row(study: Study, way: Way, found: Allocation) -> dict[str, Any]:
    """Return what one way takes, in plain types."""
    given = zip(way.tables.items(), found.chosen, strict=True)
    parts = {name: _part(study, table, i) for (name, table), i in given}
    derived = {
        velocity: {"of": of, "rmse": parts[of]["velocity_rmse"], "unit": "m/s"}
        for velocity, of in study.derived.items()
        if velocity not in parts
    }
    return {
        "strategy": way.name,
        "cost": None,
        "equal_bytes": None,
        "kept": bool(found.kept),
        **{cost: sum(part[cost] for part in parts.values()) for cost in COSTS},
        "errors": _errors(study, way.tables, found.chosen),
        "contradiction": None,
        "parts": parts,
        "derived": derived,
    }


def _part(study: Study, table: Alternatives, i: int) -> dict[str, Any]:
    rmse, velocity = float(table.rmse[i]), table.velocity_rmse
    return {
        "interval": float(table.interval[i]),
        "modes": int(table.modes[i]),
        "surrogate": table.surrogate,
        "unit": table.unit,
        "rmse": rmse,
        "rmse_diameters": rmse / study.diameter if study.diameter and table.unit == "m" else None,
        "velocity_rmse": None if velocity is None else float(velocity[i]),
        **{cost: float(getattr(table, cost)[i]) for cost in COSTS},
    }
