"""A run that keeps only the snapshots that interpolation between them needs."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from selection.spacing import Moment, Spacing
from sim.state import Snapshot
from suffice import layout
from suffice.store import Run, RunWriter

Array = NDArray[np.float64]
FINEST = 2  # halvings of the output interval: the file has room for four times its snapshots
FEWEST_STEPS = 4  # of the simulation, from one look at it to the next
MEANS = ("force.", "torque.", "power.", "fluid_force.", "fluid_torque.", "fluid_power.")  # since the look before


class Pending(NamedTuple):
    """The moment before: kept unless interpolation over it will do."""

    time: float  # s
    values: dict[str, NDArray[Any]]  # in stored precision
    series: dict[str, float]
    impacts: Array | None  # (2, bins) 1/s


def finest_halving(steps: int) -> int:
    """Return how often the interval may be halved where it has so many steps."""
    return next((k for k in range(FINEST, 0, -1) if steps >= FEWEST_STEPS << k), 0)


class Thinning:
    """Write the snapshots that must be kept, of all that are looked at.

    interval: s, over which the simulation takes the means of forces, torques, powers and impacts, though it may have
    been looked at in between; what is written are means since the snapshot written before. tolerance: m.
    """

    def __init__(self, writer: RunWriter, interval: float, tolerance: float, finest: int, dtype: np.dtype[Any]) -> None:
        self.writer, self.interval, self.dtype = writer, interval, dtype
        self.spacing = Spacing(tolerance, finest)
        self.pending: Pending | None = None
        self.seconds = 0.0  # that deciding took
        self.since = 0.0  # s, time of the snapshot written last
        self.gathered: dict[str, Any] = {}  # integrals since then, up to the moment before

    def take(self, now: Snapshot, values: Mapping[str, NDArray[Any]]) -> None:
        """Take a moment; write the one before it if it must be kept. The first is written at once."""
        began = perf_counter()
        stored = {name: np.asarray(rows, self.dtype) for name, rows in values.items()}
        moment = Moment(now.time, stored["position"].astype(np.float64), stored["velocity"].astype(np.float64))
        must = self.spacing.see(moment)
        self.seconds += perf_counter() - began
        if must:
            self.write()
        added: dict[str, Any] = {
            name: value * self.interval for name, value in now.series.items() if name.startswith(MEANS)
        }
        added |= {} if now.impacts is None else {"impacts": now.impacts * self.interval}
        self.gathered = {name: self.gathered.get(name, 0.0) + value for name, value in added.items()}
        self.pending = Pending(now.time, stored, now.series, now.impacts)
        if self.writer.n_complete == 0:
            self.write()

    def write(self) -> None:
        """Write the moment before, if it has not been."""
        if self.pending is None:
            return
        now, elapsed = self.pending, self.pending.time - self.since
        mean = {name: total / elapsed for name, total in self.gathered.items()} if elapsed > 0.0 else {}
        impacts = mean.pop("impacts", now.impacts)
        self.writer.append(now.time, now.values, now.series | mean, impacts)
        self.pending, self.since, self.gathered = None, now.time, {}

    def state(self) -> dict[str, NDArray[Any]]:
        """Return all that it needs to go on, as named arrays."""
        found = {f"spacing.{name}": rows for name, rows in self.spacing.state().items()}
        found |= {f"gathered.{name}": np.asarray(total) for name, total in self.gathered.items()}
        found |= {"thinning.since": np.asarray(self.since), "thinning.kept": np.asarray(self.writer.n_complete)}
        if self.pending is not None:
            time, values, series, impacts = self.pending
            found["pending.time"] = np.asarray(time)
            found |= {f"pending.values.{name}": rows for name, rows in values.items()}
            found |= {f"pending.series.{name}": np.asarray(value) for name, value in series.items()}
            found |= {} if impacts is None else {"pending.impacts": impacts}
        return found

    def restore_(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from what `state` returned. Raises KeyError where it is of another kind of run."""
        self.spacing.restore_(_named(state, "spacing."))
        self.since, self.gathered = float(state["thinning.since"]), _named(state, "gathered.")
        if "pending.time" in state:
            series = {name: float(value) for name, value in _named(state, "pending.series.").items()}
            values = _named(state, "pending.values.")
            self.pending = Pending(float(state["pending.time"]), values, series, state.get("pending.impacts"))

    def facts(self, times: Array) -> dict[str, Any]:
        """Say how a run was thinned in plain types; times: (kept,) s."""
        gaps = np.diff(times)
        return {
            "tolerance": self.spacing.tolerance,
            "kept": len(times),
            "shortest_interval": float(gaps.min()) if len(gaps) else None,
            "longest_interval": float(gaps.max()) if len(gaps) else None,
            "unchecked_intervals": self.spacing.unchecked + (len(self.spacing.times) == 1),  # the last one as well
        }


def _named(state: Mapping[str, NDArray[Any]], start: str) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(start): rows for name, rows in state.items() if name.startswith(start)}


def compact(path: Path, found: bytes, more: Mapping[str, NDArray[Any]]) -> None:
    """Write a thinned run anew, without the room that it did not need, and with what was found on the way.

    found: JSON; more: other arrays by their names in the file. The new file is renamed into place when it is whole.
    """
    with Run(path) as run:
        series, impacts = run.series, run.impacts
        precision: Literal["single", "double"] = "double" if run.variable("position").dtype == np.float64 else "single"
        writer_of = partial(
            RunWriter,
            path,
            ids=run.ids,
            radius=run.radius,
            species=run.species,
            n_snapshots=run.n_snapshots,
            variables=run.quantities,
            grid=run.grid,
            precision=precision,
            series=sorted(series),
            impact_energy=None if impacts is None else impacts.energy,
            provenance=run.provenance,
            beside=True,
        )
    with writer_of() as writer, Run(path) as run:  # which looks at what stands there, so nobody else may just then
        for name, values in {layout.FOUND: np.array(found), **more}.items():
            writer.reserve(name, values.shape, values.dtype)
            writer.put(name, values)
        for k in range(run.n_snapshots):
            now = {name: float(values[k]) for name, values in series.items()}
            rates = None if impacts is None else impacts.rate[k]
            writer.append(float(run.times[k]), run.snapshot(k).values, now, rates)
