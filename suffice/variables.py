"""Variables of a run as surrogates want them: in memory if they are small, with their derivative, in diameters."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pod import RowSource
from suffice.quantities import velocity_of
from suffice.run import Run
from surrogates import SURROGATES

HELD_BYTES = 2**30  # a variable up to this size is read once and kept; a larger one is streamed at every pass
BLOCK_VALUES = 4 * 2**20  # numbers per block of rows; a few such blocks are held at once
QUANTITIES_COMPARED = ("position.", "velocity.")


def mean_diameter(run: Run) -> float | None:
    """Return the mean particle diameter in m, None where the run does not know every radius."""
    diameter = 2 * float(np.mean(run.radius)) if len(run.radius) else float("nan")
    return diameter if np.isfinite(diameter) and diameter > 0 else None


def default_variables(run: Run) -> list[str]:
    """Return the components of position and velocity, all variables where there are none."""
    return [name for name in run.variables if name.startswith(QUANTITIES_COMPARED)] or run.variables


def held(run: Run, name: str) -> RowSource:
    """Return a variable, in memory if it is small enough."""
    variable = run.variable(name)
    small = variable.shape[0] * variable.shape[1] * variable.dtype.itemsize <= HELD_BYTES
    return variable[:] if small else variable


def held_rates(run: Run, name: str, surrogates: Sequence[str]) -> RowSource | None:
    """Return the derivative of a position, the stored velocity, if there is one and a surrogate asks for it."""
    needed = any(SURROGATES[surrogate].needs_rates or SURROGATES[surrogate].uses_rates for surrogate in surrogates)
    return held_velocity(run, name) if needed else None


def held_velocity(run: Run, name: str) -> RowSource | None:
    """Return the stored velocity of a position, `velocity.x` of `position.x`; None of other variables."""
    rate = velocity_of(name)
    stored = rate in run.variables or f"{rate}.x" in run.variables
    return held(run, rate) if name.startswith("position") and stored else None


def columns_of(source: Any, which: NDArray[np.intp]) -> NDArray[Any]:
    """Return some of the snapshots in full, (len(which), 3n), in the stored precision."""
    rows, snapshots = source.shape
    step = max(BLOCK_VALUES // snapshots, 1)
    blocks = [source[start : min(start + step, rows)][:, which].T for start in range(0, rows, step)]
    return np.ascontiguousarray(np.concatenate(blocks, axis=1))
