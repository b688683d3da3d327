"""Modes from eigenvectors of the inner products, made orthonormal to rounding, with their signs fixed."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import torch
from scipy.linalg.lapack import dtrtri

from pod.blas import add_symmetric_product, multiply_by_triangle_
from pod.gram import Array, Products
from pod.ranks import Ranks
from pod.snapshots import TILE_VALUES, SnapshotMatrix
from pod.workers import Tile, in_parallel, sum_of, workers_for

ORTHOGONAL = 1e-13  # ‖φᵀφ - 1‖_F that needs no mending
PROBES = 4  # random vectors that it is estimated from
REPAIRABLE = 0.1  # entries of φᵀφ - 1 up to which a Cholesky factor mends the modes
CPU = torch.device("cpu")


class Modes(NamedTuple):
    """Modes of this process's rows, in the inner product of the weighted rows."""

    mean: Array  # (rows,) W̄
    modes: Array  # (rows, p)
    orthogonality: float  # ‖φᵀφ - 1‖_F over all rows, measured


def modes_of(matrix: SnapshotMatrix, vectors: Array, average: Array | None = None) -> Modes:
    """φ = (W - w₀) v / σ by one pass over the rows, orthonormal, signs fixed; fewer where some cannot be.

    vectors: (N_t, p) v / σ, orthogonal to ones, so that W̃ v is (W - w₀) v, and W v where positions are near; average:
    (N_t,) weights of the snapshots in the mean, default the same for all.
    """
    n, p = matrix.own.stop - matrix.own.start, vectors.shape[1]
    mean, modes = np.empty(n), np.empty((n, p))
    weights = torch.from_numpy(vectors).to(matrix.device)
    even = np.full(matrix.shape[1], 1.0 / matrix.shape[1]) if average is None else average

    def work(tiles: Iterator[Tile]) -> tuple[Array, Array]:
        inner, ends = Products(p, CPU), np.zeros((2, p))
        for tile in tiles:
            rows = slice(tile.rows.start - matrix.own.start, tile.rows.stop - matrix.own.start)
            mean[rows] = tile.first + tile.motion @ even
            motion, made = torch.from_numpy(tile.motion), torch.from_numpy(modes[rows])
            if matrix.device.type == "cpu":
                torch.mm(motion, weights, out=made)
            else:
                made.copy_(motion.to(matrix.device) @ weights)
            inner.add(modes[rows])
            across = np.ascontiguousarray(modes[rows].T)  # numpy reduces along the last axis much faster
            np.maximum(ends[0], across.max(axis=1), out=ends[0])
            np.maximum(ends[1], -across.min(axis=1), out=ends[1])
        return inner.total(), ends

    parts = matrix.each(work, as_they_are=matrix.near and average is None)
    ends = matrix.ranks.largest(np.max([part[1] for part in parts], axis=0))
    signs = np.where(ends[1] > ends[0], -1.0, 1.0)
    modes, off = orthonormal(modes, matrix.summed(sum_of([part[0] for part in parts])), signs, matrix.ranks)
    if matrix.weights is not None:
        root = np.sqrt(matrix.weights[matrix.own])
        mean /= root
        modes /= root[:, None]
    return Modes(mean, modes, off)


def orthonormal(modes: Array, inner: Array, signs: Array, ranks: Ranks) -> tuple[Array, float]:
    """Orthonormalise the modes (rows, p) in place and turn them by their signs (p,); return those that could be.

    inner: φᵀφ over all rows. Modes of small eigenvalues lose orthogonality like ε λ₁/λ. φ <- φ L⁻ᵀ with LLᵀ = φᵀφ,
    repeated if need be: the first modes, the most accurate, change least. Where φᵀφ is further than 0.1 from the
    identity there is no mode to mend. Also returned: ‖φᵀφ - 1‖_F, afterwards estimated from four random vectors.
    """
    far = np.abs(inner - np.eye(len(inner))) > REPAIRABLE
    p = next((i for i in range(len(inner)) if far[i, : i + 1].any()), len(inner))
    modes = modes if p == modes.shape[1] else np.ascontiguousarray(modes[:, :p])
    inner, turn = inner[:p, :p], signs[:p]
    off = float(np.linalg.norm(inner - np.eye(p)))
    for again in range(3):
        if off <= ORTHOGONAL and (turn > 0.0).all():
            break
        if again:
            inner = ranks.summed(_over_tiles(modes, add_symmetric_product, p))
            inner = np.triu(inner) + np.triu(inner, 1).T
        inverse = dtrtri(np.linalg.cholesky(inner), lower=1)[0]
        off = _mended_(modes, np.ascontiguousarray((turn[:, None] * inverse).T), ranks)
        turn = np.ones(p)
    return modes, off


def _mended_(modes: Array, factor: Array, ranks: Ranks) -> float:
    """φ <- φ F in place with an upper triangle F (p, p); returns ‖φᵀφ - 1‖_F, which is E ‖(φᵀφ - 1) z‖."""
    probes = np.random.default_rng(0).standard_normal((modes.shape[1], PROBES))

    def mend(rows: Array, total: Array) -> None:
        multiply_by_triangle_(rows, factor)
        total += rows.T @ (rows @ probes)

    seen = ranks.summed(_over_tiles(modes, mend, PROBES))
    return float(np.linalg.norm(seen - probes) / np.sqrt(PROBES))


def _over_tiles(modes: Array, work: Callable[[Array, Array], None], columns: int) -> Array:
    """Add up, over tiles of the modes, what a piece of work adds to (p, columns)."""
    height = max(TILE_VALUES // 4 // max(modes.shape[1], 1), 1)  # they are read and written
    starts, workers = range(0, len(modes), height), workers_for(len(modes), height)

    def one(worker: int) -> Array:
        total = np.zeros((modes.shape[1], columns))
        for low in starts[worker::workers]:
            work(modes[low : low + height], total)
        return total

    return sum_of(in_parallel(one, workers))
