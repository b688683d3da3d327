"""Averages of a run over the phase of its rotor: what is left of a chaotic flow that can be predicted.

Snapshots of whole periods after a start-up are averaged by where the rotor stands within its period, and the difference
between the first and the second half of them says how well these averages are known.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from suffice.fields import Array, Densities, Eulerian
from suffice.refusal import Refusal
from suffice.rotor import Rotor, rotor_of
from suffice.run import Run

ROUNDING = 1e-6  # of a period: how far a snapshot may lie before the edge of its bin
FIELDS = {"void_fraction": "1", "solid_flux": "m/s", "agitation": "m²/s²", "fluid_flux": "m/s", "pressure": "Pa"}

Fields = Mapping[str, Array]  # by name, (bins, rows): cells and their components in a row


class Averages(NamedTuple):
    """Fields of a run, averaged over what the rotor's phase does not explain."""

    rotor: Rotor
    phase: Array  # (bins,) mean share of the period of the snapshots in each bin
    fields: Fields
    halves: tuple[Fields, Fields]  # of the first and of the second half of the periods
    periods: int
    snapshots: int

    def error(self, name: str) -> Array:
        """Return the standard error of a field in every bin and row, (bins, rows): what its halves differ by, over 2.

        Halves of equal length differ by √2 times the error of each, which is √2 times that of the whole.
        """
        first, second = self.halves
        part = (self.periods // 2) / self.periods
        return np.asarray(np.abs(first[name] - second[name]) * np.sqrt(part * (1.0 - part)))

    def over_time(self) -> "Averages":
        """Return the mean over all phases, as of a single bin."""
        mean, first, second = (
            {name: field.mean(axis=0, keepdims=True) for name, field in fields.items()}
            for fields in (self.fields, *self.halves)
        )
        return self._replace(phase=np.zeros(1), fields=mean, halves=(first, second))


class Schedule(NamedTuple):
    """Which bin and which half every snapshot belongs to."""

    snapshots: np.ndarray[tuple[int], np.dtype[np.intp]]  # indices of those that count
    bin: np.ndarray[tuple[int], np.dtype[np.intp]]
    half: np.ndarray[tuple[int], np.dtype[np.intp]]
    phase: Array
    periods: int


def schedule(rotor: Rotor, times: Array, start_up: float, bins: int) -> Schedule:
    """Sort times (s) into phase bins: those of the whole periods that follow `start_up` (s), the last ones of the run.

    Raises `Refusal` where there are fewer than two periods, or where a bin of either half stays empty.
    """
    count = int((times[-1] - start_up) / rotor.period + ROUNDING) if len(times) else 0
    if count < 2:
        raise Refusal(
            f"rotor {rotor.name!r} at {rotor.rpm:g} rpm: {max(count, 0)} whole periods of {rotor.period:.3g} s after "
            f"the start-up of {start_up:.3g} s; averages and their error need 2 at least, simulate longer"
        )
    place = times / rotor.period + ROUNDING
    first = times[-1] / rotor.period - count + 2.0 * ROUNDING  # after it: exactly so many periods
    kept = np.flatnonzero(place > first + ROUNDING)
    period = np.minimum((place[kept] - first).astype(np.intp), count - 1)
    within = np.mod(place[kept], 1.0)
    found = Schedule(
        kept, (within * bins).astype(np.intp), (period >= count // 2).astype(np.intp), within - ROUNDING, count
    )
    filled = np.zeros((2, bins), np.intp)
    np.add.at(filled, (found.half, found.bin), 1)
    if not filled.all():
        raise Refusal(f"{bins} bins of phase: some hold no snapshot; use fewer bins, or more snapshots per period")
    return found


def averages(
    run: Run, bins: int = 8, start_up: float = 1.0, progress: Callable[[int, int], None] | None = None
) -> Averages:
    """Average a run over the phase of its rotor, in `bins` of equal width, after `start_up` turns.

    A rotor that is round about its axis has one bin. Raises `Refusal` for a run without a single rotor or a fluid, or
    one that is too short.
    """
    eulerian = Eulerian(run)
    rotor = rotor_of(eulerian.scene, str(run.path))
    bins = bins if rotor.fold else 1
    plan = schedule(rotor, run.times, start_up * rotor.turn, bins)
    total: list[list[Densities | None]] = [[None] * bins for _ in range(2)]
    number = np.zeros((2, bins))
    phase = np.zeros(bins)
    for i, (k, b, half) in enumerate(zip(plan.snapshots, plan.bin, plan.half, strict=True)):
        held, now = total[half][b], eulerian.at(int(k))
        total[half][b] = now if held is None else held.plus(now)
        number[half, b] += 1
        phase[b] += plan.phase[i]
        if progress:
            progress(i + 1, len(plan.snapshots))
    first, second = ([part for part in parts if part is not None] for parts in total)
    both = [a.plus(b) for a, b in zip(first, second, strict=True)]
    amount = number.sum(axis=0)
    halves = (_fields(first, number[0]), _fields(second, number[1]))
    return Averages(rotor, phase / amount, _fields(both, amount), halves, plan.periods, len(plan.snapshots))


def _fields(sums: list[Densities], number: Array) -> Fields:
    """Divide sums over snapshots by their number, and lay each field out as (bins, rows)."""
    means = [part.scaled(1.0 / n) for part, n in zip(sums, number, strict=True)]
    return {name: np.stack([np.ravel(getattr(mean, name)) for mean in means]) for name in FIELDS}
