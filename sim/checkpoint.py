"""All of a run's state as named arrays, so that it goes on bitwise as if it had not been interrupted."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.motion import move_bodies
from sim.runs import AnyRun
from sim.simulation import Simulation

TUPLES = ("particles", "listed", "near")
ARRAYS = ("seen", "wrench", "spring", "wall_spring", "listed_at", "tally", "body_tally", "reported",
    "impacts", "wall_impacts", "reported_impacts",
)  # fmt: skip
NUMBERS = ("step", "listed_step", "rebuilds", "wall_speed", "skin")


def state_of(run: AnyRun) -> dict[str, NDArray[Any]]:
    """Return copies of all arrays and numbers of a run, by name; absent terms have no entry."""
    if not isinstance(run, Simulation):
        return {"step": np.asarray(run.step)} | run.guards.state() | run.fluid_state()
    state = run.guards.state() | run.fluid_state()
    state |= {name: np.asarray(getattr(run, name)) for name in NUMBERS}
    for name in TUPLES:
        for field, rows in getattr(run, name)._asdict().items():
            if rows is not None:
                state[f"{name}.{field}"] = rows.copy()
    state |= {name: getattr(run, name).copy() for name in ARRAYS if getattr(run, name) is not None}
    return state


def restore_(run: AnyRun, state: dict[str, NDArray[Any]]) -> None:
    """Put a run of the same scene into a state that `state_of` returned.

    Walls need no entry: their pose is a function of time. Raises KeyError where the state is of another kind of scene.
    """
    run.step = int(state["step"])
    run.guards.restore_(state)
    if not isinstance(run, Simulation):
        run.restore_fluid_(state)
        return
    run.listed_step, run.rebuilds = int(state["listed_step"]), int(state["rebuilds"])
    run.wall_speed, run.skin = float(state["wall_speed"]), float(state["skin"])
    for name in TUPLES:
        fields = getattr(run, name)._asdict()
        kept = {field: None if rows is None else state[f"{name}.{field}"] for field, rows in fields.items()}
        setattr(run, name, type(getattr(run, name))(**kept))
    for name in ARRAYS:
        if getattr(run, name) is not None:
            setattr(run, name, state[name])
    if run.walls is not None:
        move_bodies(run.walls, run.time)
    run.restore_fluid_(state)
