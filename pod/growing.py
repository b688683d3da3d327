"""Snapshots that are added to a set whose inner products are known."""

from collections.abc import Iterator

import numpy as np

from pod.errors import InputError
from pod.gram import Array
from pod.snapshots import SnapshotMatrix
from pod.workers import Tile, sum_of

ALIKE = 1e-9  # of a sum of squares: by so much two summations of the same rows may differ, in another order too


def grown_gram(matrix: SnapshotMatrix, known: Array) -> Array:
    """Inner products `matrix.gram()` where those of the first m snapshots (m, m) are known; one pass over the rows.

    Only the products with new snapshots are formed, rows × N_t × (N_t - m) multiplications. `lanczos_pod(matrix,
    gram=...)` then gives the basis that a decomposition from scratch gives.
    Raises InputError where more snapshots are known than there are, or others: the same pass measures how far each
    known snapshot is from the first one, and that must be what is known.
    """
    m, n = len(known), matrix.shape[1]
    if known.shape != (m, m) or not 1 <= m <= n:
        raise InputError(f"known: shape {known.shape}; give the inner products of the first 1 to {n} snapshots, (m, m)")

    def own(tiles: Iterator[Tile]) -> Array:
        total = np.zeros((n, n - m + 1))  # the last column: squares, of known snapshots too
        for tile in tiles:
            total[:, :-1] += tile.motion.T @ tile.motion[:, m:]
            total[:, -1] += np.einsum("rt,rt->t", tile.motion, tile.motion)
        return total

    def products() -> Array:
        found = sum_of(matrix.each(own))
        matrix.check_energy(found[:, -1])
        return found

    new = matrix.summed(matrix.ranks.agreed(products))
    _check_known(known.diagonal(), new[:m, -1])
    square = 0.5 * (new[m:, :-1] + new[m:, :-1].T)
    return np.block([[known, new[:m, :-1]], [new[:m, :-1].T, square]])


def _check_known(known: Array, found: Array) -> None:
    """Refuse inner products of other snapshots, by their squared distances from the first one, (m,) each."""
    differ = ~(np.abs(known - found) <= ALIKE * found)
    if differ.any():
        k = int(differ.argmax())
        raise InputError(
            f"known: inner products of other snapshots: snapshot {k} lies {np.sqrt(found[k]):.6g} from the first one "
            f"(norm over all rows), not {np.sqrt(max(known[k], 0.0)):.6g}; form them anew"
        )
