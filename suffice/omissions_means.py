"""What a run amounts to: averages over its steady part, which runs of a chaotic flow can be held against each other by.

Paths of particles cannot: after some ten impacts two runs that differ in round-off share none.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from selection import InputError as UnfitIntervals
from selection import sweep
from sim.vessel import WallTable
from suffice.fields import scene_of
from suffice.impacts import KINDS, Spectrum, half_energy, mean_spectra
from suffice.observables import OBSERVABLES, observe, room_at, watch_of
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.solids import Bins, Profile

Array = NDArray[np.float64]
Observed = tuple[Array, Array]  # values and weights (k,)
MOST_OBSERVED = 60  # snapshots of which profiles are made
PARTS = 4  # of the time that is averaged, whose scatter is looked at
FEASIBILITY = "feasibility"

MEANINGS: Mapping[str, tuple[str, str]] = {  # observable -> what it is, unit
    "kinetic_energy": (OBSERVABLES["kinetic_energy"].text, "J"),
    "granular_temperature": ("granular temperature", "m²/s²"),
    "coordination": ("contacts per particle", "1"),
    "overlap.99": ("overlap that 99 % of the contacts stay below", "d"),
    "overlap.largest": ("largest overlap in any snapshot", "d"),
    "power.shaft": ("power of what moves, on particles and fluid", "W"),
    "power.particles": ("power of what moves, on particles alone", "W"),
    "dissipation.contacts": ("power lost in contacts", "W"),
    "dissipation.slip": ("power lost in the slip of particles and fluid", "W"),
    "fluid.kinetic": ("kinetic energy of the fluid", "J"),
    **{
        f"impacts.{kind}.{key}": (f"{text}, {'of pairs' if kind == 'pairs' else 'with walls'}", unit)
        for kind in KINDS
        for key, text, unit in (
            ("rate", "impacts", "1/s"),
            ("power", "power of impacts", "W"),
            ("energy", "energy of impacts below which half of the power lies", "J"),
        )
    },
    **{
        name: (f"solids fraction {what}", "1")
        for name, what in (
            ("void_fraction.height", "against height"),
            ("void_fraction.axis", "along the axis"),
            ("void_fraction.radius", "against distance from the axis"),
        )
    },
    "bed_height": (OBSERVABLES["bed_height"].text, "m"),
    "rotor_side": (OBSERVABLES["rotor_side"].text, "1"),
    "mixing": (OBSERVABLES["mixing"].text, "1"),
    FEASIBILITY: ("feasibility index K_f", "1"),
}
MEAN_SERIES = ("granular_temperature", "coordination", "overlap.99", "fluid.kinetic")
RATES = {"dissipation.contacts": "energy.dissipated", "dissipation.slip": "fluid.slip_loss"}


class Average(NamedTuple):
    """An observable over time: one number, or a profile with the volume of each of its bins."""

    values: Array  # (k,)
    weights: Array  # (k,)
    parts: Array  # (PARTS, k), the same over equal parts of the time; (0, k) where it has no parts


class Means(NamedTuple):
    """What a run amounts to."""

    observables: Mapping[str, Average]  # by name, in the units of `MEANINGS`
    bins: Mapping[str, Bins]  # of its profiles
    spectra: Mapping[str, Spectrum]  # of impacts, by kind
    feasibility: Mapping[str, Any]  # `chosen_interval`, and K_f by Δτ
    window: tuple[float, float]  # s, that is averaged
    bytes_per_snapshot: int


class Outcome(NamedTuple):
    """A run of the scene or of a variant: what it cost and amounts to, or why it was refused."""

    name: str
    left_out: str
    cost: Mapping[str, Any] | None  # as `simulate_to` says it, with `processor_seconds`
    means: Means | None
    refused: str | None = None


def check_names(names: Sequence[str]) -> None:
    """Raise Refusal for an observable that there is not."""
    for name in names:
        if name not in MEANINGS and not name.startswith("mixing."):
            raise Refusal(f"observables: {name!r} is not known; use {', '.join(MEANINGS)}")


def means_of(run: Run, start_up: float, variable: str, interval: float, like: Means | None = None) -> Means:
    """Average a run from `start_up` (s) to its end.

    variable and interval: of the feasibility index, Δτ in s. like: a run whose bins the profiles take.
    Raises Refusal where nothing is left to average, or the index cannot be had.
    """
    first = int(np.searchsorted(run.times, start_up * (1.0 - 1e-9)))
    if run.n_snapshots < first + 3:
        raise Refusal(
            f"start_up = {start_up:g} s leaves {max(run.n_snapshots - first, 0)} snapshots of {run.path}; three at "
            "least are averaged: lower it, or lengthen the run"
        )
    feasibility = _feasibility(run, first, variable, interval)
    found, bins = _observed(run, first, None if like is None else like.bins)
    found |= _recorded(run, first)
    if feasibility["K_f"] is not None:
        found[FEASIBILITY] = _one(feasibility["K_f"])
    size = sum(rows.nbytes for rows in run.snapshot(0).values.values())
    window = (float(run.times[first]), float(run.times[-1]))
    return Means(found, bins, mean_spectra(run, first), feasibility, window, size)


def _one(value: float, parts: Sequence[float] = ()) -> Average:
    return Average(np.array([value]), np.ones(1), np.array(parts, dtype=np.float64).reshape(-1, 1))


def _recorded(run: Run, first: int) -> dict[str, Average]:
    """Averages of what the run recorded as it went: its series, and its impacts."""
    last = run.n_snapshots - 1
    ends = np.linspace(first, last, PARTS + 1).round().astype(int).tolist()
    whole = _between(run, first, last)
    parts = [_between(run, a, b) for a, b in pairwise(ends)] if last - first >= 2 * PARTS else []
    without = ("overlap.largest",)  # the largest of a part is not that of the whole
    return {
        name: _one(value, [] if name in without else [part[name] for part in parts if name in part])
        for name, value in whole.items()
    }


def _between(run: Run, first: int, last: int) -> dict[str, float]:
    return _of_series(run, first, last) | _of_impacts(mean_spectra(run, first, last))


def _of_series(run: Run, first: int, last: int) -> dict[str, float]:
    """Averages between two snapshots; forces and powers are means over the interval before a snapshot."""
    series = {name: values[first : last + 1] for name, values in run.series.items()}
    elapsed = float(run.times[last] - run.times[first])
    found = {name: float(series[name].mean()) for name in MEAN_SERIES if name in series}
    found |= {
        name: float(series[whole][-1] - series[whole][0]) / elapsed for name, whole in RATES.items() if whole in series
    }
    if "overlap.100" in series:
        found["overlap.largest"] = float(series["overlap.100"].max())
    moving = [wall.name for wall in _moving(run)]
    given = [float(series[f"power.{name}"][1:].mean()) for name in moving if f"power.{name}" in series]
    fluid = [float(series[f"fluid_power.{name}"][1:].mean()) for name in moving if f"fluid_power.{name}" in series]
    if given:
        found |= {"power.particles": sum(given), "power.shaft": sum(given) + sum(fluid)}
    return found


def _moving(run: Run) -> list[WallTable]:
    if "scene" not in run.provenance:
        return []
    return [wall for wall in scene_of(run).walls if wall.motion is not None]


def _of_impacts(spectra: Mapping[str, Spectrum]) -> dict[str, float]:
    found: dict[str, float] = {}
    for kind, spectrum in spectra.items():
        rate, power = float(spectrum.rate.sum()), float(spectrum.power.sum())
        found |= {f"impacts.{kind}.rate": rate, f"impacts.{kind}.power": power}
        if rate:
            found[f"impacts.{kind}.energy"] = half_energy(spectrum.energy, spectrum.power)
    return found


def _observed(run: Run, first: int, bins: Mapping[str, Bins] | None) -> tuple[dict[str, Average], Mapping[str, Bins]]:
    """Means of what is observed in snapshots, evenly chosen; profiles as the share that is solid."""
    if "position" not in run.quantities:
        return {}, {}
    chosen = range(first, run.n_snapshots, -(-(run.n_snapshots - first) // MOST_OBSERVED))
    watch = watch_of(run, chosen)
    if bins is not None:
        watch = watch._replace(bins={name: own for name, own in bins.items() if name in watch.bins})
    seen: dict[str, list[Observed]] = {}
    for k in chosen:
        values = {name: np.asarray(rows, np.float64) for name, rows in run.snapshot(k).values.items()}
        found = observe(watch, room_at(watch, float(run.times[k])), values["position"], values.get("velocity"))
        for name, value in found.items():
            if name in MEANINGS or name.startswith("mixing."):
                seen.setdefault(name, []).append(_observation(value))
    means = {name: _average(moments) for name, moments in seen.items()}
    # a mixing index may not be defined at every time
    return {name: mean for name, mean in means.items() if np.isfinite(mean.values).all()}, watch.bins


def _observation(value: float | Profile) -> Observed:
    if isinstance(value, Profile):
        return np.nan_to_num(1.0 - value.values), value.room
    return np.array([value]), np.ones(1)


def _average(moments: Sequence[Observed]) -> Average:
    split = np.array_split(np.arange(len(moments)), PARTS) if len(moments) >= 2 * PARTS else []
    parts = [_mean([moments[k] for k in part])[0] for part in split]
    values, weights = _mean(moments)
    return Average(values, weights, np.array(parts).reshape(-1, len(values)))


def _mean(moments: Sequence[Observed]) -> Observed:
    """Mean over time, each moment of a bin weighed by the room that walls leave in it."""
    weights = np.array([weight for _, weight in moments])
    summed = (np.array([values for values, _ in moments]) * weights).sum(axis=0)
    whole = weights.sum(axis=0)
    return np.divide(summed, whole, out=np.zeros_like(summed), where=whole > 0.0), whole / len(moments)


def _feasibility(run: Run, first: int, variable: str, interval: float) -> dict[str, Any]:
    """K_f at Δτ of a variable over the steady part, and the largest Δτ that suffices by the paper's rule."""
    W = run.variable(variable)[:][:, first:]
    try:
        found = sweep(W, run.times[first:], None, thresholds_of(variable))
        (own,) = sweep(W, run.times[first:], [interval], thresholds_of(variable)).candidates
    except UnfitIntervals as error:
        raise Refusal(f"{run.path}: {error}") from None
    by_interval = {f"{candidate.interval:g}": candidate.K_f for candidate in found.candidates}
    return {"chosen_interval": found.chosen_interval, "K_f": own.K_f, "by_interval": by_interval}
