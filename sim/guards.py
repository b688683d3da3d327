"""Guards: how near a run has come to each limit that would stop it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

STATE = "guards."  # before a guard's name, in the state of a run


class Nearest(NamedTuple):
    """The largest value that a guard has seen, its limit in the same unit, and the time (s) of that look."""

    value: float
    limit: float
    time: float


class Guards(dict[str, Nearest]):
    """What each guard has seen at worst, by its name: `overlap` in radii, `speed` in m/s, `courant` in cells a step.

    The fluid's `momentum` and `continuity` are what its solvers left, in multiples of their tolerances.
    """

    def note_(self, name: str, value: float, limit: float, time: float) -> None:
        """Remember a value that exceeds all before it; what is not a number exceeds them, too."""
        if name not in self or not value <= self[name].value:
            self[name] = Nearest(float(value), float(limit), float(time))

    def state(self) -> dict[str, NDArray[Any]]:
        """Return it as named arrays."""
        return {f"{STATE}{name}": np.array(found) for name, found in self.items()}

    def restore_(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from what `state` returned, which may stand among other arrays."""
        self.clear()
        for name, found in state.items():
            if name.startswith(STATE):
                self[name.removeprefix(STATE)] = Nearest(*found.tolist())


def in_tolerances(error: float, tolerance: float) -> float:
    """Return how many times its tolerance an error is; no error is 0, whatever the tolerance."""
    if error == 0.0:
        return 0.0
    return error / tolerance if tolerance > 0.0 else float("inf")
