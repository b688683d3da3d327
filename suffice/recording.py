"""What becomes of the moments of a run: its file keeps them, and whoever watches sees them."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim import AnyRun
from sim.checkpoint import restore_, state_of
from sim.state import Snapshot
from suffice import layout
from suffice.in_situ import InSitu
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import RunWriter

TEXT_BYTES = 2**14  # per variable, of what is found: nine candidates with their reasons take a quarter of it


def values_of(snapshot: Snapshot) -> dict[str, NDArray[Any]]:
    """Return what a run stores of a moment, by the names of its variables."""
    values = {}
    if len(snapshot.position):
        values = {name: getattr(snapshot, name) for name in ("position", "velocity", "angular_velocity")}
    if snapshot.fluid is not None:
        values |= {f"fluid.{name}": rows for name, rows in snapshot.fluid._asdict().items()}
    return {name: rows for name, rows in values.items() if rows is not None}


class Recorder:
    """Advance a simulation by one output interval after another, and write and watch what it shows.

    `seen` output times have been reached, the first at time zero. `watch` sees every one of them.
    """

    def __init__(self, simulation: AnyRun, writer: RunWriter, watch: InSitu | None) -> None:
        self.simulation, self.writer, self.watch = simulation, writer, watch
        self.seen = 0

    @property
    def ended(self) -> bool:
        """Whether nothing remains to be simulated: the time is up, or what is watched suffices."""
        return self.seen == self.simulation.snapshots or (self.watch is not None and self.watch.suffices)

    def advance(self) -> None:
        """Go on to the next output time and record it. Raises LimitError as the simulation does."""
        self.simulation.advance_to(self.seen * self.simulation.steps_per_snapshot)
        self.record(self.simulation.snapshot())

    def record(self, now: Snapshot) -> None:
        """Write and watch a moment."""
        values = values_of(now)
        self.writer.append(now.time, values, now.series, now.impacts)
        self.seen += 1
        if self.watch is not None:
            self.watch.see(now.time, values)

    def reserve(self) -> None:
        """Make room in the file for what will be found, before its first snapshot."""
        if self.watch is not None:
            room = TEXT_BYTES * (1 + len(self.watch.variables))
            self.writer.reserve(layout.FOUND, (), np.dtype(f"S{room}"))
            self.writer.put(layout.FOUND, np.bytes_(b""))

    def finish(self) -> dict[str, Any]:
        """Write down what was found, and return it in plain types; empty where nobody watches."""
        if self.watch is None:
            return {}
        found = {"in_situ": self.watch.verdict()}
        self.writer.put(layout.FOUND, np.bytes_(json.dumps(found).encode()))
        return found

    def seconds_of(self) -> dict[str, float]:
        """Return what watching took, s."""
        return {} if self.watch is None else {"in_situ": round(self.watch.seconds, 3)}

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all that a run needs to go on bitwise, beside its file."""
        state = state_of(self.simulation) | {"record.seen": np.asarray(self.seen)}
        return state if self.watch is None else state | self.watch.state()

    @classmethod
    def resume(cls, simulation: AnyRun, path: Path, watch: InSitu | None, state: dict[str, NDArray[Any]]) -> "Recorder":
        """Go on where a checkpoint was written. Raises Refusal where it is of another kind of run."""
        try:
            restore_(simulation, state)
            seen = int(state["record.seen"])
            if watch is not None:
                with Run(path) as past:
                    watch.restore_(state, past.times[:seen], _history(past, watch, seen))
        except KeyError as error:
            raise Refusal(f"checkpoint of {path} lacks {error}; remove it and start the run anew") from None
        self = cls(simulation, RunWriter.resume(path, seen), watch)
        self.seen = seen
        return self


def _history(past: Run, watch: InSitu, seen: int) -> Iterator[Mapping[str, NDArray[Any]]]:
    """Yield the columns of what is watched, of every output time so far."""
    for k in range(seen):
        values = past.snapshot(k).values
        yield {name: rows.of(values) for name, rows in watch.variables.items()}
