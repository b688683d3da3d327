"""Cells of space: where a particle's neighbours can be."""

from math import floor
from typing import NamedTuple

import numpy as np

from sim.kernel import Array, Indices, inlined, kernel

BLOCK = 4  # cells per side of a block; blocks are numbered in turn, so that a chunk is compact in space


class CellGrid(NamedTuple):
    """Cells over the bounding box of the particles, or the period where they repeat, numbered block by block."""

    lowest: Array  # (3,) m
    inverse_size: Array  # (3,) 1/m
    cells: Indices  # (3,)
    blocks: Indices  # (3,)
    period: Array  # (3,) m; 0 where nothing repeats


@kernel
def corners(position: Array) -> tuple[Array, Array]:
    """Return the corners (m) of the bounding box of points (n, 3)."""
    lowest, highest = position[0].copy(), position[0].copy()
    for i in range(1, position.shape[0]):
        for axis in range(3):
            lowest[axis] = min(lowest[axis], position[i, axis])
            highest[axis] = max(highest[axis], position[i, axis])
    return lowest, highest


def cell_grid(position: Array, cutoff: float, lowest: Array | None = None, period: Array | None = None) -> CellGrid:
    """Lay cells no smaller than the cutoff (m) over the particles, and no more than a few per particle.

    Where `period` (3,) m is not 0 the cells divide it evenly, from `lowest` (3,) m on.
    """
    period = np.zeros(3) if period is None else period
    corner, opposite = corners(position)
    extent = opposite - corner
    if lowest is not None:
        corner, extent = np.where(period > 0.0, lowest, corner), np.where(period > 0.0, period, extent)
    size = cutoff
    while np.prod(np.floor(extent / size) + 1.0) > 8.0 * len(position) + 64.0:
        size *= 1.5  # few particles far apart: a larger cell is slower to search but bounded in memory
    whole = np.floor(extent / size).astype(np.int64)
    cells = np.where(period > 0.0, np.maximum(whole, 1), whole + 1)
    inverse = np.where(period > 0.0, cells / np.where(period > 0.0, period, 1.0), 1.0 / size)
    return CellGrid(corner, inverse, cells, -(-cells // BLOCK), period)


@inlined
def cell_number(ix: int, iy: int, iz: int, blocks: Indices) -> int:
    """Return the number of a cell: its block's, then its place within the block."""
    block: int = ((iz // BLOCK) * blocks[1] + iy // BLOCK) * blocks[0] + ix // BLOCK
    return ((block * BLOCK + iz % BLOCK) * BLOCK + iy % BLOCK) * BLOCK + ix % BLOCK


@inlined
def cell_along(x: float, axis: int, grid: CellGrid) -> int:
    """Return the index along an axis of the cell that holds a coordinate (m)."""
    index = floor((x - grid.lowest[axis]) * grid.inverse_size[axis])
    inside: int = max(min(index, grid.cells[axis] - 1), 0)
    return inside


@inlined
def cell_of(x: float, y: float, z: float, grid: CellGrid) -> tuple[int, int, int]:
    """Return the three indices of the cell that holds a point (m)."""
    return cell_along(x, 0, grid), cell_along(y, 1, grid), cell_along(z, 2, grid)


@inlined
def around(index: int, axis: int, grid: CellGrid) -> tuple[int, int]:
    """First and last (excluded) cell along an axis that may hold neighbours; beyond the ends where it is periodic."""
    if grid.period[axis] > 0.0:
        if grid.cells[axis] < 3:
            return 0, grid.cells[axis]
        return index - 1, index + 2
    return max(index - 1, 0), min(index + 2, grid.cells[axis])


@inlined
def wrapped(index: int, axis: int, grid: CellGrid) -> int:
    """Index of the cell that one beyond the ends of a periodic axis stands for."""
    cells: int = grid.cells[axis]
    if index < 0:
        return index + cells
    return index - cells if index >= cells else index


@kernel
def sort_by_cell(position: Array, grid: CellGrid) -> tuple[Indices, Indices]:
    """Return the order of the particles by cell, shape (n,), and where each cell begins in it, shape (cells + 1,)."""
    n = position.shape[0]
    start = np.zeros(grid.blocks[0] * grid.blocks[1] * grid.blocks[2] * BLOCK**3 + 1, np.int64)
    cell = np.empty(n, np.int64)
    for i in range(n):
        ix, iy, iz = cell_of(position[i, 0], position[i, 1], position[i, 2], grid)
        cell[i] = cell_number(ix, iy, iz, grid.blocks)
        start[cell[i] + 1] += 1
    for c in range(start.shape[0] - 1):
        start[c + 1] += start[c]
    order = np.empty(n, np.int64)
    filled = start[:-1].copy()
    for i in range(n):
        order[filled[cell[i]]] = i
        filled[cell[i]] += 1
    return order, start
