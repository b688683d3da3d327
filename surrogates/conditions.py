"""Regressors over operating conditions: from a few speeds to one nobody ran, with or without a phase."""

from abc import ABC, abstractmethod
from time import perf_counter
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surrogates.errors import InputError

Array = NDArray[np.float64]

EDGE = 1e-9  # of the range: how far a condition may lie outside by rounding
ROUND = 1e-6  # of the radius: how far cosine and sine may lie off their circle


class Samples(NamedTuple):
    """What was measured at which condition: rows are samples."""

    conditions: Array  # (samples, d) operating conditions scaled to 0 … 1; with a phase, its cosine and sine come last
    values: Array  # (samples, modes)


class ConditionSurrogate(ABC):
    """Contract of all regressors over conditions: `fit(conditions, values)`, `predict(conditions)`.

    With `phase` the last two columns of the conditions are cosine and sine of a phase; the columns before it, one or
    more, are the operating condition, any unit. With `logarithmic` their logarithms count: speeds of equal ratio are
    equally far apart there, as they are for a flow that Froude and Reynolds numbers govern.
    Hyperparameters enter at construction, fitted attributes end in `_`.
    """

    name: ClassVar[str]
    random: ClassVar[bool] = False  # whether the seed matters

    lowest_: Array  # (operating,) of the fitted conditions
    highest_: Array
    fit_seconds_: float  # wall time of `fit`

    def __init__(self, *, phase: bool = False, logarithmic: bool = False, seed: int = 0) -> None:
        self.phase, self.logarithmic, self.seed = phase, logarithmic, seed

    def __repr__(self) -> str:
        fitted = "not fitted"
        if hasattr(self, "lowest_"):
            fitted = f"fitted from {self.lowest_.tolist()} to {self.highest_.tolist()}"
        return f"{type(self).__name__}(phase={self.phase}, logarithmic={self.logarithmic}, seed={self.seed}), {fitted}"

    def fit(self, conditions: ArrayLike, values: ArrayLike) -> Self:
        """Learn `values` (samples, modes) at `conditions` (samples, d), at two operating conditions or more.

        Raises InputError: shapes that do not fit, NaN, one operating condition alone, a sample given twice, a phase off
        its circle, with `logarithmic` one that is not positive.
        """
        x, y = _table("conditions", conditions), _table("values", values)
        self._check_columns(x)
        if len(x) != len(y):
            raise InputError(f"values has {len(y)} rows, conditions {len(x)}; give one row of each per sample")
        if len(np.unique(x, axis=0)) < len(x):
            raise InputError("conditions: a sample stands there twice; average samples of the same condition first")
        operating = x[:, : self._operating(x)]
        lowest, highest = operating.min(axis=0), operating.max(axis=0)
        if not (highest > lowest).all():
            column = int((highest <= lowest).argmax())
            raise InputError(
                f"conditions[:, {column}] is {lowest[column]:g} everywhere; nothing can be learnt of it, leave it out"
            )
        self.lowest_, self.highest_, self.columns_ = lowest, highest, x.shape[1]
        began = perf_counter()
        self._fit(Samples(self._scaled(x), y))
        self.fit_seconds_ = perf_counter() - began
        return self

    def predict(self, conditions: ArrayLike, *, beyond: bool = False) -> Array:
        """Values (samples, modes) at `conditions` (samples, d); outside the fitted range only with `beyond`.

        Raises InputError: not fitted, shapes that do not fit, NaN, a condition outside.
        """
        if not hasattr(self, "fit_seconds_"):
            raise InputError(f"{self.name} has not been fitted; call fit(conditions, values) before predict")
        x = _table("conditions", conditions)
        self._check_columns(x)
        if x.shape[1] != self.columns_:
            raise InputError(f"conditions has {x.shape[1]} columns, {self.columns_} were fitted; give the same ones")
        if not beyond:
            self._refuse_outside(x)
        return self._predict(self._scaled(x))

    @abstractmethod
    def _fit(self, samples: Samples) -> None: ...

    @abstractmethod
    def _predict(self, conditions: Array) -> Array: ...

    def _operating(self, conditions: Array) -> int:
        """How many columns are operating conditions."""
        return int(conditions.shape[1]) - 2 * self.phase

    def _scaled(self, conditions: Array) -> Array:
        """Operating conditions from 0 to 1 within the fitted range; the phase's columns as they are."""
        scaled, n = conditions.copy(), self._operating(conditions)
        parts = conditions[:, :n], self.lowest_, self.highest_
        x, low, high = (np.log(part) for part in parts) if self.logarithmic else parts
        scaled[:, :n] = (x - low) / (high - low)
        return scaled

    def _check_columns(self, conditions: Array) -> None:
        if self._operating(conditions) < 1:
            raise InputError(
                f"conditions has {conditions.shape[1]} columns; give an operating condition"
                + (" before the cosine and sine of the phase" if self.phase else "")
            )
        if self.logarithmic and (conditions[:, : self._operating(conditions)] <= 0.0).any():
            raise InputError("conditions: some are not positive and have no logarithm; leave out logarithmic")
        if self.phase and (np.abs(np.hypot(*conditions[:, -2:].T) - 1.0) > ROUND).any():
            raise InputError("conditions: the last two columns are no cosine and sine; give those of the phase")

    def _refuse_outside(self, conditions: Array) -> None:
        n = self._operating(conditions)
        slack = EDGE * (self.highest_ - self.lowest_)
        outside = (conditions[:, :n] < self.lowest_ - slack) | (conditions[:, :n] > self.highest_ + slack)
        if outside.any():
            row, column = (int(i) for i in np.argwhere(outside)[0])
            raise InputError(
                f"conditions[{row}, {column}] = {conditions[row, column]:.6g} lies outside the fitted range "
                f"{self.lowest_[column]:.6g} to {self.highest_[column]:.6g}; stay inside, or extrapolate with "
                "beyond"
            )


def groups_of(operating: Array) -> tuple[Array, NDArray[np.intp]]:
    """Operating conditions that differ, (groups, columns) in ascending order, and which one each sample has."""
    found, place = np.unique(operating, axis=0, return_inverse=True)
    return found, np.asarray(place.ravel(), np.intp)


def _table(field: str, given: ArrayLike) -> Array:
    table = np.array(given, dtype=np.float64)
    if table.ndim != 2 or 0 in table.shape:
        raise InputError(f"{field} has shape {table.shape}; give one row per sample, shape (samples, columns)")
    if not np.isfinite(table).all():
        row, column = (int(i) for i in np.argwhere(~np.isfinite(table))[0])
        raise InputError(f"{field}[{row}, {column}] is {table[row, column]}; remove or repair sample {row}")
    return table
