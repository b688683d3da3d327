"""The Matérn kernel of order 5/2 as a linear system driven by white noise."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import factorial, gammainc

Array = NDArray[np.float64]

REVERSED = np.array([1.0, -1.0, 1.0])  # what running backwards does to f, f' and f''


class Matern(NamedTuple):
    """k(t) = (1 + x + x²/3) e^{-x}, x = √5 |t|/ℓ, of unit variance: the covariance of f where (d/dt + λ)³ f = white.

    State (f, f', f''), λ = √5/ℓ. Exact at any spacing of times (Hartikainen and Särkkä 2010,
    doi 10.1109/MLSP.2010.5589113).
    """

    length: float  # ℓ, unit of the times

    @property
    def rate(self) -> float:
        """λ = √5/ℓ."""
        return float(np.sqrt(5) / self.length)

    def stationary(self) -> Array:
        """Covariance (3, 3) of the state where nothing has been measured."""
        a = self.rate
        return np.array([[1, 0, -(a**2) / 3], [0, a**2 / 3, 0], [-(a**2) / 3, 0, a**4]])

    def transition(self, gaps: Array) -> Array:
        """e^{F h}, (any, 3, 3), of the mean over gaps h ≥ 0 (any,)."""
        a, h = self.rate, gaps
        rows = [
            [1 + a * h + (a * h) ** 2 / 2, h + a * h**2, h**2 / 2],
            [-(a**3) * h**2 / 2, 1 + a * h - (a * h) ** 2, h - a * h**2 / 2],
            [a**4 * h**2 / 2 - a**3 * h, a**3 * h**2 - 3 * a**2 * h, 1 - 2 * a * h + (a * h) ** 2 / 2],
        ]
        return np.moveaxis(np.array(rows) * np.exp(-a * h), 2, 0)

    def added(self, gaps: Array) -> Array:
        """Covariance (any, 3, 3) that the noise adds over gaps h: q ∫₀ʰ g gᵀ ds, q = 16 λ⁵/3, g = e^{Fs} (0, 0, 1)ᵀ.

        By incomplete gamma functions: the difference of the stationary covariances loses all digits at h ≪ ℓ.
        """
        a, k = self.rate, np.arange(5)
        moments = gammainc(k + 1, 2 * a * gaps[:, None]) * factorial(k) / (2 * a) ** (k + 1)
        impulse = ([0, 0, 0.5], [0, 1, -a / 2], [1, -2 * a, a**2 / 2])  # e^{λs} g, powers of s
        products = np.array([[np.convolve(one, other) for other in impulse] for one in impulse])
        return np.asarray(16 / 3 * a**5 * np.einsum("ijk,hk->hij", products, moments))
