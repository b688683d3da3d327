"""A variable as a surrogate of its modes gives it, at times between those it was trained on."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import Basis
from suffice.compare import CONSISTENCY
from suffice.reconstruction import Case, consistent_level, projection_errors, reduce
from surrogates import SURROGATES

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
    reduced = reduce(case, energy)
    full = reduced.basis.modes.shape[1]
    n = max(consistent_level(reduced, case, CONSISTENCY), reduced.basis.n_lr or full)
    name = "spline" if reduced.rates is None else "hermite"
    rates = None if reduced.rates is None else reduced.rates[:, :n]
    surrogate = SURROGATES[name]().fit(case.times[case.training], reduced.coefficients[case.training, :n], rates)
    # modes are orthonormal: what projection leaves and what the coefficients miss add up
    miss = surrogate.predict(case.times[case.unseen]) - reduced.coefficients[case.unseen, :n]
    squares = projection_errors(reduced, case, n) ** 2 + np.square(miss).sum(axis=1) / len(reduced.basis.mean)
    return Modelled(name, reduced.basis, surrogate.predict(times), float(np.sqrt(squares).mean()))
