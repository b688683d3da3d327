"""Everything flies on: uniform motion from the last snapshot."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.interpolant import Interpolant, last_before
from surrogates.series import Array


class Ballistic(Interpolant):
    """x(t) = x_i + v_i (t - t_i), from the last snapshot before t: exact between collisions but for gravity, drag."""

    name: ClassVar[str] = "ballistic"
    needs_rates: ClassVar[bool] = True
    raw: ClassVar[bool] = True

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        knots, values, rates, _ = self.series_
        assert rates is not None, "fit has checked it"
        i = last_before(times, self.series_)
        flown = (times - knots[i])[:, None] * rates[i]
        flown += values[i]
        return flown
