"""Cells and faces of the fluid: where its fields stand.

Fields are flat arrays over a grid with a margin of two cells on every side, so that a stencil needs no branch at the
border. Along axis a the neighbours of cell n are n − stride[a] and n + stride[a]; face n of a velocity's component a
lies between them, on the lower side of cell n.
"""

from typing import NamedTuple

import numpy as np

from sim.flow import FluidTable
from sim.kernel import Array, Indices, Vector

MARGIN = 2


class Grid(NamedTuple):
    """A uniform grid."""

    cells: tuple[int, int, int]  # along x, y, z
    lowest: Vector  # m, corner
    spacing: Vector  # m
    periodic: tuple[bool, bool, bool]

    @property
    def stride(self) -> tuple[int, int, int]:
        """Places between a cell and its next neighbour along x, y, z."""
        nx, ny, _ = self.cells
        return 1, nx + 2 * MARGIN, (nx + 2 * MARGIN) * (ny + 2 * MARGIN)

    @property
    def size(self) -> int:
        """Places of a field, margin included."""
        return self.stride[2] * (self.cells[2] + 2 * MARGIN)

    @property
    def volume(self) -> float:
        """Volume of a cell, m³."""
        return self.spacing[0] * self.spacing[1] * self.spacing[2]


def grid_of(table: FluidTable, periodic: tuple[bool, bool, bool]) -> Grid:
    """Return the grid that a scene asks for."""
    spacing = tuple((high - low) / n for low, high, n in zip(table.lowest, table.highest, table.cells, strict=True))
    return Grid(table.cells, table.lowest, (spacing[0], spacing[1], spacing[2]), periodic)


class Frame(NamedTuple):
    """What a compiled loop knows of the grid."""

    cells: Indices  # (3,)
    stride: Indices  # (3,)
    inverse: Array  # (3,) 1/m


def frame_of(grid: Grid) -> Frame:
    """Return the grid as arrays."""
    return Frame(np.array(grid.cells), np.array(grid.stride), 1.0 / np.array(grid.spacing))


def zeros(grid: Grid) -> Array:
    """Return a field of cells, or of one component's faces, of zeros."""
    return np.zeros(grid.size)


def cells_of(field: Array, grid: Grid) -> Array:
    """Look at the cells of a field (size,) without its margin, as (z, y, x)."""
    nx, ny, nz = grid.cells
    m = MARGIN
    return field.reshape(nz + 2 * m, ny + 2 * m, nx + 2 * m)[m : m + nz, m : m + ny, m : m + nx]


def faces_of(field: Array, axis: int, grid: Grid) -> Array:
    """Look at the faces of a component (size,) along an axis, both borders included, as (z, y, x)."""
    nx, ny, nz = (n + (a == axis) for a, n in enumerate(grid.cells))
    m = MARGIN
    x, y, z = (n + 2 * m for n in grid.cells)
    return field.reshape(z, y, x)[m : m + nz, m : m + ny, m : m + nx]


def centres(grid: Grid) -> tuple[Array, Array, Array]:
    """Return the coordinates (m) of the centres of the cells along x, y, z."""
    boxes = zip(grid.lowest, grid.cells, grid.spacing, strict=True)
    x, y, z = (np.asarray(low + (np.arange(n) + 0.5) * h, np.float64) for low, n, h in boxes)
    return x, y, z


def face_points(axis: int, grid: Grid) -> tuple[Array, Array, Array]:
    """Return the coordinates (m) of the faces across an axis, broadcast to (z, y, x)."""
    along = [c if a != axis else grid.lowest[a] + np.arange(grid.cells[a] + 1) * grid.spacing[a]
             for a, c in enumerate(centres(grid))]  # fmt: skip
    z, y, x = np.meshgrid(along[2], along[1], along[0], indexing="ij")
    return x, y, z


def along(axis: int, part: slice | int) -> tuple[slice | int, ...]:
    """Index of a part along an axis of arrays (z, y, x)."""
    index: list[slice | int] = [slice(None)] * 3
    index[2 - axis] = part
    return tuple(index)
