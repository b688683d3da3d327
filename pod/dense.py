"""A small matrix decomposed as it is, by a dense solver: no squares are formed, so small modes keep all digits."""

from collections.abc import Iterator

import numpy as np
import torch

from pod.lanczos import EPSILON, RitzPairs, Wanted, thin_svd
from pod.snapshots import SnapshotMatrix
from pod.workers import Tile


def dense_pairs(matrix: SnapshotMatrix, wanted: Wanted) -> RitzPairs:
    """Eigenpairs of W̃ᵀW̃ / N_t from the singular values of W̃, those above rounding, σ > max(rows, N_t) ε σ₁."""
    motion = np.empty(matrix.shape)

    def centre(tiles: Iterator[Tile]) -> None:
        for tile in tiles:
            np.subtract(tile.motion, tile.motion.mean(axis=1, keepdims=True), out=motion[tile.rows])

    matrix.each(centre)
    _, sigma, right = thin_svd(torch.from_numpy(motion).to(matrix.device))
    values, vectors = sigma**2 / matrix.shape[1], right.T
    rank = int((sigma > max(matrix.shape) * EPSILON * sigma[0]).sum())
    p, reason = wanted(values, lambda: vectors), "dense decomposition"
    if p is None or p > rank:
        p, reason = rank, f"rank {rank}: dense decomposition; smaller singular values are rounding"
    bounds = torch.full_like(values[:p], EPSILON * float(values[0]))
    none = torch.zeros((0, 0), dtype=torch.float64)
    return RitzPairs(values[:p], vectors[:, :p], bounds, 0, values, reason, none)
