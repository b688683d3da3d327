"""Snapshots that are added to a set whose inner products are known."""

from collections.abc import Iterator

import numpy as np

from pod.errors import InputError
from pod.gram import Array
from pod.snapshots import SnapshotMatrix
from pod.workers import Tile, sum_of


def grown_gram(matrix: SnapshotMatrix, known: Array) -> Array:
    """Inner products `matrix.gram()` where those of the first m snapshots (m, m) are known; one pass over the rows.

    Only the products with new snapshots are formed, rows × N_t × (N_t - m) multiplications. `lanczos_pod(matrix,
    gram=...)` then gives the basis that a decomposition from scratch gives.
    Raises InputError where more snapshots are known than there are.
    """
    m, n = len(known), matrix.shape[1]
    if known.shape != (m, m) or not 1 <= m <= n:
        raise InputError(f"known: shape {known.shape}; give the inner products of the first 1 to {n} snapshots, (m, m)")
    if m == n:
        return known

    def own(tiles: Iterator[Tile]) -> Array:
        total = np.zeros((n, n - m))
        for tile in tiles:
            total += tile.motion.T @ tile.motion[:, m:]
        return total

    def products() -> Array:
        found = sum_of(matrix.each(own))
        matrix.check_energy(found.diagonal(-m))
        return found

    new = matrix.summed(matrix.ranks.agreed(products))
    square = 0.5 * (new[m:] + new[m:].T)
    return np.block([[known, new[:m]], [new[:m].T, square]])
