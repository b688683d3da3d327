"""A run and what a surrogate makes of it, side by side over time, for the player of the report."""

import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import InputError as UnfitSnapshots
from selection.errors import InputError as UnfitIntervals
from selection.intervals import Subset, candidates
from suffice.bridge import bridge_of
from suffice.frames import STEPS, Box, box_of, pack, placed
from suffice.reconstruction import Case
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.setting import setting_of
from suffice.variables import columns_of, held, held_velocity
from surrogates import InputError as UnfitSeries

Array = NDArray[np.float64]
Results = Mapping[str, Any]

MOST_FRAMES = 100
MOST_PARTICLES = 20_000
MOST_MODES_BYTES = 4 * 2**30  # all modes of all particles, in double precision
PER_DIAMETER = 500  # quanta: a finer place is not seen, nor a finer error by its colour
MOST_BYTES = 18 * 10**6  # deflated: with the rest of the page under 30 MB as base64
UNKNOWN_RADIUS = 0.01  # of the box's edge: drawn where the run does not know it
BRIGHTEST = 0.995  # share of speeds or errors below the end of the scale …
STEPS_OF_SCALE = 20  # … that spans no fewer quanta, or it would show how places are rounded


class Prediction(NamedTuple):
    """Positions that a surrogate trained every Δτ gives, and how far off they are."""

    interval: float  # s, Δτ
    surrogate: str
    modes: int
    kept: NDArray[np.bool_]  # (frames,) which frames it was trained on
    position: Array  # (frames, n, 3) m
    error: Array  # (frames, n) m, distance from the truth
    rmse: float  # m, of a component of position over all particles, mean over all unseen times of the window


class Shown(NamedTuple):
    """What part of a run is shown, by numbers of snapshots and particles, and the truth there."""

    frames: NDArray[np.intp]  # (frames,)
    particles: NDArray[np.intp]  # (n,)
    truth: Array  # (frames, n, 3) m


class Player(NamedTuple):
    """What the page shows: facts in plain types, and the frames."""

    facts: dict[str, Any]  # ready for JSON, without the frames
    streams: dict[str, bytes]  # deflated: `truth`, `radius` (float32, m), and a prediction each under its number


def player_of(path: Path, results: Results) -> Player | None:
    """Return the frames of a run beside those of a surrogate, of as many beads and snapshots as a page can hold.

    The surrogate is Hermite's cubic on n_c modes of the vector `position`, but no fewer than n_lr, a spline where the
    run has no velocities. It is trained twice, see `intervals_shown`: at a coarse Δτ, so that errors are seen, and at
    a fine one. The frames are the last snapshots of the window, every one, at most 100, of at most 20,000 particles.

    results: with `compare` and `select` as the report has them; None without `compare`. What prevents a player is
    said in `facts["left_out"]`, and then there are no streams.
    """
    if not results.get("compare"):
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

    Where none is sufficient for every component, the finest compared stands in its place.
    """
    compared = {row["interval"] for row in results["compare"]["rows"] if row["variable"].startswith("position")}
    if not compared:
        return []
    sufficient = sufficient_interval(results)
    finer = min(compared) if sufficient is None or sufficient not in compared else sufficient
    return sorted({max(compared), finer}, reverse=True)


def sufficient_interval(results: Results) -> float | None:
    """Return the largest Δτ (s) that the paper's rule finds sufficient for every component of position, or None."""
    judged = (results.get("select") or {}).get("variables") or {}
    chosen = [found.get("chosen_interval") for name, found in judged.items() if name.startswith("position")]
    return min(chosen) if chosen and all(chosen) else None


def _without(reason: str) -> Player:
    return Player({"left_out": reason}, {})


def _player(run: Run, intervals: Sequence[float], sufficient: float | None) -> Player:
    subsets = [each for each in candidates(run.times, list(intervals)) if _modes_bytes(run, each) <= MOST_MODES_BYTES]
    if not subsets:
        return _without("the modes of all particles would take more than 4 GiB")
    values, rates = held(run, "position"), held_velocity(run, "position")
    last = min(int(subset.training[-1]) for subset in subsets)
    frames = np.arange(max(last + 1 - MOST_FRAMES, 0), last + 1)
    particles = np.linspace(0, run.n_particles - 1, min(MOST_PARTICLES, run.n_particles)).round().astype(np.intp)
    truth = columns_of(values, frames).reshape(len(frames), -1, 3)[:, particles].astype(np.float64)
    shown = Shown(frames, particles, truth)
    found = [
        _predicted(Case(values, rates, run.times, s.training, np.setdiff1d(s.testing, s.training)), s.interval, shown)
        for s in subsets
    ]
    setting = setting_of(run)
    box, packed = packed_within([truth, *(each.position for each in found)], (setting.diameter or 0.0) / PER_DIAMETER)
    streams = {"truth": packed[0], "radius": _radii(run.radius[particles], box)}
    streams |= {str(i): data for i, data in enumerate(packed[1:])}
    facts = {
        "frames": len(frames),
        "particles": len(particles),
        "of_particles": run.n_particles,
        "times": run.times[frames].tolist(),
        "lowest": box.lowest.tolist(),
        "quantum": box.quantum,
        "diameter": setting.diameter,
        "up": [0.0, 0.0, 1.0] if setting.up is None else setting.up.tolist(),
        "period": None if setting.period is None else [part.tolist() for part in setting.period],
        "sufficient": sufficient,
        "fastest": _fastest(truth, run.times[frames], box.quantum),
        "predictions": [_facts(each, setting.diameter, box.quantum) for each in found],
        "bytes": sum(map(len, streams.values())),
    }
    return Player(facts, streams)


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


def _modes_bytes(run: Run, subset: Subset) -> int:
    return 8 * 3 * run.n_particles * len(subset.training)


def _predicted(case: Case, interval: float, shown: Shown) -> Prediction:
    """Train on the snapshots kept every `interval` (s) and predict those shown."""
    bridge = bridge_of(case)
    rows = (3 * shown.particles[:, None] + np.arange(3)).ravel()
    position = bridge.at(case.times[shown.frames], rows).reshape(shown.truth.shape)
    error = np.linalg.norm(position - shown.truth, axis=-1)
    kept = np.isin(shown.frames, case.training)
    return Prediction(interval, bridge.surrogate.name, bridge.modes, kept, position, error, bridge.rmse())


def _facts(found: Prediction, diameter: float | None, quantum: float) -> dict[str, Any]:
    """Facts of a prediction in plain types; errors of the frames are those of the particles shown."""
    unseen = found.error[~found.kept]
    return {
        "interval": found.interval,
        "surrogate": found.surrogate,
        "modes": found.modes,
        "kept": found.kept.tolist(),
        "rmse": found.rmse,
        "rmse_diameters": found.rmse / diameter if diameter else None,
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
    return zlib.compress(drawn.astype("<f4").tobytes())
