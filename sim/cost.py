"""What a step costs, term by term, measured on this machine."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sim.kernel import threads_for
from sim.near_walls import no_near_walls
from sim.neighbors import Neighbors
from sim.simulation import Simulation

MEASURED_STEPS = 200
MOST_SECONDS = 5.0  # of measured steps: a large scene is measured over fewer
BATCHES = 10
REPEATS = 5  # of one evaluation of the forces


class StepCost(NamedTuple):
    """Seconds of a step of the particles, the mean over the measured ones, and what part of it each term takes."""

    steps: int
    whole: float  # s
    pairs: float  # s
    walls: float  # s
    lists: float  # s
    motion: float  # s, and all that is none of the others
    fluid: dict[str, float]  # s, of the terms of the fluid: its share of a step of the particles


def step_cost(run: Simulation) -> StepCost:
    """Run up to 200 steps, or a few seconds, and return what one costs; the run is of no other use afterwards.

    Raises LimitError where a limit is violated on the way.
    """
    run.advance_to(1)  # compiles
    began = time.perf_counter()
    run.advance_to(3)
    once = (time.perf_counter() - began) / 2.0
    batch = max(1, min(MEASURED_STEPS, int(MOST_SECONDS / max(once, 1e-9))) // BATCHES)
    before, spent, parts = run.term_seconds(), 0.0, np.zeros(2)
    _forces(run)  # once, for nothing
    for _ in range(BATCHES):  # in turn, so that what else the machine does falls on steps and parts alike
        began = time.perf_counter()
        run.advance_to(run.step + batch)
        spent += time.perf_counter() - began
        parts += _forces(run)
    terms = {name: seconds - before[name] for name, seconds in run.term_seconds().items()}
    lists = terms.pop("lists") / (BATCHES * batch)
    whole = (spent - sum(terms.values())) / (BATCHES * batch)
    pairs, walls = np.maximum(parts / BATCHES, 0.0)
    over = max((pairs + walls + lists) / whole, 1.0)
    pairs, walls, lists = float(pairs / over), float(walls / over), lists / over
    fluid = {name: seconds / (BATCHES * run.steps_to_next_flow()) for name, seconds in terms.items()}
    motion = max(whole - pairs - walls - lists, 0.0)  # rounding, where the others take all of it
    return StepCost(BATCHES * batch, whole + sum(fluid.values()), pairs, walls, lists, motion, fluid)


def _forces(run: Simulation) -> tuple[float, float]:
    """Seconds that pairs and walls take in one evaluation of the forces: what an empty list saves."""
    near, listed, wrench = run.near, run.listed, run.wrench.copy()
    with threads_for(len(listed.chunks) - 1):
        run.near, run.listed = no_near_walls(len(run.particles.radius)), emptied(listed)
        nothing = _seconds(run._fill_starting_forces)
        run.listed = listed
        pairs = _seconds(run._fill_starting_forces)
        run.near = near
        everything = _seconds(run._fill_starting_forces)
    run.wrench[:] = wrench  # each call has added to it
    return pairs - nothing, everything - pairs


def emptied(listed: Neighbors) -> Neighbors:
    """Return a list of pairs without its entries: those of a chunk go from its first to its last particle's."""
    return listed._replace(last=np.repeat(listed.first[listed.chunks[:-1]], np.diff(listed.chunks)))


def _seconds(call: Callable[[], Any]) -> float:
    began = time.perf_counter()
    for _ in range(REPEATS):
        call()
    return (time.perf_counter() - began) / REPEATS


def memory_of(run: Simulation) -> dict[str, int]:
    """Return the bytes that particles, forces, pair list, wall list and fluid take."""
    return {
        "particles": _bytes(run.particles),
        "forces": _bytes((run.seen, run.wrench)),
        "pairs": _bytes((*run.listed, run.spring, run.listed_at)),
        "walls": _bytes((*run.near, run.wall_spring, *(run.walls or ()))),
        "fluid": _bytes(run.fluid_arrays()),
    }


def _bytes(arrays: Any) -> int:
    return sum(rows.nbytes for rows in arrays if isinstance(rows, np.ndarray))
