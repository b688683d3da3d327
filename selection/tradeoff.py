"""What accuracy costs: the choices that no other beats, and the cheapest one within a limit."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.errors import InputError


class Choice(NamedTuple):
    """One of the alternatives: the cheapest that keeps all limits, or else the one that comes closest."""

    chosen: int
    kept: bool  # False where no alternative keeps the limits


def pareto_front(errors: ArrayLike, costs: ArrayLike) -> NDArray[np.bool_]:
    """Mark the alternatives that none beats: none is at most as large in both error and cost, and smaller in one.

    errors, costs: (k,) any unit, finite. Equal alternatives stand on the front together. Returns (k,).
    Raises InputError for different lengths or values that are not finite.
    """
    error, cost = _column("errors", errors), _column("costs", costs)
    if len(error) != len(cost):
        raise InputError(f"costs: {len(cost)} for {len(error)} errors; give one per alternative")
    order = np.lexsort((error, cost))
    front = np.zeros(len(error), bool)
    least, least_cost = np.inf, np.nan
    for i in order:
        # sorted by cost: whoever is beaten is beaten by the least error so far
        if error[i] < least or (error[i] == least and cost[i] == least_cost):
            front[i], least, least_cost = True, error[i], cost[i]
    return front


def choose(costs: ArrayLike, bounded: ArrayLike, limits: ArrayLike) -> Choice:
    """Choose the alternative of least cost among those with every bounded quantity at most its limit.

    costs: (k,), bounded: (k, l), limits: (l,) positive, in the units of the bounded quantities. Where none keeps them,
    the closest is chosen: the least of max(bounded / limits). Of equal ones the first.
    Raises InputError for no alternative, different lengths, values that are not finite or limits that are not positive.
    """
    cost = _column("costs", costs)
    quantities, most = np.asarray(bounded, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    if not len(cost):
        raise InputError("costs: no alternative to choose from; give at least one")
    if quantities.shape != (len(cost), len(most)) or not np.isfinite(quantities).all():
        raise InputError(
            f"bounded: shape {quantities.shape}; give finite values, ({len(cost)} alternatives, {len(most)} limits)"
        )
    if not (most > 0).all():
        raise InputError(f"limits: {most[~(most > 0)][0]:g}; a limit must be positive")
    excess = (quantities / most).max(axis=1, initial=0.0)
    kept = excess <= 1
    if not kept.any():
        return Choice(int(np.argmin(excess)), False)
    return Choice(int(np.argmin(np.where(kept, cost, np.inf))), True)


def _column(field: str, given: ArrayLike) -> NDArray[np.float64]:
    column = np.asarray(given, dtype=np.float64)
    if column.ndim != 1 or not np.isfinite(column).all():
        raise InputError(f"{field}: shape {column.shape}; give one finite number per alternative")
    return column
