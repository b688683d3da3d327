"""Radial basis functions in time, kernel and shape chosen by leaving one snapshot out."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from surrogates.errors import InputError
from surrogates.interpolant import Interpolant
from surrogates.kernel import Kernel, candidates, checked_shape, family_name
from surrogates.series import Array, Series
from surrogates.surrogate import saved_numbers
from surrogates.windows import WindowedRbf, interior_error

EXACT = 1e-10  # largest miss at a snapshot over the largest value
ROUNDING = 1e-13  # leave-one-out errors below this fraction of the largest value are equal: the first candidate wins


class Rbf(Interpolant):
    """Radial interpolation c(t) = Σ_i w_i φ(ε|t - t_i|/Δτ) + polynomial (the f of paper eq. (30), in time).

    Kernel and shape are those with the least leave-one-out error, summed over all modes (so it is the error of the
    reconstructed field), among those that pass through their own snapshots to 1e-10 of the largest value. Give
    `kernel`, or `kernel` and `shape` (ε per Δτ), to choose yourself.

    The series is cut into overlapping windows of about 32 snapshots: with 500 snapshots in one matrix the quintic
    kernel missed its own snapshots by 6e-5.
    """

    name: ClassVar[str] = "rbf"

    kernel_: Kernel
    leave_one_out_: dict[Kernel, float]  # every candidate's error, in units of the values; empty in a loaded model

    def __init__(self, kernel: str | None = None, shape: float | None = None) -> None:
        self.kernel = None if kernel is None else family_name(kernel)
        self.shape = None if shape is None else checked_shape(shape, kernel)

    def _fit(self, series: Series) -> None:
        tau, values = series.scaled(series.times), np.asarray(series.values, dtype=np.float64)
        scale = float(np.abs(values).max())
        errors = {
            kernel: interior_error(kernel, tau, values / (scale or 1.0)) * scale
            for kernel in candidates(self.kernel, self.shape, len(tau))
        }
        for kernel in sorted(errors, key=lambda candidate: max(errors[candidate], ROUNDING * scale)):
            if self._passes(series, kernel):
                self.leave_one_out_ = errors
                return
        raise InputError(
            f"kernel {self.kernel or 'of every kind'} misses its own snapshots by more than {EXACT:g} of the largest "
            "value at these times; let the data choose the kernel, take a larger shape, or space the times more evenly"
        )

    def _passes(self, series: Series, kernel: Kernel) -> bool:
        """Fit one kernel; false if it is too ill-conditioned to pass through its own snapshots."""
        try:
            self._build(series, kernel)
        except np.linalg.LinAlgError:
            return False
        miss = np.abs(self._predict(series.times, None, None) - series.values).max()
        return bool(miss <= EXACT * np.abs(series.values).max())

    def _build(self, series: Series, kernel: Kernel) -> None:
        super()._fit(series)
        self.kernel_ = kernel
        values = np.asarray(series.values, dtype=np.float64)
        self.curve_ = WindowedRbf.through(series.scaled(series.times), values, kernel)

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        return self.curve_(self.series_.scaled(times))

    def _arrays(self) -> dict[str, NDArray[Any]]:
        name, shape, _ = self.kernel_
        chosen = {"kernel": np.frombuffer(name.encode(), np.uint8), "shape": np.array([shape])}
        return {**super()._arrays(), **chosen}

    def _restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        series, name = self._stored(state), family_name(state["kernel"].tobytes().decode(errors="replace"))
        (shape,) = saved_numbers(state, "shape", 1)
        (kernel,) = candidates(name, checked_shape(shape, name), len(series.times))
        self.leave_one_out_ = {}
        self._build(series, kernel)
