"""What snapshots foreseen beyond the window are worth: their observables against those of what then happened."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import InputError as UnfitSnapshots
from pod import SnapshotMatrix
from selection.intervals import dense_interval
from suffice.beyond import check_ahead, cut_at, known_ahead, within
from suffice.horizon import Array, Future, Reduced, ask_ahead, fit_past, reduce_past
from suffice.making import is_trained, made
from suffice.observables import Watch, observable_errors, observe, watch_of
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.variables import held, held_rates, mean_diameter
from suffice.watched import FLOOR, STEP, UNDEFINED, Moment, described_in, level_of, moment_of
from suffice.wording import finite
from surrogates import SURROGATES
from surrogates import InputError as UnfitSeries

FARTHEST = 1e6  # m: beads farther out are lost, before the cells that mixing counts outgrow whole numbers

# positions (n, 3) m and velocities (n, 3) m/s at the horizon of this number; not finite where the rollout is lost
Foresight = Callable[[int], tuple[Array, Array]]


class Past(NamedTuple):
    """What is known at the end of training, and what is asked from there."""

    future: Future  # of the vector `position`
    reduced: Reduced
    modes: int  # n_lr, all where they hold too little
    positions: Array  # (2, 3n) m, the last two snapshots trained on
    velocities: Array | None  # (2, 3n) m/s; None where the run has none
    horizons: NDArray[np.intp]  # snapshots ahead
    around: Array  # (3,) s: a little before, at, and a little after


def observe_beyond(
    run: Run,
    interval: float,
    surrogates: Sequence[str] | None = None,
    *,
    share: float = 2 / 3,
    horizons: Sequence[int] = (1, 2, 5, 10, 25),
    energy: float = 0.999,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Predict whole snapshots from the end of training on, and observe them; plain types, ready for JSON.

    Modes of the vector `position` and surrogates see the snapshots, `interval` s apart, of the first `share` of the run
    only. Every surrogate is fitted to n_lr coefficients (the least that hold `energy`) and goes on from the last of
    them, the start kept: x(s) + Σ (ĉ - c(s)) φ; those without modes go on from the last two snapshots. Velocities are
    those with which the predicted positions move, (x(t + δ) - x(t - δ)) / 2δ with δ a hundredth of the dense interval.
    surrogates: names, default all but networks. horizons: snapshots ahead; those longer than the rest of the run are
    left out. One start is one draw: of the few largest overlaps, say, chance decides. progress: (done, all).

    The answer holds `rows`, one per surrogate, with lists over `horizons`: `errors` of each observable, with their sign
    (of profiles, rms over the bins) in the unit that `observables` names beside the truth's values at the horizons;
    `rmse` of a component of position (m), `rmse_diameters`. The surrogate `projection` has exact coefficients, and the
    stored velocities on the same modes: the floor. None where the rollout is lost, `left_out` says from where on; it
    also holds what was not observed or not fitted, with reasons; `notes` how observables are meant in this run.
    Raises `Refusal` for unknown names, numbers out of range, a run without positions or too short to be cut.
    """
    names = [name for name in known_ahead(surrogates) if surrogates is not None or not is_trained(name)]
    check_ahead(share, 1, horizons, energy)
    if "position" not in run.quantities:
        raise Refusal(
            f"{run.path} holds no positions, so there is nothing to observe; it has {', '.join(run.variables)}"
        )
    kept, trained = cut_at(run, interval, share)
    ahead = within(horizons, len(kept) - trained)
    targets = [int(kept[trained - 1 + h]) for h in ahead]
    past, watch = _past(run, kept, trained, ahead, energy), watch_of(run, targets)
    moments = [moment_of(run, watch, k) for k in targets]
    answer: dict[str, Any] = {
        "interval": interval,
        "trained": trained,
        "train_end": float(run.times[kept[trained - 1]]),
        "horizons": ahead,
        "times": [float(run.times[k]) for k in targets],
        "modes": past.modes,
        "energy": energy,
        "seed": seed,
        "diameter": mean_diameter(run),
        "notes": list(watch.notes),
        **_described(watch, moments),
        "rows": [],
    }
    for done, name in enumerate([FLOOR, *names]):
        if progress:
            progress(done, 1 + len(names))
        _observe_one(answer, name, past, watch, moments)
    if progress:
        progress(1 + len(names), 1 + len(names))
    return answer


def _observe_one(answer: dict[str, Any], name: str, past: Past, watch: Watch, moments: Sequence[Moment]) -> None:
    """Add what one surrogate foresees to the answer, or why it does not."""
    try:
        modes, foresight = _foresight(name, past, answer["seed"])
    except UnfitSeries as error:
        answer["left_out"].append({"observable": None, "surrogate": name, "reason": f"{name}: {error}"})
        return
    row = _row(watch, moments, foresight, list(answer["observables"]))
    answer["rows"].append({"surrogate": name, "modes": modes, **row})
    answer["left_out"] += _lost(name, answer["horizons"], row["rmse"])


def _past(run: Run, kept: NDArray[np.intp], trained: int, ahead: Sequence[int], energy: float) -> Past:
    """Decompose the training part, and keep what goes on from its end."""
    values, rates = held(run, "position"), held_rates(run, "position", ["ballistic"])
    end = np.array([trained - 1])
    future = Future(values, rates, kept, run.times[kept], trained, end, ahead[-1])
    try:
        reduced = reduce_past(future, energy)
    except UnfitSnapshots as error:
        raise Refusal(f"{run.path}: position: {error}") from None
    last = [run.snapshot(int(k)).values for k in kept[trained - 2 : trained]]
    positions = np.stack([np.asarray(one["position"], np.float64).ravel() for one in last])
    velocities = None
    if rates is not None:
        velocities = np.stack([np.asarray(one["velocity"], np.float64).ravel() for one in last])
    modes = reduced.basis.n_lr or reduced.basis.modes.shape[1]
    around = STEP * dense_interval(run.times) * np.array([-1.0, 0.0, 1.0])
    return Past(future, reduced, modes, positions, velocities, np.array(ahead), around)


def _foresight(name: str, past: Past, seed: int) -> tuple[int | None, Foresight]:
    """Return the number of modes of a surrogate, and what it foresees. Raises surrogates.InputError where unfit."""
    if name == FLOOR:
        return past.modes, _projected(past)
    if SURROGATES[name].raw:
        return None, _stored(name, past, seed)
    return past.modes, _modal(name, past, seed)


def _modal(name: str, past: Past, seed: int) -> Foresight:
    """Go on from the coefficients up to the end of training; what the modes miss of that snapshot stays as it is."""
    known, modes, end = past.reduced.coefficients[:, : past.modes], _kept_modes(past), past.future.trained - 1
    surrogate = fit_past(name, past.future, past.reduced, past.modes, seed)
    times = surrogate.window_[1] + surrogate.interval_ * past.horizons[:, None] + past.around
    found = ask_ahead(surrogate, known, end, times.ravel()).reshape(*times.shape, past.modes)
    return _moving(lambda i: past.positions[1] + (found[i] - known[end]) @ modes.T, past)


def _stored(name: str, past: Past, seed: int) -> Foresight:
    """Go on from the last two snapshots themselves."""
    end = past.future.trained - 1
    times = past.future.times[end + past.horizons][:, None] + past.around
    surrogate = made(name, seed).fit(past.future.times[end - 1 : end + 1], past.positions, past.velocities)
    return _moving(lambda i: surrogate.predict(times[i], beyond=True), past)


def _moving(at: Callable[[int], Array], past: Past) -> Foresight:
    """Positions, and the velocities with which they move; `at` gives (3, 3n) m at the times around a horizon."""

    def foresee(i: int) -> tuple[Array, Array]:
        before, now, after = at(i)
        return now.reshape(-1, 3), ((after - before) / (past.around[2] - past.around[0])).reshape(-1, 3)

    return foresee


def _projected(past: Past) -> Foresight:
    """Return what exact coefficients foresee, the start kept, and the stored velocities on the same modes."""
    known, modes, end = past.reduced.coefficients[:, : past.modes], _kept_modes(past), past.future.trained - 1
    still = past.reduced.basis._replace(modes=modes, mean=np.zeros_like(past.reduced.basis.mean))

    def foresee(i: int) -> tuple[Array, Array]:
        k = end + int(past.horizons[i])
        position = (past.positions[1] + modes @ (known[k] - known[end])).reshape(-1, 3)
        if past.future.rates is None:
            return position, np.zeros_like(position)  # nothing that is observed asks for it
        moved = still.project(SnapshotMatrix(past.future.rates).columns(past.future.kept[[k]]))
        return position, still.reconstruct(moved).reshape(-1, 3)

    return foresee


def _kept_modes(past: Past) -> Array:
    return np.ascontiguousarray(past.reduced.basis.modes[:, : past.modes])


def _row(watch: Watch, moments: Sequence[Moment], foresight: Foresight, names: Sequence[str]) -> dict[str, Any]:
    """Errors of one surrogate at every horizon, in plain types."""
    seen = [_errors(watch, moment, *foresight(i)) for i, moment in enumerate(moments)]
    rmse, diameter = [error for error, _ in seen], watch.setting.diameter
    over = [None if error is None else error / diameter for error in rmse] if diameter else None
    return {
        "rmse": rmse,
        "rmse_diameters": over,
        "errors": {name: [finite(errors.get(name)) for _, errors in seen] for name in names},
    }


def _errors(watch: Watch, moment: Moment, position: Array, velocity: Array) -> tuple[float | None, dict[str, float]]:
    """RMSE of a component of position (m) and the errors of the observables; None and nothing where all is lost."""
    if not (np.isfinite(velocity).all() and np.abs(position).max() < FARTHEST):
        return None, {}
    observed = observe(watch, moment.room, position, None if moment.velocity is None else velocity)
    return float(np.sqrt(np.mean((position - moment.position) ** 2))), observable_errors(moment.observed, observed)


def _lost(name: str, ahead: Sequence[int], rmse: Sequence[float | None]) -> list[dict[str, Any]]:
    """Say from which horizon on nothing is left of a rollout."""
    first = next((h for h, error in zip(ahead, rmse, strict=True) if error is None), None)
    if first is None:
        return []
    how = f"its rollout is lost by {first} snapshots ahead, grown beyond {FARTHEST / 1e3:g} km or without bound"
    return [{"observable": None, "surrogate": name, "reason": f"{name}: {how}"}]


def _described(watch: Watch, moments: Sequence[Moment]) -> dict[str, Any]:
    """Say what each observable is, with its value in the truth at every horizon, and which are left out."""
    described = described_in(watch, moments)
    undefined = {name: UNDEFINED for name, what in described.items() if what["truth"] is None}
    reasons = {**watch.left_out, **undefined}
    observables = {
        name: {**what, "truths": [float(level_of(moment.observed[name])) for moment in moments]}
        for name, what in described.items()
        if name not in undefined
    }
    left_out = [{"observable": name, "surrogate": None, "reason": why} for name, why in reasons.items()]
    return {"observables": observables, "left_out": left_out}
