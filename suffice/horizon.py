"""Errors ahead of a start: what surrogates say about snapshots that come after all they were trained on."""

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import Basis, RowSource, SnapshotMatrix, lanczos_pod
from suffice.making import made
from suffice.variables import BLOCK_VALUES
from surrogates import InputError, Surrogate

Array = NDArray[np.float64]


class Future(NamedTuple):
    """One variable at one Δτ, cut into a part to train on and the rest."""

    values: RowSource  # (rows, snapshots) of the run
    rates: RowSource | None  # their derivative in time; None where the run has none
    kept: NDArray[np.intp]  # (M,) snapshots of the run, Δτ apart
    times: Array  # (M,) s
    trained: int  # the first m of them are trained on
    starts: NDArray[np.intp]  # (s,) which of them predictions start from: the end of training, and later ones
    reach: int  # snapshots ahead

    @property
    def targets(self) -> NDArray[np.intp]:
        """Snapshots (s, reach) that are predicted, from each start."""
        return self.starts[:, None] + 1 + np.arange(self.reach)


class Reduced(NamedTuple):
    """Modes of the training part, and every snapshot projected on them."""

    basis: Basis
    coefficients: Array  # (M, p)
    rates: Array | None  # (m, p) their derivative in the training part
    outside: Array  # (M - m + 1, the same) inner products of what no mode represents, from the end of training on
    motion: float  # RMS over rows and times of the training part about its mean
    seconds: float  # to decompose


class Ahead(NamedTuple):
    """Errors of one surrogate, RMSE over the rows; NaN where a rollout was lost."""

    errors: Array  # (s, reach)
    alone: Array  # (s, reach) of the modes alone, without what they miss of the start
    starts: NDArray[np.intp]  # (s,) which of the starts
    fit_seconds: float
    step_seconds: float  # per snapshot ahead


def reduce_past(future: Future, energy: float) -> Reduced:
    """Decompose the training part alone, and project all snapshots on its modes. Raises pod.InputError."""
    matrix, m = SnapshotMatrix(future.values), future.trained
    begin = perf_counter()
    basis = lanczos_pod(matrix.columns(future.kept[:m]), modes=m - 1, reconstructable=energy)
    seconds = perf_counter() - begin
    coefficients, rates = basis.project(matrix.columns(future.kept)), None
    if future.rates is not None:
        derivative = basis._replace(mean=np.zeros_like(basis.mean))  # that of W̄ + Σ c φ has none
        rates = derivative.project(SnapshotMatrix(future.rates).columns(future.kept[:m]))
    outside, first = np.zeros((len(future.kept) - m + 1,) * 2), 0
    for block in matrix.columns(future.kept[m - 1 :]).row_blocks():
        rows = slice(first, first + len(block))
        left = block - basis.mean[rows, None] - basis.modes[rows] @ coefficients[m - 1 :].T
        outside += left.T @ left
        first += len(block)
    motion = float(np.sqrt(basis.total_energy / len(basis.mean)))
    return Reduced(basis, coefficients, rates, outside, motion, seconds)


def floors(future: Future, reduced: Reduced, n: int) -> tuple[Array, Array]:
    """RMSE (s, reach) that exact coefficients would leave: with what the modes miss of the start kept, and without.

    Kept, |r(t) - r(s)| of the part r that n modes miss; without, |r(t)|: the projection error (paper eq. (34)).
    """
    tail, end = reduced.coefficients[:, n:], future.trained - 1
    now, later = np.broadcast_to(future.starts[:, None], future.targets.shape), future.targets
    product = reduced.outside
    still = product[later - end, later - end] + np.square(tail[later]).sum(axis=-1)
    crossed = product[now - end, later - end] + (tail[now] * tail[later]).sum(axis=-1)
    begun = product[now - end, now - end] + np.square(tail[now]).sum(axis=-1)
    rows = len(reduced.basis.mean)
    return np.sqrt(np.maximum(still + begun - 2 * crossed, 0.0) / rows), np.sqrt(still / rows)


def ahead_of_modes(name: str, future: Future, reduced: Reduced, n: int, seed: int) -> Ahead:
    """Fit one surrogate to n coefficients of the training part, and ask it ahead of the starts.

    A state map goes on from the coefficients up to each start, a regressor in time only from the end of training. The
    snapshot it starts from is known, so x(s) + Σ (ĉ - c(s)) φ is predicted: what the modes miss of it stays as it is.
    Raises surrogates.InputError where it cannot be fitted.
    """
    known, surrogate = reduced.coefficients[:, :n], fit_past(name, future, reduced, n, seed)
    times: Array = surrogate.window_[1] + surrogate.interval_ * np.arange(1.0, future.reach + 1.0)
    which = np.arange(len(future.starts) if surrogate.kind == "state" else 1)
    begin = perf_counter()
    predicted = np.stack([ask_ahead(surrogate, known, int(start), times) for start in future.starts[which]])
    seconds = (perf_counter() - begin) / (len(which) * future.reach)
    miss = np.square(predicted - known[future.targets[which]]).sum(axis=-1) / len(reduced.basis.mean)
    kept, alone = floors(future, reduced, n)
    return Ahead(
        np.sqrt(miss + kept[which] ** 2), np.sqrt(miss + alone[which] ** 2), which, surrogate.fit_seconds_, seconds
    )


def fit_past(name: str, future: Future, reduced: Reduced, n: int, seed: int) -> Surrogate:
    """Fit one surrogate to n coefficients of the training part. Raises surrogates.InputError where it cannot be."""
    m, rates = future.trained, None if reduced.rates is None else reduced.rates[:, :n]
    return made(name, seed).fit(future.times[:m], reduced.coefficients[:m, :n], rates)


def ask_ahead(surrogate: Surrogate, known: Array, start: int, times: Array) -> Array:
    """Coefficients (times, n) ahead of a start, (M, n) being known; NaN from where a rollout is lost.

    times: rising, s, counted as if the start stood at the end of training; a regressor in time knows no other start.
    """
    past = None
    if surrogate.kind == "state":
        memory: int = surrogate.memory_  # type: ignore[attr-defined]
        past = known[start - memory + 1 : start + 1]
    predicted = np.full((len(times), known.shape[1]), np.nan)
    for count in range(len(times), 0, -1):
        try:
            predicted[:count] = surrogate.predict(times[:count], past, beyond=True)
        except InputError:
            continue
        break
    return predicted


def ahead_of_snapshots(name: str, future: Future, seed: int) -> Ahead:
    """Ask a surrogate without modes ahead of every start, from the two snapshots up to it, by blocks of rows."""
    rows, last = int(future.values.shape[0]), future.trained - 2
    squares, fit_seconds, seconds = np.zeros(future.targets.shape), 0.0, 0.0
    step = max(BLOCK_VALUES // int(future.values.shape[1]), 1)
    for first in range(0, rows, step):
        part = slice(first, min(first + step, rows))
        values = _columns(future.values, part, future.kept[last:])
        rates = None if future.rates is None else _columns(future.rates, part, future.kept[last:])
        for k, start in enumerate(future.starts - last):
            seen = slice(start - 1, start + 1)
            times = future.times[last:][seen]
            surrogate = made(name, seed).fit(times, values[seen], None if rates is None else rates[seen])
            begin = perf_counter()
            ahead = surrogate.predict(future.times[last + start + 1 :][: future.reach], beyond=True)
            seconds += perf_counter() - begin
            fit_seconds += surrogate.fit_seconds_
            squares[k] += np.square(ahead - values[start + 1 :][: future.reach]).sum(axis=1)
    errors, count = np.sqrt(squares / rows), len(future.starts)
    return Ahead(errors, errors, np.arange(count), fit_seconds / count, seconds / (count * future.reach))


def _columns(source: RowSource, part: slice, which: NDArray[np.intp]) -> NDArray[Any]:
    """Return some snapshots of a block of rows, (len(which), b), in the stored precision."""
    return np.ascontiguousarray(np.asarray(source[part])[:, which].T)
