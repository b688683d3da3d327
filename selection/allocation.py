"""One alternative for each of several variables under limits that they share: an exact allocation."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selection.errors import InputError

Array = NDArray[np.float64]
ROUNDING = 1e-12  # of a limit: by so much a sum may pass it, for its terms may come in another order
MULTIPLIERS = np.geomspace(1e-4, 1e4, 25)  # of the mean cost: prices of a burden that bound what is left to pay


class Allocation(NamedTuple):
    """What each variable gets."""

    chosen: tuple[int, ...]  # number of the alternative, per variable
    cost: float  # in total
    totals: Array  # (q,) burdens in total, in their own units
    kept: bool  # False where no allocation keeps the limits; then those that fail come closest in sum


class _Partial(NamedTuple):
    """Allocations to the first few variables that none of the same few beats."""

    costs: Array  # (s,)
    burdens: Array  # (s, q) in units of the limits
    chosen: NDArray[np.intp]  # (s, v)


def allocate(costs: Sequence[ArrayLike], burdens: Sequence[ArrayLike], limits: ArrayLike) -> Allocation:
    """Minimise Σ_v cost_v subject to Σ_v burden_vq ≤ limit_q for every q, one alternative for each variable v.

    A multiple-choice knapsack, solved exactly: variables are added one by one, and an allocation to the first few is
    dropped where another costs and burdens no more, where the limits can no longer be kept, or where the Lagrangian
    bound on what is still to pay, min Σ (cost + μ·burden) - μ·(limit left), passes an allocation already known.
    Squared errors add up over variables; so with costs in bytes and burdens in squared errors it finds the fewest
    bytes within Σ e² ≤ E², and with the two exchanged the least error within a number of bytes.

    costs: per variable (k,); burdens: per variable (k,) or (k, q), not negative; limits: (q,) or a number, positive.
    Raises InputError for no variable, a variable without alternatives, shapes that differ, or unfit values.
    """
    most = np.atleast_1d(np.asarray(limits, dtype=np.float64))
    if most.ndim != 1 or not (np.isfinite(most).all() and (most > 0).all()):
        raise InputError(f"limits: {most}; give positive finite numbers")
    if not costs or len(costs) != len(burdens):
        raise InputError(f"costs: of {len(costs)} variables, burdens of {len(burdens)}; give both for at least one")
    tables = [_table(v, c, b, most) for v, (c, b) in enumerate(zip(costs, burdens, strict=True))]
    chosen, kept = np.array([int(np.argmin(b.sum(axis=1))) for _, b in tables]), True
    for together in _independent([b for _, b in tables]):
        found = _merged([tables[v] for v in together])
        if len(found.costs):
            chosen[together] = found.chosen[int(np.argmin(found.costs))]
        else:
            kept = False
    paid = sum(float(c[i]) for (c, _), i in zip(tables, chosen, strict=True))
    totals = most * sum(b[i] for (_, b), i in zip(tables, chosen, strict=True))
    return Allocation(tuple(int(i) for i in chosen), paid, totals, kept)


def allocate_alike(
    costs: Sequence[ArrayLike], burdens: Sequence[ArrayLike], limits: ArrayLike, labels: Sequence[ArrayLike]
) -> Allocation:
    """Allocate likewise, but all variables get alternatives of one label: the rival, one Δτ for all.

    labels: per variable (k,), such as Δτ in s. Of equal cost the first label in descending order is taken.
    Raises InputError as `allocate` does, and where no label is common to all variables.
    """
    marks = [np.asarray(label) for label in labels]
    common = sorted(set.intersection(*(set(mark.tolist()) for mark in marks)), reverse=True) if marks else []
    if not common:
        raise InputError("labels: none is common to all variables; give alternatives of the same labels")
    best: Allocation | None = None
    for label in common:
        which = [np.flatnonzero(mark == label) for mark in marks]
        one = allocate(
            [np.asarray(c)[w] for c, w in zip(costs, which, strict=True)],
            [np.asarray(b)[w] for b, w in zip(burdens, which, strict=True)],
            limits,
        )
        one = one._replace(chosen=tuple(int(w[i]) for w, i in zip(which, one.chosen, strict=True)))
        if best is None or _rank(one, limits) < _rank(best, limits):
            best = one
    assert best is not None, "there is a common label"
    return best


def _rank(one: Allocation, limits: ArrayLike) -> tuple[bool, float]:
    """Order allocations: those that keep the limits by cost, then the others by how far they miss them."""
    return (not one.kept, one.cost if one.kept else float((one.totals / np.asarray(limits)).sum()))


def _table(v: int, costs: ArrayLike, burdens: ArrayLike, limits: Array) -> tuple[Array, Array]:
    """Costs (k,) and burdens (k, q) in units of their limits."""
    cost, burden = np.asarray(costs, dtype=np.float64), np.asarray(burdens, dtype=np.float64)
    burden = burden[:, None] if burden.ndim == 1 else burden
    if cost.ndim != 1 or not len(cost) or burden.shape != (len(cost), len(limits)):
        raise InputError(
            f"variable {v}: costs of shape {cost.shape}, burdens of {burden.shape} for {len(limits)} limits; give at "
            "least one alternative, a cost and a burden for each"
        )
    if not (np.isfinite(cost).all() and np.isfinite(burden).all() and (burden >= 0).all()):
        raise InputError(f"variable {v}: a cost or burden is negative or not finite; leave such an alternative out")
    return cost, burden / limits


def _independent(burdens: Sequence[Array]) -> list[list[int]]:
    """Return groups of variables that share a limit: each group is allocated by itself."""
    uses = np.array([(b > 0).any(axis=0) for b in burdens])  # (v, q)
    label = np.arange(len(burdens))
    for shared in uses.T:
        if shared.any():
            label[np.isin(label, label[shared])] = label[shared].min()
    return [np.flatnonzero(label == k).tolist() for k in np.unique(label)]


def _merged(tables: Sequence[tuple[Array, Array]]) -> _Partial:
    """Add one variable after the other; what is left when all are in holds the cheapest allocation, if any."""
    rest = _Rest.of(tables)
    state = _Partial(np.zeros(1), np.zeros((1, tables[0][1].shape[1])), np.zeros((1, 0), dtype=np.intp))
    for v, (cost, burden) in enumerate(tables):
        own = np.flatnonzero(_undominated(cost, burden))
        total = (state.costs[:, None] + cost[own]).ravel()
        carried = (state.burdens[:, None] + burden[own]).reshape(len(total), burden.shape[1])
        alive = np.flatnonzero(rest.can_win(v + 1, total, carried))
        alive = alive[_undominated(total[alive], carried[alive])]
        before, last = np.divmod(alive, len(own))
        state = _Partial(total[alive], carried[alive], np.column_stack([state.chosen[before], own[last]]))
    return state


class _Rest(NamedTuple):
    """What the variables not yet added will cost and burden at least."""

    least_burden: Array  # (v + 1, q) of variables v, v + 1, …
    priced: Array  # (v + 1, multipliers) least Σ (cost + μ Σ burden) of variables v, v + 1, …
    prices: Array  # (multipliers,) μ
    known: float  # cost of an allocation that keeps the limits; infinite where none was found

    @classmethod
    def of(cls, tables: Sequence[tuple[Array, Array]]) -> "_Rest":
        scale = max(float(np.mean([np.abs(cost).mean() for cost, _ in tables])), 1e-300)
        prices = scale * MULTIPLIERS
        priced = [cost[:, None] + burden.sum(axis=1)[:, None] * prices for cost, burden in tables]
        choices = np.array([one.argmin(axis=0) for one in priced])  # (v, multipliers)
        costs = sum(cost[i] for (cost, _), i in zip(tables, choices, strict=True))
        totals = sum(burden[i] for (_, burden), i in zip(tables, choices, strict=True))
        keeps = (np.asarray(totals) <= 1 + ROUNDING).all(axis=1)
        known = float(np.asarray(costs)[keeps].min(initial=np.inf))
        return cls(
            _sums_from([burden.min(axis=0) for _, burden in tables]),
            _sums_from([one.min(axis=0) for one in priced]),
            prices,
            known,
        )

    def can_win(self, v: int, costs: Array, burdens: Array) -> NDArray[np.bool_]:
        """Tell which allocations to the first v variables may still become the cheapest that keeps the limits."""
        feasible = (burdens + self.least_burden[v] <= 1 + ROUNDING).all(axis=1)
        left = (1 + ROUNDING) * burdens.shape[1] - burdens.sum(axis=1)
        slack = 1e-9 * abs(self.known) if np.isfinite(self.known) else 0.0
        for priced, price in zip(self.priced[v], self.prices, strict=True):
            feasible &= costs + priced - price * left <= self.known + slack + 1e-9 * price
        return np.asarray(feasible)


def _sums_from(parts: Sequence[Array]) -> Array:
    """Σ of the parts from each one on, and zero after the last."""
    zero = np.zeros_like(parts[0])
    return np.array([sum(parts[v:], zero) for v in range(len(parts) + 1)])


def _undominated(costs: Array, burdens: Array) -> NDArray[np.bool_]:
    """Mark alternatives that none costs and burdens less or alike; of equal ones the first."""
    order = np.lexsort((*burdens.T[::-1], costs))
    kept = np.zeros(len(costs), bool)
    if burdens.shape[1] == 1:
        sorted_burden = burdens[order, 0]
        kept[order] = sorted_burden < np.append(np.inf, np.minimum.accumulate(sorted_burden)[:-1])
        return kept
    front = np.empty_like(burdens)
    size = 0
    for i in order:  # sorted by cost: only burdens can still be less
        if not (front[:size] <= burdens[i]).all(axis=1).any():
            front[size], kept[i], size = burdens[i], True, size + 1
    return kept
