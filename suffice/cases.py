"""What one variable at one Δτ has to say: every surrogate, on every basis, in every precision."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from pod import InputError as UnfitSnapshots
from pod import SnapshotMatrix
from suffice.baselines import extents, raw
from suffice.enriching import reduce_enriched
from suffice.making import is_trained, made
from suffice.precision import precisions_from
from suffice.reconstruction import (
    Array,
    Case,
    Reconstruction,
    Reduced,
    consistent_level,
    measure_reconstruction,
    modal,
    projection_errors,
    reduce,
)
from suffice.rounding import Rounding, roundings
from suffice.selecting import thresholds_of
from surrogates import SURROGATES
from surrogates import InputError as UnfitSeries

PLAIN, ENRICHED = "plain", "enriched"

ROUNDING = 1e-9  # of an error: a floor below it is none
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


class Criteria(NamedTuple):
    """What numbers of modes mean, and in what they are kept."""

    energy: float | None  # share of it that n_lr modes hold; None for that of each kind of variable
    consistency: float  # R_c up to n_c
    precisions: Sequence[str] | None  # beside that of the run; None for the usual ones

    def energy_of(self, variable: str) -> float:
        """Return the share of the energy that n_lr modes of this variable hold."""
        return thresholds_of(variable).energy if self.energy is None else self.energy


class Effort(NamedTuple):
    """How networks are trained."""

    seed: int
    seeds: int
    max_seconds: float | None


class Level(NamedTuple):
    """A number of modes, its projection errors (u,), and what is the same for all surrogates on it."""

    n: int
    floor: Array
    seconds: tuple[float, float]  # that reconstruction adds, of one snapshot alone, and of each among many
    kept: dict[str, Rounding | None]  # by precision, what narrower numbers take from mean and modes
    for_rates_only: bool = False  # whether others than those that use rates are left out


class Prepared(NamedTuple):
    """A basis, and the numbers of modes to compare at."""

    basis: str
    reduced: Reduced
    levels: list[Level]


def add_case(found: Comparison, case: Case, place: Place, names: Sequence[str], how: tuple[Criteria, Effort]) -> None:
    """Add what one variable at one Δτ has to say to the tables."""
    criteria, effort = how
    try:
        prepared = list(_prepared(found, case, place, names, criteria))
    except UnfitSnapshots as error:
        found.left_out.append(_omission(place, None, f"{place.variable}: {error}"))
        return
    for name in names:
        if SURROGATES[name].needs_rates and case.rates is None:
            reason = f"{name} needs the derivative of {place.variable}, which the run does not hold"
            found.left_out.append(_omission(place, name, reason))
            continue
        try:
            for basis, ones, floor in _tried(name, prepared, case, effort):
                row = {**_label(place, case), **_figures(ones[0], floor, case, place), "basis": basis}
                found.rows.append(row | _over_seeds(ones, floor, place))
        except UnfitSeries as error:
            found.left_out.append(_omission(place, name, f"{name}: {error}"))


def _prepared(
    found: Comparison, case: Case, place: Place, names: Sequence[str], criteria: Criteria
) -> Iterator[Prepared]:
    """Decompose positions, and with their velocities if there are any; each basis is added to the table.

    Networks are left on the plain basis: each training takes seconds.
    """
    energy = criteria.energy_of(place.variable)
    reduced = reduce(case, energy)
    n_c = consistent_level(reduced, case, criteria.consistency)
    full, names_kept = reduced.basis.modes.shape[1], precisions_from(case.itemsize, criteria.precisions)
    found.bases.append(_base(PLAIN, reduced, case, place) | {"n_c": n_c})
    least = reduced.basis.n_lr or full
    # fewer than n_lr are not enough, consistent or not
    yield _at_levels(PLAIN, reduced, case, {least, max(n_c, least), full}, names_kept)
    if case.rates is None or not any(_on_modes(name) and not is_trained(name) for name in names):
        return
    enriched = reduce_enriched(case, energy)
    all_modes = enriched.basis.modes.shape[1]
    found.bases.append(_base(ENRICHED, enriched, case, place))
    yield _at_levels(ENRICHED, enriched, case, {enriched.basis.n_lr or full, full, all_modes}, names_kept, full)


def _on_modes(name: str) -> bool:
    return not SURROGATES[name].raw


def _base(basis: str, reduced: Reduced, case: Case, place: Place) -> dict[str, Any]:
    """Describe a decomposition and its cost; modes consistent with unseen snapshots are those of positions alone."""
    return {
        **_label(place, case),
        "basis": basis,
        "n_lr": reduced.basis.n_lr,
        "n_c": None,
        "modes": reduced.basis.modes.shape[1],
        "seconds": reduced.seconds,
        "reason": reduced.basis.reason,
    }


def _label(place: Place, case: Case) -> dict[str, Any]:
    label = {"variable": place.variable, "interval": place.interval, "unit": place.unit}
    return {**label, "n_snapshots": len(case.training)}


def _omission(place: Place, surrogate: str | None, reason: str) -> dict[str, Any]:
    return {"variable": place.variable, "interval": place.interval, "surrogate": surrogate, "reason": reason}


def _at_levels(
    basis: str, reduced: Reduced, case: Case, counts: set[int], names: Sequence[str], for_all: int | None = None
) -> Prepared:
    """Return what each number of modes has in common. for_all: only with so many modes all surrogates are compared."""
    return Prepared(
        basis,
        reduced,
        [
            Level(
                n,
                projection_errors(reduced, case, n),
                measure_reconstruction(reduced.basis, reduced.coefficients[case.unseen, :n]),
                _kept(reduced, case, n, names),
                for_all is not None and n != for_all,
            )
            for n in sorted(counts)
        ],
    )


def _kept(reduced: Reduced, case: Case, n: int, names: Sequence[str]) -> dict[str, Rounding | None]:
    """Return what each precision takes from mean and first n modes; nothing in double."""
    unseen = SnapshotMatrix(case.values).columns(case.unseen)
    left = len(reduced.basis.mean) * projection_errors(reduced, case, n) ** 2
    lost = roundings(reduced.basis, unseen, reduced.coefficients[case.unseen, :n], left, names)
    return {name: lost.get(name) for name in names}


def _tried(
    name: str, prepared: Sequence[Prepared], case: Case, effort: Effort
) -> Iterator[tuple[str | None, list[Reconstruction], Array]]:
    """Each way of using this surrogate, once for every seed, with the projection error that it is held against."""
    member = SURROGATES[name]
    if member.raw:
        last = prepared[0].levels[-1]
        for one in raw(name, case, list(last.kept), extents(case)):
            yield None, [one], last.floor
        return
    trained = is_trained(name)
    for basis, reduced, levels in prepared[:1] if trained else prepared:
        for n, floor, seconds, kept, for_rates_only in levels:
            if for_rates_only and not member.needs_rates:
                continue  # it stays in the span of the positions: what more modes hold is lost on it
            seeds = range(effort.seed, effort.seed + (effort.seeds if trained else 1))
            runs = [modal(made(name, seed, effort.max_seconds), reduced, case, n, seconds, kept) for seed in seeds]
            for ones in zip(*runs, strict=True):
                yield basis, list(ones), floor


def _over_seeds(ones: Sequence[Reconstruction], floor: Array, place: Place) -> dict[str, Any]:
    """Return what several seeds change in a row: the errors are means, and that of each seed stands beside them."""
    if not ones[0].remark:
        return {}
    errors = [float(one.errors.mean()) for one in ones]
    mean, least, early = sum(errors) / len(errors), float(floor.mean()), any(one.early for one in ones)
    found = {"remark": ones[0].remark, "early": early, "seeds": errors}
    in_diameters = mean / place.diameter if place.diameter is not None and place.unit == "m" else None
    return found | {"rmse": mean, "rmse_diameters": in_diameters, "ratio_to_floor": _over(mean, least)}


def _over(rmse: float, floor: float) -> float | None:
    """Return an error over that of the modes alone, None where that is rounding beside it, or nothing."""
    return rmse / floor if floor > ROUNDING * rmse else None


def _figures(one: Reconstruction, floor: Array, case: Case, place: Place) -> dict[str, Any]:
    """Errors and costs of one row, in plain types."""
    rmse, least = float(one.errors.mean()), float(floor.mean())
    worst = int(one.errors.argmax())
    return {
        "surrogate": one.surrogate,
        "modes": one.modes,
        "precision": one.precision,
        "finer_modes": one.finer_modes,
        "rmse": rmse,
        "rmse_diameters": rmse / place.diameter if place.diameter is not None and place.unit == "m" else None,
        "worst_rmse": float(one.errors[worst]),
        "worst_time": float(case.times[case.unseen[worst]]),
        "projection_rmse": least,
        "ratio_to_floor": _over(rmse, least),
        "fit_seconds": one.fit_seconds,
        "single_seconds": one.single_seconds,
        "batch_seconds": one.batch_seconds,
        "storage_bytes": one.storage_bytes,
    }
