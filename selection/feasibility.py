"""Feasibility of a snapshot interval: consistent modes against the modes that must be reconstructed."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from selection.errors import InputError

Array = NDArray[np.float64]
FEWEST_SNAPSHOTS = 10  # below it n_lr and n_c are a handful of modes and one more of either decides

LEAST = (0.0, 1.0, 0.0, 1.0)  # what every threshold lies above: a share, a ratio of errors, K_f, a ratio of errors


class Thresholds(NamedTuple):
    """What counts as enough, per variable; take energy 0.99 for fluid fields (paper 2.2-2.3)."""

    energy: float = 0.999  # Lanczos ratio that the least reconstructable mode reaches
    consistency: float = 1.05  # R_c up to which a mode is consistent
    feasibility: float = 2.0  # K_f from which Δτ is accepted
    resolution: float = 1.25  # R_a up to which the time axis is resolved (ours)


def checked(thresholds: Thresholds | None) -> Thresholds:
    """Return thresholds, the paper's where None are given. Raises InputError for one outside its range."""
    limits = thresholds or Thresholds()
    for name, value, low in zip(Thresholds._fields, limits, LEAST, strict=True):
        if not (math.isfinite(value) and value > low):
            raise InputError(f"thresholds: {name} is {value:g}; give a finite one above {low:g}")
    if limits.energy > 1.0:
        raise InputError(f"thresholds: energy is {limits.energy:g}; it is a share, at most 1")
    return limits


class Crossing(NamedTuple):
    """Where a ratio first exceeds its limit."""

    n_c: int  # the largest number of modes before it does; the last one evaluated if it never does
    position: float  # the same as a real number in [n_c, n_c + 1), interpolated
    exceeded: bool


def least_reconstructable_mode(eigenvalues: Array, energy: float, denominator: int | None = None) -> int:
    """n_lr, the smallest p with I(p) = Σ_{i≤p} λ_i / Σ λ_i ≥ energy (paper eq. (28)); 0 where nothing moves.

    eigenvalues: (p,) descending. denominator: how many leading eigenvalues are summed below the line; None is
    all of them, the exact total energy. The paper sums "e.g., 80 % of total data": `ceil(0.8 m)` of m
    snapshots, which flatters K_f.
    """
    total = math.fsum(eigenvalues[:denominator])
    if total <= 0:
        return 0
    enough = np.cumsum(eigenvalues) >= energy * total
    # energy 1 may be missed by one rounding of the sum: then all modes are needed
    return int(np.argmax(enough)) + 1 if enough.any() else len(eigenvalues)


def consistent_mode(ratio: Array, limit: float) -> Crossing:
    """n_c, the largest n before the ratio first exceeds the limit; 0 where the first mode does (paper 2.3).

    ratio: (n,) R_c or its gap-only twin at n = 0, 1, …; n = 0, the mean alone, only serves the interpolation.
    """
    beyond = ratio[1:] > limit
    if not beyond.any():
        n = max(len(ratio) - 1, 0)
        return Crossing(n, float(n), False)
    n = int(np.argmax(beyond))
    below, above = ratio[n], ratio[n + 1]
    return Crossing(n, n + float(max(limit - below, 0.0) / (above - below)) if above > below else float(n), True)


def feasibility_index(n_c: int, n_lr: int) -> float | None:
    """K_f = n_c / n_lr (paper eq. (36)); None where nothing moves and there is no mode to reconstruct."""
    return n_c / n_lr if n_lr > 0 else None


class Evidence(NamedTuple):
    """What a verdict rests on."""

    n_snapshots: int
    unseen: int  # testing times that are not training times
    n_lr: int
    crossing: Crossing
    K_f: float | None
    K_f_interval: tuple[float, float] | None
    R_a: float | None
    resampled: bool  # False where resampling was asked for and the particles are too few
    blurred: bool = False  # rounding in R_c may move n_c


class Verdict(NamedTuple):
    """`sufficient`, `insufficient` or `undecidable`, and why."""

    verdict: str
    reasons: list[str]


def verdict(evidence: Evidence, thresholds: Thresholds) -> Verdict:
    """Our own verdict beside the paper's rule: K_f and R_a must both hold, and the data must be able to tell.

    Sufficient: K_f at least its threshold and R_a at most its own. Undecidable: the data cannot tell; see `doubts`.
    """
    doubt = doubts(evidence, thresholds)
    reasons = shortfalls(evidence, thresholds)
    if doubt:
        return Verdict("undecidable", doubt + reasons)
    if reasons:
        return Verdict("insufficient", reasons)
    return Verdict(
        "sufficient",
        [
            f"K_f {evidence.K_f:.2f} at least {thresholds.feasibility:g}",
            f"R_a {evidence.R_a:.2f} at most {thresholds.resolution:g}",
        ],
    )


def doubts(evidence: Evidence, thresholds: Thresholds) -> list[str]:
    """Why the data cannot tell: one phrase for each cause, none if they can."""
    crossing, limit = evidence.crossing, thresholds.feasibility
    if evidence.n_lr == 0:
        return ["nothing moves: the variable is the same in every snapshot"]
    found = []
    if evidence.unseen == 0:
        found.append("Δτ equals the dense interval: no unseen snapshot to test on")
    elif not crossing.exceeded and crossing.n_c + 2 < evidence.n_snapshots:
        found.append(f"E_train at round-off beyond {crossing.n_c} modes, before R_c exceeds {thresholds.consistency:g}")
    elif not crossing.exceeded:
        found.append(f"R_c never exceeds {thresholds.consistency:g}")
    if evidence.blurred:
        found.append("inner products know R_c too poorly to tell n_c; rounding hides E_train there")
    if evidence.n_snapshots < FEWEST_SNAPSHOTS:
        found.append(f"too few snapshots: {evidence.n_snapshots}, at least {FEWEST_SNAPSHOTS} needed")
    if not evidence.resampled:
        found.append("too few particles to resample")
    if evidence.K_f_interval is not None and evidence.K_f_interval[0] < limit <= evidence.K_f_interval[1]:
        low, high = evidence.K_f_interval
        found.append(f"too few particles: K_f between {low:.2f} and {high:.2f} may be either side of {limit:g}")
    return found


def shortfalls(evidence: Evidence, thresholds: Thresholds) -> list[str]:
    """Speak against Δτ: one phrase for each threshold missed."""
    found = []
    if evidence.K_f is not None and evidence.K_f < thresholds.feasibility:
        found.append(f"K_f {evidence.K_f:.2f} below {thresholds.feasibility:g}")
    if evidence.R_a is not None and evidence.R_a > thresholds.resolution:
        found.append(f"R_a {evidence.R_a:.2f} above {thresholds.resolution:g}")
    if evidence.R_a is None and evidence.n_lr > 0 and evidence.unseen > 0:
        found.append(
            "R_a undefined: no consistent mode"
            if evidence.crossing.n_c == 0
            else "R_a undefined: the modes leave no error"
        )
    return found
