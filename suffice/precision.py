"""Numbers kept in fewer bits: how many bytes they take, and what is read back of them."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.refusal import Refusal
from surrogates import Surrogate

Array = NDArray[np.float64]


class Precision(NamedTuple):
    """How a number is kept."""

    bytes: int
    text: str
    steps: int = 0  # of an integer, either way from zero
    packed: bool = False  # shifted and scaled column by column, which takes two doubles for each
    finer: str | None = None  # what a model keeps its mean, its coefficients and its leading modes in instead


PRECISIONS = {
    "double": Precision(8, "double precision"),
    "single": Precision(4, "single precision"),
    "half": Precision(2, "half precision", packed=True),
    "int16": Precision(2, "16-bit integers", 32767, packed=True),
    "int8": Precision(1, "8-bit integers", 127, packed=True, finer="int16"),
}
USUAL = ("int16", "int8")  # half errs more than int16 and takes as much
OF_A_COLUMN = 16  # bytes of its shift and its scale


class Extent(NamedTuple):
    """Where the values of every column lie."""

    low: Array  # (columns,)
    high: Array
    mean: Array


def precisions_from(itemsize: int, asked: Sequence[str] | None = None) -> list[str]:
    """Return the precision in which a run keeps its numbers, by their bytes, and those asked for, the widest first.

    asked: names in `PRECISIONS`, default integers of 16 and of 8 bits.
    Raises Refusal for a name that is not known, or one wider than the run.
    """
    known = list(PRECISIONS) if itemsize >= PRECISIONS["double"].bytes else list(PRECISIONS)[1:]
    for name in asked or ():
        if name not in known:
            raise Refusal(
                f"precision {name!r}: numbers of {itemsize} bytes cannot be kept in it; use {', '.join(known)}"
            )
    return [name for name in known if name == known[0] or name in (USUAL if asked is None else asked)]


def extent_of(blocks: Iterable[NDArray[Any]]) -> Extent:
    """Return the extent of columns whose rows come in blocks (b, columns), at least one."""
    low: Any = np.inf
    high: Any = -np.inf
    total: Any = 0.0
    rows = 0
    for block in blocks:
        low, high = np.minimum(low, block.min(axis=0)), np.maximum(high, block.max(axis=0))
        total, rows = total + block.sum(axis=0, dtype=np.float64), rows + len(block)
    return Extent(np.asarray(low, np.float64), np.asarray(high, np.float64), np.asarray(total / rows, np.float64))


def read_back(values: NDArray[Any], precision: str, extent: Extent) -> Array:
    """Return what a precision keeps of values (rows, columns), in double.

    Half precision keeps (x - mean) / max|x - mean|, so that neither range nor origin costs digits; integers of b bits
    keep (x - middle) in steps of the half range over 2^(b-1) - 1: an error of at most half a step.
    """
    wide = np.asarray(values, dtype=np.float64)
    if precision == "double":
        return wide
    if precision == "single":
        return wide.astype(np.float32).astype(np.float64)
    if precision == "half":
        shift, reach = extent.mean, np.maximum(extent.high - extent.mean, extent.mean - extent.low)
        scale = np.where(reach > 0, reach, 1.0)
        return np.asarray(((wide - shift) / scale).astype(np.float16).astype(np.float64) * scale + shift)
    shift, reach = 0.5 * (extent.high + extent.low), 0.5 * (extent.high - extent.low)
    scale = np.where(reach > 0, reach, 1.0) / PRECISIONS[precision].steps
    return np.asarray(np.rint((wide - shift) / scale) * scale + shift)


def bytes_kept(rows: int, columns: int, precision: str) -> int:
    """Bytes of a table (rows, columns)."""
    kept = PRECISIONS[precision]
    return rows * columns * kept.bytes + (columns * OF_A_COLUMN if kept.packed else 0)


def finer(precision: str) -> str:
    """Return the precision in which a model keeps what would suffer most: its mean, coefficients, and leading modes."""
    return PRECISIONS[precision].finer or precision


def model_bytes(rows: int, n: int, precision: str, leading: int) -> int:
    """Bytes of the mean and of n modes (rows,), the leading ones of which are kept in a finer precision."""
    fine = min(n, leading)
    return bytes_kept(rows, 1 + fine, finer(precision)) + bytes_kept(rows, n - fine, precision)


def narrowed(surrogate: Surrogate, precision: str) -> tuple[Surrogate, int]:
    """Return the surrogate that is read back when the tables of its state are kept in this precision, and its bytes.

    Tables, coefficients or weights, are what grows with the modes; vectors, such as times, stay as they are, and so
    does what is kept in fewer bits already.
    """
    state, total = surrogate.state(), 0
    for name, array in state.items():
        if array.ndim == 2 and array.size and array.dtype.kind == "f" and array.itemsize > PRECISIONS[precision].bytes:
            state[name] = read_back(array, precision, extent_of([array])).astype(array.dtype)
            total += bytes_kept(array.shape[0], array.shape[1], precision)
        else:
            total += array.nbytes
    return type(surrogate).from_state(state, surrogate.settings()), total
