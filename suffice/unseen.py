"""Fields at a rotor speed that nobody showed to the surrogates (task "unseen").

The averaged fields of every other speed are decomposed together, the coefficients of the modes are fitted over speed
and phase, and the fields at the speed held out are predicted and held against its own simulation.

Errors of a field are relative to its spread over speeds, e = rms(predicted − measured) / S,
S² = mean over training speeds, phases and rows of (f − mean of f over training speeds)²: 1 is what the mean over all
training speeds would cost. Beside every error stand the statistical floor, the standard error of the measured averages
themselves, and the projection floor, what the modes leave of all fields together; a single field may err less than its
part of it, at the cost of another.
"""

from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from pod import lanczos_pod
from pod.basis import Basis
from suffice.fields import Array, scene_of
from suffice.phases import FIELDS, Averages, averages
from suffice.refusal import Refusal
from suffice.rotor import Rotor, angle, check_one_scene, rotor_of
from suffice.run import Run
from suffice.unseen_verdicts import OVERALL, ahead_of, sentences
from surrogates import CONDITION_SURROGATES

POWERS = {"void_fraction": 0, "solid_flux": 1, "agitation": 2, "fluid_flux": 1, "pressure": 2}  # of the tip speed
SCALINGS = {"none": 0, "tip speed": 1}
AVERAGES = ("phase", "time")
COMPETITORS = {  # name of a regressor over conditions, and whether it sees the logarithm of the speed
    "nearest": ("nearest", False),
    "linear": ("linear", False),
    "log-linear": ("linear", True),
    "rbf": ("rbf", True),
    "mlp": ("mlp", True),
}
HALVES = ("whole", "first half", "second half")


class Case(NamedTuple):
    """One kind of average under one scaling, training and held out."""

    training: Sequence[Averages]
    held_out: Sequence[Averages]
    spread: Mapping[str, float]  # S by field, in its unit
    scaling: int  # 1 where fields are divided by powers of the rotor's speed
    reference: float  # 1/min, speed at which that changes nothing

    @property
    def phase(self) -> bool:
        """Whether the phase is among the conditions."""
        return len(self.training[0].phase) > 1

    def conditions(self, runs: Sequence[Averages]) -> Array:
        """Speed in rpm, and cosine and sine of the phase where there is one, (samples, 1 or 3)."""
        speeds = np.repeat([abs(run.rotor.rpm) for run in runs], len(runs[0].phase))[:, None]
        return np.column_stack([speeds, angle(np.concatenate([run.phase for run in runs]))]) if self.phase else speeds

    def columns(self, runs: Sequence[Averages]) -> Array:
        """All fields of all samples, each in parts of its spread and of its number of rows, (rows, samples)."""
        return np.concatenate(
            [np.concatenate([self._factor(run, name) * run.fields[name] for run in runs]).T for name in FIELDS]
        )

    def fields(self, columns: Array, runs: Sequence[Averages]) -> list[dict[str, Array]]:
        """Invert `columns`: the fields of every run by name, (bins, rows) in their units."""
        ends = np.cumsum([self.training[0].fields[name].shape[1] for name in FIELDS])[:-1]
        parts = dict(zip(FIELDS, np.split(columns, ends), strict=True))
        bins = len(self.training[0].phase)
        return [
            {name: part.T[i * bins : (i + 1) * bins] / self._factor(run, name) for name, part in parts.items()}
            for i, run in enumerate(runs)
        ]

    def _factor(self, run: Averages, name: str) -> float:
        pace = (self.reference / abs(run.rotor.rpm)) ** (self.scaling * POWERS[name])
        return float(pace / (self.spread[name] * np.sqrt(run.fields[name].shape[1])))


class Trial(NamedTuple):
    """One surrogate with one seed."""

    errors: Mapping[str, Mapping[str, float]]  # against the whole run and each half of it, by field
    fit_seconds: float
    predict_seconds: float  # of all phases of one speed, reconstruction included


def compare_unseen(
    runs: Sequence[Run],
    held_out: Sequence[float],
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    *,
    surrogates: Sequence[str] | None = None,
    seeds: int = 3,
    bins: int = 8,
    start_up: float = 1.0,
) -> dict[str, Any]:
    """Predict the averaged fields of runs that differ in rotor speed alone at the speeds `held_out` (rpm).

    surrogates: names in `COMPETITORS`, default all; random ones are fitted with `seeds` seeds from `seed` on.
    bins: of the rotor's phase; start_up: turns that are left out. progress is called with (done, all).
    The answer, plain types ready for JSON, holds `runs` and `cases`, one per average (over phase bins, over time) and
    scaling (none, or fields divided by the powers of the tip speed that their units ask for), each with its `rows`.
    Raises `Refusal` for fewer than three speeds, speeds held out that are unknown or not inside, or runs that differ in
    more than their speed.
    """
    names = known_competitors(surrogates)
    work = len(runs) + len(AVERAGES) * len(SCALINGS) * len(names)
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(done, work)

    scenes = [scene_of(run) for run in runs]
    check_speeds([rotor_of(scene, str(run.path)) for scene, run in zip(scenes, runs, strict=True)], held_out)
    check_one_scene(scenes)
    found = []
    for run in runs:
        found.append(averages(run, bins, start_up))
        advance()
    training, unseen = split(found, held_out)
    cases = []
    for average in AVERAGES:
        shown, hidden = ([a if average == "phase" else a.over_time() for a in part] for part in (training, unseen))
        spread = spreads(shown)
        reference = float(np.mean([abs(a.rotor.rpm) for a in shown]))
        for scaling, power in SCALINGS.items():
            case = Case(shown, hidden, spread, power, reference)
            cases.append({"average": average, "scaling": scaling, **_compared(case, names, seed, seeds, advance)})
    return {
        "task": "unseen",
        "seed": seed,
        "seeds": seeds,
        "bins": len(found[0].phase),
        "start_up": start_up,
        "fields": dict(FIELDS),
        "held_out": [abs(a.rotor.rpm) for a in unseen],
        "runs": [_facts(run, a) for run, a in zip(runs, found, strict=True)],
        "cases": cases,
    }


def check_speeds(rotors: Sequence[Rotor], held_out: Sequence[float]) -> None:
    """Raise `Refusal` unless rotors are the same but for their speeds, and those held out are between others."""
    speeds = sorted(abs(rotor.rpm) for rotor in rotors)
    if len({(rotor.name, rotor.fold) for rotor in rotors}) > 1:
        raise Refusal("runs: their rotors differ in more than the speed; give runs of one scene at several speeds")
    if len(set(speeds)) < len(speeds):
        raise Refusal(f"runs: speeds are {', '.join(f'{s:g}' for s in speeds)} rpm; give one run per speed")
    for rpm in held_out:
        if rpm not in speeds:
            raise Refusal(f"held out: {rpm:g} rpm is not run; there are {', '.join(f'{s:g}' for s in speeds)} rpm")
    shown = [rpm for rpm in speeds if rpm not in held_out]
    if not held_out or len(shown) < 2:
        raise Refusal(f"held out: {len(set(held_out))} of {len(speeds)} speeds; hold one out at least, and leave two")
    for rpm in held_out:
        if not shown[0] < rpm < shown[-1]:
            raise Refusal(f"held out: {rpm:g} rpm is not between speeds that are shown; hold out another")


def split(found: Sequence[Averages], held_out: Sequence[float]) -> tuple[list[Averages], list[Averages]]:
    """Return the averages shown and those held out, by ascending speed. Raises `Refusal` where their rows differ."""
    known = sorted(found, key=lambda a: abs(a.rotor.rpm))
    if len({tuple(field.shape for field in a.fields.values()) for a in found}) > 1:
        raise Refusal("runs: their cells or phases differ; give runs of one scene at several speeds")
    training = [a for a in known if abs(a.rotor.rpm) not in held_out]
    return training, [a for a in known if abs(a.rotor.rpm) in held_out]


def spreads(training: Sequence[Averages]) -> dict[str, float]:
    """S of every field, in its unit: rms over training speeds, phases and rows of what differs from their mean.

    Raises `Refusal` where a field does not depend on the speed at all.
    """
    found = {}
    for name in FIELDS:
        fields = np.stack([a.fields[name] for a in training])
        found[name] = float(np.sqrt(((fields - fields.mean(axis=0)) ** 2).mean()))
        if found[name] == 0.0:
            raise Refusal(f"{name} is the same at every speed shown; there is nothing to predict")
    return found


def known_competitors(asked: Sequence[str] | None) -> list[str]:
    """Return the names of surrogates to compare, default all. Raises `Refusal` for one that is not known."""
    for name in asked or ():
        if name not in COMPETITORS:
            raise Refusal(f"surrogate {name!r} is not known here; use {', '.join(COMPETITORS)}")
    return list(dict.fromkeys(asked or COMPETITORS))


def _facts(run: Run, found: Averages) -> dict[str, Any]:
    error = {name: float(np.sqrt((found.error(name) ** 2).mean())) for name in FIELDS}
    return {
        "path": str(run.path),
        "rpm": abs(found.rotor.rpm),
        "periods": found.periods,
        "snapshots": found.snapshots,
        "standard_error": error,
    }


def _compared(case: Case, names: Sequence[str], seed: int, seeds: int, advance: Callable[[], None]) -> dict[str, Any]:
    """Fit and hold every surrogate against the speeds held out, in one case."""
    columns = case.columns(case.training)
    began = perf_counter()
    basis = lanczos_pod(columns, modes=columns.shape[1] - 1)
    seconds = perf_counter() - began
    unseen = case.columns(case.held_out)
    floor = _errors(case, basis.reconstruct(basis.project(unseen)))["whole"]
    statistical = {
        name: float(np.sqrt(np.mean([(a.error(name) ** 2).mean() for a in case.held_out]))) / case.spread[name]
        for name in FIELDS
    }
    statistical[OVERALL] = overall(statistical)
    coefficients = basis.project(columns)
    rows = []
    for name in names:
        tries = range(seed, seed + (seeds if CONDITION_SURROGATES[COMPETITORS[name][0]].random else 1))
        rows.append(_row(name, [_trial(case, basis, coefficients, name, s) for s in tries]))
        advance()
    return {
        "samples": columns.shape[1],
        "modes": basis.modes.shape[1],
        "pod_seconds": seconds,
        "spread": dict(case.spread),
        "statistical_floor": statistical,
        "projection_floor": floor,
        "rows": [{**row, "ahead_of": {key: ahead_of(row, rows, key) for key in (*FIELDS, OVERALL)}} for row in rows],
        "sentences": sentences(rows, statistical, floor),
    }


def _trial(case: Case, basis: Basis, coefficients: Array, name: str, seed: int) -> Trial:
    regressor, logarithmic = COMPETITORS[name]
    surrogate = CONDITION_SURROGATES[regressor](phase=case.phase, logarithmic=logarithmic, seed=seed)
    surrogate.fit(case.conditions(case.training), coefficients)
    began = perf_counter()
    predicted = basis.reconstruct(surrogate.predict(case.conditions(case.held_out)))
    seconds = (perf_counter() - began) / len(case.held_out)
    return Trial(_errors(case, predicted), surrogate.fit_seconds_, seconds)


def _errors(case: Case, predicted: Array) -> dict[str, dict[str, float]]:
    """Errors of predicted columns in parts of the spread: against the runs held out, and against each half of them."""
    fields = case.fields(predicted, case.held_out)
    truths = [[(a.fields, *a.halves)[k] for a in case.held_out] for k in range(len(HALVES))]
    found = {}
    for half, truth in zip(HALVES, truths, strict=True):
        errors = {
            name: float(np.sqrt(np.mean([(p[name] - t[name]) ** 2 for p, t in zip(fields, truth, strict=True)])))
            / case.spread[name]
            for name in FIELDS
        }
        found[half] = {**errors, OVERALL: overall(errors)}
    return found


def overall(errors: Mapping[str, float]) -> float:
    """Root mean square over the fields: each counts alike."""
    return float(np.sqrt(np.mean([errors[name] ** 2 for name in FIELDS])))


def _row(name: str, trials: Sequence[Trial]) -> dict[str, Any]:
    """Mean over the seeds of every error, and how much they scatter; plain types."""

    def each(half: str, field: str) -> list[float]:
        return [trial.errors[half][field] for trial in trials]

    keys = (*FIELDS, OVERALL)
    return {
        "surrogate": name,
        "seeds": len(trials),
        "errors": {key: float(np.mean(each("whole", key))) for key in keys},
        "seed_spread": {key: float(np.std(each("whole", key), ddof=1)) if len(trials) > 1 else 0.0 for key in keys},
        "half_errors": {key: [float(np.mean(each(half, key))) for half in HALVES[1:]] for key in keys},
        "fit_seconds": float(np.median([trial.fit_seconds for trial in trials])),
        "predict_seconds": float(np.median([trial.predict_seconds for trial in trials])),
    }
