"""Straight lines between snapshots."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.interpolant import Interpolant, place
from surrogates.series import Array


class Linear(Interpolant):
    """Piecewise linear interpolation, c(t) = (1-s) c_i + s c_{i+1}; second order in Δτ."""

    name: ClassVar[str] = "linear"
    columnwise: ClassVar[bool] = True

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        i, s = place(times, self.series_.times)
        between = (1 - s)[:, None] * self.series_.values[i]
        between += s[:, None] * self.series_.values[i + 1]
        return between


class RawLinear(Linear):
    """`Linear` on the snapshots themselves: the cheapest baseline without a model."""

    name: ClassVar[str] = "raw-linear"
    raw: ClassVar[bool] = True
