"""State maps: regressors that step from the last snapshots to the next one, and are rolled out."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.errors import InputError
from surrogates.series import Array, Series
from surrogates.surrogate import EDGE, Kind, Surrogate, saved_table

UNEVEN = 1e-3  # of Δτ: text dumps round their times, a lost snapshot shifts them by a whole interval
LOST = 1e150  # values beyond it cannot be squared: the rollout has left every scale


class StateMap(Surrogate):
    """Map c_{n+1} = f(c_n, …, c_{n-memory+1}) over one training interval Δτ, rolled out (paper eq. (30)).

    Without `start`, times inside the window are rolled out from its first `memory_` snapshots and times beyond it from
    its last ones: the prediction may jump at the end of the window by what the rollout has lost until then. With
    `start`, (memory_, modes) or for one state (modes,), its last state stands at the end of the window, and only times
    from there on are answered: a horizon h is asked as `window_[1] + h`. A state map runs forwards only.

    Between its own steps a time is answered by the cubic through the four nearest of them, known snapshots included:
    fourth order in Δτ, and the answer depends on no other time asked.

    Nothing is clipped, and nothing is invented: where a rollout leaves the finite numbers (above 1e150, where squares
    overflow), times before that are answered as usual and times after it refused.
    """

    kind: ClassVar[Kind] = "state"
    bridges: ClassVar[bool] = False

    memory: int = 1  # most past snapshots that one step reads

    memory_: int  # those it reads: fewer where the series is shorter
    first_: NDArray[np.float64]  # (memory_, modes) the snapshots that the window begins with
    last_: NDArray[np.float64]  # (memory_, modes) those it ends with

    @abstractmethod
    def _learn(self, series: Series) -> None:
        """Learn the step from evenly spaced snapshots; `memory_` is set, and may be lowered."""

    @abstractmethod
    def _step(self, history: NDArray[np.float64]) -> NDArray[np.float64]:
        """State (modes,) that follows `history` (memory_, modes), oldest first."""

    @abstractmethod
    def _learnt(self) -> dict[str, NDArray[Any]]:
        """Arrays that `_learn` made."""

    @abstractmethod
    def _recall(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Read back what `_learnt` gave."""

    def _fit(self, series: Series) -> None:
        _refuse_uneven(series)
        self.memory_ = min(self.memory, len(series.times) - 1)
        self._learn(series)
        values = np.asarray(series.values, dtype=np.float64)
        self.first_, self.last_ = values[: self.memory_].copy(), values[-self.memory_ :].copy()

    def _predict(
        self, times: NDArray[np.float64], start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        first, last = self.window_
        if start is not None:
            self._refuse_before(times, last, "the start stands")
            return self._rolled_out(self._checked_start(start), times, last)
        self._refuse_before(times, first, "the window begins")
        inside = times <= last + EDGE * self.interval_
        predicted = np.empty((len(times), self.first_.shape[1]))
        predicted[inside] = self._rolled_out(self.first_, times[inside], first + (self.memory_ - 1) * self.interval_)
        predicted[~inside] = self._rolled_out(self.last_, times[~inside], last)
        return predicted

    def _rolled_out(self, history: NDArray[np.float64], times: NDArray[np.float64], now: float) -> NDArray[np.float64]:
        """Values (times, modes) of the rollout from `history`, whose last state stands at `now` in s."""
        if not len(times):
            return np.empty((0, history.shape[1]))
        place = np.maximum((times - now) / self.interval_ + self.memory_ - 1, 0.0)
        path = self._rollout(history, max(int(place.max()) + 3, 4))  # two steps past the interval, for the cubic
        lost = place > len(path) - 1 + EDGE
        if lost.any():
            reached = now + (len(path) - self.memory_) * self.interval_
            raise InputError(
                f"time {times[lost.argmax()]:.9g} s: the rollout of {self.name} grows without bound and ends at "
                f"{reached:.9g} s, {(reached - now):.3g} s after its start; ask for a shorter horizon, or fit with "
                "more snapshots or fewer modes"
            )
        return cubic_between(path, place)

    def _rollout(self, history: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        """`history` and the states after it, (count, modes), or fewer if the next one is lost."""
        m = self.memory_
        path = np.empty((max(count, m), history.shape[1]))
        path[:m] = history
        with np.errstate(all="ignore"):  # what overflows is found by its size
            for k in range(m, len(path)):
                path[k] = self._step(path[k - m : k])
                if not np.abs(path[k]).max() < LOST:
                    return path[:k]
        return path

    def _refuse_before(self, times: NDArray[np.float64], begin: float, what: str) -> None:
        early = times < begin - EDGE * self.interval_
        if early.any():
            raise InputError(
                f"time {times[early.argmax()]:.9g} s lies before {begin:.9g} s, where {what}; {self.name} is a state "
                "map and runs forwards only, ask for later times"
            )

    def _checked_start(self, start: Array) -> NDArray[np.float64]:
        shape = self.first_.shape
        given = np.atleast_2d(start) if shape[0] == 1 else start
        if given.shape != shape:
            raise InputError(
                f"start has shape {start.shape}; {self.name} reads the last {shape[0]} snapshots of {shape[1]} modes, "
                f"give them oldest first, shape {shape}"
            )
        if not np.isfinite(given).all():
            raise InputError(f"start holds a value that is not finite; give {self.name} the coefficients of snapshots")
        return np.asarray(given, dtype=np.float64)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {"first": self.first_, "last": self.last_, **self._learnt()}

    def _restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        self.first_ = saved_table(state, "first")
        self.last_ = saved_table(state, "last", self.first_.shape)
        self.memory_ = len(self.first_)
        self._recall(state)


def cubic_between(path: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (any, modes) at `place` (any,), counted in rows of `path` (rows, modes), by Lagrange's cubic.

    c = Σ_j c_j Π_{k≠j} (s - k)/(j - k) over the four rows around each place, fewer if there are no four; on a row it
    is that row.
    """
    width = min(4, len(path))
    begin = np.clip(place.astype(np.intp) - 1, 0, len(path) - width)
    s, nodes = place - begin, np.arange(width)
    between = np.zeros((len(place), path.shape[1]))
    for j in nodes:
        others = nodes[nodes != j]
        weight = np.prod((s[:, None] - others) / (j - others), axis=1)
        between += weight[:, None] * path[begin + j]
    return between


def _refuse_uneven(series: Series) -> None:
    tau = series.scaled(series.times)
    late = np.abs(tau - np.arange(len(tau)))
    if late.max() > UNEVEN:
        k = int(late.argmax())
        raise InputError(
            f"times[{k}] = {series.times[k]:.9g} s lies {late[k]:.2g} intervals of {series.interval:.9g} s off an even "
            "spacing; a state map steps evenly, keep evenly spaced snapshots or use a regressor in time such as spline"
        )
