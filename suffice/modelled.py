"""A variable as a surrogate of its modes gives it, at times between those it was trained on."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import Basis
from suffice.bridge import bridge_of
from suffice.reconstruction import Case

Array = NDArray[np.float64]


class Modelled(NamedTuple):
    """What a surrogate trained every Δτ says of a variable at some times, as coefficients of modes."""

    surrogate: str
    basis: Basis
    coefficients: Array  # (times, n)
    rmse: float  # unit of the variable, over all rows, mean over all unseen times of the window

    @property
    def modes(self) -> int:
        """Number of modes used."""
        return int(self.coefficients.shape[1])

    def at(self, rows: NDArray[np.intp]) -> Array:
        """Return some rows of W̄ + Σ c φ (paper eq. (29)) at those times, (times, rows)."""
        return np.asarray(self.basis.mean[rows] + self.coefficients @ self.basis.modes[rows, : self.modes].T)


def modelled(case: Case, energy: float, times: Array) -> Modelled:
    """Train on the snapshots kept and predict at some times (s) of the window.

    Hermite's cubic, a spline where the case has no rates, on n_c modes but no fewer than n_lr; energy: the Lanczos
    ratio that defines n_lr (paper eq. (28)). Raises pod.InputError where nothing moves or a value is not finite.
    """
    bridge = bridge_of(case, energy)
    return Modelled(bridge.surrogate.name, bridge.reduced.basis, bridge.surrogate.predict(times), bridge.rmse())
