"""Baselines over conditions: the nearest speed, and straight lines between two."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.conditions import Array, ConditionSurrogate, Samples, groups_of
from surrogates.errors import InputError


class Measured(ConditionSurrogate):
    """What answers with samples as they were measured: those of the phase closest to the one asked for."""

    def _fit(self, samples: Samples) -> None:
        self.samples_ = samples
        self.groups_, self.group_ = groups_of(samples.conditions[:, : self._operating(samples.conditions)])

    def _at(self, group: int, phase: Array) -> Array:
        """Values (modes,) measured at one operating condition, at the phase (its cosine and sine) closest to one."""
        rows = np.flatnonzero(self.group_ == group)
        known = self.samples_.conditions[rows][:, self.groups_.shape[1] :]
        return np.asarray(self.samples_.values[rows[int(((known - phase) ** 2).sum(axis=1).argmin())]])


class NearestCondition(Measured):
    """The values of the nearest operating condition, in parts of the fitted range; of two as near, the lower one."""

    name: ClassVar[str] = "nearest"

    def _predict(self, conditions: Array) -> Array:
        n = self.groups_.shape[1]
        nearest = ((self.groups_[None] - conditions[:, None, :n]) ** 2).sum(axis=2).argmin(axis=1)
        return np.stack([self._at(int(g), row[n:]) for g, row in zip(nearest, conditions, strict=True)])


class LinearCondition(Measured):
    """Straight line between the two operating conditions beside the one asked for; one operating condition only."""

    name: ClassVar[str] = "linear"

    def _fit(self, samples: Samples) -> None:
        super()._fit(samples)
        if self.groups_.shape[1] != 1:
            raise InputError(f"{self.name} knows one operating condition, {self.groups_.shape[1]} given; use rbf")

    def _predict(self, conditions: Array) -> Array:
        known = self.groups_[:, 0]
        below: NDArray[np.intp] = np.clip(np.searchsorted(known, conditions[:, 0], "right") - 1, 0, len(known) - 2)
        part = (conditions[:, 0] - known[below]) / (known[below + 1] - known[below])
        low, high = (
            np.stack([self._at(int(g), row[1:]) for g, row in zip(below + up, conditions, strict=True)])
            for up in (0, 1)
        )
        return np.asarray((1.0 - part)[:, None] * low + part[:, None] * high)
