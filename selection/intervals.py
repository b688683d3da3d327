"""Which snapshots a candidate interval Δτ would have kept."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.errors import InputError

TIMING_TOLERANCE = (
    1e-3  # of one dense interval: text dumps round their times, a lost snapshot shifts them by a whole one
)


class Subset(NamedTuple):
    """One candidate: the snapshots it trains on and those it is tested on, as indices into the dense set."""

    interval: float  # s
    training: NDArray[np.intp]  # (m,) every stride-th snapshot
    testing: NDArray[np.intp]  # (m - 1) * stride + 1 snapshots: all of them up to the last training snapshot


def dense_interval(times: ArrayLike) -> float:
    """Interval of the dense (testing) set, in seconds.

    times: (N_t,) s, increasing and uniform. Raises InputError for fewer than two snapshots, for times that are not
    finite, do not increase, or leave the uniform spacing by more than a thousandth of an interval.
    """
    t = np.asarray(times, dtype=np.float64)
    if t.ndim != 1 or t.size < 2:
        raise InputError(f"times: {t.size} snapshot(s); a choice of Δτ needs at least 2, in practice 100 or more")
    if not np.isfinite(t).all():
        raise InputError(
            f"times: snapshot {int(np.argmin(np.isfinite(t)))} is at {t[~np.isfinite(t)][0]} s; give its time"
        )
    interval = float(t[-1] - t[0]) / (t.size - 1)
    if interval <= 0:
        raise InputError(f"times: from {t[0]:g} s to {t[-1]:g} s; they must increase")
    late = np.abs(t - (t[0] + interval * np.arange(t.size))) / interval
    if late.max() > TIMING_TOLERANCE:
        k = int(np.argmax(late))
        raise InputError(
            f"times: not uniform, snapshot {k} at {t[k]:g} s lies {late[k]:.2g} intervals of {interval:g} s off; "
            "resample the run or cut it where it changes its output interval"
        )
    return interval


def stride(interval: float, dense: float, n_snapshots: int) -> int:
    """How many dense intervals one Δτ spans.

    interval, dense: s. Raises InputError, with the nearest allowed value, where Δτ is not a multiple of the dense
    interval or leaves fewer than two training snapshots.
    """
    if not (np.isfinite(interval) and interval > 0):
        raise InputError(f"interval: {interval} s; it must be a positive number of seconds")
    k = round(interval / dense)
    if abs(interval / dense - k) > TIMING_TOLERANCE or k < 1:
        raise InputError(
            f"interval: {interval:g} s is not a multiple of the dense interval {dense:g} s; "
            f"the nearest allowed is {max(k, 1) * dense:g} s"
        )
    if k > n_snapshots - 1:
        raise InputError(
            f"interval: {interval:g} s is longer than the run; the longest allowed is {(n_snapshots - 1) * dense:g} s"
        )
    return k


def default_intervals(times: ArrayLike) -> list[float]:
    """Ten down to two dense intervals, the scan of the paper (2.3), in seconds; fewer where the run is shorter."""
    dense, n = dense_interval(times), np.size(np.asarray(times))
    # twelve digits, so that 3 × 0.001 s is written 0.003 and not 0.0030000000000000001
    return [float(f"{k * dense:.12g}") for k in range(10, 1, -1) if k <= n - 1]


def candidates(times: ArrayLike, intervals: Sequence[float] | None) -> list[Subset]:
    """Training and testing sets of every Δτ, coarse to fine, each once.

    times: (N_t,) s; intervals: s, None for the default scan. Testing times beyond the last training snapshot are
    trimmed, so Δτ need not divide the time range. Raises InputError as `dense_interval` and `stride` do.
    """
    dense, n = dense_interval(times), np.size(np.asarray(times))
    wanted = default_intervals(times) if intervals is None else [float(i) for i in intervals]
    if not wanted and intervals is None:
        raise InputError(
            f"times: {n} snapshots, the run is too short; a Δτ of two dense intervals, the least that can be judged, "
            "needs at least 3, in practice 100 or more; record more"
        )
    if not wanted:
        raise InputError("intervals: none given; give at least one Δτ in seconds")
    by_stride = {stride(i, dense, n): i for i in wanted}
    subsets = []
    for k in sorted(by_stride, reverse=True):
        training = np.arange(0, n, k)
        subsets.append(Subset(by_stride[k], training, np.arange(training[-1] + 1)))
    return subsets
