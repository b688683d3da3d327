"""What a checkpoint must hold: compiled loops trust its lists of neighbours, so nothing in them may lead astray."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim import AnyRun
from sim.checkpoint import state_of
from sim.simulation import Simulation

State = Mapping[str, NDArray[Any]]

# arrays as long as a list is: that of pairs, of the letter boxes between chunks, and of walls nearby
PAIRS = ("listed.owner", "listed.partner", "listed.touching", "listed.target", "listed.image", "spring")
BOXES = ("listed.receiver",)
WALLS = ("near.surface", "near.touching", "wall_spring")
LISTS = (*PAIRS, *BOXES, *WALLS)
LARGEST = 1e100  # of any number in SI units: squares and their sums stay finite
KEPT = ("particles.radius", "particles.inverse_mass", "particles.species")  # of each particle, by its id


def check_state(simulation: AnyRun, state: State) -> None:
    """Raise ValueError or KeyError unless a state fits this simulation, which has not begun, in every array.

    Types and shapes are those of the simulation's own state, but for the lengths of lists; numbers are finite, steps
    within the run, and every index within what it counts.
    """
    fresh = state_of(simulation)
    for name, own in fresh.items():
        held, free = state[name], int(name in LISTS)
        if held.dtype != own.dtype or held.ndim != own.ndim or held.shape[free:] != own.shape[free:]:
            raise ValueError(f"{name} is {held.dtype} of shape {held.shape}, not {own.dtype} of {own.shape}")
        if held.dtype.kind == "f" and not (np.abs(held) <= LARGEST).all():
            raise ValueError(f"{name} holds a value that is not finite, or beyond {LARGEST:g}")
    last = (simulation.snapshots - 1) * simulation.steps_per_snapshot
    _check_within("step", state["step"], 0, last + 1)
    if "record.seen" in state:
        _check_within("record.seen", state["record.seen"], 1, simulation.snapshots + 1)
    if isinstance(simulation, Simulation):
        _check_within("listed_step", state["listed_step"], 0, int(state["step"]) + 1)
        _check_particles(fresh, state)
        _check_pairs(fresh, state)
        shapes = 0 if simulation.walls is None else len(simulation.walls.kind)
        _check_entries(state, "near", _length(state, WALLS))
        _check_within("near.surface", state["near.surface"], 0, shapes)


def _check_particles(fresh: State, state: State) -> None:
    """Raise unless the particles are those of the scene, in whatever order."""
    order, own = np.argsort(state["particles.id"]), np.argsort(fresh["particles.id"])
    if not np.array_equal(state["particles.id"][order], fresh["particles.id"][own]):
        raise ValueError("particles.id are not those of the scene")
    for name in KEPT:
        if name in fresh and not np.array_equal(state[name][order], fresh[name][own]):
            raise ValueError(f"{name} is not that of the scene")


def _check_pairs(fresh: State, state: State) -> None:
    """Raise unless the list of pairs leads to particles and to letter boxes, each chunk's to its own."""
    n, boxes = len(state["particles.id"]), len(state["listed.receiver"])
    for name in ("listed.chunks", "listed.period"):
        if not np.array_equal(state[name], fresh[name]):
            raise ValueError(f"{name} is not that of the scene")
    pairs = _length(state, [name for name in PAIRS if name != "listed.image" or state["listed.period"].any()])
    _check_entries(state, "listed", pairs)
    for name, most in (("owner", n), ("partner", n), ("target", n + boxes), ("receiver", n)):
        _check_within(f"listed.{name}", state[f"listed.{name}"], 0, most)
    ends = state["listed.boxes"]
    if ends[0] != 0 or ends[-1] != boxes or (np.diff(ends) < 0).any():
        raise ValueError("listed.boxes do not divide the letter boxes")


def _length(state: State, names: Any) -> int:
    """Return how long a list is. Raises ValueError where its arrays differ."""
    found = {name: len(state[name]) for name in names if name in state}
    if len(set(found.values())) > 1:
        raise ValueError(f"lists differ in length: {found}")
    return next(iter(found.values()))


def _check_entries(state: State, which: str, length: int) -> None:
    """Raise unless every particle's entries lie within the list."""
    first, last = state[f"{which}.first"], state[f"{which}.last"]
    if (first < 0).any() or (first > last).any() or (last > length).any():
        raise ValueError(f"{which}.first to {which}.last lead out of the list of {length}")


def _check_within(name: str, values: NDArray[Any], least: int, end: int) -> None:
    if values.dtype.kind not in "iu" or (values < least).any() or (values >= end).any():
        raise ValueError(f"{name} is not within {least} to {end - 1}")
