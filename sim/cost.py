"""What a step costs, term by term, measured on this machine."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sim.kernel import threads_for
from sim.simulation import Simulation
from sim.walls import no_near_walls

MEASURED_STEPS = 200
MOST_SECONDS = 5.0  # of measured steps: a large scene is measured over fewer
BATCHES = 10
REPEATS = 5  # of one evaluation of the forces, of which the fastest counts


class StepCost(NamedTuple):
    """Seconds of a step, the mean over the measured ones, and what part of it each term takes."""

    steps: int
    whole: float  # s
    pairs: float  # s
    walls: float  # s
    lists: float  # s
    motion: float  # s, and all that is none of the others


class MeasuredSimulation(Simulation):
    """A run that adds up the time its lists take."""

    listing = 0.0  # s

    def rebuild(self) -> None:
        """Sort and list anew, and count the time."""
        began = time.perf_counter()
        super().rebuild()
        self.listing += time.perf_counter() - began


def step_cost(run: MeasuredSimulation) -> StepCost:
    """Run up to 200 steps, or a few seconds, and return what one costs; the run is of no other use afterwards.

    Raises LimitError where a limit is violated on the way.
    """
    run.advance_to(1)  # compiles
    began = time.perf_counter()
    run.advance_to(3)
    once = (time.perf_counter() - began) / 2.0
    batch = max(1, min(MEASURED_STEPS, int(MOST_SECONDS / max(once, 1e-9))) // BATCHES)
    run.listing, taken = 0.0, []
    for _ in range(BATCHES):
        began = time.perf_counter()
        run.advance_to(run.step + batch)
        taken.append((time.perf_counter() - began) / batch)
    whole, lists = sum(taken) / BATCHES, run.listing / (BATCHES * batch)
    # parts are timed at their fastest; on a busy machine the mean is slower, and they with it
    pairs, walls = (part * (whole / min(taken)) for part in _forces(run))
    return StepCost(BATCHES * batch, whole, pairs, walls, lists, max(whole - pairs - walls - lists, 0.0))


def _forces(run: MeasuredSimulation) -> tuple[float, float]:
    """Seconds that pairs and walls take in one evaluation of the forces.

    A term is measured as what is saved when its list is empty.
    """
    fill = run._fill_starting_forces
    near, spring, listed = run.near, run.wall_spring, run.listed
    with threads_for(len(listed.chunks) - 1):
        everything = _fastest(fill)
        run.near, run.wall_spring = no_near_walls(len(run.particles.radius)), spring
        pairs_only = _fastest(fill)
        run.listed = listed._replace(last=listed.first)
        nothing = _fastest(fill)
    run.near, run.listed = near, listed
    return max(pairs_only - nothing, 0.0), max(everything - pairs_only, 0.0)


def _fastest(call: Callable[[], Any]) -> float:
    call()
    taken = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return min(taken)


def memory_of(run: Simulation) -> dict[str, int]:
    """Return the bytes that particles, forces, pair list and wall list take."""
    return {
        "particles": _bytes(run.particles),
        "forces": _bytes((run.force, run.torque)),
        "pairs": _bytes((*run.listed, run.listed_at)),
        "walls": _bytes((*run.near, run.wall_spring, *(run.walls or ()))),
    }


def _bytes(arrays: Any) -> int:
    return sum(rows.nbytes for rows in arrays if isinstance(rows, np.ndarray))
