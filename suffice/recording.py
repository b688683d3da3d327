"""What becomes of the moments of a run: its file keeps all or some of them, and whoever watches sees them."""

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
from suffice.checkpoint_check import check_state
from suffice.in_situ import InSitu
from suffice.logbook import Logbook, summed_up
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import DTYPES, Reserved, RunWriter
from suffice.summary import Outcome, Summary
from suffice.thinning import Thinning, compact, finest_halving
from suffice.warned import Counted

TEXT_BYTES = 2**14  # per variable, of what is found: nine candidates with their reasons take a quarter of it
TOLD_BYTES = {layout.SUMMARY: 2**14, layout.PACE: 2**9}  # twenty warnings of three hundred characters fit in twice


def values_of(snapshot: Snapshot) -> dict[str, NDArray[Any]]:
    """Return what a run stores of a moment, by the names of its variables."""
    values = {}
    if len(snapshot.position):
        values = {name: getattr(snapshot, name) for name in ("position", "velocity", "angular_velocity")}
    if snapshot.fluid is not None:
        values |= {f"fluid.{name}": rows for name, rows in snapshot.fluid._asdict().items()}
    return {name: rows for name, rows in values.items() if rows is not None}


def reserved_of(simulation: AnyRun, watch: InSitu | None, thinned: bool) -> Reserved:
    """Return what a run's file must have room for beside its snapshots: what will be told, found and watched."""
    room: Reserved = {name: ((), np.dtype(f"S{size}")) for name, size in TOLD_BYTES.items()}
    if watch is None:
        return room
    if not thinned:
        return room | {layout.FOUND: ((), np.dtype(f"S{TEXT_BYTES * (1 + len(watch.variables))}"))}
    most, dtype = simulation.snapshots, DTYPES[simulation.scene.output.precision]
    room[layout.WATCHED_TIME] = ((most,), np.dtype(np.float64))
    return room | {f"{layout.HISTORY}/{name}": ((most, rows.rows), dtype) for name, rows in watch.variables.items()}


class Recorder:
    """Advance a simulation by one output interval after another; write and watch what it shows.

    `seen` output times have been reached, the first at time zero; `watch` sees every one of them. Where only some
    snapshots are kept (`tolerance`, m), the simulation may be looked at in between, but whoever watches is not shown
    that, and what is watched is kept in the file until the run has ended.
    """

    def __init__(self, simulation: AnyRun, writer: RunWriter, watch: InSitu | None, tolerance: float | None) -> None:
        self.simulation, self.writer, self.watch = simulation, writer, watch
        self.seen, self.logbook = 0, Logbook()
        self.told: dict[str, bytes] = {}  # the summary, once there is one, by its names in the file
        self.thinning: Thinning | None = None
        if tolerance is not None:
            output = simulation.scene.output
            finest = finest_halving(simulation.steps_per_snapshot)
            self.thinning = Thinning(writer, output.interval, tolerance, finest, DTYPES[output.precision])

    @property
    def ended(self) -> bool:
        """Whether nothing remains to be simulated: the time is up, or what is watched suffices."""
        return self.seen == self.simulation.snapshots or (self.watch is not None and self.watch.suffices)

    def advance(self) -> None:
        """Go on to the next output time and record it. Raises LimitError as the simulation does."""
        with self.logbook.timing():
            self._advance()

    def _advance(self) -> None:
        steps = self.simulation.steps_per_snapshot
        start = (self.seen - 1) * steps
        parts = 1 if self.thinning is None else 1 << self.thinning.spacing.finest
        now = 0
        while now < parts:
            now = parts if self.thinning is None else self.thinning.spacing.next_stop(now)
            self.simulation.advance_to(start + steps * now // parts)
            if now < parts:
                self._keep(self.simulation.snapshot())
        self.record(self.simulation.snapshot())

    def record(self, now: Snapshot) -> None:
        """Write and watch the moment of an output time."""
        values = self._keep(now)
        self.logbook.see(now)
        if self.watch is not None:
            if self.thinning is not None:
                self._put_history(now.time, values)
            self.watch.see(now.time, values)
        self.seen += 1

    def _keep(self, now: Snapshot) -> dict[str, NDArray[Any]]:
        values = values_of(now)
        if self.thinning is None:
            self.writer.append(now.time, values, now.series, now.impacts)
        else:
            self.thinning.take(now, values)
        return values

    def _put_history(self, time: float, values: Mapping[str, NDArray[Any]]) -> None:
        """Keep what is watched, of which not every snapshot may be kept, so that a resumed run knows it."""
        assert self.watch is not None
        self.writer.put(layout.WATCHED_TIME, time, self.seen)
        for name, rows in self.watch.variables.items():
            self.writer.put(f"{layout.HISTORY}/{name}", rows.of(values), self.seen)

    def finish(self) -> dict[str, Any]:
        """Close the file and write down what was found; return it in plain types, empty where nobody watches."""
        found = {} if self.watch is None else {"in_situ": self.watch.verdict()}
        if self.thinning is None:
            if found:
                self.writer.put(layout.FOUND, np.bytes_(json.dumps(found).encode()))
            self.writer.close()
            return found
        self.thinning.write()
        self.writer.close()
        with Run(self.writer.path) as run:
            found["kept"] = self.thinning.facts(run.times) | {"seen": self.seen}
        told = {name: np.array(text) for name, text in self.told.items()}
        more = told if self.watch is None else told | self._products()
        compact(self.writer.path, json.dumps(found).encode(), more)
        return found

    def sum_up(self, outcome: Outcome, warned: Mapping[str, Counted]) -> Summary:
        """Write what the run tells about itself into its file and return it; warned: what was warned of since then."""
        summary = summed_up(self.simulation, self.logbook, warned, outcome)
        assert summary.pace is not None
        parts = {layout.SUMMARY: summary.model_copy(update={"pace": None}), layout.PACE: summary.pace}
        self.told = {name: part.model_dump_json().encode() for name, part in parts.items()}
        for name, text in self.told.items():
            self.writer.put(name, np.bytes_(text))
        return summary

    def _products(self) -> dict[str, NDArray[Any]]:
        """Return the inner products of what was watched, and its times, by their names in the file."""
        assert self.watch is not None
        found = {f"{layout.PRODUCTS}/{name}": rows.gram() for name, rows in self.watch.snapshots.items()}
        return {layout.WATCHED_TIME: np.array(self.watch.times), **found}

    def seconds_of(self) -> dict[str, float]:
        """Return what watching and thinning took during the run, and the verdict after it, s; empty without them."""
        parts = [part.seconds for part in (self.watch, self.thinning) if part is not None]
        after = {} if self.watch is None else {"last_verdict": round(self.watch.seconds_after, 3)}
        return {"in_situ": round(sum(parts), 3), **after} if parts else {}

    def state(self, warned: Mapping[str, Counted]) -> dict[str, NDArray[Any]]:
        """Return all that a run needs to go on bitwise, beside its file; warned: what was warned of since then."""
        self.writer.sync()
        own = {"record.seen": np.asarray(self.seen)} | self.logbook.state(warned)
        return state_of(self.simulation) | own | ({} if self.thinning is None else self.thinning.state())

    @classmethod
    def resume(
        cls, simulation: AnyRun, path: Path, watch: InSitu | None, tolerance: float | None, state: dict[str, Any]
    ) -> "Recorder":
        """Go on where a checkpoint was written. Raises Refusal where it is damaged, or of another kind of run."""
        try:
            check_state(simulation, state)
            restore_(simulation, state)
            seen = int(state["record.seen"])
            kept = seen if tolerance is None else int(state["thinning.kept"])
            if watch is not None:
                with Run(path) as past:
                    times = past.times if tolerance is None else past.watched(layout.WATCHED_TIME)
                    watch.restore_(times[:seen], _history(past, watch, seen, thinned=tolerance is not None))
            self = cls(simulation, RunWriter.resume(path, kept), watch, tolerance)
            self.logbook.restore_(state)
            for name in TOLD_BYTES:  # what an interrupted run told is over
                self.writer.put(name, np.bytes_(b""))
            if self.thinning is not None:
                self.thinning.restore_(state)
        except Refusal:
            raise
        except KeyError as error:
            raise Refusal(f"checkpoint of {path} lacks {error}; remove it and start the run anew") from None
        except (IndexError, TypeError, ValueError) as error:
            raise Refusal(f"checkpoint of {path} is damaged: {error}; remove it and start the run anew") from None
        self.seen = seen
        return self


def _history(past: Run, watch: InSitu, seen: int, *, thinned: bool) -> Iterator[Mapping[str, NDArray[Any]]]:
    """Yield the columns of what is watched, of every output time so far."""
    known = {name: past.watched(f"{layout.HISTORY}/{name}") for name in watch.variables} if thinned else {}
    for k in range(seen):
        if thinned:
            yield {name: columns[k] for name, columns in known.items()}
        else:
            values = past.snapshot(k).values
            yield {name: rows.of(values) for name, rows in watch.variables.items()}
