"""The surrogate that pictures and the player show: cubics between the snapshots kept, on all consistent modes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.intervals import candidates
from suffice.compare import CONSISTENCY
from suffice.reconstruction import Array, Case, Reduced, consistent_level, projection_errors, reduce
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.variables import held, held_velocity
from suffice.wording import seconds_text
from surrogates import SURROGATES, Surrogate

ENERGY = 0.999  # that n_lr modes hold


class Bridge(NamedTuple):
    """A vector variable between the snapshots kept every Δτ."""

    case: Case
    reduced: Reduced
    surrogate: Surrogate  # fitted to the first `modes` coefficients
    modes: int
    n_c: int

    def at(self, times: ArrayLike, rows: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Return values of rows at times (k,) s inside the window, (k, rows)."""
        basis = self.reduced.basis
        return np.asarray(basis.mean[rows] + self.surrogate.predict(times) @ basis.modes[rows, : self.modes].T)

    def rate_at(self, times: ArrayLike, rows: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Return the derivative of `at`, (k, rows); of positions, the velocity in m/s."""
        return np.asarray(self.surrogate.derivative(times) @ self.reduced.basis.modes[rows, : self.modes].T)

    def rmse(self) -> float:
        """Return the RMSE over the rows, mean over the snapshots between those kept, unit of the variable."""
        # modes are orthonormal: what projection leaves and what the coefficients miss add up
        case, n = self.case, self.modes
        miss = self.surrogate.predict(case.times[case.unseen]) - self.reduced.coefficients[case.unseen, :n]
        rows = len(self.reduced.basis.mean)
        squares = projection_errors(self.reduced, case, n) ** 2 + np.square(miss).sum(axis=1) / rows
        return float(np.sqrt(squares).mean())


def bridge_of(case: Case) -> Bridge:
    """Fit Hermite's cubic on n_c modes, but no fewer than n_lr; a spline where the case has no rates.

    Raises pod.InputError or surrogates.InputError where that cannot be done.
    """
    reduced = reduce(case, ENERGY)
    full = reduced.basis.modes.shape[1]
    n_c = consistent_level(reduced, case, CONSISTENCY)
    n = max(n_c, reduced.basis.n_lr or full)
    name = "spline" if reduced.rates is None else "hermite"
    rates = None if reduced.rates is None else reduced.rates[:, :n]
    surrogate = SURROGATES[name]().fit(case.times[case.training], reduced.coefficients[case.training, :n], rates)
    return Bridge(case, reduced, surrogate, n, n_c)


def bridges_of(run: Run, variable: str, intervals: list[float]) -> dict[float, Bridge]:
    """Return the bridges of a variable at every Δτ (s), coarse to fine.

    Raises selection.InputError for a Δτ that the run cannot be thinned to, and Refusal for one that leaves no snapshot
    to predict.
    """
    subsets = candidates(run.times, intervals)
    if len(subsets[-1].training) == len(subsets[-1].testing):
        raise Refusal(f"Δτ = {seconds_text(subsets[-1].interval)} leaves no snapshot to predict; take a coarser one")
    values, rates = held(run, variable), held_velocity(run, variable)
    return {
        subset.interval: bridge_of(
            Case(values, rates, run.times, subset.training, np.setdiff1d(subset.testing, subset.training))
        )
        for subset in subsets
    }
