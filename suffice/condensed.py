"""Snapshots condensed to few rows: as many as there are snapshots, with the same inner products."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import RowSource
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.variables import BLOCK_VALUES, held, held_velocity

Array = NDArray[np.float64]


class Condensed(NamedTuple):
    """A variable and, of a position, its velocity: distances between snapshots are those of all rows."""

    variable: str
    unit: str
    values: Array  # (r, snapshots) r at most the number of columns; the first snapshot is zero
    rates: Array | None  # (r, snapshots) of the velocity of a position, None where the run has none
    rows: int  # of the variable itself, over which an RMSE is taken
    itemsize: int  # bytes of one stored number


def condense(run: Run, variable: str) -> Condensed:
    """Read a variable once, and keep R of W = QR: whatever errors R shows, the rows of W show.

    Raises Refusal where a value is not finite.
    """
    stored, velocity = run.variable(variable), held_velocity(run, variable)
    sources = [held(run, variable), *([] if velocity is None else [velocity])]
    factor = triangular_factor(sources)
    if not np.isfinite(factor).all():
        raise Refusal(f"{run.path}: {variable} holds a value that is not finite; repair or drop the snapshot")
    n = run.n_snapshots
    rates = None if velocity is None else factor[:, n:]
    return Condensed(variable, stored.unit, factor[:, :n], rates, stored.shape[0], stored.dtype.itemsize)


def triangular_factor(sources: Sequence[RowSource]) -> Array:
    """R (r, columns) of [W₁ - w₀, W₂, …] = QR, block by block of rows: RᵀR is the matrix of all inner products.

    sources: (rows, snapshots) each; from the first its first snapshot is subtracted, so that rounding is measured
    against motion. R comes from orthogonal steps alone, with the relative accuracy of W itself and not of its square.
    """
    rows, columns = sources[0].shape[0], sum(source.shape[1] for source in sources)
    factor, step = np.zeros((0, columns)), max(BLOCK_VALUES // columns, 2 * columns)
    for start in range(0, rows, step):
        parts = [np.asarray(source[start : min(start + step, rows)], dtype=np.float64) for source in sources]
        parts[0] = parts[0] - parts[0][:, :1]
        factor = np.asarray(np.linalg.qr(np.vstack([factor, np.hstack(parts)]), mode="r"))
    return factor
