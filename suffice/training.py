"""From a run to a trained surrogate on disk."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pod import InputError as UnfitSnapshots
from selection.errors import InputError as UnfitIntervals
from selection.intervals import Subset, candidates
from suffice.compare import CONSISTENCY
from suffice.derived import velocity_rmse
from suffice.door import InterruptedRunError
from suffice.doubts import EARLY
from suffice.making import is_trained, made
from suffice.model import Model, begin_training, check_model_place, save_model
from suffice.progress import Reporter
from suffice.reconstruction import (
    Case,
    Reduced,
    consistent_level,
    ended_early,
    projection_errors,
    reduce,
    training_remark,
)
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.uneven import unfit
from suffice.variables import held, held_rates, held_velocity, mean_diameter
from surrogates import SURROGATES, Network, Surrogate


class Wish(NamedTuple):
    """What is trained, and how long."""

    variable: str
    interval: float  # s, Δτ
    surrogate: str
    modes: int | None = None  # default n_c, but no fewer than n_lr; n_lr where n_c is not defined
    energy: float = 0.999
    seed: int = 0
    max_seconds: float | None = None
    resume: bool = False


def train_model(run: Run, folder: Path, wish: Wish, reporter: Reporter) -> dict[str, Any]:
    """Fit one surrogate to a variable of a run, write it with its modes, and return its card in plain types.

    A network leaves its states and a log in the folder on the way and can be resumed. Raises Refusal,
    pod.InputError or surrogates.InputError for what cannot be used.
    """
    check_wish(wish.surrogate)
    if wish.resume and not is_trained(wish.surrogate):
        raise Refusal(f"--resume with --surrogate {wish.surrogate}: only networks are trained in steps; leave it out")
    check_model_place(folder)
    subset = _subset(run, wish.interval)
    unseen = np.setdiff1d(subset.testing, subset.training)
    values, rates = held(run, wish.variable), held_rates(run, wish.variable, [wish.surrogate])
    case = Case(values, rates, run.times, subset.training, unseen)
    try:
        reduced = reduce(case, wish.energy)
    except UnfitSnapshots as error:
        raise Refusal(f"{wish.variable}: {error}") from None
    n_c = consistent_level(reduced, case, CONSISTENCY) if len(unseen) else None  # R_c is 1 by construction
    n = _modes(wish, reduced, n_c)
    surrogate = _fitted(wish, case, reduced, n, folder, reporter)
    model = _model(run, wish, case, reduced, surrogate, (n, n_c))
    save_model(folder, model)
    return dict(model.card)


def check_wish(surrogate: str) -> None:
    """Refuse what is not trained on modes."""
    known = [name for name, member in SURROGATES.items() if not member.raw]
    if surrogate not in known:
        raise Refusal(f"--surrogate {surrogate!r} is not one that is trained on modes; use {', '.join(known)}")


def _subset(run: Run, interval: float) -> Subset:
    try:
        (subset,) = candidates(run.times, [interval])
    except UnfitIntervals as error:
        raise unfit(run, error) from None
    return subset


def _modes(wish: Wish, reduced: Reduced, n_c: int | None) -> int:
    """Return the number of modes asked for, or as many as are consistent, but no fewer than hold the energy.

    n_c is None where nothing lies between the snapshots: then as many as hold the energy.
    """
    full = reduced.basis.modes.shape[1]
    if wish.modes is None:
        return max(n_c or 0, reduced.basis.n_lr or full)
    if not 1 <= wish.modes <= full:
        raise Refusal(f"--modes is {wish.modes}; these snapshots have {full} modes, give 1 to {full}")
    return wish.modes


def _fitted(wish: Wish, case: Case, reduced: Reduced, n: int, folder: Path, reporter: Reporter) -> Surrogate:
    surrogate = made(wish.surrogate, wish.seed, wish.max_seconds)
    times, known = case.times[case.training], reduced.coefficients[case.training, :n]
    rates = None if reduced.rates is None else reduced.rates[:, :n]
    network = isinstance(surrogate, Network)
    try:
        with reporter.stage("train", "steps" if network else "fits") as advance:
            if isinstance(surrogate, Network):
                begin_training(folder)
                surrogate.watched(folder, wish.resume, advance)
                surrogate.fit(times, known, rates)
                if ended_early(surrogate):
                    reporter.warn(EARLY, f"{wish.variable}, {wish.surrogate}: {training_remark(surrogate)}")
                return surrogate
            advance(0, 1)
            surrogate.fit(times, known, rates)
            advance(1, 1)
            return surrogate
    except KeyboardInterrupt:
        raise InterruptedRunError(
            f"interrupted; the training stands in {folder}, the same command with --resume goes on"
        ) from None


def _model(
    run: Run, wish: Wish, case: Case, reduced: Reduced, surrogate: Surrogate, levels: tuple[int, int | None]
) -> Model:
    """Model with what is known about its errors."""
    n, n_c = levels
    basis, variable = reduced.basis, run.variable(wish.variable)
    of_fluid = wish.variable.startswith("fluid.")
    mean, modes = (part.astype(variable.dtype) for part in (basis.mean, basis.modes[:, :n]))
    card = {
        "surrogate": wish.surrogate,
        "settings": surrogate.settings(),
        "run": str(run.path),
        "variable": wish.variable,
        "unit": variable.unit,
        "interval": wish.interval,
        "window": list(surrogate.window_),
        "n_snapshots": len(case.training),
        "n_rows": len(basis.mean),
        "n_modes": n,
        "n_lr": basis.n_lr,
        "n_c": n_c,
        "thresholds": {"energy": wish.energy, "consistency": CONSISTENCY},
        "grid": None if not of_fluid or run.grid is None else [list(part) for part in run.grid],
        "storage_bytes": mean.nbytes + modes.nbytes + sum(array.nbytes for array in surrogate.arrays().values()),
        "fit_seconds": surrogate.fit_seconds_,
        "training": training_remark(surrogate),
        **_errors(run, wish.variable, case, reduced, surrogate, n),
    }
    particles = {"ids": run.ids, "radius": run.radius, "species": run.species}
    return Model(surrogate, mean, np.ascontiguousarray(modes), particles, card)


def _errors(run: Run, name: str, case: Case, reduced: Reduced, surrogate: Surrogate, n: int) -> dict[str, float | None]:
    """Return errors between the training snapshots, None where there are none or a state map has no answer.

    `velocity_rmse` is that of the derivative of a position in place of its stored velocity, m/s.
    """
    found: dict[str, float | None] = dict.fromkeys(("rmse", "projection_rmse", "rmse_diameters", "velocity_rmse"))
    if not len(case.unseen) or not surrogate.bridges:
        return found
    floor, unseen = projection_errors(reduced, case, n), case.times[case.unseen]
    miss = surrogate.predict(unseen) - reduced.coefficients[case.unseen, :n]
    rmse = float(np.sqrt(floor**2 + np.square(miss).sum(axis=1) / len(reduced.basis.mean)).mean())
    found |= {"rmse": rmse, "projection_rmse": float(floor.mean())}
    diameter = mean_diameter(run)
    if diameter and run.variable(name).unit == "m":
        found["rmse_diameters"] = rmse / diameter
    velocity = held_velocity(run, name) if surrogate.differentiable else None
    if velocity is not None:
        basis = reduced.basis._replace(modes=reduced.basis.modes[:, :n])
        found["velocity_rmse"] = velocity_rmse(surrogate, basis, velocity, unseen, case.unseen)
    return found
