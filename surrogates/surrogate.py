"""A surrogate: anything that fits a series in time and predicts it at other times."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping
from time import perf_counter
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surrogates.errors import InputError
from surrogates.series import Array, Series, checked_series, checked_times

Kind = Literal["time", "state"]

EDGE = 1e-6  # of an interval: how far a time may lie outside the window by rounding alone


class Surrogate(ABC):
    """Contract of all regressors f in c(t_n) = f(...) (paper eq. (30)).

    Hyperparameters enter at construction, data in `fit`, fitted attributes end in `_`. A member of kind `time`
    interpolates c(t); one of kind `state` maps c(t_{n-1}) to c(t_n) and is rolled out from `start`. A raw member is the
    same regressor on the identity basis: it takes the snapshots themselves, keeps them without a copy (do not change
    them afterwards), and costs what they cost.
    """

    name: ClassVar[str]
    kind: ClassVar[Kind]
    needs_rates: ClassVar[bool] = False
    uses_rates: ClassVar[bool] = False  # needs none, but learns from them where they are given
    bridges: ClassVar[bool] = True  # answers between the snapshots; a mere state map only steps from the last ones
    takes_parameters: ClassVar[bool] = False
    raw: ClassVar[bool] = False
    columnwise: ClassVar[bool] = False  # fits every column by itself: fewer modes are the same curves, fewer of them
    differentiable: ClassVar[bool] = False  # has a derivative in closed form

    window_: tuple[float, float]  # s, first and last training time
    interval_: float  # s, mean training interval Δτ
    fit_seconds_: float  # wall time of `fit`; NaN in a loaded model, whose card has it

    def __repr__(self) -> str:
        settings = ", ".join(f"{name}={value!r}" for name, value in self.settings().items())
        fitted = "not fitted"
        if hasattr(self, "window_"):
            fitted = f"fitted from {self.window_[0]:.6g} to {self.window_[1]:.6g} s, every {self.interval_:.6g} s"
        return f"{type(self).__name__}({settings}), {fitted}"

    def fit(
        self,
        times: ArrayLike,
        values: ArrayLike,
        rates: ArrayLike | None = None,
        parameters: ArrayLike | None = None,
    ) -> Self:
        """Learn `values` (snapshots, modes) given at `times` (snapshots,) s; returns itself.

        `rates` (snapshots, modes) are d(values)/dt: of coefficients, the velocity snapshots projected on the modes
        without subtracting a mean; a member that neither needs nor uses them ignores them. `parameters` (snapshots,
        parameters) is the operating condition.

        Raises InputError: see `checked_series`; rates missing; parameters given to a member that takes none.
        """
        if self.needs_rates and rates is None:
            raise InputError(f"rates is missing; {self.name} needs d(values)/dt of every snapshot, save velocities too")
        self._refuse_unused(parameters=parameters)
        given = rates if self.needs_rates or self.uses_rates else None
        series = checked_series(times, values, given, parameters, copy=not self.raw)
        begin = perf_counter()
        self._fit(series)
        self.fit_seconds_ = perf_counter() - begin
        self.window_, self.interval_ = (float(series.times[0]), float(series.times[-1])), series.interval
        return self

    def predict(
        self,
        times: ArrayLike,
        start: ArrayLike | None = None,
        parameters: ArrayLike | None = None,
        *,
        beyond: bool = False,
    ) -> NDArray[np.float64]:
        """Values (times, modes) at `times` (any count and order,) s.

        `start` is the state a state map is rolled out from, see `StateMap`; a regressor in time refuses it. Times
        outside `window_` are refused unless `beyond`: there nothing was measured, and a regressor in time merely
        continues its last expression.

        Raises InputError: not fitted; a time that is not finite or outside the window; start or parameters unused.
        """
        if not hasattr(self, "window_"):
            raise InputError(f"{self.name} has not been fitted; call fit(times, values) before predict")
        self._refuse_unused(parameters=parameters, start=start)
        asked = checked_times(times)
        if not beyond:
            self._refuse_outside(asked)
        return self._predict(asked, _optional(start), _optional(parameters))

    def derivative(self, times: ArrayLike, *, beyond: bool = False) -> NDArray[np.float64]:
        """d(values)/dt (times, modes) at `times` (any count and order,) s; of positions, the velocity.

        Raises InputError: not differentiable; otherwise as `predict` does.
        """
        if not self.differentiable:
            raise InputError(f"{self.name} has no derivative in closed form; use hermite or spline")
        if not hasattr(self, "window_"):
            raise InputError(f"{self.name} has not been fitted; call fit(times, values) before derivative")
        asked = checked_times(times)
        if not beyond:
            self._refuse_outside(asked)
        return self._derivative(asked)

    def settings(self) -> dict[str, Any]:
        """Hyperparameters by name, as given at construction."""
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything `fit` learnt, as contiguous arrays ready for safetensors; `from_state` reads it back."""
        return {name: np.ascontiguousarray(array) for name, array in self.arrays().items()}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]], settings: Mapping[str, Any] | None = None) -> Self:
        """Fitted surrogate from what `state` and `settings` gave: its predictions are bitwise the same.

        Raises InputError: an array is missing or fails the checks of `fit`.
        """
        surrogate = cls(**(settings or {}))
        try:
            surrogate._restore(state)
            first, last = saved_numbers(state, "window", 2)
            (interval,) = saved_numbers(state, "interval", 1)
        except KeyError as missing:
            raise InputError(f"the model lacks array {missing}; it is not a {cls.name} model, save it again") from None
        surrogate.window_, surrogate.interval_, surrogate.fit_seconds_ = (first, last), interval, float("nan")
        return surrogate

    def arrays(self) -> dict[str, NDArray[Any]]:
        """As `state`, but views where possible: for counting bytes."""
        return {"window": np.array(self.window_), "interval": np.array([self.interval_]), **self._arrays()}

    @abstractmethod
    def _fit(self, series: Series) -> None: ...

    @abstractmethod
    def _predict(
        self, times: NDArray[np.float64], start: Array | None, parameters: Array | None
    ) -> NDArray[np.float64]: ...

    def _derivative(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        raise NotImplementedError

    @abstractmethod
    def _arrays(self) -> dict[str, NDArray[Any]]: ...

    @abstractmethod
    def _restore(self, state: Mapping[str, NDArray[Any]]) -> None: ...

    def _refuse_unused(self, parameters: ArrayLike | None, start: ArrayLike | None = None) -> None:
        if parameters is not None and not self.takes_parameters:
            raise InputError(f"parameters given, but {self.name} knows no operating condition; leave them out")
        if start is not None and self.kind == "time":
            raise InputError(f"start given, but {self.name} is a regressor in time, not a state map; leave it out")

    def _refuse_outside(self, times: NDArray[np.float64]) -> None:
        first, last = self.window_
        slack = EDGE * self.interval_
        outside = (times < first - slack) | (times > last + slack)
        if outside.any():
            raise InputError(
                f"time {times[outside.argmax()]:.9g} s lies outside the fitted window {first:.9g} to {last:.9g} s; "
                "stay inside, or ask for extrapolation with beyond"
            )


def _optional(given: ArrayLike | None) -> Array | None:
    return None if given is None else np.asarray(given, dtype=np.float64)


def saved_numbers(state: Mapping[str, NDArray[Any]], name: str, count: int) -> list[float]:
    """Read `count` finite numbers from the saved array `name`. Raises InputError; KeyError if it is missing."""
    numbers = np.asarray(state[name], dtype=np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise InputError(
            f"array {name!r} of the model has to be {count} finite numbers; the file is damaged, save it again"
        )
    return [float(number) for number in numbers]


def saved_table(
    state: Mapping[str, NDArray[Any]], name: str, shape: tuple[int, ...] | None = None
) -> NDArray[np.float64]:
    """Read the saved array `name` as finite numbers of this shape, or of two dimensions if none is given.

    Raises InputError; KeyError if it is missing.
    """
    table = np.array(state[name], dtype=np.float64)
    fits = table.ndim == 2 if shape is None else table.shape == shape
    if not fits or 0 in table.shape or not np.isfinite(table).all():
        raise InputError(
            f"array {name!r} of the model has shape {table.shape} or holds what is no number; the file is damaged, "
            "save it again"
        )
    return table
