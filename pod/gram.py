"""Gram matrix of the snapshots: every inner product of two snapshots, in double precision."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from pod.blas import Array, add_symmetric_product

__all__ = ["Array", "Parts", "Products", "centred_pairs", "compute_device", "gram_parts"]
MIRRORED = 128  # rows and columns of a block that is copied at once
HELD_ROWS = 256  # of each sum: a product of fewer spends its time on reading and writing the sum


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
    """Σ BᵀB over blocks of rows B (b, n), (n, n) in double precision: half of each product is computed and kept.

    into: zeros (n, n) that the sum is formed in; by default new ones.
    """

    def __init__(self, size: int, device: torch.device, into: Array | None = None) -> None:
        self._device = device
        self._half = np.zeros((size, size)) if into is None else into
        self._whole = torch.zeros((size, size) if device.type != "cpu" else (0, 0), dtype=torch.float64, device=device)

    def add(self, rows: Array) -> None:
        """Add BᵀB of some rows (b, n)."""
        if not len(rows):
            return
        if self._device.type == "cpu":
            add_symmetric_product(np.ascontiguousarray(rows), self._half)
        else:
            there = torch.from_numpy(rows).to(self._device)
            self._whole += there.T @ there

    def total(self) -> Array:
        """Return the sum, both halves; nothing can be added after it."""
        if self._device.type != "cpu":
            self._half[:] = self._whole.cpu().numpy()
        fill_lower_half_(self._half)  # of a GPU as well, whose product need not be symmetric to the last digit
        return self._half


def fill_lower_half_(total: Array) -> None:
    """Copy the upper triangle of a matrix to the lower one, by blocks that stay in the cache."""
    for low in range(0, len(total), MIRRORED):
        high = low + MIRRORED
        total[high:, low:high] = total[low:high, high:].T
        square = total[low:high, low:high]
        square[:] = np.triu(square) + np.triu(square, 1).T


class _Gathered:
    """Rows of one sum, held back until there are enough of them for a product that does not wait for memory."""

    def __init__(self, total: Products) -> None:
        self._total, self._held, self._count, self._moved = total, np.empty((0, 0)), 0, False

    def add(self, rows: Array) -> None:
        """Add rows (b, n), any b."""
        self._moved = self._moved or bool(rows.any())
        if self._count == 0 and len(rows) >= HELD_ROWS:
            self._total.add(rows)
            return
        if not self._held.size:
            self._held = np.empty((HELD_ROWS, rows.shape[1]))
        while len(rows):
            taken = rows[: HELD_ROWS - self._count]
            self._held[self._count : self._count + len(taken)] = taken
            self._count, rows = self._count + len(taken), rows[len(taken) :]
            if self._count == HELD_ROWS:
                self._flush()

    def finish(self) -> bool:
        """Complete the sum, and tell whether any of its rows moved."""
        self._flush()
        self._total.total()
        return self._moved

    def _flush(self) -> None:
        self._total.add(self._held[: self._count])
        self._count = 0


class Parts(NamedTuple):
    """Gram matrices of some components, split over groups of particles."""

    grams: Array  # (components, groups, N_t, N_t)
    moved: NDArray[np.bool_]  # (components,) whether any value differs from that of the first snapshot
    still: float  # ‖w₀‖², w₀ the first snapshot


def gram_parts(
    tiles: Iterable[_Rows], size: int, groups: int, components: Sequence[Sequence[int]], per: int, device: torch.device
) -> Parts:
    """(W - w₀)ᵀ(W - w₀), w₀ the first snapshot, of some components and split over groups of particles, by one pass.

    Particle i belongs to group i mod groups, and has `per` rows; each of `components` says which of them it sums over:
    ((0, 1, 2),) a vector as a whole, ((0,), (1,), (2,)) each of its components. Rows are added in fixed order, so the
    result is reproducible. size: N_t.
    """
    grams, still = np.zeros((len(components), groups, size, size)), 0.0
    sums = [[_Gathered(Products(size, device, gram)) for gram in part] for part in grams]
    places = [[_places(g, rows, per, groups) for g in range(groups)] for rows in components]
    for tile in tiles:
        with np.errstate(over="ignore", invalid="ignore"):  # check_energy() says where they come from
            still += float(tile.first @ tile.first)
        for part, at in zip(sums, places, strict=True):
            for total, (firsts, step) in zip(part, at, strict=True):
                for first in firsts:
                    total.add(tile.motion[(first - tile.rows.start) % step :: step])
    moved = [[total.finish() for total in part] for part in sums]
    return Parts(grams, np.any(moved, axis=1), still)


def _places(g: int, rows: Sequence[int], per: int, groups: int) -> tuple[list[int], int]:
    """Return the first rows of group g, and the step from each to its next: together some rows of its particles."""
    if groups == 1 and len(rows) == per:
        return [0], 1
    return [per * g + row for row in rows], per * groups


def centred_pairs(gram: Array) -> Array:
    """W̃ᵀW̃ from inner products about any snapshot: K_ij = G_ij - ḡ_i - ḡ_j + ḡ, (N_t, N_t)."""
    to_mean = gram.mean(axis=0)
    return np.asarray(gram - to_mean - to_mean[:, None] + to_mean.mean())
