"""Baselines without a model: the unseen snapshots interpolated from the stored ones themselves."""

from collections.abc import Iterator, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pod import RowSource
from suffice.precision import Array, Extent, bytes_kept, extent_of, read_back
from suffice.reconstruction import REPEATS, Case, Reconstruction
from suffice.variables import BLOCK_VALUES
from surrogates import SURROGATES, measure_cost


def raw(name: str, case: Case, precisions: Sequence[str], extents: Sequence[Extent] = ()) -> list[Reconstruction]:
    """Interpolate the unseen snapshots from the stored ones, without modes, by blocks of rows, in each precision.

    precisions: that of the run first, in which nothing is rounded; the others need `extents`. One snapshot alone is
    timed on the two stored ones around it, widened already, which is all that an interpolation reads.
    Raises surrogates.InputError where it cannot be fitted.
    """
    rows, fields = int(case.values.shape[0]), 2 if SURROGATES[name].needs_rates else 1
    squares = np.zeros((len(precisions), len(case.unseen)))
    fit_seconds, ask_seconds = 0.0, 0.0
    for part in _row_slices(case):
        stored = _stored(name, case, part)
        truth = _snapshots(case.values, part)[case.unseen]
        for k, precision in enumerate(precisions):
            kept = stored if k == 0 else [_narrow(v, precision, e) for v, e in zip(stored, extents, strict=False)]
            surrogate = SURROGATES[name]().fit(case.times[case.training], *kept)
            begin = perf_counter()
            predicted = surrogate.predict(case.times[case.unseen])
            if k == 0:
                ask_seconds += perf_counter() - begin
                fit_seconds += surrogate.fit_seconds_
            predicted -= truth
            squares[k] += np.einsum("ij,ij->i", predicted, predicted)
    alone, times = _seconds_between_two(name, case), case.times[case.training].nbytes
    return [
        Reconstruction(
            name,
            None,
            precision,
            np.sqrt(square / rows),
            fit_seconds,
            alone,
            ask_seconds / len(case.unseen),
            fields * bytes_kept(rows, len(case.training), precision) + times,
        )
        for precision, square in zip(precisions, squares, strict=True)
    ]


def _stored(name: str, case: Case, part: slice) -> list[NDArray[Any]]:
    """Return the training snapshots (m, b) of some rows, and their rates where the baseline needs them."""
    sources = [case.values, *([case.rates] if SURROGATES[name].needs_rates and case.rates is not None else [])]
    return [_snapshots(source, part)[case.training] for source in sources]


def extents(case: Case) -> list[Extent]:
    """Return where the values of each training snapshot lie over all rows, and those of their rates if there are any.

    What packed numbers are shifted and scaled by.
    """
    sources = [source for source in (case.values, case.rates) if source is not None]
    return [extent_of(_snapshots(source, p)[case.training].T for p in _row_slices(case)) for source in sources]


def _narrow(values: NDArray[Any], precision: str, extent: Extent) -> Array:
    """Return what a precision keeps of snapshots (m, b); a column of the file is a snapshot."""
    return np.ascontiguousarray(read_back(values.T, precision, extent).T)


def _row_slices(case: Case) -> Iterator[slice]:
    rows, snapshots = case.values.shape
    step = max(BLOCK_VALUES // snapshots, 1)
    return (slice(start, min(start + step, rows)) for start in range(0, rows, step))


def _snapshots(source: RowSource, part: slice) -> NDArray[Any]:
    """Rows of this slice as (snapshots, b), contiguous in a snapshot as they are stored, in the stored precision."""
    return np.ascontiguousarray(np.asarray(source[part]).T)


def _seconds_between_two(name: str, case: Case) -> float:
    """Seconds to interpolate one full snapshot half way between two stored ones, both in memory."""
    around = case.training[len(case.training) // 2 - 1 :][:2]
    values, rates = _whole(case.values, around, case), None
    if case.rates is not None and SURROGATES[name].needs_rates:
        rates = _whole(case.rates, around, case)
    times = case.times[around]
    surrogate = SURROGATES[name]().fit(times, values, rates)
    return measure_cost(surrogate, [float(times.mean())], repeats=REPEATS).single_seconds


def _whole(source: RowSource, which: NDArray[np.intp], case: Case) -> NDArray[Any]:
    """Return some of the snapshots in full, (len(which), rows); read by blocks."""
    return np.concatenate([_snapshots(source, part)[which] for part in _row_slices(case)], axis=1)
