"""What a caller gives a snapshot matrix: rows, columns and weights, or a refusal of what would be lost silently."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pod.errors import InputError
from pod.gram import Array


def real(values: Any) -> NDArray[Any]:
    """Return the rows as an array. Raises InputError where a part would be lost: imaginary parts, or a mask."""
    if np.ma.is_masked(values):
        raise InputError("snapshots: some values are masked; fill them, or leave those rows or snapshots out")
    block = np.asarray(values)
    if np.iscomplexobj(block):
        raise InputError("snapshots: complex values; give real ones, such as real and imaginary parts as separate rows")
    return block


def checked_weights(weights: ArrayLike, rows: int) -> Array:
    """Return weights (rows,). Raises InputError unless there is a positive one for each row."""
    found = np.asarray(weights, dtype=np.float64)
    if found.shape != (rows,):
        raise InputError(f"weights: shape {found.shape}; give one per row, ({rows},)")
    if not (np.isfinite(found) & (found > 0.0)).all():
        row = int(np.argmin(np.isfinite(found) & (found > 0.0)))
        raise InputError(f"weights: {found[row]} at row {row}; give positive ones, or leave the row out")
    return found


def checked_columns(columns: Sequence[int] | NDArray[np.intp], snapshots: int) -> NDArray[np.intp]:
    """Return numbers of snapshots. Raises InputError for a mask, for what is no whole number, and beyond the last."""
    found = np.asarray(columns)
    if found.dtype == bool or (found.size and not np.issubdtype(found.dtype, np.integer)):
        raise InputError(f"columns: {found.dtype} values; give numbers of snapshots, of a mask np.flatnonzero(mask)")
    if found.ndim != 1 or (found.size and not (-snapshots <= found.min() and found.max() < snapshots)):
        raise InputError(
            f"columns: shape {found.shape}, beyond 0 to {snapshots - 1}; give numbers of snapshots there are"
        )
    return found.astype(np.intp)
