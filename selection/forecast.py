"""Which Δτ will suffice for a run that is simulated longer: a forecast from its first part, the pilot."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from selection.candidate import Candidate
from selection.errors import InputError
from selection.feasibility import FEWEST_SNAPSHOTS, Thresholds, consistent_mode
from selection.sweep import Sweep

Array = NDArray[np.float64]
STEADY = 2.0  # times: halves of a pilot that differ by more in energy are no sample of one flow


class Growth(NamedTuple):
    """How n_lr grows with the duration t of the run: n_lr(T) = n_lr(t) (T/t)^a."""

    n_lr: float  # of the pilot, interpolated to a real number
    exponent: float  # a as expected: the pilot against the simpler of its halves, between 0 and 1
    least_exponent: float  # the pilot against the richer of its halves; the most is 1, each piece as new as the first
    energy_growth: float  # energy of the second half of the pilot over that of the first


class Foreseen(NamedTuple):
    """One Δτ over the planned duration. The first of a range is at the most modes foreseen, the last at the least."""

    interval: float  # s
    n_snapshots: int
    n_lr: int
    n_lr_range: tuple[int, int]
    n_c: int
    K_f: float
    K_f_range: tuple[float, float]
    verdict: str  # sufficient or insufficient where the whole range is, else undecidable
    reasons: list[str]


class Forecast(NamedTuple):
    """What the pilot foresees, coarse to fine."""

    pilot: float  # s, its duration
    duration: float  # s, the planned one
    growth: Growth | None  # None where nothing moves or the pilot is too short
    expected_interval: float | None  # s, the largest Δτ of K_f at least its threshold as expected; None where none is
    safe_interval: float | None  # s, the same where n_lr grows in proportion to the duration
    candidates: list[Foreseen]
    remarks: list[str]  # why not to trust it

    def as_dict(self) -> dict[str, Any]:
        """Plain Python types, ready for JSON."""
        ranges = ("n_lr_range", "K_f_range")
        candidates = [c._asdict() | {name: list(getattr(c, name)) for name in ranges} for c in self.candidates]
        growth = None if self.growth is None else self.growth._asdict()
        return self._asdict() | {"growth": growth, "candidates": candidates}


def growth_of_modes(gram: Array, energy: float) -> Growth | None:
    """Fit how n_lr grows from the pilot and its halves.

    a = log₂(n_lr(t) / n_lr(t/2)), the least n_lr of the two halves for what is expected. Two halves that move alike
    need the same modes: a = 0. Two that have nothing in common need those of both: a = 1.

    gram: (N_t, N_t) inner products of the pilot's snapshots about any point. None where a half does not move.
    """
    last = len(gram) - 1
    windows = [gram, gram[: last // 2 + 1, : last // 2 + 1], gram[last // 2 :, last // 2 :]]
    spectra = [_eigenvalues(window) for window in windows]
    if min(spectrum.sum() for spectrum in spectra) <= 0:
        return None
    whole, *halves = (_modes_as_real(spectrum, energy) for spectrum in spectra)
    exponent, least = (min(max(math.log2(whole / n), 0.0), 1.0) for n in (min(halves), max(halves)))
    power = [float(spectrum.sum()) / len(spectrum) for spectrum in spectra]
    return Growth(whole, exponent, least, power[2] / power[1])


def forecast(table: Sweep, gram: Array, duration: float) -> Forecast:
    """Foresee n_lr, n_c and K_f of every Δτ over a planned duration from the first part of the run.

    n_c(Δτ; T) = m(T)/m(t) n_c(Δτ; t): n_c counts what Δτ resolves a second, and keeps its share of the m snapshots.
    n_lr(T) = n_lr(t) (T/t)^a as `growth_of_modes` finds it. At a = 1, the most for a flow that goes on as it began, K_f
    stays what it is in the pilot.

    table: the Δτ judged on the pilot; those of fewer than ten snapshots in it are left out. gram: (N_t, N_t) of the
    pilot. duration: T in s, from the first snapshot on. Raises InputError where it is no longer than the pilot.
    """
    pilot = table.dense_interval * (len(gram) - 1)
    if not (math.isfinite(duration) and duration > pilot * (1 + 1e-9)):
        raise InputError(
            f"duration: {duration:g} s, the run has {pilot:g} s already; judge it as it is, or plan longer"
        )
    limit = table.thresholds.feasibility
    growth = growth_of_modes(gram, table.thresholds.energy) if len(gram) >= 2 * FEWEST_SNAPSHOTS else None
    if growth is None:
        few = f"too short a pilot: {len(gram)} snapshots, at least {2 * FEWEST_SNAPSHOTS} needed"
        still = "nothing moves in a half of the pilot"
        return Forecast(pilot, duration, None, None, None, [], [few if len(gram) < 2 * FEWEST_SNAPSHOTS else still])
    usable = [c for c in table.candidates if c.n_snapshots >= FEWEST_SNAPSHOTS and c.K_f is not None]
    foreseen = [_foresee(c, growth, pilot, duration, table.thresholds) for c in usable]
    expected = next((c.interval for c in foreseen if c.K_f >= limit), None)
    safe = next((c.interval for c in foreseen if c.K_f_range[0] >= limit), None)
    return Forecast(pilot, duration, growth, expected, safe, foreseen, _remarks(growth, foreseen, expected))


def check_duration(duration: float, pilot: float) -> None:
    """Raise InputError where the planned duration is no longer than the pilot, both in s."""
    if not (math.isfinite(duration) and duration > pilot * (1 + 1e-9)):
        raise InputError(
            f"duration: {duration:g} s, the run has {pilot:g} s already; judge it as it is, or plan longer"
        )


def _eigenvalues(gram: Array) -> Array:
    """Eigenvalues of the snapshots about their mean, descending."""
    mean = gram.mean(axis=0)
    values: Array = np.linalg.eigvalsh(gram - mean - mean[:, None] + mean.mean())[::-1]
    # rounding of a window that stands still must not pass for motion
    return np.where(values > len(gram) * np.finfo(np.float64).eps * np.abs(gram).max(), values, 0.0)


def _modes_as_real(eigenvalues: Array, energy: float) -> float:
    """n_lr interpolated between the modes, at least one, so that halves can be compared."""
    ratio = np.append(0.0, np.cumsum(eigenvalues) / eigenvalues.sum())
    n = int(np.argmax(ratio >= min(energy, ratio[-1])))
    return max(float(n - 1 + (energy - ratio[n - 1]) / (ratio[n] - ratio[n - 1])), 1.0)


def _foresee(candidate: Candidate, growth: Growth, pilot: float, duration: float, limits: Thresholds) -> Foreseen:
    """One Δτ over the planned duration."""
    m = math.floor(duration / candidate.interval * (1 + 1e-9)) + 1
    crossing = consistent_mode(candidate.curves.R_c, limits.consistency)
    # a motion of finite rank is exhausted by its modes, however long it lasts
    n_c = math.floor(crossing.position * m / candidate.n_snapshots) if crossing.exceeded else crossing.n_c
    exponents = (1.0, growth.exponent, growth.least_exponent)
    longer = duration / pilot
    most, n_lr, least = (min(math.ceil(growth.n_lr * longer**a), m - 1) for a in exponents)
    K_f = n_c / most, n_c / least
    facts = candidate.interval, m, n_lr, (least, most), n_c, n_c / n_lr, K_f
    told = f"K_f between {K_f[0]:.2f} and {K_f[1]:.2f}"
    if not crossing.exceeded:
        return Foreseen(*facts, "undecidable", [told, f"R_c never exceeds {limits.consistency:g} in the pilot"])
    if K_f[0] < limits.feasibility <= K_f[1]:
        return Foreseen(*facts, "undecidable", [f"{told}, either side of {limits.feasibility:g}"])
    return Foreseen(*facts, "sufficient" if K_f[0] >= limits.feasibility else "insufficient", [told])


def _remarks(growth: Growth, foreseen: list[Foreseen], expected: float | None) -> list[str]:
    """Say why the forecast may fail."""
    found = []
    if not 1 / STEADY <= growth.energy_growth <= STEADY:
        found.append(
            f"transient: the second half of the pilot has {growth.energy_growth:.2g} times the energy of the first"
        )
    if foreseen and expected == foreseen[0].interval:
        found.append("the coarsest Δτ that the pilot can judge suffices; a coarser one may")
    if not foreseen:
        found.append(f"no Δτ has {FEWEST_SNAPSHOTS} snapshots in the pilot")
    return found
