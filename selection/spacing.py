"""Which snapshots of a run must be kept, so that interpolation between them stays within a tolerance."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LONGEST = 32  # moments from one kept to the next: so many are held, and tried at every further one
CALM = 8  # moments since the kept one at which half as many would still show the error


class Moment(NamedTuple):
    """Particles at one time."""

    time: float  # s
    position: Array  # (n, 3) m
    velocity: Array  # (n, 3) m/s


def hermite_weights(start: float, end: float, times: Array) -> Array:
    """Return weights (k, 4) of x₀, v₀, x₁, v₁ in the cubic that has these values and slopes at both ends.

    x(θ) = (1+2θ)(1-θ)² x₀ + θ(1-θ)² h v₀ + θ²(3-2θ) x₁ - θ²(1-θ) h v₁, θ = (t - start)/h. times: (k,) s.
    """
    h = end - start
    s = (times - start) / h
    rest = 1.0 - s
    return np.stack([(1 + 2 * s) * rest**2, h * s * rest**2, s**2 * (3 - 2 * s), -h * s**2 * rest], axis=1)


def hermite_errors(first: Moment, last: Moment, times: Array, position: Array) -> Array:
    """Return the RMSE (k,) m over the rows of the interpolant at times (k,) s, from known positions (k, n, 3) m."""
    ends = np.stack([first.position, first.velocity, last.position, last.velocity]).reshape(4, -1)
    miss = hermite_weights(first.time, last.time, times) @ ends
    miss -= position.reshape(len(times), -1)
    return np.asarray(np.sqrt(np.einsum("kr,kr->k", miss, miss) / miss.shape[1]))


class Spacing:
    """Decide, walking in time, which moments are kept and how often the run must be looked at.

    The next kept moment is the last one up to which the cubic Hermite interpolant through kept positions and
    velocities has an RMSE over the rows (n, 3) of at most `tolerance` (m) at every moment seen in between. Where two
    moments in a row must be kept, nothing was seen between them: that gap is `unchecked`, and the run is looked at
    twice as often from there on, up to 2^finest times; half as often again where it is calm.
    """

    def __init__(self, tolerance: float, finest: int) -> None:
        self.tolerance, self.finest = tolerance, finest
        self.level = self.unchecked = 0  # halvings of the interval; gaps that nothing was seen in
        self.kept: Moment | None = None
        self.last: Moment | None = None  # the candidate: kept unless a later one will do
        self.times: list[float] = []  # s, of what was seen since the kept moment
        self.positions = np.empty((LONGEST, 0, 3))  # m, at these times

    def see(self, now: Moment) -> bool:
        """Take the next moment; return whether the one before it is kept. The first one is kept by itself."""
        if self.kept is None:
            self.kept, self.positions = now, np.empty((LONGEST, *now.position.shape))
            return False
        must = self.last is not None and not self._reaches(self.kept, now)
        if must:
            self._keep_last()
        self.positions[len(self.times)] = now.position
        self.times.append(now.time)
        self.last = now
        if not must and len(self.times) > 1 and (len(self.times) - 1) % CALM == 0:
            self.level = max(self.level - 1, 0)
        return must

    def _reaches(self, kept: Moment, now: Moment) -> bool:
        """Tell whether interpolation from the kept moment to this one is good enough at all those in between."""
        k = len(self.times)
        if k == LONGEST:
            return False
        return bool(hermite_errors(kept, now, np.array(self.times), self.positions[:k]).max() <= self.tolerance)

    def _keep_last(self) -> None:
        if len(self.times) == 1:
            self.unchecked += 1
            self.level = min(self.level + 1, self.finest)
        self.kept, self.times = self.last, []

    def next_stop(self, now: int) -> int:
        """Return where to look next, in 2^finest-ths of an interval, after `now` of them."""
        step = 1 << (self.finest - self.level)
        return (now // step + 1) * step

    def state(self) -> dict[str, NDArray[np.float64]]:
        """Return all that it needs to go on, as named arrays."""
        found = {"counts": np.array([self.level, self.unchecked], np.float64)}
        for name, moment in (("kept", self.kept), ("last", self.last)):
            if moment is not None:
                found |= {f"{name}.{field}": np.asarray(rows) for field, rows in moment._asdict().items()}
        found["times"], found["positions"] = np.array(self.times), self.positions[: len(self.times)].copy()
        return found

    def restore_(self, state: Mapping[str, NDArray[np.float64]]) -> None:
        """Go on from what `state` returned. Raises KeyError where it is of something else."""
        self.level, self.unchecked = (int(count) for count in state["counts"])
        self.kept, self.last = (
            Moment(float(state[f"{name}.time"]), state[f"{name}.position"], state[f"{name}.velocity"])
            if f"{name}.time" in state
            else None
            for name in ("kept", "last")
        )
        self.times, seen = [float(time) for time in state["times"]], state["positions"]
        self.positions = np.empty((LONGEST, *(seen.shape[1:] if self.kept is None else self.kept.position.shape)))
        self.positions[: len(seen)] = seen


def kept_of(times: Array, position: Array, velocity: Array, tolerance: float) -> NDArray[np.intp]:
    """Return which snapshots of a whole run are kept, its first and last included, where it can be looked at no finer.

    times: (N_t,) s; position, velocity: (N_t, n, 3) m and m/s; tolerance: m, RMSE over the rows.
    """
    spacing, kept = Spacing(tolerance, 0), [0]
    for k, time in enumerate(times):
        if spacing.see(Moment(float(time), position[k], velocity[k])):
            kept.append(k - 1)
    return np.array([*kept, len(times) - 1] if len(times) > 1 else kept)
