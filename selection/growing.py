"""Snapshots that arrive one by one, and their inner products so far."""

from collections.abc import Iterator
from copy import copy

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from selection.errors import InputError

Array = NDArray[np.float64]
TILE_VALUES = 2**20  # numbers that are computed with at once, in double precision: 8 MiB


class GrowingSnapshots:
    """A snapshot matrix W (rows, n) whose columns arrive one by one; `sweep` takes it at any moment.

    Inner products are about the first snapshot, (w_i - w₀)·(w_j - w₀), for each of `groups` groups of particles, dealt
    in turn. They are formed when they are asked for: one matrix product of the snapshots that are new with all there
    are, 2 rows n (n - m) operations where those of the first m are known. Columns are held in `dtype`, the precision
    they are stored in, so that the products are those of the file; at most `most` of them, whose memory is taken as
    they come. rows_per_particle: rows that belong together.
    """

    def __init__(
        self, rows: int, most: int, rows_per_particle: int = 1, dtype: DTypeLike = np.float64, groups: int = 10
    ) -> None:
        self.rows_per_particle, self.groups = rows_per_particle, groups
        group = np.arange(rows) // rows_per_particle % groups
        self._order = np.argsort(group, kind="stable")  # rows of a group side by side
        self._borders = np.searchsorted(group[self._order], np.arange(groups + 1))
        self._columns = np.zeros((most, rows), dtype)
        self._parts = np.zeros((groups, most, most))
        self._sum = np.zeros((most, most))  # of the parts
        self._n = self._known = 0

    @staticmethod
    def bytes_needed(rows: int, most: int, dtype: DTypeLike, groups: int = 10) -> int:
        """Return the memory that so many snapshots take, with their products and the sum of these."""
        return most * rows * np.dtype(dtype).itemsize + (groups + 1) * most**2 * 8

    @property
    def shape(self) -> tuple[int, int]:
        """Rows, and snapshots so far."""
        return self._columns.shape[1], self._n

    def append(self, column: ArrayLike) -> None:
        """Add a snapshot (rows,). Raises InputError where a value is not finite, or there is no room for it."""
        values = np.asarray(column)
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise InputError(f"W: row {row}, snapshot {self._n} is {values[row]}; repair or drop it")
        if self._n == len(self._columns):
            raise InputError(f"W: there is room for {self._n} snapshots; make room for more")
        self._columns[self._n] = values[self._order]
        self._n += 1

    def first(self, n: int) -> "GrowingSnapshots":
        """Return the first n of these snapshots as they were: nothing is copied, and products are not formed anew."""
        self._grow()
        some = copy(self)
        some._n = some._known = n
        return some

    def gram(self) -> Array:
        """Return (W - w₀)ᵀ(W - w₀), (n, n): a view, of which nothing changes later."""
        self._grow()
        return self._sum[: self._n, : self._n]

    def gram_groups(self, groups: int) -> Array:
        """Return the same split over the groups of particles, (groups, n, n): a view likewise."""
        if groups != self.groups:
            raise InputError(f"groups: {groups}; these snapshots were dealt to {self.groups}")
        self._grow()
        return self._parts[:, : self._n, : self._n]

    def row_blocks(self) -> Iterator[Array]:
        """Blocks (b, n) of W in double precision; rows in the order of the groups."""
        for low, high in self._tiles(0, self.shape[0]):
            yield np.ascontiguousarray(self._columns[: self._n, low:high].T, dtype=np.float64)

    def _grow(self) -> None:
        """Form the products of the snapshots that are new, in fixed order."""
        m, n = self._known, self._n
        if m == n:
            return
        for part, first, last in zip(self._parts, self._borders[:-1], self._borders[1:], strict=True):
            new = np.zeros((n - m, n))
            for low, high in self._tiles(int(first), int(last)):
                motion = self._columns[:n, low:high].astype(np.float64)
                motion -= motion[0].copy()
                new += motion[m:] @ motion.T
            new[:, m:] = 0.5 * (new[:, m:] + new[:, m:].T)
            part[m:n, :n], part[:n, m:n] = new, new.T
        self._sum[m:n, :n] = self._parts[:, m:n, :n].sum(axis=0)
        self._sum[:n, m:n] = self._sum[m:n, :n].T
        self._known = n

    def _tiles(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        step = max(TILE_VALUES // max(self._n, 1), 1)
        for low in range(first, last, step):
            yield low, min(low + step, last)
