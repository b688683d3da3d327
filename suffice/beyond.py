"""Every surrogate beyond the snapshots it was trained on: error against horizon."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from pod import InputError as UnfitSnapshots
from pod import SnapshotMatrix
from selection import InputError as UnfitIntervals
from selection import Thresholds, sweep
from selection.intervals import candidates
from suffice.foresight import first_above, foretold
from suffice.horizon import Ahead, Array, Future, Reduced, ahead_of_modes, ahead_of_snapshots, floors, reduce_past
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.uneven import unfit
from suffice.variables import default_variables, held, held_rates, mean_diameter
from surrogates import SURROGATES
from surrogates import InputError as UnfitSeries

FEWEST = 3  # snapshots to train on

Table = list[dict[str, Any]]


class Reference(NamedTuple):
    """What every surrogate is held against, from each start."""

    persistence: Ahead
    ballistic: Ahead | None  # None where the run has no velocities


def compare_beyond(
    run: Run,
    variables: Sequence[str] | None,
    interval: float,
    surrogates: Sequence[str] | None = None,
    *,
    share: float = 2 / 3,
    starts: int = 8,
    horizons: Sequence[int] = (1, 2, 5, 10, 25),
    energy: float = 0.999,
    consistency: float = 1.05,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Train on the first part of a run and predict what follows it; plain types, ready for JSON.

    Modes and surrogates see the snapshots, `interval` s apart, of the first `share` of the run only. State maps, and
    the baselines without modes, are then asked ahead of several `starts`, the end of training and others spread over
    the rest, each given the snapshots up to it; regressors in time can only go on from the end of training. `horizons`
    are snapshots ahead; those longer than the rest of the run are left out. Modes: n_lr (the least that hold `energy`)
    and n_c (the most that are consistent, R_c up to `consistency`, of the training part alone; all where that is
    undefined). progress is called with (done, all).

    The answer holds `rows`, one per variable, surrogate and n: `rmse` at 1, 2, … snapshots ahead, the mean over its
    starts of the RMSE over rows, in the variable's unit, with the start kept (x(s) + Σ (ĉ - c(s)) φ), and
    `rmse_of_modes` without (W̄ + Σ ĉ φ); beside each the floor that exact coefficients would leave, and persistence
    and ballistic motion from the same starts. `behind_persistence` is the first horizon at which it is no longer better
    than persistence, `behind_ballistic` and `ahead_of_ballistic` likewise; None for never. `from_end` is the same from
    the end of training alone, where all can be compared. Also `bases`, `left_out` with reasons, and `sentences`.
    Raises `Refusal` for unknown names, numbers out of range, an interval that is no multiple of the dense one, or a run
    too short to be cut.
    """
    names = known_ahead(surrogates)
    asked = default_variables(run) if variables is None else list(dict.fromkeys(variables))
    check_ahead(share, starts, horizons, energy)
    kept, trained = cut_at(run, interval, share)
    ahead = within(horizons, len(kept) - trained)
    spread = np.unique(np.linspace(trained - 1, len(kept) - 1 - ahead[-1], starts).round().astype(np.intp))
    answer: dict[str, Any] = {
        "task": "beyond",
        "interval": interval,
        "trained": trained,
        "train_end": float(run.times[kept[trained - 1]]),
        "start_times": [float(run.times[kept[start]]) for start in spread],
        "horizons": ahead,
        "energy": energy,
        "consistency": consistency,
        "seed": seed,
        "diameter": mean_diameter(run),
        **{table: [] for table in ("rows", "bases", "left_out")},
    }
    for done, name in enumerate(asked):
        if progress:
            progress(done, len(asked))
        values, rates = held(run, name), held_rates(run, name, ["ballistic"])
        future = Future(values, rates, kept, run.times[kept], trained, spread, ahead[-1])
        _compare_one(answer, future, run, name, names)
    if progress:
        progress(len(asked), len(asked))
    return {**answer, "sentences": _sentences(answer, asked)}


def _sentences(answer: dict[str, Any], asked: Sequence[str]) -> dict[str, str]:
    """Return a sentence for each variable that was compared; Refusal where none was."""
    if not answer["rows"]:
        raise Refusal(f"nothing can be compared: {answer['left_out'][0]['reason']}")
    present = [name for name in asked if any(row["variable"] == name for row in answer["rows"])]
    return {name: foretold(name, answer) for name in present}


def known_ahead(asked: Sequence[str] | None) -> list[str]:
    """Return the surrogates to compare, default all; persistence always, for all is held against it.

    Raises Refusal for a name that is not known, or for none.
    """
    for name in asked or ():
        if name not in SURROGATES:
            raise Refusal(f"surrogate {name!r} is not known; use {', '.join(SURROGATES)}")
    if asked is not None and not asked:
        raise Refusal(f"surrogates: none is named; use {', '.join(SURROGATES)}, or leave the list out for all")
    return list(dict.fromkeys(SURROGATES if asked is None else [*asked, "persistence"]))


def check_ahead(share: float, starts: int, horizons: Sequence[int], energy: float) -> None:
    """Raise Refusal for a number out of range."""
    if not 0 < share < 1:
        raise Refusal(f"share is {share:g}; the training part must be above 0 and below 1 of the run, for example 0.67")
    if starts < 1:
        raise Refusal(f"starts is {starts}; predict from at least 1")
    if not horizons or min(horizons) < 1:
        raise Refusal(f"horizons are {list(horizons)}; give at least one, each 1 snapshot or more")
    if not 0 < energy <= 1:
        raise Refusal(f"energy is {energy:g}; it must be a share above 0 and at most 1, for example 0.999")


def cut_at(run: Run, interval: float, share: float) -> tuple[np.ndarray[Any, np.dtype[np.intp]], int]:
    """Snapshots one Δτ apart, and how many of them are trained on; Refusal where there are too few."""
    try:
        (subset,) = candidates(run.times, [interval])
    except UnfitIntervals as error:
        raise unfit(run, error) from None
    kept = subset.training
    trained = round(share * len(kept))
    if trained < FEWEST or trained >= len(kept):
        raise Refusal(
            f"interval: {interval:g} s leaves {len(kept)} snapshots, of which {trained} would be trained on; at least "
            f"{FEWEST} and one to predict are needed, take a smaller interval or another share"
        )
    return kept, trained


def within(horizons: Sequence[int], left: int) -> list[int]:
    """Return the horizons that the `left` snapshots after the training part reach, rising; Refusal where none does."""
    ahead = sorted({h for h in horizons if h <= left})
    if not ahead:
        raise Refusal(
            f"horizons: the shortest is {min(horizons)} snapshots, but only {left} follow the training part; take a "
            "shorter one, a smaller share or a smaller interval"
        )
    return ahead


def _compare_one(answer: dict[str, Any], future: Future, run: Run, variable: str, names: Sequence[str]) -> None:
    """Add what one variable has to say to the answer."""
    label = {"variable": variable, "unit": run.variable(variable).unit}
    diameter = answer["diameter"] if label["unit"] == "m" else None
    try:
        reduced = reduce_past(future, answer["energy"])
    except UnfitSnapshots as error:
        answer["left_out"].append({**label, "surrogate": None, "reason": f"{variable}: {error}"})
        return
    n_lr, n_c = reduced.basis.n_lr, _consistent(run, future, answer)
    full = reduced.basis.modes.shape[1]
    answer["bases"].append(
        {**label, "n_lr": n_lr, "n_c": n_c, "modes": full, "motion": reduced.motion, "seconds": reduced.seconds}
    )
    levels = sorted({n_lr or full, min(n_c or full, full)})
    ballistic = None if future.rates is None else ahead_of_snapshots("ballistic", future, answer["seed"])
    reference = Reference(ahead_of_snapshots("persistence", future, answer["seed"]), ballistic)
    for name in names:
        if SURROGATES[name].needs_rates and future.rates is None:
            reason = f"{name} needs the derivative of {variable}, which the run does not hold"
            answer["left_out"].append({**label, "surrogate": name, "reason": reason})
            continue
        try:
            for n in [None] if SURROGATES[name].raw else levels:
                row = _row(name, n, future, reduced, reference, answer["seed"])
                answer["rows"].append({**label, **row, "rmse_diameters": _over(row["rmse"], diameter)})
        except UnfitSeries as error:
            answer["left_out"].append({**label, "surrogate": name, "reason": f"{name}: {error}"})


def _consistent(run: Run, future: Future, answer: dict[str, Any]) -> int | None:
    """n_c of the training part at this Δτ, None where there are no unseen snapshots or no consistent mode."""
    dense = np.arange(future.kept[future.trained - 1] + 1)
    part = SnapshotMatrix(future.values).columns(dense)
    limits = Thresholds(energy=answer["energy"], consistency=answer["consistency"])
    (found,) = sweep(part, run.times[dense], [answer["interval"]], limits, groups=None).candidates
    return found.n_c if found.K_f is not None and found.n_c > 0 else None


def _row(name: str, n: int | None, future: Future, reduced: Reduced, reference: Reference, seed: int) -> dict[str, Any]:
    """Curves against the horizon, what they cross, and what they cost, in plain types."""
    ahead = reference._asdict().get(name)
    if ahead is None:
        ahead = ahead_of_snapshots(name, future, seed) if n is None else ahead_of_modes(name, future, reduced, n, seed)
    curve, persistence = _mean(ahead.errors), _mean(reference.persistence.errors[ahead.starts])
    row = {
        "surrogate": name,
        "kind": "raw" if n is None else SURROGATES[name].kind,
        "modes": n,
        "starts": len(ahead.starts),
        "rmse": curve,
        "relative": _over(curve, reduced.motion),
        **_of_modes(n, ahead, future, reduced),
        "persistence": persistence,
        "over_persistence": _ratio(curve[0], persistence[0]),
        "behind_persistence": first_above(curve, persistence),
        "from_end": _from_end(ahead, reference),
        "ballistic": None,
        "behind_ballistic": None,
        "ahead_of_ballistic": None,
        "fit_seconds": ahead.fit_seconds,
        "step_seconds": ahead.step_seconds,
    }
    if reference.ballistic is not None:
        flown = _mean(reference.ballistic.errors[ahead.starts])
        row |= {
            "ballistic": flown,
            "behind_ballistic": first_above(curve, flown),
            "ahead_of_ballistic": first_above(flown, curve),
        }
    return row


def _from_end(ahead: Ahead, reference: Reference) -> dict[str, Any]:
    """Return the curve from the first start, the end of training, which is the only one that all can start from."""
    curve, persistence = _mean(ahead.errors[:1]), _mean(reference.persistence.errors[:1])
    return {"rmse": curve, "over_persistence": _ratio(curve[0], persistence[0])}


def _of_modes(n: int | None, ahead: Ahead, future: Future, reduced: Reduced) -> dict[str, Any]:
    """Return the floors beside a row with modes, and its error where the start is not kept."""
    if n is None:
        return {"rmse_of_modes": None, "floor": None, "floor_of_modes": None}
    kept, alone = floors(future, reduced, n)
    return {
        "rmse_of_modes": _mean(ahead.alone),
        "floor": _mean(kept[ahead.starts]),
        "floor_of_modes": _mean(alone[ahead.starts]),
    }


def _over(curve: list[float | None], unit: float | None) -> list[float | None] | None:
    """Return a curve in this unit, None where there is none."""
    return None if unit is None else [None if error is None else error / unit for error in curve]


def _mean(errors: Array) -> list[float | None]:
    """Mean over the starts at each horizon; None where any rollout was lost."""
    return [float(error) if np.isfinite(error) else None for error in errors.mean(axis=0)]


def _ratio(error: float | None, reference: float | None) -> float | None:
    return error / reference if error is not None and reference else None
