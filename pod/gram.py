"""Gram matrix of the snapshots: every inner product of two snapshots, in double precision."""

from collections.abc import Iterable
from typing import Protocol

import numpy as np
import torch

from pod.blas import Array, add_symmetric_product

__all__ = ["Array", "Products", "centred_pairs", "compute_device", "gram_groups"]


class _Rows(Protocol):
    @property
    def rows(self) -> slice: ...
    @property
    def motion(self) -> Array: ...
    @property
    def first(self) -> Array: ...


def compute_device(device: str | None) -> torch.device:
    """Device asked for; by default a GPU if there is one."""
    if device is not None:
        return torch.device(device)
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


class Products:
    """Σ BᵀB over blocks of rows B (b, n), (n, n) in double precision: half of each product is computed and kept."""

    def __init__(self, size: int, device: torch.device) -> None:
        self._device = device
        self._half = np.zeros((size, size))
        self._whole = torch.zeros((size, size) if device.type != "cpu" else (0, 0), dtype=torch.float64, device=device)

    def add(self, rows: Array) -> None:
        """Add BᵀB of some rows (b, n)."""
        if self._device.type == "cpu":
            add_symmetric_product(np.ascontiguousarray(rows), self._half)
        else:
            there = torch.from_numpy(rows).to(self._device)
            self._whole += there.T @ there

    def total(self) -> Array:
        """Return the sum, both halves."""
        if self._device.type != "cpu":
            return np.asarray(self._whole.cpu().numpy())
        upper = np.triu(self._half)
        return np.asarray(upper + np.triu(upper, 1).T)


def gram_groups(
    tiles: Iterable[_Rows], size: int, groups: int, rows_per_particle: int, device: torch.device
) -> tuple[Array, float]:
    """(W - w₀)ᵀ(W - w₀) split over groups of particles, (groups, N_t, N_t), and ‖w₀‖²; w₀ is the first snapshot.

    Particle i belongs to group i mod groups. The sum over groups is the Gram matrix; tiles are added in fixed
    order, so the result is reproducible. size: N_t.
    """
    totals, still = [Products(size, device) for _ in range(groups)], 0.0
    for tile in tiles:
        with np.errstate(over="ignore", invalid="ignore"):  # check_energy() says where they come from
            still += float(tile.first @ tile.first)
        if groups == 1:
            totals[0].add(tile.motion)
        else:
            group = np.arange(tile.rows.start, tile.rows.stop) // rows_per_particle % groups
            for g, total in enumerate(totals):
                total.add(tile.motion[group == g])
    return np.stack([total.total() for total in totals]), still


def centred_pairs(gram: Array) -> Array:
    """W̃ᵀW̃ from inner products about any snapshot: K_ij = G_ij - ḡ_i - ḡ_j + ḡ, (N_t, N_t)."""
    to_mean = gram.mean(axis=0)
    return np.asarray(gram - to_mean - to_mean[:, None] + to_mean.mean())
