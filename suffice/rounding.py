"""What a model errs more when its mean and modes are kept in fewer bits, to the last digit."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pod import Basis, SnapshotMatrix
from suffice.precision import Array, extent_of, read_back


class Rounding(NamedTuple):
    """Inner products of D = [W̄ - W̄', Φ - Φ'], what rounding takes from mean and modes: (rows, 1 + p)."""

    own: Array  # (1 + p, 1 + p) DᵀD
    on_modes: Array  # (p, 1 + p) ΦᵀD
    on_rest: Array  # (u, 1 + p) rᵀD, r what the modes leave of the unseen snapshots


def roundings(basis: Basis, unseen: SnapshotMatrix, coefficients: Array, names: Sequence[str]) -> dict[str, Rounding]:
    """Return the rounding of mean and modes in each precision but double, by one pass over the rows.

    coefficients: (u, p) of the unseen snapshots.
    """
    u, p = coefficients.shape
    columns = extent_of([basis.mean[:, None]]), extent_of([basis.modes])
    found = {
        name: Rounding(np.zeros((1 + p, 1 + p)), np.zeros((p, 1 + p)), np.zeros((u, 1 + p)))
        for name in names
        if name != "double"
    }
    start = 0
    for block in unseen.row_blocks():
        rows = slice(start, start + len(block))
        mean, modes = basis.mean[rows, None], basis.modes[rows]
        rest = block - mean - modes @ coefficients.T
        for name, sums in found.items():
            lost = np.hstack([mean - read_back(mean, name, columns[0]), modes - read_back(modes, name, columns[1])])
            found[name] = Rounding(
                sums.own + lost.T @ lost, sums.on_modes + modes.T @ lost, sums.on_rest + rest.T @ lost
            )
        start += len(block)
    return found


def rounded_errors(rounding: Rounding, floor: Array, known: Array, predicted: Array) -> Array:
    """Squared norm of W(t) - W̄' - Φ' ĉ at the unseen times, (u,), for the first n modes.

    With r_n what n modes leave of W(t), and a = (1, ĉ), W - W̄' - Φ'ĉ = r_n + Φ (c - ĉ) + D a. Every term is of the size
    of an error, so nothing cancels; rounded modes are not orthonormal, and none is assumed to be.
    floor: (u,) |r_n|²; known: (u, p) c; predicted: (u, n) ĉ.
    """
    n = predicted.shape[1]
    some = slice(0, 1 + n)
    a = np.hstack([np.ones((len(predicted), 1)), predicted])
    miss = known[:, :n] - predicted
    # what truncation leaves is made of the modes beyond n
    on_rest = (
        rounding.on_rest[:, some] + known[:, n:] @ rounding.on_modes[n:, some] + miss @ rounding.on_modes[:n, some]
    )
    total = floor + np.einsum("ij,ij->i", miss, miss) + 2.0 * np.einsum("ij,ij->i", on_rest, a)
    total += np.einsum("ij,ij->i", a @ rounding.own[some, some], a)
    return np.asarray(np.maximum(total, 0.0))
