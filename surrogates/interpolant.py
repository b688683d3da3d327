"""Regressors in time that pass through every snapshot."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.series import Series, checked_series
from surrogates.surrogate import EDGE, Kind, Surrogate


class Interpolant(Surrogate):
    """Surrogate whose fitted state is the series itself: c(t_i) is reproduced at every training time t_i."""

    kind: ClassVar[Kind] = "time"

    series_: Series

    def _fit(self, series: Series) -> None:
        self.series_ = series

    def _arrays(self) -> dict[str, NDArray[Any]]:
        times, values, rates, _ = self.series_
        kept = {"times": times, "values": values}
        return kept if rates is None else {**kept, "rates": rates}

    def _restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        self._fit(self._stored(state))

    def _stored(self, state: Mapping[str, NDArray[Any]]) -> Series:
        rates = state["rates"] if self.needs_rates else None
        return checked_series(state["times"], state["values"], rates, copy=not self.raw)


def place(times: NDArray[np.float64], knots: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Interval i and fraction s of each time: t = t_i + s (t_{i+1} - t_i); outside the knots s leaves [0, 1]."""
    i = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    return i, (times - knots[i]) / (knots[i + 1] - knots[i])


def last_before(times: NDArray[np.float64], series: Series) -> NDArray[np.intp]:
    """Last snapshot at or before each time, up to rounding; the first where there is none."""
    late = np.searchsorted(series.times, times + EDGE * series.interval, side="right") - 1
    return np.asarray(np.maximum(late, 0))
