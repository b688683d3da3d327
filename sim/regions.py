"""Regions of connected cells: in one that no face of known pressure touches, pressure has no level of its own."""

from typing import NamedTuple

from sim.kernel import Array, Flags, Indices, inlined, kernel
from sim.multigrid import Grids, Level, level_of, row_start, rows_of, strides


class Regions(NamedTuple):
    """A region bears the number of its first cell; closed cells belong to none."""

    label: Indices  # (cells,) region of each cell, -1 where it is closed
    floats: Flags  # (cells,) of the region with this number: its pressure is free up to a constant
    size: Indices  # (cells,) cells of the region
    mean: Array  # (cells,) room for the mean of each region


@inlined
def first_of(label: Indices, cell: int) -> int:
    """Return the first cell of a region, and shorten the way to it."""
    while label[cell] != cell:
        label[cell] = label[label[cell]]
        cell = label[cell]
    return cell


@inlined
def join_(label: Indices, a: int, b: int) -> None:
    """Make the regions of two cells one."""
    first, second = first_of(label, a), first_of(label, b)
    label[max(first, second)] = min(first, second)


@kernel
def join_inside_(level: Level, regions: Regions) -> None:
    """Join all cells that share an open face inside the grid."""
    label, (nx, ny, _) = regions.label, level.cells
    wx, wy, wz = level.wx, level.wy, level.wz
    for row in range(rows_of(level)):
        j, begin, cell = row % ny, row_start(level, row), row * nx
        for i in range(nx):
            if i > 0 and wx[begin + i] > 0.0:
                join_(label, cell + i, cell + i - 1)
            if j > 0 and wy[begin + i] > 0.0:
                join_(label, cell + i, cell + i - nx)
            if row >= ny and wz[begin + i] > 0.0:
                join_(label, cell + i, cell + i - nx * ny)


@kernel
def join_ends_(level: Level, regions: Regions, w: Array, axis: int) -> None:
    """Join cells across the seam of a periodic axis; elsewhere an open end gives the pressure of a region its level."""
    label, n, s = regions.label, level.cells, strides(level)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    steps = (1, n[0], n[0] * n[1])
    behind = (n[axis] - 1) * steps[axis]
    for i in range(n[a]):
        for j in range(n[b]):
            cell, m = i * steps[a] + j * steps[b], (i + 1) * s[a] + (j + 1) * s[b] + s[axis]
            if level.periodic[axis]:
                if w[m] > 0.0:
                    join_(label, cell, cell + behind)
                continue
            if w[m] > 0.0:
                regions.floats[cell] = 0
            if w[m + n[axis] * s[axis]] > 0.0:
                regions.floats[cell + behind] = 0


@kernel
def fill_regions(grids: Grids, regions: Regions) -> None:
    """Find the regions of the finest level."""
    level = level_of(grids, 0)
    label, nx = regions.label, level.cells[0]
    for cell in range(label.shape[0]):
        label[cell] = cell
    regions.size[:] = 0
    regions.floats[:] = 1
    join_inside_(level, regions)
    join_ends_(level, regions, level.wx, 0)
    join_ends_(level, regions, level.wy, 1)
    join_ends_(level, regions, level.wz, 2)
    for row in range(rows_of(level)):
        begin = row_start(level, row)
        for i in range(nx):
            cell = row * nx + i
            first = label[label[cell]]  # that of a lower cell is already the first of the region
            label[cell] = first if level.inverse[begin + i] > 0.0 else -1
            regions.size[first] += 1
            regions.floats[first] &= regions.floats[cell]


@kernel
def remove_means_(regions: Regions, values: Array) -> float:
    """Take their mean from the values (cells,) of every floating region and return the largest; zero closed cells."""
    label, mean = regions.label, regions.mean
    mean[:] = 0.0
    for cell in range(label.shape[0]):
        if label[cell] >= 0:
            mean[label[cell]] += values[cell]
    largest = 0.0
    for region in range(mean.shape[0]):
        mean[region] *= regions.floats[region] / max(regions.size[region], 1)
        if abs(mean[region]) > abs(largest):
            largest = mean[region]
    for cell in range(label.shape[0]):
        values[cell] = values[cell] - mean[label[cell]] if label[cell] >= 0 else 0.0
    return largest
