"""The verdict on a simulation while it runs: which snapshot interval Δτ suffices, and whether the run may end."""

import os
from collections.abc import Iterable, Mapping, Sequence
from math import prod
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from selection import Sweep, default_intervals, dense_interval, sufficient_intervals, sweep
from selection.feasibility import FEWEST_SNAPSHOTS
from selection.growing import GrowingSnapshots
from selection.settled import Settling, checks
from selection.threads import alone
from suffice.quantities import AXES, QUANTITIES, Grid, component_names
from suffice.refusal import Refusal
from suffice.selecting import thresholds_of
from suffice.wording import bytes_text, number, seconds_text

Array = NDArray[np.float64]
GROUPS = 10  # of particles, for the interval of K_f: as many as `select` makes
STRIDES = 10  # the coarsest Δτ of the default scan, in dense intervals
REMEDY = "go on longer or watch finer"
MEMORY_SHARE = 0.8  # of the memory that is free


class Rows(NamedTuple):
    """Where a watched variable stands among the stored values of a snapshot."""

    quantity: str
    axis: int | None  # None for all components
    rows: int  # n, or 3n for a whole vector
    rows_per_particle: int

    def of(self, values: Mapping[str, ArrayLike]) -> NDArray[Any]:
        """Return the variable's column of W, (rows,), from the values of a snapshot by quantity."""
        whole = np.asarray(values[self.quantity])
        return (whole if self.axis is None else whole[..., self.axis]).reshape(-1)


def rows_of(variable: str, quantities: Sequence[str], n: int, grid: Grid | None) -> Rows:
    """Return where a variable, `position.x` or the whole vector `position`, stands in snapshots of n particles.

    Raises Refusal naming the variables that the run will have.
    """
    names = component_names(quantities)
    if variable not in quantities and variable not in names:
        raise Refusal(f"--variable {variable!r}: the run will have no such variable; it has {', '.join(names)}")
    vector, _, letter = variable.rpartition(".")
    whole, axis = (variable, None) if variable in quantities else (vector, AXES.index(letter))
    quantity = QUANTITIES[whole]
    points = prod(grid.shape) if quantity.of_fluid and grid is not None else n
    per = quantity.components if axis is None else 1
    return Rows(whole, axis, points * per, per)


class InSitu:
    """Watch variables of a simulation: let it `see` every snapshot, and end the run when it `suffices`.

    Snapshots are held in memory, in stored precision, and judged at numbers of them that grow by a tenth; between these
    checks nothing but a copy is made. The verdict is that of `suffice select` on a file that holds the same snapshots,
    but for the interval of K_f, which costs ten times the rest: it is left out until a Δτ has settled for every
    variable (see selection/settled.py). Then the run ends if that holds with the interval too. At its end nothing is
    left out.
    most: snapshots at the end of the run. Raises Refusal where all of them do not fit into memory.
    """

    def __init__(self, variables: Mapping[str, Rows], most: int, dtype: DTypeLike) -> None:
        sizes = {name: GrowingSnapshots.bytes_needed(r.rows, most, dtype, GROUPS) for name, r in variables.items()}
        self.bytes_needed = sum(sizes.values())
        check_memory(self.bytes_needed, most)
        self.variables, self.most, self.checks = dict(variables), most, checks(most)
        self.times: list[float] = []
        self.snapshots = {
            name: GrowingSnapshots(r.rows, most, r.rows_per_particle, dtype, GROUPS) for name, r in variables.items()
        }
        self.settling = {name: Settling() for name in variables}
        self.table: dict[str, Sweep] = {}  # complete, of the last check that asked for it
        self.suffices = False
        self.seconds = 0.0  # that watching took

    def see(self, time: float, values: Mapping[str, ArrayLike]) -> None:
        """Take a snapshot at a time (s), and judge the run if a check is due."""
        began = perf_counter()
        self.times.append(time)
        for name, rows in self.variables.items():
            self.snapshots[name].append(rows.of(values))
        if len(self.times) in self.checks:
            self._check()
        self.seconds += perf_counter() - began

    def _check(self) -> None:
        n, last = len(self.times), len(self.times) == self.most
        with alone():
            if last:
                self.table = self._sweeps()
            for name, settling in self.settling.items():
                settling.note(n, sufficient_strides(self.table[name]) if last else self._sufficient(name))
            if all(settling.settled(n) for settling in self.settling.values()):
                self.table = self.table if last else self._sweeps()
                self.suffices = all(self.settled_interval(name) is not None for name in self.variables)

    def _sweeps(self) -> dict[str, Sweep]:
        return {
            name: sweep(rows, self.times, None, thresholds_of(name), GROUPS) for name, rows in self.snapshots.items()
        }

    def _sufficient(self, variable: str) -> list[int]:
        """Return the Δτ that are sufficient now but for the interval of K_f, in dense intervals."""
        rows, dense = self.snapshots[variable], dense_interval(self.times)
        found = sufficient_intervals(rows, self.times, _decidable(self.times), thresholds_of(variable))
        return [round(interval / dense) for interval in found]

    def settled_interval(self, variable: str) -> float | None:
        """Return the largest Δτ (s) that has settled and is sufficient at the last check, None where there is none."""
        found, settled = self.table[variable], self.settling[variable].settled(len(self.times))
        strides = [stride for stride in sufficient_strides(found) if stride in settled]
        return float(f"{max(strides) * found.dense_interval:.12g}") if strides else None

    def state(self) -> dict[str, NDArray[Any]]:
        """Return what cannot be had again from the snapshots alone: since when each Δτ has been sufficient."""
        since = np.zeros((len(self.variables), STRIDES + 1), np.int64)
        for k, settling in enumerate(self.settling.values()):
            for stride, first in settling.since.items():
                since[k, stride] = first
        return {"in_situ.since": since}

    def restore_(
        self, state: Mapping[str, NDArray[Any]], times: Iterable[float], history: Iterable[Mapping[str, NDArray[Any]]]
    ) -> None:
        """Take the snapshots before an interruption again: at each time (s) the columns (rows,) by variable.

        Inner products are formed at the same checks as before, so that they have the same bits. Raises KeyError where
        the state is of another kind of run.
        """
        since = state["in_situ.since"]
        for time, columns in zip(times, history, strict=True):
            self.times.append(float(time))
            for name, rows in self.snapshots.items():
                rows.append(columns[name])
            if len(self.times) in self.checks:
                for rows in self.snapshots.values():
                    rows.gram_groups(GROUPS)
        for name, firsts in zip(self.variables, since, strict=True):
            self.settling[name] = Settling({stride: int(n) for stride, n in enumerate(firsts) if n})
        if len(self.times) in self.checks:  # what it found is not in the state; it changes nothing there
            self._check()

    def verdict(self) -> dict[str, Any]:
        """Return the last check in plain types, as `select --json` has it, with what it means for the run."""
        dense = next(iter(self.table.values())).dense_interval
        intervals = {name: self.settled_interval(name) for name in self.table}
        return {
            "sufficient": self.suffices,
            "sentences": [self._end(), *(self._sentence(name, intervals[name]) for name in self.table)],
            "n_snapshots": len(self.times),
            "time": self.times[-1],
            "dense_interval": dense,
            "checks": [n for n in self.checks if n <= len(self.times)],
            "variables": {
                name: {**found.as_dict(), "settled_interval": intervals[name]} for name, found in self.table.items()
            },
        }

    def _end(self) -> str:
        """Say when the run ended and why."""
        n, at = len(self.times), f"at t = {seconds_text(self.times[-1])}"
        if not self.suffices:
            return f"the run's time is up {at}, after {n} snapshots, before all that is watched suffices"
        early = f" of {self.most}" if n < self.most else ""
        return f"all that is watched suffices {at}, after {n}{early} snapshots"

    def _sentence(self, name: str, interval: float | None) -> str:
        """Say what is known of a variable in one sentence."""
        found, settling = self.table[name], self.settling[name]
        if interval is not None:
            stride = round(interval / found.dense_interval)
            at = next(c for c in found.candidates if round(c.interval / found.dense_interval) == stride)
            n = settling.since[stride]
            return (
                f"{name}: Δτ = {seconds_text(interval)} suffices, {_index(at)}, as at every check since {n} snapshots"
            )
        best = max(found.candidates, key=lambda c: (c.verdict == "sufficient", c.K_f or 0.0, -c.interval))
        place = f"{seconds_text(best.interval)}, {_index(best)}"
        if best.verdict == "sufficient":
            since = settling.since[round(best.interval / found.dense_interval)]
            return f"{name}: {place} suffices, but only since {since} of {len(self.times)} snapshots; go on longer"
        because = "; ".join(best.reasons)
        return f"{name}: not sufficient at any Δτ; the best, {place}, is {best.verdict}: {because}; {REMEDY}"


def _index(candidate: Any) -> str:
    """Write K_f and its interval."""
    spread = candidate.K_f_interval
    between = "" if spread is None else f" ({spread[0]:.2f} to {spread[1]:.2f})"
    return f"K_f {number(candidate.K_f)}{between}"


def sufficient_strides(found: Sweep) -> list[int]:
    """Return the Δτ that are sufficient by our verdict, in dense intervals, coarse to fine."""
    return [round(c.interval / found.dense_interval) for c in found.candidates if c.verdict == "sufficient"]


def _decidable(times: Sequence[float]) -> list[float]:
    """Δτ of the default scan (s) that keep enough snapshots for a verdict; the finest whatever it keeps."""
    *coarse, finest = default_intervals(times)
    longest = (len(times) - 1) * dense_interval(times) / (FEWEST_SNAPSHOTS - 1)
    return [*(interval for interval in coarse if interval <= longest * (1 + 1e-9)), finest]


def check_memory(needed: int, snapshots: int) -> None:
    """Refuse to hold more bytes than there is memory for."""
    free = free_memory()
    if needed > MEMORY_SHARE * free:
        raise Refusal(
            f"--until-sufficient holds up to {snapshots} snapshots of what it watches, {bytes_text(needed)}, and "
            f"{bytes_text(free)} of memory are free; watch fewer variables, a component instead of a vector, or fewer "
            "snapshots (a longer output.interval)"
        )


def free_memory() -> int:
    """Return the bytes of memory that are available without swapping."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            fields = dict(line.split(":", 1) for line in lines)
        return int(fields["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):  # not Linux: half of what is built in
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
