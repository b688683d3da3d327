"""Cubics between snapshots that match positions and velocities at both ends."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.interpolant import Interpolant, place
from surrogates.series import Array


class Hermite(Interpolant):
    """Cubic Hermite interpolation with the stored rates as exact derivatives; fourth order in Δτ, once differentiable.

    c(t) = (1+2s)(1-s)² c_i + s²(3-2s) c_{i+1} + h s(1-s)² ċ_i - h s²(1-s) ċ_{i+1},  h = t_{i+1} - t_i.
    Evaluated from the snapshots at each call: the polynomials of raw snapshots would take four times their memory.
    """

    name: ClassVar[str] = "hermite"
    needs_rates: ClassVar[bool] = True
    columnwise: ClassVar[bool] = True
    differentiable: ClassVar[bool] = True

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        knots, values, rates, _ = self.series_
        assert rates is not None, "fit has checked it"
        i, s = place(times, knots)
        h = knots[i + 1] - knots[i]
        between = ((1 + 2 * s) * (1 - s) ** 2)[:, None] * values[i]
        between += (s**2 * (3 - 2 * s))[:, None] * values[i + 1]
        between += (h * s * (1 - s) ** 2)[:, None] * rates[i]
        between -= (h * s**2 * (1 - s))[:, None] * rates[i + 1]
        return between

    def _derivative(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """ċ(t) = 6s(1-s)/h (c_{i+1} - c_i) + (1-s)(1-3s) ċ_i + s(3s-2) ċ_{i+1}; third order in Δτ."""
        knots, values, rates, _ = self.series_
        assert rates is not None, "fit has checked it"
        i, s = place(times, knots)
        h = knots[i + 1] - knots[i]
        slope = (6 * s * (1 - s) / h)[:, None] * (values[i + 1] - values[i])
        slope += ((1 - s) * (1 - 3 * s))[:, None] * rates[i]
        slope += (s * (3 * s - 2))[:, None] * rates[i + 1]
        return np.asarray(slope, dtype=np.float64)


class RawHermite(Hermite):
    """`Hermite` on stored positions and velocities: the baseline without a model that every ROM is shown against."""

    name: ClassVar[str] = "raw-hermite"
    raw: ClassVar[bool] = True
