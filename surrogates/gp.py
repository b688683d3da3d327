"""Gaussian process in time: interpolation that knows how uncertain it is."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surrogates.errors import InputError
from surrogates.interpolant import Interpolant
from surrogates.kalman import Filtered, Weights, kalman_filter, smoother, weights_between
from surrogates.matern import Matern
from surrogates.series import Array, Series, checked_times
from surrogates.surrogate import saved_numbers

LENGTHS = tuple(2 ** (k / 2) for k in range(-2, 17))  # ℓ tried, in Δτ: beyond 256 Δτ a series is a polynomial
NOISES = (0.0, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1)  # of a mode's variance
LIKELY_ON = 1000  # snapshots, from the middle of the series, that the likelihood is taken over


class Gp(Interpolant):
    """c_k(t) = c̄_k + a process of Matérn kernel 5/2 with one length ℓ for all modes, conditioned on the snapshots.

    Twice differentiable, through every snapshot where `noise` is zero, and back to the mean of the series some ℓ
    outside it. Filter and smoother take it in O(snapshots). ℓ is the most likely of a scale of factors √2, in a
    likelihood with one variance for all modes, so that the reconstructed field counts and not each small mode alike.
    Give `length` (Δτ) or `noise` (variance of white noise over that of the mode) to choose yourself; noise None lets
    the likelihood choose it, and then the snapshots are smoothed.

    `deviation` has each mode's own most likely variance, σ_k² = Σ v²/S / snapshots.
    """

    name: ClassVar[str] = "gp"

    length_: float  # ℓ in Δτ
    noise_: float
    likelihood_: dict[tuple[float, float], float]  # logarithm by (ℓ, noise), per number; empty in a loaded model

    def __init__(self, length: float | None = None, noise: float | None = 0.0) -> None:
        if length is not None and not (np.isfinite(length) and length > 0):
            raise InputError(f"length is {length:g} intervals; use a positive number, 2 to 20 are usual")
        if noise is not None and not 0 <= noise < np.inf:
            raise InputError(f"noise is {noise:g} of a mode's variance; use 0 or a positive number, 1e-4 is usual")
        self.length, self.noise = length, noise

    def _fit(self, series: Series) -> None:
        super()._fit(series)
        tau, values = series.scaled(series.times), np.asarray(series.values, dtype=np.float64)
        first = max(0, (len(tau) - LIKELY_ON) // 2)
        some = slice(first, first + LIKELY_ON)
        scale = float(np.abs(values - values.mean(axis=0)).max()) or 1.0
        fluctuation = (values[some] - values.mean(axis=0)) / scale
        self.likelihood_ = {
            (length, noise): _likelihood(kalman_filter(Matern(length), tau[some], fluctuation, noise))
            for length in (LENGTHS if self.length is None else (self.length,))
            for noise in (NOISES if self.noise is None else (self.noise,))
        }
        self._condition(*max(self.likelihood_, key=lambda choice: self.likelihood_[choice]))

    def _condition(self, length: float, noise: float) -> None:
        self.length_, self.noise_, self.kernel_ = length, noise, Matern(length)
        values = np.ascontiguousarray(self.series_.values, dtype=np.float64)  # sums depend on the order
        self.tau_, self.mean_ = self.series_.scaled(self.series_.times), values.mean(axis=0)
        filtered = kalman_filter(self.kernel_, self.tau_, values - self.mean_, noise)
        self.filtered_ = filtered.track
        self.smoothed_ = smoother(self.kernel_, self.tau_, filtered.track)
        self.scale_ = np.sqrt(np.mean(filtered.surprises**2 / filtered.variances[:, None], axis=0))  # (modes,) σ_k

    def deviation(self, times: ArrayLike, *, beyond: bool = False) -> NDArray[np.float64]:
        """Give the standard deviation (times, modes) of the values at `times` (any,) s, noise not counted.

        Raises InputError as `predict` does.
        """
        if not hasattr(self, "window_"):
            raise InputError("gp has not been fitted; call fit(times, values) before deviation")
        asked = checked_times(times)
        if not beyond:
            self._refuse_outside(asked)
        return np.asarray(np.sqrt(self._weights(asked).variance)[:, None] * self.scale_)

    def _weights(self, times: NDArray[np.float64]) -> Weights:
        return weights_between(self.kernel_, self.tau_, self.series_.scaled(times), self.filtered_, self.smoothed_)

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        before, of_before, after, of_after, _ = self._weights(times)
        predicted = np.tile(self.mean_, (len(times), 1))
        for k in range(3):
            predicted += of_before[:, k, None] * self.filtered_.means[before, k]
            predicted += of_after[:, k, None] * self.smoothed_.means[after, k]
        return predicted

    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {**super()._arrays(), "kernel": np.array([self.length_, self.noise_])}

    def _restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        super()._fit(self._stored(state))  # as an interpolant: the kernel is known, and need not be sought again
        length, noise = saved_numbers(state, "kernel", 2)
        self.likelihood_ = {}
        self._condition(length, noise)


def _likelihood(filtered: Filtered) -> float:
    """Logarithm of the likelihood per number, at the most likely variance σ² of all columns together.

    log p = -½ (log σ² + mean of log S) + const, σ² = mean of v²/S.
    """
    variance = float(np.mean(filtered.surprises**2 / filtered.variances[:, None]))
    return -0.5 * (float(np.log(variance)) + float(np.log(filtered.variances).mean())) if variance > 0 else 0.0
