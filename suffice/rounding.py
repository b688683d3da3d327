"""What a model errs more when its mean and modes are kept in fewer bits, to the last digit."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pod import Basis, SnapshotMatrix
from suffice.precision import PRECISIONS, Array, Extent, extent_of, finer, read_back

UNNOTICED = 0.01  # of the squared error that the modes leave: what the coarsest modes may add by rounding
BLOCK_VALUES = 4 * 2**20  # of the modes that are rounded at once


class Rounding(NamedTuple):
    """Inner products of D = [W̄ - W̄', Φ - Φ'], what rounding takes from mean and modes: (rows, 1 + p)."""

    own: Array  # (1 + p, 1 + p) DᵀD
    on_modes: Array  # (p, 1 + p) ΦᵀD
    on_rest: Array  # (u, 1 + p) rᵀD, r what these p modes leave of the unseen snapshots
    leading: int  # modes that are kept in a finer precision


def roundings(
    basis: Basis, unseen: SnapshotMatrix, coefficients: Array, outside: Array, names: Sequence[str]
) -> dict[str, Rounding]:
    """Return the rounding of the mean and the first p modes in each precision but double, by one pass over the rows.

    coefficients: (u, p) of the unseen snapshots; outside: (u,) squared norm of what these modes leave of them.
    """
    u, p = coefficients.shape
    modes_kept = basis.modes[:, :p]
    extents = extent_of([basis.mean[:, None]]), extent_of([modes_kept])
    found = {
        name: Rounding(
            np.zeros((1 + p, 1 + p)),
            np.zeros((p, 1 + p)),
            np.zeros((u, 1 + p)),
            _leading(modes_kept, name, extents[1], coefficients, float(outside.mean())),
        )
        for name in names
        if name != "double"
    }
    start = 0
    for block in unseen.row_blocks():
        mean, modes = basis.mean[start : start + len(block), None], modes_kept[start : start + len(block)]
        rest = block - mean - modes @ coefficients.T
        for name, sums in found.items():
            lost = np.hstack(
                [mean - read_back(mean, finer(name), extents[0]), _lost(modes, name, extents[1], sums.leading)]
            )
            found[name] = Rounding(
                sums.own + lost.T @ lost, sums.on_modes + modes.T @ lost, sums.on_rest + rest.T @ lost, sums.leading
            )
        start += len(block)
    return found


def _lost(modes: Array, name: str, extent: Extent, leading: int) -> Array:
    """Return what rounding takes from some rows of the modes, the leading ones of which are kept finer."""
    first, last = Extent(*(e[:leading] for e in extent)), Extent(*(e[leading:] for e in extent))
    kept = [read_back(modes[:, :leading], finer(name), first), read_back(modes[:, leading:], name, last)]
    return np.asarray(modes - np.hstack(kept))


def _leading(modes: Array, name: str, extent: Extent, coefficients: Array, floor: float) -> int:
    """Count the leading modes that must be finer, so that the others add next to nothing to the squared error.

    Rounding a mode by δφ errs by |c|² |δφ|²; the modes after the leading ones may add 1 % of what all of them leave.
    """
    if PRECISIONS[name].finer is None:
        return 0
    taken = sum(np.square(_lost(block, name, extent, 0)).sum(axis=0) for block in _blocks(modes))
    added = np.square(coefficients).mean(axis=0) * taken
    after = np.append(added[::-1].cumsum()[::-1], 0.0)  # by all modes from this one on
    return int(np.argmax(after <= UNNOTICED * floor))


def _blocks(modes: Array) -> Iterator[Array]:
    step = max(BLOCK_VALUES // modes.shape[1], 1)
    return (modes[start : start + step] for start in range(0, len(modes), step))


def rounded_errors(rounding: Rounding, floor: Array, known: Array, predicted: Array) -> Array:
    """Squared norm of W(t) - W̄' - Φ' ĉ at the unseen times, (u,).

    With r what the modes leave of W(t), and a = (1, ĉ), W - W̄' - Φ'ĉ = r + Φ (c - ĉ) + D a. Every term is of the size
    of an error, so nothing cancels; rounded modes are not orthonormal, and none is assumed to be.
    floor: (u,) |r|²; known, predicted: (u, p) c and ĉ.
    """
    a = np.hstack([np.ones((len(predicted), 1)), predicted])
    miss = known - predicted
    total = floor + np.einsum("ij,ij->i", miss, miss) + np.einsum("ij,ij->i", a @ rounding.own, a)
    total += 2.0 * np.einsum("ij,ij->i", rounding.on_rest + miss @ rounding.on_modes, a)
    return np.asarray(np.maximum(total, 0.0))
