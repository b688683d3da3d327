"""Cubic spline through the snapshots."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from surrogates.interpolant import Interpolant
from surrogates.series import Array, Series


class Spline(Interpolant):
    """Twice differentiable cubic spline, not-a-knot ends (a line through 2 snapshots, a parabola through 3).

    Fourth order in Δτ up to the ends. Times are counted from the first snapshot in units of Δτ, so that neither the
    origin nor the unit of time matters.
    """

    name: ClassVar[str] = "spline"
    columnwise: ClassVar[bool] = True
    differentiable: ClassVar[bool] = True

    def _fit(self, series: Series) -> None:
        super()._fit(series)
        self.curve_ = CubicSpline(series.scaled(series.times), series.values)

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        return np.asarray(self.curve_(self.series_.scaled(times)))

    def _derivative(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self.curve_(self.series_.scaled(times), 1)) / self.series_.interval
