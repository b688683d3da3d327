"""Gram matrix of the snapshots: every inner product of two snapshots, in double precision."""

from collections.abc import Iterable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Array = NDArray[np.float64]


def compute_device(device: str | None) -> torch.device:
    """Device asked for; by default a GPU if there is one."""
    if device is not None:
        return torch.device(device)
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def inner_products(block: Array, device: torch.device) -> Tensor:
    """BᵀB of one block of rows (b, N_t): (N_t, N_t), double precision, on the device."""
    if device.type == "cpu":
        # numpy sees that both factors are one matrix and computes half of the product; torch does not
        return torch.from_numpy(block.T @ block)
    rows = torch.from_numpy(block).to(device)
    return rows.T @ rows


def gram_groups(blocks: Iterable[Array], size: int, groups: int, rows_per_particle: int, device: torch.device) -> Array:
    """(W - w₀)ᵀ(W - w₀) split over groups of particles, (groups, N_t, N_t); w₀ is the first snapshot.

    Particle i belongs to group i mod groups. The sum over groups is the Gram matrix; blocks are added in fixed
    order, so the result is reproducible. blocks: (b, N_t) each; size: N_t.
    """
    total = torch.zeros((groups, size, size), dtype=torch.float64, device=device)
    start = 0
    for block in blocks:
        motion = block - block[:, :1]
        if groups == 1:
            total[0] += inner_products(motion, device)
        else:
            group = (start + np.arange(len(block))) // rows_per_particle % groups
            for g in range(groups):
                total[g] += inner_products(motion[group == g], device)
        start += len(block)
    return np.asarray(total.cpu().numpy())


def centred(gram: Tensor) -> Tensor:
    """W̃ᵀW̃ from inner products about any snapshot: K_ij = G_ij - ḡ_i - ḡ_j + ḡ, (N_t, N_t)."""
    to_mean = gram.mean(dim=0)
    return gram - to_mean - to_mean[:, None] + to_mean.mean()
