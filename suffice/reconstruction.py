"""Snapshots nobody trained on, reconstructed from those that were kept: how wrong, and at what cost."""

from collections.abc import Mapping
from statistics import median
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import Basis, RowSource, SnapshotMatrix, lanczos_pod
from selection.consistency import Projection, consistency
from selection.feasibility import consistent_mode
from suffice.precision import finer, model_bytes, narrowed
from suffice.rounding import Rounding, rounded_errors
from surrogates import Network, Surrogate, measure_cost

Array = NDArray[np.float64]
BATCH = 16  # snapshots reconstructed together when the cost of many is measured
REPEATS = 5


class Case(NamedTuple):
    """One variable at one snapshot interval Δτ: what is kept and what is left to predict."""

    values: RowSource  # (rows, snapshots)
    rates: RowSource | None  # their derivative in time, (rows, snapshots); None where the run has none
    times: Array  # (snapshots,) s
    training: NDArray[np.intp]  # (m,) snapshots kept, one every Δτ
    unseen: NDArray[np.intp]  # (u,) snapshots between them

    @property
    def itemsize(self) -> int:
        """Bytes of one stored number."""
        return int(np.dtype(getattr(self.values, "dtype", np.float64)).itemsize)


class Reduced(NamedTuple):
    """The snapshots kept as modes, and every snapshot of the window projected on them (paper eqs. (29), (31)-(32))."""

    basis: Basis
    coefficients: Array  # (window, p) of all snapshots up to the last one kept
    rates: Array | None  # (m, p) derivative of the coefficients at the training times
    outside: Array  # (u,) squared norm of what no mode represents, at the unseen times
    seconds: float  # wall time of the decomposition: inner products, eigenpairs, modes


class Reconstruction(NamedTuple):
    """One surrogate's answer at the unseen times, and what it took."""

    surrogate: str
    modes: int | None  # None: on the snapshots themselves
    precision: str  # in which mean, modes and coefficients, or the snapshots, are kept
    errors: Array  # (u,) RMSE over the rows, unit of the variable
    fit_seconds: float
    single_seconds: float  # one full snapshot, asked for alone
    batch_seconds: float  # one full snapshot, when many are asked for at once
    storage_bytes: int  # everything that must be kept to answer
    remark: str = ""  # how the training of a network ended
    finer_modes: int = 0  # leading modes that are kept in a finer precision, because rounding them would show
    early: bool = False  # the training of a network ended before it was done, or it had nothing to learn


def reduce(case: Case, energy: float) -> Reduced:
    """Decompose the training snapshots, keeping every mode, and project the window on them.

    energy: the Lanczos ratio that defines n_lr (paper eq. (28)). Memory: the modes in double precision, rows × m, and
    a block. Raises pod.InputError where nothing moves or a value is not finite.
    """
    matrix = SnapshotMatrix(case.values)
    begin = perf_counter()
    kept = len(case.training) - 1  # the mean takes one of the m degrees of freedom
    basis = lanczos_pod(matrix.columns(case.training), modes=kept, reconstructable=energy)
    return reduced_on(basis, case, perf_counter() - begin)


def reduced_on(basis: Basis, case: Case, seconds: float) -> Reduced:
    """Project the window on a basis that took so many seconds."""
    matrix = SnapshotMatrix(case.values)
    coefficients = basis.project(matrix.columns(np.arange(case.training[-1] + 1)))
    rates = None
    if case.rates is not None:
        # the derivative of W̄ + Σ c φ has no mean
        derivative = basis._replace(mean=np.zeros_like(basis.mean))
        rates = derivative.project(SnapshotMatrix(case.rates).columns(case.training))
    outside = _outside(basis, matrix.columns(case.unseen), coefficients[case.unseen])
    return Reduced(basis, coefficients, rates, outside, seconds)


def _outside(basis: Basis, unseen: SnapshotMatrix, coefficients: Array) -> Array:
    """Squared norm of the part of each snapshot that no mode represents, formed as a vector and then squared, (u,)."""
    total, start = np.zeros(len(coefficients)), 0
    for block in unseen.row_blocks():
        rows = slice(start, start + len(block))
        left = block - basis.mean[rows, None] - basis.modes[rows] @ coefficients.T
        total += np.einsum("ij,ij->j", left, left)
        start += len(block)
    return total


def projection_errors(reduced: Reduced, case: Case, n: int) -> Array:
    """RMSE over the rows that projection on the first n modes leaves at the unseen times, (u,) (paper eq. (34))."""
    truncated = np.square(reduced.coefficients[case.unseen, n:]).sum(axis=1)
    return np.asarray(np.sqrt((reduced.outside + truncated) / len(reduced.basis.mean)))


def modal(
    surrogate: Surrogate,
    reduced: Reduced,
    case: Case,
    n: int,
    reconstruct_seconds: tuple[float, float],
    kept: Mapping[str, Rounding | None],
) -> list[Reconstruction]:
    """Fit one surrogate to the first n coefficients and reconstruct the unseen snapshots, in each precision kept.

    Modes are orthonormal, so E² = E_projection² + |c - ĉ|²/rows holds and no row is touched again; of rounded ones the
    inner products that `roundings` found are added. Seconds are the same for all: numbers are widened when a model is
    read. reconstruct_seconds: of one snapshot alone and of one among many, from `measure_reconstruction`; kept: what
    rounding takes from mean and modes in each precision, None for nothing.
    Raises surrogates.InputError where it cannot be fitted.
    """
    rates = None if reduced.rates is None else reduced.rates[:, :n]
    surrogate.fit(case.times[case.training], reduced.coefficients[case.training, :n], rates)
    unseen, rows = case.times[case.unseen], len(reduced.basis.mean)
    known, floor = reduced.coefficients[case.unseen, :n], rows * projection_errors(reduced, case, n) ** 2
    cost = measure_cost(surrogate, unseen, repeats=REPEATS)
    alone, among_many = reconstruct_seconds
    found = []
    for precision, rounding in kept.items():
        asked, size = narrowed(surrogate, finer(precision))
        leading = 0 if rounding is None else rounding.leading
        predicted = asked.predict(unseen)
        if rounding is None:
            squares = floor + np.square(predicted - known).sum(axis=1)
        else:
            squares = rounded_errors(rounding, floor, known, predicted)
        found.append(
            Reconstruction(
                surrogate.name,
                n,
                precision,
                np.sqrt(squares / rows),
                cost.fit_seconds,
                cost.single_seconds + alone,
                cost.batch_seconds + among_many,
                model_bytes(rows, n, precision, leading) + size,
                training_remark(surrogate),
                leading,
                ended_early(surrogate),
            )
        )
    return found


def training_remark(surrogate: Surrogate) -> str:
    """Return in a few words how the trainings of a network ended, nothing for other surrogates."""
    if not isinstance(surrogate, Network):
        return ""
    ends = [f"step {done.best_step} of {done.steps} kept, {done.reason}" for done in surrogate.trainings_]
    return "; ".join(ends) or "nothing to learn, or too few snapshots to learn it from"


def ended_early(surrogate: Surrogate) -> bool:
    """Tell whether a network had nothing to learn, or some training of it stopped before it was done."""
    if not isinstance(surrogate, Network):
        return False
    return not surrogate.trainings_ or any(done.early for done in surrogate.trainings_)


def consistent_level(reduced: Reduced, case: Case, limit: float) -> int:
    """n_c, the modes that can be used before R_c exceeds the limit (paper 2.3), from the same projections."""
    outside = np.zeros(len(reduced.coefficients))
    outside[case.unseen] = reduced.outside
    values, rows = reduced.basis.values, len(reduced.basis.mean)
    projection = Projection(values, reduced.coefficients, outside, case.training)
    motion = float(np.sqrt(values.sum() / rows))
    return consistent_mode(consistency(projection, rows, motion, exact=True).R_c, limit).n_c


def measure_reconstruction(basis: Basis, coefficients: Array) -> tuple[float, float]:
    """Seconds to turn coefficients (u, n) into snapshots: one alone, and each of `BATCH` at once; medians."""
    n = coefficients.shape[1]
    kept = basis._replace(modes=np.ascontiguousarray(basis.modes[:, :n]))
    batch = np.resize(coefficients, (BATCH, n))

    def seconds(asked: Array) -> float:
        begin = perf_counter()
        kept.reconstruct(asked)
        return perf_counter() - begin

    alone = median(seconds(batch[:1]) for _ in range(REPEATS))
    return alone, median(seconds(batch) for _ in range(REPEATS)) / BATCH
