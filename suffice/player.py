"""A run and what a surrogate makes of it, side by side over time, for the player of the report."""

import zlib
from collections.abc import Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import InputError as UnfitSnapshots
from pod import RowSource
from selection.errors import InputError as UnfitIntervals
from selection.intervals import Subset, candidates
from suffice.fluid_slice import VARIABLE, Slices, slices_of
from suffice.frames import STEPS, Box, box_of, pack, placed
from suffice.modelled import Modelled, modelled
from suffice.outline import outlines_of
from suffice.reconstruction import Case
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import FLUID_ENERGY
from suffice.setting import Setting, setting_of
from suffice.variables import columns_of, held, held_velocity
from surrogates import InputError as UnfitSeries

Array = NDArray[np.float64]
Results = Mapping[str, Any]

MOST_FRAMES = 100
MOST_PARTICLES = 20_000
MOST_MODES_BYTES = 4 * 2**30  # all modes of all particles, in double precision
PER_DIAMETER = 500  # quanta: a finer place is not seen, nor a finer error by its colour
MOST_BYTES = 16 * 10**6  # deflated: as base64, with 8 MB of figures and their library, a page stays under 30 MB
ENERGY = 0.999  # that n_lr modes hold
UNKNOWN_RADIUS = 0.01  # of the box's edge: drawn where the run does not know it
BRIGHTEST = 0.995  # share of speeds or errors below the end of the scale …
STEPS_OF_SCALE = 20  # … that spans no fewer quanta, or it would show how places are rounded


class Prediction(NamedTuple):
    """Positions that a surrogate trained every Δτ gives, and how far off they are."""

    interval: float  # s, Δτ
    model: Modelled
    kept: NDArray[np.bool_]  # (frames,) which frames it was trained on
    position: Array  # (frames, n, 3) m
    error: Array  # (frames, n) m, distance from the truth


class Shown(NamedTuple):
    """What part of a run is shown, by numbers of snapshots and particles, and the truth there."""

    frames: NDArray[np.intp]  # (frames,)
    particles: NDArray[np.intp]  # (n,)
    truth: Array  # (frames, n, 3) m


class Player(NamedTuple):
    """What the page shows: facts in plain types, and the frames."""

    facts: dict[str, Any]  # ready for JSON, without the frames
    streams: dict[str, bytes]  # deflated: `truth`, `radius` (float32, m), a prediction each under its number, and
    # the fluid's as `Slices` has them; `lines` (2 lines, 3) and `moved` (frames, bodies that move, 3, 4), float32, m


def player_of(path: Path, results: Results) -> Player | None:
    """Return the frames of a run beside those of a surrogate, of as many beads and snapshots as a page can hold.

    The surrogate is Hermite's cubic on n_c modes of the vector `position`, but no fewer than n_lr, a spline where the
    run has no velocities. It is trained twice, see `intervals_shown`: at a coarse Δτ, so that errors are seen, and at
    a fine one. The frames are the last snapshots of the window, every one, at most 100, of at most 20,000 particles.
    Where the run has a fluid, its speed on three planes goes with them, simulated and of a spline on its own modes.

    path: of a run; results: with `compare` or `select` as the report has them of this run; None without both. What
    prevents a player is said in `facts["left_out"]`, and then there are no streams.
    """
    if not (results.get("compare") or results.get("select")):
        return None
    try:
        with Run(path) as run:
            if "position" not in run.quantities:
                return _without("the run holds no positions")
            intervals = intervals_shown(results)
            if not intervals:
                return _without("positions were compared at no Δτ that leaves snapshots to predict")
            return _player(run, intervals, sufficient_interval(results))
    except (Refusal, UnfitIntervals, UnfitSnapshots, UnfitSeries) as error:
        return _without(str(error))


def intervals_shown(results: Results) -> list[float]:
    """Return the coarsest Δτ compared (s) and, where finer, the largest that is sufficient for all of position.

    Where none is sufficient for every component, the finest compared stands in its place. Where nothing was compared,
    those that were judged count instead.
    """
    tried = _compared(results) if results.get("compare") else _considered(results)
    if not tried:
        return []
    sufficient = sufficient_interval(results)
    finer = min(tried) if sufficient is None or sufficient not in tried else sufficient
    return sorted({max(tried), finer}, reverse=True)


def _compared(results: Results) -> set[float]:
    return {row["interval"] for row in results["compare"]["rows"] if row["variable"].startswith("position")}


def _considered(results: Results) -> set[float]:
    judged = results["select"]["variables"]
    rows = [row for name, found in judged.items() if name.startswith("position") for row in found["candidates"]]
    return {row["interval"] for row in rows if row["interval"] > results["select"]["dense_interval"]}


def sufficient_interval(results: Results) -> float | None:
    """Return the largest Δτ (s) that the paper's rule finds sufficient for every component of position, or None."""
    judged = (results.get("select") or {}).get("variables") or {}
    chosen = [found.get("chosen_interval") for name, found in judged.items() if name.startswith("position")]
    return min(chosen) if chosen and all(chosen) else None


def _without(reason: str) -> Player:
    return Player({"left_out": reason}, {})


def _player(run: Run, intervals: Sequence[float], sufficient: float | None) -> Player:
    subsets = [
        each
        for each in candidates(run.times, list(intervals))
        if _modes_bytes(run.n_particles, each) <= MOST_MODES_BYTES
    ]
    if not subsets:
        return _without("the modes of all particles would take more than 4 GiB")
    shown, found = _predictions(run, subsets)
    setting = setting_of(run)
    fluid, no_fluid = _slices(run, setting, subsets, shown.frames)
    room = 0 if fluid is None else sum(map(len, fluid.streams.values()))
    finest = (setting.diameter or 0.0) / PER_DIAMETER
    box, packed = packed_within([shown.truth, *(each.position for each in found)], finest, MOST_BYTES - room)
    bodies, lines = _outlines(setting, run.times[shown.frames], shown.truth)
    streams = {"truth": packed[0], "radius": _radii(run.radius[shown.particles], box), **lines}
    streams |= {str(i): data for i, data in enumerate(packed[1:])}
    streams |= {} if fluid is None else fluid.streams
    facts = {
        "run": run.path.name,
        "frames": len(shown.frames),
        "particles": len(shown.particles),
        "of_particles": run.n_particles,
        "times": run.times[shown.frames].tolist(),
        "lowest": box.lowest.tolist(),
        "quantum": box.quantum,
        "diameter": setting.diameter,
        "up": [0.0, 0.0, 1.0] if setting.up is None else setting.up.tolist(),
        "period": None if setting.period is None else [part.tolist() for part in setting.period],
        "sufficient": sufficient,
        "fastest": _fastest(shown.truth, run.times[shown.frames], box.quantum),
        "predictions": [_facts(each, setting.diameter, box.quantum) for each in found],
        "fluid": None if fluid is None else fluid.facts,
        "fluid_left_out": no_fluid,
        "bodies": bodies,
        "bytes": sum(map(len, streams.values())),
    }
    return Player(facts, streams)


def _predictions(run: Run, subsets: Sequence[Subset]) -> tuple[Shown, list[Prediction]]:
    """Return the truth of the last frames, and what is predicted of them from each training set."""
    values, rates = held(run, "position"), held_velocity(run, "position")
    last = min(int(subset.training[-1]) for subset in subsets)
    frames = np.arange(max(last + 1 - MOST_FRAMES, 0), last + 1)
    particles = np.linspace(0, run.n_particles - 1, min(MOST_PARTICLES, run.n_particles)).round().astype(np.intp)
    truth = columns_of(values, frames).reshape(len(frames), -1, 3)[:, particles].astype(np.float64)
    shown = Shown(frames, particles, truth)
    return shown, [_predicted(_case(values, rates, run, subset), subset, shown) for subset in subsets]


def _case(values: RowSource, rates: RowSource | None, run: Run, subset: Subset) -> Case:
    return Case(values, rates, run.times, subset.training, np.setdiff1d(subset.testing, subset.training))


def _slices(
    run: Run, setting: Setting, subsets: Sequence[Subset], frames: NDArray[np.intp]
) -> tuple[Slices | None, str]:
    """Return the speed of the fluid on planes; or None, and why where the run has a fluid."""
    if VARIABLE not in run.quantities or run.grid is None:
        return None, ""
    if max(_modes_bytes(prod(run.grid.shape), subset) for subset in subsets) > MOST_MODES_BYTES:
        return None, "the modes of all cells would take more than 4 GiB"
    values, times = held(run, VARIABLE), run.times[frames]
    try:
        models = [modelled(_case(values, None, run, subset), FLUID_ENERGY, times) for subset in subsets]
    except UnfitSnapshots as error:
        return None, str(error)
    return slices_of(values, run.grid, setting, frames, models), ""


def _outlines(setting: Setting, times: Array, truth: Array) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Return name, number of ends of lines and whether it moves of each body, and their streams."""
    found = outlines_of(setting, times, (truth.min(axis=(0, 1)), truth.max(axis=(0, 1))))
    if not found:
        return [], {}
    bodies = [{"name": each.name, "ends": len(each.ends), "moves": each.moved is not None} for each in found]
    moved = [each.moved for each in found if each.moved is not None]
    paths = np.stack(moved, axis=1) if moved else np.empty(0)
    return bodies, {"lines": _floats(np.concatenate([each.ends for each in found])), "moved": _floats(paths)}


def packed_within(positions: Sequence[Array], finest: float, most: int = MOST_BYTES) -> tuple[Box, list[bytes]]:
    """Pack several series of positions (frames, n, 3) m in one box, in coarser quanta until they fit in `most` bytes.

    finest: m, the quantum to begin with, unless the 16 bits of a place need a coarser one.
    """
    while True:
        box = box_of(positions, finest)
        packed = [pack(placed(each, box)) for each in positions]
        if sum(map(len, packed)) <= most:
            return box, packed
        finest = 2.0 * box.quantum


def _modes_bytes(places: int, subset: Subset) -> int:
    """Return what the modes of a vector at so many places take, in double precision."""
    return 8 * 3 * places * len(subset.training)


def _predicted(case: Case, subset: Subset, shown: Shown) -> Prediction:
    """Train on the snapshots kept and predict those shown."""
    model = modelled(case, ENERGY, case.times[shown.frames])
    rows = (3 * shown.particles[:, None] + np.arange(3)).ravel()
    position = model.at(rows).reshape(shown.truth.shape)
    error = np.linalg.norm(position - shown.truth, axis=-1)
    return Prediction(subset.interval, model, np.isin(shown.frames, case.training), position, error)


def _facts(found: Prediction, diameter: float | None, quantum: float) -> dict[str, Any]:
    """Facts of a prediction in plain types; errors of the frames are those of the particles shown."""
    unseen = found.error[~found.kept]
    return {
        "interval": found.interval,
        "surrogate": found.model.surrogate,
        "modes": found.model.modes,
        "kept": found.kept.tolist(),
        "rmse": found.model.rmse,
        "rmse_diameters": found.model.rmse / diameter if diameter else None,
        "frame_rmse": np.sqrt(np.square(found.error).mean(axis=1) / 3).tolist(),
        "largest": max(float(np.quantile(unseen, BRIGHTEST)) if unseen.size else 0.0, STEPS_OF_SCALE * quantum),
    }


def _fastest(position: Array, times: Array, quantum: float) -> float:
    """End of the scale of speeds, m/s: that which but few particles exceed, between neighbouring frames."""
    steps = np.diff(times)
    speeds = np.linalg.norm(np.diff(position, axis=0), axis=-1) / steps[:, None]
    return max(float(np.quantile(speeds, BRIGHTEST)), STEPS_OF_SCALE * quantum / float(steps.min()))


def _radii(radius: Array, box: Box) -> bytes:
    """Radii as deflated float32, in m; where unknown, a share of the box that can be seen."""
    drawn = np.where(np.isfinite(radius) & (radius > 0), radius, UNKNOWN_RADIUS * STEPS * box.quantum)
    return _floats(drawn)


def _floats(values: Array) -> bytes:
    return zlib.compress(values.astype("<f4").tobytes())
