"""Training series: what was measured at which time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surrogates.errors import InputError

Array = NDArray[np.floating]

CLOSEST = 1e-6  # shortest interval over the mean one: below it the slope between two snapshots is rounding
BLOCK = 1 << 22  # numbers checked at once


class Series(NamedTuple):
    """Snapshots in time: rows are times, columns modes (or raw degrees of freedom)."""

    times: NDArray[np.float64]  # (snapshots,) s, increasing
    values: Array  # (snapshots, modes) any unit
    rates: Array | None = None  # (snapshots, modes) the same unit per second
    parameters: Array | None = None  # (snapshots, parameters) operating condition of each snapshot

    @property
    def interval(self) -> float:
        """Mean snapshot interval Δτ in s."""
        return float(self.times[-1] - self.times[0]) / (len(self.times) - 1)

    def scaled(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Count times from the first snapshot in units of Δτ: neither the origin nor the unit of time matters."""
        scaled: NDArray[np.float64] = (times - self.times[0]) / self.interval
        return scaled


def checked_series(
    times: ArrayLike,
    values: ArrayLike,
    rates: ArrayLike | None = None,
    parameters: ArrayLike | None = None,
    *,
    copy: bool = True,
) -> Series:
    """Series of the given arrays, or a refusal that says what is wrong.

    `times` (snapshots,) s; `values` and `rates` (snapshots, modes); `parameters` (snapshots, parameters).
    With `copy=False` floating arrays are kept as they are, single precision included: raw snapshots may be larger
    than what is left of the memory.

    Raises InputError: fewer than two snapshots, times that do not increase, a shape that does not fit, NaN.
    """
    t = checked_times(times)
    _check_increasing(t)
    return Series(
        t,
        _table("values", values, len(t), copy),
        None if rates is None else _rates(rates, np.shape(values), copy),
        None if parameters is None else _table("parameters", parameters, len(t), copy),
    )


def checked_times(times: ArrayLike) -> NDArray[np.float64]:
    """Copy times into a float64 array (any count,) in s. Raises InputError unless one-dimensional and finite."""
    t = np.array(times, dtype=np.float64)
    if t.ndim != 1:
        raise InputError(f"times has shape {t.shape}; give one time in seconds per snapshot, shape (snapshots,)")
    if not np.isfinite(t).all():
        raise InputError(f"times[{_first_bad(t)[0]}] is not a finite number of seconds")
    return t


def _check_increasing(times: NDArray[np.float64]) -> None:
    if len(times) < 2:
        raise InputError(f"times has {len(times)} snapshots; a regressor in time needs at least 2, take a smaller Δτ")
    gaps = np.diff(times)
    k = int(gaps.argmin())
    if gaps[k] <= 0:
        raise InputError(
            f"times[{k + 1}] = {times[k + 1]:.9g} s does not come after times[{k}] = {times[k]:.9g} s; "
            "sort the snapshots by time and drop repeated ones"
        )
    if gaps[k] < CLOSEST * gaps.mean():
        raise InputError(
            f"times[{k}] and times[{k + 1}] are {gaps[k]:.3g} s apart, the mean interval is {gaps.mean():.3g} s; "
            "drop one of the two snapshots"
        )


def _table(field: str, given: ArrayLike, snapshots: int, copy: bool) -> Array:
    if np.ma.is_masked(given) or np.iscomplexobj(given):
        raise InputError(
            f"{field} holds complex or masked values; give real ones, and fill or leave out what is masked"
        )
    table = np.asarray(given)
    if not copy and np.issubdtype(table.dtype, np.floating):
        kept: Array = table
    else:
        kept = np.array(table, dtype=np.float64)
    if kept.ndim != 2 or kept.shape[0] != snapshots or kept.shape[1] == 0:
        raise InputError(
            f"{field} has shape {kept.shape}, times has {snapshots} snapshots; give {field} one row per snapshot, "
            f"shape ({snapshots}, columns)"
        )
    if not _all_finite(kept):
        row, column = _first_bad(kept)
        raise InputError(f"{field}[{row}, {column}] is {kept[row, column]}; remove or repair snapshot {row}")
    return kept


def _rates(given: ArrayLike, shape: tuple[int, ...], copy: bool) -> Array:
    rates = _table("rates", given, shape[0], copy)
    if rates.shape != shape:
        raise InputError(f"rates has shape {rates.shape}, values {shape}; give d(values)/dt of every column")
    return rates


def _all_finite(table: Array) -> bool:
    # block by block in the order of memory: raw snapshots may fill it
    stored = table.T if table.flags.f_contiguous else table
    rows = max(1, BLOCK // stored.shape[1])
    return all(np.isfinite(stored[i : i + rows]).all() for i in range(0, len(stored), rows))


def _first_bad(array: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
