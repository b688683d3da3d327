"""Pressure: conjugate gradients for Σ_f A_f (p_neighbour − p_cell)/h² = rhs, preconditioned by a multigrid cycle.

The sum runs over the six faces of a cell and h is the spacing along the face's axis. The coefficients contain the
boundary conditions: a boundary face with A = 0 is a wall, one with A > 0 has p = 0 on the face itself, half a cell
away. A cell whose faces are all closed lies inside a solid and has no pressure.
"""

from typing import NamedTuple

import numba
import numpy as np
from numba import prange

from sim.coarsening import fill_levels
from sim.kernel import Array, kernel, parallel_kernel, signed
from sim.multigrid import (
    FEWEST_TO_SHARE,
    Grids,
    Level,
    cycle_,
    empty_grids,
    level_of,
    outflow,
    row_start,
    rows_of,
    strides,
    wrap_,
)
from sim.regions import Regions, fill_regions, remove_means_

SWEEPS = 1  # of the smoother before and after each coarse correction
DIRECTION, APPLY, ADVANCE, PRODUCT, START, REST = range(6)  # what can be done to rows of the vectors


class Solution(NamedTuple):
    """How a pressure was found."""

    iterations: int
    residual: float  # largest |residual| of any cell, computed afresh from the pressure; unit of rhs
    imbalance: float  # mean taken from rhs in a region without a face of known pressure, the largest of all regions


class Vectors(NamedTuple):
    """Vectors of the iteration beside those of the finest level (b: residual, x: preconditioned, rest: product)."""

    pressure: Array  # (cells,)
    rhs: Array  # (cells,)
    search: Array  # (padded cells,)
    partial: Array  # (rows,) sums or largest values of rows


@kernel
def apply_rows(level: Level, vectors: Vectors, first: int, last: int) -> None:
    """Fill the product A s with the search direction, and per row its part of s·A s."""
    sy, sz = np.uint64(strides(level)[1]), np.uint64(strides(level)[2])
    search, product, (wx, wy, wz) = vectors.search, level.rest, (level.wx, level.wy, level.wz)
    for row in range(first, last):
        begin, total = row_start(level, row), 0.0
        for i in range(level.cells[0]):
            m = np.uint64(begin + i)
            product[m] = outflow(search, wx, wy, wz, m, sy, sz)
            total += search[m] * product[m]
        vectors.partial[row] = total


@kernel
def rest_rows(level: Level, vectors: Vectors, first: int, last: int) -> None:
    """Fill b with the residual of the pressure, whose copy stands in `search`, and per row its largest value."""
    sy, sz = np.uint64(strides(level)[1]), np.uint64(strides(level)[2])
    rhs, search, b, (wx, wy, wz) = vectors.rhs, vectors.search, level.b, (level.wx, level.wy, level.wz)
    for row in range(first, last):
        begin, place, largest = row_start(level, row), row * level.cells[0], 0.0
        for i in range(level.cells[0]):
            m = np.uint64(begin + i)
            b[m] = -rhs[place + i] - outflow(search, wx, wy, wz, m, sy, sz)
            largest = max(largest, abs(b[m]))
        vectors.partial[row] = largest


@kernel
def advance_rows(level: Level, vectors: Vectors, step: float, first: int, last: int) -> None:
    """Move pressure and residual along the search direction; note the largest |residual| of each row."""
    pressure, search, b, product = vectors.pressure, vectors.search, level.b, level.rest
    for row in range(first, last):
        begin, place, largest = row_start(level, row), row * level.cells[0], 0.0
        for i in range(level.cells[0]):
            pressure[place + i] += step * search[begin + i]
            b[begin + i] -= step * product[begin + i]
            largest = max(largest, abs(b[begin + i]))
        vectors.partial[row] = largest


@kernel
def product_rows(level: Level, vectors: Vectors, first: int, last: int) -> None:
    """Fill the parts of b·x of rows."""
    b, x = level.b, level.x
    for row in range(first, last):
        begin, total = row_start(level, row), 0.0
        for m in range(begin, begin + level.cells[0]):
            total += b[m] * x[m]
        vectors.partial[row] = total


@kernel
def direct_rows(level: Level, vectors: Vectors, share: float, first: int, last: int) -> None:
    """Turn the search direction to x + share times itself."""
    x, search = level.x, vectors.search
    for row in range(first, last):
        begin = row_start(level, row)
        for m in range(begin, begin + level.cells[0]):
            search[m] = x[m] + share * search[m]


@kernel
def copy_rows(level: Level, vectors: Vectors, first: int, last: int) -> None:
    """Copy the pressure to the padded `search`."""
    pressure, search = vectors.pressure, vectors.search
    for row in range(first, last):
        begin, place = row_start(level, row), row * level.cells[0]
        for i in range(level.cells[0]):
            search[begin + i] = pressure[place + i]


@kernel
def do_vector_rows(task: int, grids: Grids, vectors: Vectors, scale: float, first: int, last: int) -> None:
    """Do one of the tasks to some rows."""
    level = level_of(grids, 0)
    if task == DIRECTION:
        direct_rows(level, vectors, scale, first, last)
    elif task == APPLY:
        apply_rows(level, vectors, first, last)
    elif task == ADVANCE:
        advance_rows(level, vectors, scale, first, last)
    elif task == PRODUCT:
        product_rows(level, vectors, first, last)
    elif task == START:
        copy_rows(level, vectors, first, last)
    else:
        rest_rows(level, vectors, first, last)


@parallel_kernel
def share_vector_rows(task: int, grids: Grids, vectors: Vectors, scale: float, rows: int, shares: int) -> None:
    """Do a task to all rows; any number of shares gives the same numbers."""
    for c in prange(shares):
        do_vector_rows(
            task, grids, vectors, scale, signed(c) * rows // shares, (signed(c) + 1) * rows // shares
        )  # fmt: skip


@kernel
def run_vectors(task: int, grids: Grids, vectors: Vectors, scale: float, threads: int) -> None:
    """Do a task to all rows."""
    rows, cells = rows_of(level_of(grids, 0)), vectors.rhs.shape[0]
    if threads == 1 or cells < FEWEST_TO_SHARE:
        do_vector_rows(task, grids, vectors, scale, 0, rows)
    else:
        share_vector_rows(task, grids, vectors, scale, rows, threads)


@kernel
def total_of(partial: Array) -> float:
    """Sum in a fixed order."""
    total = 0.0
    for value in partial:
        total += value
    return total


@kernel
def true_residual(grids: Grids, vectors: Vectors, threads: int) -> float:
    """Fill b with the residual of the pressure, by its definition, and return the largest |residual|."""
    level = level_of(grids, 0)
    run_vectors(START, grids, vectors, 0.0, threads)
    wrap_(level, vectors.search)
    run_vectors(REST, grids, vectors, 0.0, threads)
    return vectors.partial.max()  # type: ignore[no-any-return]


@kernel
def iterate(grids: Grids, vectors: Vectors, tolerance: float, most: int, threads: int) -> int:
    """Reduce the residual b to the tolerance and return how many iterations it took."""
    level = level_of(grids, 0)
    before = 0.0
    for iteration in range(most):
        cycle_(grids, SWEEPS, threads)
        run_vectors(PRODUCT, grids, vectors, 0.0, threads)
        power = total_of(vectors.partial)
        if not power > 0.0:
            return iteration
        run_vectors(DIRECTION, grids, vectors, power / before if iteration > 0 else 0.0, threads)
        wrap_(level, vectors.search)
        run_vectors(APPLY, grids, vectors, 0.0, threads)
        curvature = total_of(vectors.partial)
        if not curvature > 0.0:
            return iteration
        run_vectors(ADVANCE, grids, vectors, power / curvature, threads)
        before = power
        if vectors.partial.max() <= tolerance:
            return iteration + 1
    return most


@kernel
def solve(
    grids: Grids, regions: Regions, vectors: Vectors, tolerance: float, most: int, threads: int
) -> tuple[int, float, float]:
    """Iterate until the residual by definition is within the tolerance; start afresh where rounding kept it above."""
    imbalance = remove_means_(regions, vectors.rhs)
    if not vectors.rhs.any():
        vectors.pressure[:] = 0.0
    remove_means_(regions, vectors.pressure)
    done = 0
    residual = true_residual(grids, vectors, threads)
    while residual > tolerance and done < most:
        count = iterate(grids, vectors, tolerance, most - done, threads)
        remove_means_(regions, vectors.pressure)
        residual = true_residual(grids, vectors, threads)
        if count == 0:
            break
        done += count
    return done, residual, imbalance


class PressureSolver:
    """Solver of Σ_f A_f (p_neighbour − p_cell)/h² = rhs on one grid, whose coefficients may change."""

    def __init__(
        self, cells: tuple[int, int, int], spacing: tuple[float, float, float], periodic: tuple[bool, bool, bool]
    ) -> None:
        self.shape = cells[::-1]
        self.spacing = spacing
        self.periodic = periodic
        self.grids = empty_grids(cells, spacing, np.array(periodic, np.int64))
        self.search = np.zeros(int(self.grids.start[1]))
        self.partial = np.zeros(cells[1] * cells[2])
        self.rhs = np.zeros(self.shape)
        self.regions = Regions(
            label=np.zeros(int(np.prod(cells)), np.int64),
            floats=np.zeros(int(np.prod(cells)), np.uint8),
            mean=np.zeros(int(np.prod(cells))),
            size=np.zeros(int(np.prod(cells)), np.int64),
        )

    def set_coefficients(self, ax: Array, ay: Array, az: Array) -> None:
        """Take the coefficients A_f of all faces: ax (nz, ny, nx + 1), ay (nz, ny + 1, nx), az (nz + 1, ny, nx)."""
        padded = tuple(n + 2 for n in self.shape)
        for field, a in enumerate((ax, ay, az)):
            axis = 2 - field
            w = self.grids.fields[3 + field, : self.grids.start[1]].reshape(padded)
            inside = w[tuple(slice(1, None if d == axis else -1) for d in range(3))]
            np.divide(a, self.spacing[field] ** 2, out=inside)
            ends = np.moveaxis(inside, axis, 0)[:: max(1, self.shape[axis])]
            if not self.periodic[field]:
                ends *= 2.0  # the face is half a cell away
            elif self.shape[axis] == 1:
                ends[:] = 0.0  # a cell is its own neighbour
        fill_levels(self.grids)
        fill_regions(self.grids, self.regions)

    def solve_(self, pressure: Array, rhs: Array, tolerance: float, most: int = 200) -> Solution:
        """Replace the first guess `pressure` (nz, ny, nx) by the solution for `rhs` (nz, ny, nx), in units of A p/h².

        Stops when no cell's |residual| exceeds `tolerance` (unit of rhs) or after `most` iterations: look at the
        residual. In a region without a face of known pressure the mean of rhs is taken away and that of p is zero.
        """
        np.copyto(self.rhs, rhs)
        vectors = Vectors(pressure.reshape(-1), self.rhs.reshape(-1), self.search, self.partial)
        return Solution(*solve(self.grids, self.regions, vectors, tolerance, most, numba.get_num_threads()))
