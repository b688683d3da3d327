"""Rows of the snapshot matrix W, read from a run block by block."""

import math
from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import Quantity
from suffice.refusal import Refusal

PASSES = 2  # over the rows, that a decomposition takes at least


class Variable:
    """One variable of a run as the matrix W (rows, snapshots): one row per particle or cell, one column per snapshot.

    A vector has three rows per particle: x, y, z of the first, then of the second. `W[a:b]` reads these rows of every
    complete snapshot, in the stored precision; memory is that of the rows asked for, and of one snapshot of them.
    """

    def __init__(
        self,
        dataset: Any,
        quantity: Quantity,
        axis: int | None,
        n: int,
        n_snapshots: int,
        check_length: Callable[[], None],
    ) -> None:
        self.unit = quantity.unit
        self.rows_per_particle = quantity.components if axis is None else 1
        self.shape = (n * self.rows_per_particle, n_snapshots)
        self.dtype = np.dtype(dataset.dtype)
        self._dataset, self._quantity, self._axis, self._n = dataset, quantity, axis, n
        self._check_length = check_length

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Return the rows of this slice, of every snapshot, (rows, snapshots). Raises `Refusal` on a damaged file."""
        start, stop, step = rows.indices(self.shape[0])
        if step != 1:
            raise ValueError(f"rows are read as a block, with step 1, not {step}")
        stop, per = max(start, stop), self.rows_per_particle
        first, last = start // per, -(-stop // per)
        block = np.empty((self.shape[1], last - first, per), self.dtype)
        for k, snapshot in enumerate(block):
            self._read_into(snapshot, k, first, last)
        self._check_length()
        return block.reshape(len(block), (last - first) * per)[:, start - first * per : stop - first * per].T

    def _read_into(self, out: NDArray[Any], k: int, first: int, last: int) -> None:
        read = self._cells if self._quantity.of_fluid else self._particles
        try:
            values = read(k, first, last)
        except OSError as error:
            name = self._quantity.dataset
            raise Refusal(
                f"snapshot {k} of {name} cannot be read ({error}): the file is damaged, make it again"
            ) from None
        out[:] = values if self._axis is None else values[:, self._axis, None]

    def _particles(self, k: int, first: int, last: int) -> NDArray[Any]:
        values: NDArray[Any] = self._dataset[k * self._n + first : k * self._n + last]
        return values

    def _cells(self, k: int, first: int, last: int) -> NDArray[Any]:
        """Read the planes of cells in which rows first to last lie, and keep those rows, (cells, components)."""
        sizes = self._dataset.shape[1:4]
        lead = next(
            (axis for axis in range(3) if sizes[axis] > 1), 2
        )  # a 2-D grid is one cell deep: its planes are lines
        plane = math.prod(sizes[lead + 1 :])
        low, high = first // plane, -(-last // plane)
        values = self._dataset[(k, *[0] * lead, slice(low, high))]
        inside: NDArray[Any] = values.reshape(-1, self._quantity.components)[first - low * plane : last - low * plane]
        return inside


class Counted:
    """A variable that tells whenever rows are read how many have been, of how many.

    Two passes over the rows are expected, inner products and modes. Where they are read more often, as by the route
    `block` at every Lanczos step, all is what the passes begun so far will have read.
    share: how many rows this process reads in a pass.
    """

    def __init__(self, variable: Variable, share: int, advance: Callable[[int, int], None]) -> None:
        self.shape, self.rows_per_particle = variable.shape, variable.rows_per_particle
        self._variable, self._share, self._advance = variable, share, advance
        self._done, self._lock = 0, Lock()  # blocks are read by several threads

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Return the rows as the variable has them."""
        found = self._variable[rows]
        with self._lock:
            self._done += len(found)
            self._advance(self._done, self._share * max(PASSES, math.ceil(self._done / self._share)))
        return found
