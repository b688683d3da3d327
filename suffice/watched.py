"""What the snapshots that surrogates give are worth: their observables against those of the truth."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import InputError as UnfitSnapshots
from pod import SnapshotMatrix
from selection.errors import InputError as UnfitIntervals
from selection.intervals import candidates, dense_interval
from suffice.compare import known_surrogates
from suffice.making import made
from suffice.observables import (
    UNITS_OF_ENERGY,
    Observables,
    Room,
    Watch,
    meaning_of,
    observable_errors,
    observe,
    room_at,
    watch_of,
)
from suffice.reconstruction import Case, Reduced, reduce
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.solids import Profile
from suffice.uneven import unfit
from suffice.variables import columns_of, held, mean_diameter
from suffice.wording import finite
from surrogates import SURROGATES, Surrogate
from surrogates import InputError as UnfitSeries

Array = NDArray[np.float64]
MOST_TIMES = 20  # unseen times observed
STEP = 0.01  # of the dense interval: half the step over which a prediction is differentiated
UNDEFINED = "not defined at every time: a mixing index needs both kinds, and cells that several particles share"
FLOOR = "projection"  # on the modes, of the truth itself: what no surrogate of these modes can know better

# what a surrogate gives at one time: positions and velocities (n, 3)
Prediction = Callable[[int], tuple[Array, Array]]


class Moment(NamedTuple):
    """An unseen snapshot: the truth, and what is observed in it."""

    k: int  # its number in the run
    position: Array  # (n, 3) m
    velocity: Array | None  # (n, 3) m/s
    room: Room
    observed: Observables


def compare_observables(
    run: Run,
    interval: float,
    surrogates: Sequence[str] | None = None,
    *,
    energy: float = 0.999,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Reconstruct whole snapshots between those kept every Δτ, and observe them; plain types, ready for JSON.

    interval: Δτ in s. surrogates: names of kind `time`, default all; each is fitted to n_lr coefficients of the modes
    of the vector `position` (the least that hold `energy`) and to all, raw baselines to the snapshots. Velocities are
    those with which the predicted positions move, (x(t + δ) − x(t − δ)) / 2δ with δ a hundredth of the dense interval:
    so every surrogate has them, from one model, and they belong to its positions. At most 20 unseen times are
    observed, evenly chosen. seed: of the surrogates that take one. progress is called with (done, all).

    The answer holds `rows`, one per surrogate and number of modes: `errors`, the mean size of each observable's error
    over the times, and `bias`, the mean with its sign (not of profiles), both in the units that `observables` names
    beside the mean of the truth; `profiles`, means over the times; `rmse` of a component of position (m). The surrogate
    `projection` is the truth projected on the modes, the floor for all on them. `left_out` holds what was not observed
    or not fitted, with reasons, `notes` how observables are meant in this run.
    Raises `Refusal` for an unknown name, a Δτ that leaves nothing to predict, a run without positions, or too few
    snapshots.
    """
    names = known_surrogates(surrogates)
    _check(run, energy)
    training, unseen = _split(run, interval)
    watch = watch_of(run, unseen)
    case = _case(run, training, unseen)
    try:
        reduced = reduce(case, energy)
    except UnfitSnapshots as error:
        raise Refusal(f"{run.path}: position: {error}") from None
    moments = [moment_of(run, watch, int(k)) for k in unseen]
    described = described_in(watch, moments)
    names_observed = [name for name, what in described.items() if what["truth"] is not None]
    undefined = {name: UNDEFINED for name in described if name not in names_observed}
    left_out = [
        {"observable": name, "surrogate": None, "reason": why} for name, why in {**watch.left_out, **undefined}.items()
    ]
    seen = (watch, moments, names_observed)
    rows = _all_rows(seen, case, reduced, names, seed, left_out, progress)
    return {
        "interval": interval,
        "dense_interval": dense_interval(run.times),
        "times": [float(run.times[k]) for k in unseen],
        "n_snapshots": len(training),
        "n_lr": reduced.basis.n_lr,
        "modes": reduced.basis.modes.shape[1],
        "energy": energy,
        "seed": seed,
        "diameter": mean_diameter(run),
        "observables": {name: described[name] for name in names_observed},
        "profiles": _profiles(moments[0].observed, [moment.observed for moment in moments]),
        "rows": rows,
        "left_out": left_out,
        "notes": list(watch.notes),
    }


def _all_rows(
    seen: tuple[Watch, Sequence[Moment], Sequence[str]],
    case: Case,
    reduced: Reduced,
    names: Sequence[str],
    seed: int,
    left_out: list[dict[str, Any]],
    progress: Callable[[int, int], None] | None,
) -> list[dict[str, Any]]:
    """Rows of every surrogate and number of modes; what cannot be fitted is added to `left_out`."""
    watch, moments, observed = seen
    rows: list[dict[str, Any]] = []
    for done, name in enumerate([FLOOR, *names]):
        if progress:
            progress(done, 1 + len(names))
        try:
            for modes, predict in _predictions(name, case, reduced, seed):
                rows.append({"surrogate": name, "modes": modes, **_observed(watch, moments, predict, observed)})
        except UnfitSeries as error:
            left_out.append({"observable": None, "surrogate": name, "reason": f"{name}: {error}"})
    if progress:
        progress(1 + len(names), 1 + len(names))
    return rows


def _check(run: Run, energy: float) -> None:
    if "position" not in run.quantities:
        raise Refusal(
            f"{run.path} holds no positions, so there is nothing to observe; it has {', '.join(run.variables)}"
        )
    if not 0 < energy <= 1:
        raise Refusal(f"energy is {energy:g}; it must be a share above 0 and at most 1, for example 0.999")


def _split(run: Run, interval: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Snapshots kept every Δτ, and up to 20 of those between them."""
    try:
        (subset,) = candidates(run.times, [interval])
    except UnfitIntervals as error:
        raise unfit(run, error) from None
    unseen = np.setdiff1d(subset.testing, subset.training)
    if not len(unseen):
        raise Refusal(
            f"interval: {interval:g} s is the dense interval of {run.path}, which leaves no snapshot to predict; take "
            f"at least {2 * interval:g} s"
        )
    chosen = np.linspace(0, len(unseen) - 1, min(MOST_TIMES, len(unseen))).round().astype(np.intp)
    return subset.training, unseen[chosen]


def _case(run: Run, training: NDArray[np.intp], unseen: NDArray[np.intp]) -> Case:
    rates = held(run, "velocity") if "velocity" in run.quantities else None
    return Case(held(run, "position"), rates, run.times, training, unseen)


def moment_of(run: Run, watch: Watch, k: int) -> Moment:
    """Return snapshot k of a run, observed."""
    values = run.snapshot(k).values
    position = np.asarray(values["position"], dtype=np.float64)
    velocity = np.asarray(values["velocity"], dtype=np.float64) if "velocity" in values else None
    room = room_at(watch, float(run.times[k]))
    return Moment(k, position, velocity, room, observe(watch, room, position, velocity))


def _predictions(name: str, case: Case, reduced: Reduced, seed: int) -> Iterator[tuple[int | None, Prediction]]:
    """Each way of using a surrogate: its number of modes, and what it gives at snapshot k."""
    if name != FLOOR and SURROGATES[name].raw:
        stored = _raw(name, case, seed)
        yield None, _moving(lambda k: stored.predict(_around(case, k)), case)
        return
    full = reduced.basis.modes.shape[1]
    for n in sorted({reduced.basis.n_lr or full, full}):
        yield n, _projected(reduced, case, n) if name == FLOOR else _modal(name, case, reduced, n, seed)


def _modal(name: str, case: Case, reduced: Reduced, n: int, seed: int) -> Prediction:
    rates = None if reduced.rates is None else reduced.rates[:, :n]
    known = reduced.coefficients[case.training, :n]
    surrogate = made(name, seed).fit(case.times[case.training], known, rates)
    # asked once for all times: what is rolled out is rolled out once
    asked = np.concatenate([_around(case, k) for k in case.unseen])
    found = dict(zip(case.unseen.tolist(), surrogate.predict(asked).reshape(-1, 3, n), strict=True))
    return _moving(lambda k: reduced.basis.reconstruct(found[k]).T, case)


def _raw(name: str, case: Case, seed: int) -> Surrogate:
    values = columns_of(case.values, case.training)
    rates = columns_of(case.rates, case.training) if case.rates is not None and SURROGATES[name].needs_rates else None
    return made(name, seed).fit(case.times[case.training], values, rates)


def _around(case: Case, k: int) -> Array:
    """Time of snapshot k, with one a little before and one after, (3,) s."""
    return np.asarray(case.times[k] + STEP * dense_interval(case.times) * np.array([-1.0, 0.0, 1.0]))


def _moving(at: Callable[[int], Array], case: Case) -> Prediction:
    """Positions at snapshot k and the velocities with which they move; `at` gives (3, 3n) m at the times around it."""

    def predict(k: int) -> tuple[Array, Array]:
        (before, now, after), (first, _, last) = at(k), _around(case, k)
        return now.reshape(-1, 3), ((after - before) / (last - first)).reshape(-1, 3)

    return predict


def _projected(reduced: Reduced, case: Case, n: int) -> Prediction:
    """Truth projected on the first n modes, its stored velocities on the same; NaN where there are none."""
    kept = reduced.basis._replace(modes=np.ascontiguousarray(reduced.basis.modes[:, :n]))
    still = kept._replace(mean=np.zeros_like(kept.mean))

    def predict(k: int) -> tuple[Array, Array]:
        position = kept.reconstruct(reduced.coefficients[[k], :n]).reshape(-1, 3)
        if case.rates is None:
            return position, np.full(position.shape, np.nan)
        rate = still.project(SnapshotMatrix(case.rates).columns([k]))
        return position, still.reconstruct(rate).reshape(-1, 3)

    return predict


def _observed(watch: Watch, moments: Sequence[Moment], predict: Prediction, names: Sequence[str]) -> dict[str, Any]:
    """Errors of one surrogate over the unseen times, in plain types."""
    errors: list[dict[str, float]] = []
    squares, seen = [], []
    for moment in moments:
        position, velocity = predict(moment.k)
        if not np.isfinite(position).all():
            raise UnfitSeries(f"positions at {moment.room.time:.6g} s are not finite; nothing can be observed")
        observed = observe(watch, moment.room, position, None if moment.velocity is None else velocity)
        errors.append(observable_errors(moment.observed, observed))
        squares.append(float(np.sqrt(np.mean((position - moment.position) ** 2))))
        seen.append(observed)
    rmse, diameter = float(np.mean(squares)), watch.setting.diameter
    profiles = {name for name in names if isinstance(moments[0].observed[name], Profile)}
    return {
        "rmse": rmse,
        "rmse_diameters": rmse / diameter if diameter else None,
        "errors": {name: _mean([abs(each[name]) for each in errors]) for name in names},
        "bias": {name: _mean([each[name] for each in errors]) for name in names if name not in profiles},
        "profiles": {name: found["values"] for name, found in _profiles(moments[0].observed, seen).items()},
    }


def _mean(values: Sequence[float]) -> float | None:
    """Mean, None where it is no number."""
    return finite(float(np.mean(values)))


def _profiles(like: Observables, observed: Sequence[Observables]) -> dict[str, dict[str, Any]]:
    """Profiles averaged over the times, None in bins that walls fill at any of them."""
    found = {}
    for name, first in like.items():
        if isinstance(first, Profile):
            mean = np.mean([each[name].values for each in observed], axis=0)  # type: ignore[union-attr]
            found[name] = {"place": first.place.tolist(), "values": [finite(float(value)) for value in mean]}
    return found


def described_in(watch: Watch, moments: Sequence[Moment]) -> dict[str, dict[str, Any]]:
    """Say what each observable is, and its mean in the truth (of profiles over bins, too)."""
    described = {}
    for name, first in moments[0].observed.items():
        meaning, values = meaning_of(name), [moment.observed[name] for moment in moments]
        levels = [level_of(value) for value in values]
        unit = UNITS_OF_ENERGY[watch.setting.weight_unit] if name == "kinetic_energy" else meaning.unit
        described[name] = {
            "text": meaning.text,
            "unit": unit,
            "error": meaning.error,
            "error_unit": meaning.error_unit,
            "truth": _mean(levels),
            "profile": isinstance(first, Profile),
        }
    return described


def level_of(value: float | Profile) -> float:
    """Return an observable as one number: a profile averaged over its bins, weighted by the room in them."""
    if not isinstance(value, Profile):
        return value
    known = np.isfinite(value.values)
    return float(np.average(value.values[known], weights=value.room[known]))
