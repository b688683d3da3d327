"""Nothing moves: the last snapshot, whatever comes."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.interpolant import Interpolant, last_before
from surrogates.series import Array


class Persistence(Interpolant):
    """x(t) = x_i, the last snapshot before t: what a prediction is worth that knows nothing of motion."""

    name: ClassVar[str] = "persistence"
    raw: ClassVar[bool] = True

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        return np.asarray(self.series_.values[last_before(times, self.series_)], dtype=np.float64)
