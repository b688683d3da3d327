"""Modes from eigenvectors of the inner products, made orthonormal to rounding, with their signs fixed."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dtrtri

from pod.gram import Array, Products
from pod.ranks import Ranks
from pod.snapshots import TILE_VALUES, SnapshotMatrix
from pod.workers import Tile, in_parallel, sum_of, workers_for

ORTHOGONAL = 1e-14  # entries of φᵀφ - 1 that rounding alone explains
REPAIRABLE = 0.1  # entries of φᵀφ - 1 up to which a Cholesky factor mends the modes
CPU = torch.device("cpu")


class Modes(NamedTuple):
    """Modes of this process's rows, in the inner product of the weighted rows."""

    mean: Array  # (rows,) W̄
    modes: Array  # (rows, p)
    orthogonality: float  # largest entry of φᵀφ - 1 over all rows, measured


def modes_of(matrix: SnapshotMatrix, vectors: Array, average: Array | None = None) -> Modes:
    """φ = (W - w₀) v / σ by one pass over the rows, orthonormal, signs fixed; fewer where some cannot be.

    vectors: (N_t, p) v / σ, orthogonal to ones, so that W̃ v is (W - w₀) v; average: (N_t,) weights of the snapshots in
    the mean, default the same for all.
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
            if matrix.device.type == "cpu":
                np.matmul(tile.motion, vectors, out=modes[rows])
            else:
                modes[rows] = (torch.from_numpy(tile.motion).to(matrix.device) @ weights).cpu().numpy()
            inner.add(modes[rows])
            np.maximum(ends[0], modes[rows].max(axis=0), out=ends[0])
            np.maximum(ends[1], -modes[rows].min(axis=0), out=ends[1])
        return inner.total(), ends

    parts = matrix.each(work)
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
    repeated: the first modes, the most accurate, change least. Where φᵀφ is further than 0.1 from the identity there
    is no mode to mend. Also returned: the largest entry of φᵀφ - 1 afterwards.
    """
    far = np.abs(inner - np.eye(len(inner))) > REPAIRABLE
    p = next((i for i in range(len(inner)) if far[i, : i + 1].any()), len(inner))
    modes = modes if p == modes.shape[1] else np.ascontiguousarray(modes[:, :p])
    inner, turn = inner[:p, :p], signs[:p]
    for _ in range(3):
        if _distance(inner) <= ORTHOGONAL and (turn > 0.0).all():
            break
        inverse = dtrtri(np.linalg.cholesky(inner), lower=1)[0]
        inner = ranks.summed(_mended_(modes, turn[:, None] * inverse))
        turn = np.ones(p)
    return modes, _distance(inner)


def _mended_(modes: Array, factor: Array) -> Array:
    """φ <- φ Fᵀ in place with a lower triangle F (p, p); returns φᵀφ."""
    height = max(TILE_VALUES // max(modes.shape[1], 1), 1)
    starts = range(0, len(modes), height)

    def work(worker: int) -> Array:
        inner = Products(modes.shape[1], CPU)
        for low in starts[worker::workers]:
            rows = modes[low : low + height]
            dtrmm(1.0, factor, rows.T, lower=1, overwrite_b=1)
            inner.add(rows)
        return inner.total()

    workers = workers_for(len(modes), height)
    return sum_of(in_parallel(work, workers))


def _distance(inner: Array) -> float:
    return float(np.abs(inner - np.eye(len(inner))).max(initial=0.0))
