"""Snapshots far from the origin whose singular values about their mean are known."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
OFFSET = 4.0  # rms of the mean position over rms of the motion


class KnownSnapshots(NamedTuple):
    """W = W̄ 1ᵀ + U diag(s) Vᵀ by blocks of rows; U and V are cosines, so V is orthogonal to ones."""

    rows: int
    snapshots: int
    sigma: Array  # (k,) descending, k at most snapshots - 1

    def mean(self) -> Array:
        """Mean of the snapshots, (rows,)."""
        motion = np.linalg.norm(self.sigma) / np.sqrt(self.rows * self.snapshots)
        return OFFSET * motion * np.random.default_rng(0).standard_normal(self.rows)

    def blocks(self, height: int = 8192):
        """First row and values (height, snapshots) of every block, in double precision."""
        mean = self.mean()
        weighted = self.sigma[:, None] * cosines(self.snapshots, len(self.sigma), range(self.snapshots)).T
        for low in range(0, self.rows, height):
            some = range(low, min(low + height, self.rows))
            yield low, cosines(self.rows, len(self.sigma), some) @ weighted + mean[low : some.stop, None]

    def filled(self, dtype: str) -> NDArray:
        """All of W in memory, (rows, snapshots)."""
        W = np.empty((self.rows, self.snapshots), dtype)
        for low, block in self.blocks():
            W[low : low + len(block)] = block
        return W


def cosines(n: int, count: int, some: range) -> Array:
    """Return some rows of `count` orthonormal vectors of length n, √(2/n) cos(π (i + ½) k / n) from k = 1."""
    # reduced in integers, or rounding of the angle shows in the products
    turn = np.outer(2 * np.arange(some.start, some.stop) + 1, np.arange(1, count + 1)) % (4 * n)
    return np.sqrt(2.0 / n) * np.cos(turn * (np.pi / (2 * n)))


def granular(count: int, modes: int) -> Array:
    """Singular values that fall as those of granular flow do: three decades over the modes wanted, then a noisy tail.

    s_k = k^(-3/4) (e^(-(k - 1) / b) + 1e-4), b such that s_modes is 1e-3 of s_1 but for the noise.
    """
    k = np.arange(1.0, count + 1)
    b = (modes - 1) / (3 * np.log(10) - 0.75 * np.log(modes))
    return k**-0.75 * (np.exp(-(k - 1) / b) + 1e-4)


def steep(count: int) -> Array:
    """Singular values that fall by a decade in 20, s_k = 10^(-(k - 1) / 20)."""
    return 10.0 ** (-np.arange(count) / 20)
