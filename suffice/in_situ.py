"""The verdict on a simulation while it runs: which snapshot interval Δτ suffices, and whether the run may end."""

import os
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from math import prod
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from selection import Sweep, dense_interval, is_sufficient, sweep
from selection.candidate import Candidate
from selection.growing import GrowingSnapshots
from selection.intervals import default_intervals
from selection.settled import Settling, checks
from selection.threads import alone, cores
from suffice.quantities import AXES, QUANTITIES, Grid, component_names
from suffice.refusal import Refusal
from suffice.selecting import thresholds_of
from suffice.wording import bytes_text, number, seconds_text

Array = NDArray[np.float64]
GROUPS = 10  # of particles, for the interval of K_f: as many as `select` makes
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
    but of a Δτ it is looked at only where it can have settled (see selection/settled.py), and without the interval of
    K_f. Where one has settled for every variable it is judged with that interval, and the run ends if it still holds.
    The `verdict` at its end judges every Δτ where the run is thinned, because `select` will refuse it; else only what
    it rests on: the Δτ that ended the run, or that came nearest.
    most: snapshots at the end of the run. Raises Refusal where all of them do not fit into memory.
    """

    def __init__(self, variables: Mapping[str, Rows], most: int, dtype: DTypeLike, *, thinned: bool = False) -> None:
        sizes = {name: GrowingSnapshots.bytes_needed(r.rows, most, dtype, GROUPS) for name, r in variables.items()}
        self.bytes_needed = sum(sizes.values())
        check_memory(self.bytes_needed, most)
        cores()  # the libraries are looked up before the run, not at its first check
        self.variables, self.most, self.checks, self.thinned = dict(variables), most, checks(most), thinned
        self.times: list[float] = []
        self.snapshots = {
            name: GrowingSnapshots(r.rows, most, r.rows_per_particle, dtype, GROUPS) for name, r in variables.items()
        }
        self.settling = {name: Settling(self.checks, partial(self._sufficient, name)) for name in variables}
        self.limits = {name: thresholds_of(name) for name in variables}
        self.held: dict[tuple[str, int], Sweep] = {}  # by variable and snapshots: judged last with its interval
        self.table: dict[str, Sweep] = {}  # of the end of the run
        self.suffices = False
        self.seconds = 0.0  # that watching took while the simulation went on
        self.seconds_after = 0.0  # that the last verdict took

    def see(self, time: float, values: Mapping[str, ArrayLike]) -> None:
        """Take a snapshot at a time (s), and judge the run if a check is due."""
        began = perf_counter()
        self._take(time, {name: rows.of(values) for name, rows in self.variables.items()})
        self.seconds += perf_counter() - began

    def _take(self, time: float, columns: Mapping[str, ArrayLike]) -> None:
        self.times.append(time)
        for name, snapshots in self.snapshots.items():
            snapshots.append(columns[name])
        if len(self.times) in self.checks:
            self._check()

    def _check(self) -> None:
        n = len(self.times)
        if n == self.most:
            return
        with alone():
            if all(settling.any_settled(n) for settling in self.settling.values()):
                self.suffices = all(map(self._holds, self.variables))

    def _holds(self, variable: str) -> bool:
        """Tell whether any Δτ that has settled is sufficient with the interval of K_f as well."""
        n = len(self.times)
        for stride in self.settling[variable].all_settled(n):
            found = self.held[variable, n] = self._sweep(variable, [self._interval(stride)])
            if found.candidates[0].verdict == "sufficient":
                return True
        return False

    def _interval(self, stride: int) -> float:
        """Return Δτ (s) of so many dense intervals, as `select` writes it."""
        return float(f"{stride * dense_interval(self.times):.12g}")

    def _sweep(self, variable: str, intervals: Sequence[float], groups: int | None = GROUPS) -> Sweep:
        return sweep(self.snapshots[variable], self.times, intervals, self.limits[variable], groups)

    def _sufficient(self, variable: str, stride: int, n: int) -> bool:
        """Tell whether Δτ, in dense intervals, is sufficient in the first n snapshots but for the interval of K_f."""
        times, snapshots = self.times[:n], self.snapshots[variable].first(n)
        return is_sufficient(snapshots, times, stride * dense_interval(times), self.limits[variable])

    def _whole_table(self, variable: str) -> Sweep:
        """Judge every Δτ of the default scan; not again the one that was judged last and let the run end."""
        n = len(self.times)
        known = self.held[variable, n].candidates if (variable, n) in self.held else []
        wanted = set(default_intervals(self.times)).difference(found.interval for found in known)
        rest = self._sweep(variable, sorted(wanted))
        table = sorted([*known, *rest.candidates], key=lambda c: -c.interval)
        whole = rest._replace(candidates=table, chosen_interval=next((c.interval for c in table if c.sufficient), None))
        self._learn(variable, whole)
        return whole

    def _needed(self, variable: str) -> Sweep:
        """Judge with its interval of K_f what the verdict rests on: the Δτ that have settled, else the best one.

        That interval can only take the verdict "sufficient" away.
        """
        rough = self._sweep(variable, default_intervals(self.times), groups=None)
        self._learn(variable, rough)
        settled = (self._interval(s) for s in sufficient_strides(rough) if self._has_settled(variable, s))
        best_first = (c.interval for c in sorted(rough.candidates, key=_merit, reverse=True))
        judged: dict[float, Candidate] = {}
        for interval in chain(settled, best_first):
            if interval in judged:
                continue
            (judged[interval],) = self._sweep(variable, [interval]).candidates
            if judged[interval].verdict == "sufficient" or rough.at(interval).verdict != "sufficient":
                break
        return rough._replace(candidates=list(judged.values()))

    def _learn(self, variable: str, found: Sweep) -> None:
        for stride in sufficient_strides(found):
            self.settling[variable].learn(stride, len(self.times), sufficient=True)

    def _table(self, variable: str) -> Sweep:
        if self.thinned:
            return self._whole_table(variable)
        return self.held[variable, len(self.times)] if self.suffices else self._needed(variable)

    def _settled_interval(self, variable: str) -> float | None:
        """Return the largest Δτ (s) that has settled and is sufficient at the end, None where there is none."""
        strides = sufficient_strides(self.table[variable])
        stride = next((s for s in strides if self._has_settled(variable, s)), None)
        return None if stride is None else self._interval(stride)

    def _has_settled(self, variable: str, stride: int) -> bool:
        return self.settling[variable].settled(stride, len(self.times), at_last=True)

    def restore_(self, times: Iterable[float], history: Iterable[Mapping[str, NDArray[Any]]]) -> None:
        """Take the snapshots before an interruption again: at each time (s) the columns (rows,) by variable.

        Every check is made again, so that inner products are formed at the same moments and have the same bits.
        """
        for time, columns in zip(times, history, strict=True):
            self._take(float(time), columns)

    def verdict(self) -> dict[str, Any]:
        """Judge what there is at the end of the run and return it in plain types, as `select --json` has it."""
        began = perf_counter()
        with alone():
            found = self._verdict()
        self.seconds_after = perf_counter() - began
        return found

    def _verdict(self) -> dict[str, Any]:
        self.table = {name: self._table(name) for name in self.variables}
        intervals = {name: self._settled_interval(name) for name in self.table}
        self.suffices = None not in intervals.values()
        return {
            "sufficient": self.suffices,
            "sentences": [self._end(), *(self._sentence(name, intervals[name]) for name in self.table)],
            "n_snapshots": len(self.times),
            "time": self.times[-1],
            "dense_interval": dense_interval(self.times),
            "checks": [n for n in self.checks if n <= len(self.times)],
            "variables": {name: self._facts(name) | {"settled_interval": intervals[name]} for name in self.table},
        }

    def _facts(self, name: str) -> dict[str, Any]:
        """Return what is known of a variable; which Δτ the paper's rule chooses only where every one was judged."""
        known = self.table[name].as_dict()
        return known if self.thinned else {key: value for key, value in known.items() if key != "chosen_interval"}

    def _end(self) -> str:
        """Say when the run ended and why."""
        n, at = len(self.times), f"at t = {seconds_text(self.times[-1])}"
        rest = "" if self.thinned else "; `suffice select` judges every Δτ"
        if not self.suffices:
            return f"the run's time is up {at}, after {n} snapshots, before all that is watched suffices{rest}"
        early = f" of {self.most}" if n < self.most else ""
        return f"all that is watched suffices {at}, after {n}{early} snapshots{rest}"

    def _sentence(self, name: str, interval: float | None) -> str:
        """Say what is known of a variable in one sentence."""
        found, settling = self.table[name], self.settling[name]
        if interval is not None:
            stride = round(interval / found.dense_interval)
            at = next(c for c in found.candidates if round(c.interval / found.dense_interval) == stride)
            n = settling.since(stride, len(self.times))
            return (
                f"{name}: Δτ = {seconds_text(interval)} suffices, {_index(at)}, as at every check since {n} snapshots"
            )
        best = max(found.candidates, key=_merit)
        place = f"{seconds_text(best.interval)}, {_index(best)}"
        if best.verdict == "sufficient":
            since = settling.since(round(best.interval / found.dense_interval), len(self.times))
            return f"{name}: {place} suffices, but only since {since} of {len(self.times)} snapshots; go on longer"
        because = "; ".join(best.reasons)
        return f"{name}: not sufficient at any Δτ; the best, {place}, is {best.verdict}: {because}; {REMEDY}"


def _merit(candidate: Candidate) -> tuple[bool, float, float]:
    """Order candidates by how near they come to a sufficient Δτ."""
    return candidate.verdict == "sufficient", candidate.K_f or 0.0, -candidate.interval


def _index(candidate: Any) -> str:
    """Write K_f and its interval."""
    spread = candidate.K_f_interval
    between = "" if spread is None else f" ({spread[0]:.2f} to {spread[1]:.2f})"
    return f"K_f {number(candidate.K_f)}{between}"


def sufficient_strides(found: Sweep) -> list[int]:
    """Return the Δτ that are sufficient by our verdict, in dense intervals, coarse to fine."""
    return [round(c.interval / found.dense_interval) for c in found.candidates if c.verdict == "sufficient"]


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
