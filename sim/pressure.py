"""Pressure: conjugate gradients for Σ_f A_f (p_neighbour − p_cell)/h² = rhs, preconditioned by a multigrid cycle.

The sum runs over the six faces of a cell and h is the spacing along the face's axis. The coefficients contain the
boundary conditions: a boundary face with A = 0 is a wall, one with A > 0 has p = 0 on the face itself, half a cell
away. A cell whose faces are all closed lies inside a solid and has no pressure.

In a region of connected cells that no face of known pressure touches, pressure has no level of its own.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.coarsening import fill_levels
from sim.kernel import Array, Indices, kernel
from sim.multigrid import INVERSE, WX, WY, WZ, B, X, cycle_, empty_levels, layers, outflow, wrap_


class Solution(NamedTuple):
    """How a pressure was found."""

    iterations: int
    residual: float  # largest |residual| of any cell, computed afresh from the pressure; unit of rhs
    imbalance: float  # mean taken from rhs in a region without a face of known pressure, the largest of all regions


@kernel
def apply_(fields: Array, x: Array, product: Array, nx: int, ny: int, nz: int) -> float:
    """Fill the product A x of a padded vector and return x·A x."""
    wx, wy, wz, total = fields[WX], fields[WY], fields[WZ], 0.0
    sy, sz = np.uint64(nx + 2), np.uint64((nx + 2) * (ny + 2))
    for k in range(1, nz + 1):
        for j in range(1, ny + 1):
            m = np.uint64((k * (ny + 2) + j) * (nx + 2) + 1)
            part = 0.0
            for _ in range(nx):
                product[m] = outflow(x, wx, wy, wz, m, sy, sz)
                part += x[m] * product[m]
                m += np.uint64(1)
            total += part
    return total


@kernel
def advance_(pressure: Array, b: Array, search: Array, product: Array, step: float) -> float:
    """Move pressure and residual along the search direction and return the largest |residual|."""
    largest = 0.0
    for m in range(b.shape[0]):
        pressure[m] += step * search[m]
        b[m] -= step * product[m]
        largest = max(largest, abs(b[m]))
    return largest


@kernel
def join_(label: Indices, fields: Array, nx: int, ny: int, nz: int) -> None:
    """Give all cells that open faces join the number of one of them; `label` says what the ghosts are one with."""
    steps = (1, nx + 2, (nx + 2) * (ny + 2))
    for k in range(1, nz + 2):
        for j in range(1, ny + 2):
            for i in range(1, nx + 2):
                m = k * steps[2] + j * steps[1] + i
                for axis in range(3):
                    if fields[WX + axis, m] == 0.0:
                        continue
                    a, b = m, m - steps[axis]
                    while label[a] != a:  # the first of a region is its own; shorten the way to it
                        label[a] = label[label[a]]
                        a = label[a]
                    while label[b] != b:
                        label[b] = label[label[b]]
                        b = label[b]
                    label[max(a, b)] = min(a, b)
    for m in range(label.shape[0]):
        label[m] = label[label[m]]  # that of a lower cell is already the first of the region


class PressureSolver:
    """Solver of Σ_f A_f (p_neighbour − p_cell)/h² = rhs on one grid, whose coefficients may change."""

    def __init__(
        self, cells: tuple[int, int, int], spacing: tuple[float, float, float], periodic: tuple[bool, bool, bool]
    ) -> None:
        self.cells = cells
        self.spacing = spacing
        self.periodic = periodic
        self.levels = empty_levels(cells, spacing, periodic)
        self.pressure, self.rhs, self.search, self.product = np.zeros((4, self.levels[0].fields.shape[1]))  # padded
        self.label = np.zeros(self.rhs.size, np.int64)  # region of each padded cell, 0 for cells that belong to none
        self.size = np.full(1, np.inf)  # cells of each region; the mean of "region" 0 is then zero

    def set_coefficients(self, ax: Array, ay: Array, az: Array) -> None:
        """Take the coefficients A_f of all faces: ax (nz, ny, nx + 1), ay (nz, ny + 1, nx), az (nz + 1, ny, nx)."""
        for axis, a in enumerate((ax, ay, az)):
            w = layers(self.levels[0].fields[WX + axis], self.cells, axis)[1:]
            np.divide(np.moveaxis(a, 2 - axis, 0), self.spacing[axis] ** 2, out=w)
            if not self.periodic[axis]:
                w[0] *= 2.0  # the face is half a cell away
                w[-1] *= 2.0
        fill_levels(self.levels)
        self._fill_regions()

    def _fill_regions(self) -> None:
        """Give numbers from 1 to the regions whose pressure is free up to a constant."""
        level, number = self.levels[0], np.arange(self.label.size)
        first = np.zeros_like(number)  # ghosts are one with cell 0: behind an open face the pressure is known
        self._inside(first)[:] = self._inside(number)
        for axis in range(3):
            if self.periodic[axis]:
                along = layers(first, self.cells, axis)
                along[0], along[-1] = along[-2], along[1]
        join_(first, level.fields, *self.cells)
        first[level.fields[INVERSE] == 0.0] = 0
        self.label = (np.cumsum(first == number) - 1)[first]
        self.size = np.bincount(self.label).astype(float)
        self.size[0] = np.inf

    def _inside(self, field: NDArray[Any]) -> NDArray[Any]:
        """Return the cells of a padded field, shape (nz, ny, nx)."""
        return layers(field, self.cells, 2)[1:-1]

    def _remove_means_(self, values: Array) -> float:
        """Take their mean from the values of every region whose pressure is free, and return the largest."""
        if self.size.size == 1:
            return 0.0
        means = np.bincount(self.label, values) / self.size
        values -= means[self.label]
        return float(means[np.abs(means).argmax()])

    def _fill_residual(self) -> float:
        """Fill b with the residual of the pressure, by its definition, and return the largest |residual|."""
        level = self.levels[0]
        wrap_(level, self.pressure)
        apply_(level.fields, self.pressure, self.product, *self.cells)
        b = level.fields[B]
        np.negative(self.rhs, out=b)
        b -= self.product
        return float(np.abs(b).max())

    def _iterate_(self, tolerance: float, most: int) -> int:
        """Reduce the residual b to the tolerance and return how many iterations it took."""
        level, search, product = self.levels[0], self.search, self.product
        b, x = level.fields[B], level.fields[X]
        before = np.inf
        search[:] = 0.0
        for iteration in range(most):
            cycle_(self.levels)
            power = float(np.multiply(b, x, out=product).sum())
            if not power > 0.0:
                return iteration
            search *= power / before
            search += x
            wrap_(level, search)
            curvature = apply_(level.fields, search, product, *self.cells)
            if not curvature > 0.0:
                return iteration
            if advance_(self.pressure, b, search, product, power / curvature) <= tolerance:
                return iteration + 1
            before = power
        return most

    def solve_(self, pressure: Array, rhs: Array, tolerance: float, most: int = 200) -> Solution:
        """Replace the first guess `pressure` (nz, ny, nx) by the solution for `rhs` (nz, ny, nx), in units of A p/h².

        Stops when no cell's |residual| exceeds `tolerance` (unit of rhs) or after `most` iterations: look at the
        residual. In a region without a face of known pressure the mean of rhs is taken away and that of p is zero.
        """
        is_open = self._inside(self.levels[0].fields[INVERSE]) > 0.0
        self._inside(self.rhs)[:] = np.where(is_open, rhs, 0.0)
        self._inside(self.pressure)[:] = np.where(is_open, pressure, 0.0)
        imbalance = self._remove_means_(self.rhs)
        if not self.rhs.any():
            self.pressure[:] = 0.0
        self._remove_means_(self.pressure)
        done, residual = 0, self._fill_residual()
        while residual > tolerance and done < most:  # start afresh where rounding kept the residual above
            count = self._iterate_(tolerance, most - done)
            self._remove_means_(self.pressure)
            residual = self._fill_residual()
            if count == 0:
                break
            done += count
        pressure[:] = np.where(is_open, self._inside(self.pressure), 0.0)
        return Solution(done, residual, imbalance)
