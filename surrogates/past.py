"""The past as a point: the last state and its differences, each kind in its own unit."""

from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PARTS = 5  # stretches of the series that a choice is tested on, each left out in turn


class Past(NamedTuple):
    """z_i = (c_i - c̄, ∇c_i, ∇²c_i, …) of the last `memory` states, ∇c_i = c_i - c_{i-1}, divided by their RMS.

    The same knowledge as the states themselves, but a state and its rate of change count alike, however short Δτ is.
    """

    centre: Array  # (modes,) c̄
    units: Array  # (memory,) RMS of the differences of each order; 1 where there are none

    @classmethod
    def of(cls, values: Array, memory: int) -> Self:
        """Centre and units of a series (snapshots, modes)."""
        centre = values.mean(axis=0)
        rms = np.array([np.sqrt(np.mean(np.diff(values - centre, k, axis=0) ** 2)) for k in range(memory)])
        return cls(centre, np.where(rms > 0, rms, 1.0))

    @property
    def memory(self) -> int:
        """Past states that a point is made of."""
        return len(self.units)

    def points(self, values: Array) -> Array:
        """Points (snapshots - memory + 1, memory · modes) of a series (snapshots, modes): each state and its past."""
        lost = self.memory - 1
        orders = [np.diff(values - self.centre, k, axis=0)[lost - k :] / unit for k, unit in enumerate(self.units)]
        return np.hstack(orders)

    def point_of_delays(self) -> Array:
        """Matrix (memory, memory) from states, newest first and about the centre, to orders: ∇ᵏ in units."""
        rows = [np.eye(self.memory)[0]]
        for _ in range(self.memory - 1):
            rows.append(rows[-1] - np.roll(rows[-1], 1))
        return np.array(rows) / self.units[:, None]


def parts(count: int) -> list[slice]:
    """Contiguous parts of a series of this length: single snapshots hide between neighbours nearly equal to them."""
    edges = np.linspace(0, count, min(PARTS, count) + 1).astype(int).tolist()
    return [slice(first, last) for first, last in pairwise(edges)]
