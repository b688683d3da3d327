"""What particles and cells give each other, through one kernel.

A particle belongs to the cells around it by a product of hats, w ∝ Π (1 − |x_c − x_p|/H), each at least a cell wide and
continuous in space, divided by their sum; parts beyond a wall fall to the cell before it, and a cell counts by how open
it is. The same weights spread volume, drag and momentum to the cells and interpolate fields to the particle, so that
what one side gives the other receives.
"""

from math import ceil, floor
from typing import NamedTuple

import numpy as np
from numba import prange

from sim.grid import MARGIN, Grid
from sim.kernel import Array, Flags, Indices, inlined, kernel, parallel_kernel, signed

WIDEST = 16  # cells that a kernel reaches in one direction


class Cloud(NamedTuple):
    """Where the kernel puts particles: the grid and how open its cells are."""

    cells: Indices  # (3,)
    stride: Indices  # (3,)
    lowest: Array  # (3,) m
    inverse: Array  # (3,) 1/m
    periodic: Flags  # (3,)
    reach: Array  # (3,) half width of the kernel in cells, 1 at least
    openness: Array  # (size,) 1 − α of the cells; without rows where no body is immersed


def cloud_of(grid: Grid, half_width: float, openness: Array | None) -> Cloud:
    """Return the kernel of half width (m), a cell at least, on a grid; raises ValueError where it spans too many."""
    spacing = np.array(grid.spacing)
    reach = np.maximum(half_width / spacing, 1.0)
    if reach.max() > 0.5 * WIDEST - 1.0:
        raise ValueError(f"drag.kernel spans {2.0 * reach.max():.3g} cells; use larger cells or a narrower kernel")
    return Cloud(
        np.array(grid.cells), np.array(grid.stride), np.array(grid.lowest), 1.0 / spacing,
        np.array(grid.periodic, np.uint8), reach, np.zeros(0) if openness is None else openness,
    )  # fmt: skip


@inlined
def along_axis(cloud: Cloud, axis: int, x: float, cell: Indices, weight: Array) -> int:
    """Fill indices (WIDEST,) of the cells near a coordinate (m) along an axis, and their hats; return how many."""
    at = (x - cloud.lowest[axis]) * cloud.inverse[axis] - 0.5  # in cells from the centre of the first
    reach, last = cloud.reach[axis], cloud.cells[axis] - 1
    n = 0
    for k in range(floor(at - reach) + 1, ceil(at + reach)):
        hat = 1.0 - abs(k - at) / reach
        inside = k % (last + 1) if cloud.periodic[axis] else min(max(k, 0), last)
        if n > 0 and cell[n - 1] == inside:
            weight[n - 1] += hat
            continue
        cell[n], weight[n] = inside, hat
        n += 1
    return n


@inlined
def weigh(cloud: Cloud, x: float, y: float, z: float, place: Indices, weight: Array, cell: Indices, hat: Array) -> int:
    """Fill places (WIDEST³,) of the cells of a particle and weights that add up to 1; return how many.

    `cell` and `hat` (3, WIDEST) are room for the directions.
    """
    nx = along_axis(cloud, 0, x, cell[0], hat[0])
    ny = along_axis(cloud, 1, y, cell[1], hat[1])
    nz = along_axis(cloud, 2, z, cell[2], hat[2])
    n, total, whole, veiled = 0, 0.0, 0.0, cloud.openness.shape[0] > 0
    for c in range(nz):
        for b in range(ny):
            for a in range(nx):
                at = (
                    (cell[0, a] + MARGIN)
                    + (cell[1, b] + MARGIN) * cloud.stride[1]
                    + (cell[2, c] + MARGIN) * (cloud.stride[2])
                )
                w = hat[0, a] * hat[1, b] * hat[2, c]
                place[n], weight[n] = at, w
                whole += w
                total += w * cloud.openness[at] if veiled else w
                n += 1
    is_open = total > 1e-6 * whole  # else it lies within a body, and belongs to the cells there
    for m in range(n):
        w = weight[m]
        if veiled and is_open:
            w *= cloud.openness[place[m]]
        weight[m] = w / (total if is_open else whole)
    return n


@kernel
def spread_field(c: int, cloud: Cloud, position: Array, amount: Array, field: Array) -> None:
    """Add amount (n, columns) of column c of every particle to `field` (columns, size)."""
    place, weight = np.empty(WIDEST**3, np.int64), np.empty(WIDEST**3)
    cell, hat = np.empty((3, WIDEST), np.int64), np.empty((3, WIDEST))
    for i in range(position.shape[0]):
        n = weigh(cloud, position[i, 0], position[i, 1], position[i, 2], place, weight, cell, hat)
        for m in range(n):
            field[c, place[m]] += weight[m] * amount[i, c]


@parallel_kernel
def spread_(cloud: Cloud, position: Array, amount: Array, field: Array) -> None:
    """Add amounts (n, columns) of particles at positions (n, 3) m to the cells of `field` (columns, size).

    One thread a column, particles in their order: the same sums on any number of threads.
    """
    for c in prange(amount.shape[1]):
        spread_field(signed(c), cloud, position, amount, field)


@kernel
def gather_block(block: int, blocks: int, cloud: Cloud, position: Array, field: Array, value: Array) -> None:
    """Do a block of the particles for `interpolate_`."""
    place, weight = np.empty(WIDEST**3, np.int64), np.empty(WIDEST**3)
    cell, hat = np.empty((3, WIDEST), np.int64), np.empty((3, WIDEST))
    rows = position.shape[0]
    for i in range(block * rows // blocks, (block + 1) * rows // blocks):
        n = weigh(cloud, position[i, 0], position[i, 1], position[i, 2], place, weight, cell, hat)
        for c in range(field.shape[0]):
            total = 0.0
            for m in range(n):
                total += weight[m] * field[c, place[m]]
            value[i, c] = total


@parallel_kernel
def interpolate_(cloud: Cloud, position: Array, field: Array, value: Array) -> None:
    """Fill `value` (n, columns) with the fields (columns, size) of cells at positions (n, 3) m."""
    blocks = 8
    for block in prange(blocks):
        gather_block(signed(block), blocks, cloud, position, field, value)
