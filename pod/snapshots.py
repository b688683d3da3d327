"""The snapshot matrix W (rows, N_t), one snapshot per column, read by blocks of rows and never held whole."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from pod.errors import InputError
from pod.given import checked_columns, checked_weights, real
from pod.gram import Array, Parts, compute_device, gram_parts
from pod.ranks import ALONE, Ranks
from pod.workers import Tile, in_parallel, sum_of, workers_for

BLOCK_VALUES = 8 * 2**20  # that are read at once: 64 MiB of doubles, small beside any run
TILE_VALUES = 2**19  # that are computed with at once: 4 MiB, of which most stay in the cache
NEAR = 8.0  # positions over motion, both rms, up to which a sum over positions loses less than a digit of the motion
T = TypeVar("T")
SQUARES_FIT = (1e-290, 1e290)  # energies outside have lost digits, or overflow soon


class RowSource(Protocol):
    """Anything that hands out blocks of rows: a numpy array, a torch tensor, an HDF5 dataset, a variable of a run.

    An optional `rows_per_particle` says how many consecutive rows belong to one particle (3 for a vector; default 1).
    """

    @property
    def shape(self) -> Any:
        """Rows and snapshots."""
        ...

    def __getitem__(self, rows: slice, /) -> Any:
        """Rows of a slice, (rows, N_t)."""
        ...


class SnapshotMatrix:
    """Snapshots as products and blocks: memory is bounded by a block, whatever the size of the run.

    source: rows on disk or in memory, any real precision; sums are in double precision. block_rows: rows per block,
    default 64 MiB of doubles. columns: which snapshots, default all. weights: (rows,) of the inner product, such as
    volumes of cells, default ones. ranks: the processes among which the rows are shared out, default this one alone.
    device: where products are formed, default a GPU if there is one.
    Raises InputError for a source that is not a matrix or has no row or no snapshot, and for weights that are not
    positive.
    """

    def __init__(
        self,
        source: RowSource,
        block_rows: int | None = None,
        *,
        columns: Sequence[int] | NDArray[np.intp] | None = None,
        weights: ArrayLike | None = None,
        ranks: Ranks = ALONE,
        device: str | None = None,
    ) -> None:
        shape = tuple(getattr(source, "shape", ()))
        if len(shape) != 2 or 0 in shape:
            kind = type(source).__name__
            raise InputError(f"snapshots: {kind} of shape {shape}; give a matrix (rows, snapshots) with both above 0")
        if block_rows is not None and block_rows < 1:
            raise InputError(f"block_rows: {block_rows}; give at least 1 row, or None")
        self._source = source
        self._columns = None if columns is None else checked_columns(columns, int(source.shape[1]))
        n_times = int(source.shape[1]) if self._columns is None else len(self._columns)
        self.shape: tuple[int, int] = (int(source.shape[0]), n_times)
        self.rows_per_particle = int(getattr(source, "rows_per_particle", 1))
        self.block_rows = block_rows or max(BLOCK_VALUES // int(source.shape[1]), 1)
        self.device = compute_device(device)
        self.ranks, self.own = ranks, ranks.share(self.shape[0], self.rows_per_particle)
        self.weights = None if weights is None else checked_weights(weights, self.shape[0])
        self.near = False  # whether positions are known to be no more than some times the motion

    @property
    def total_weight(self) -> float:
        """Σ of the weights of all rows, their number where they weigh the same."""
        return float(self.shape[0] if self.weights is None else self.weights.sum())

    @property
    def in_memory(self) -> bool:
        """Whether rows need not be read from a disk."""
        return isinstance(self._source, np.ndarray | Tensor)

    def columns(self, indices: Sequence[int] | NDArray[np.intp]) -> "SnapshotMatrix":
        """View of some of the snapshots, in the order given."""
        chosen = checked_columns(indices, self.shape[1])
        if self._columns is not None:
            chosen = self._columns[chosen]
        return SnapshotMatrix(
            self._source, self.block_rows, columns=chosen, weights=self.weights, ranks=self.ranks,
            device=str(self.device),
        )  # fmt: skip

    def row_blocks(self) -> Iterator[Array]:
        """Blocks (b, N_t) of this process's rows, double precision, no weights. Raises InputError for NaN or inf."""
        for start, values in self._read():
            yield self._finite(start, values)

    def each(self, work: Callable[[Iterator[Tile]], T], as_they_are: bool = False, held: int = 0) -> list[T]:
        """Results of a piece of work done by every thread on its share of the tiles of this process's rows.

        A value that is not finite goes through, into all that is summed from it. as_they_are: tiles may be about the
        origin instead of the first snapshot, where that spares a copy. held: values of the sums that each thread holds.
        """
        workers = 1 if self.device.type != "cpu" else workers_for(self.own.stop - self.own.start, self._height, held)
        return in_parallel(lambda worker: work(self._tiles(worker, workers, as_they_are)), workers)

    @property
    def _height(self) -> int:
        return min(max(TILE_VALUES // max(self.shape[1], 1), 1), self.block_rows)  # a view may be of no snapshot

    def _tiles(self, worker: int, workers: int, as_they_are: bool) -> Iterator[Tile]:
        motion = np.empty((self._height, self.shape[1]))
        for start, block in self._read(worker, workers):
            for low in range(0, len(block), self._height):
                values = block[low : low + self._height]
                rows = slice(start + low, start + low + len(values))
                if as_they_are and self.weights is None and values.dtype == np.float64 and values.flags.carray:
                    yield Tile(rows, values, np.zeros(len(values)))
                else:
                    yield self._tile(rows, values, motion[: len(values)])

    def _tile(self, rows: slice, values: NDArray[Any], motion: Array) -> Tile:
        first = values[:, 0].astype(np.float64)
        with np.errstate(invalid="ignore", over="ignore"):  # check_energy() says where they come from
            np.subtract(values, first[:, None], out=motion, dtype=np.float64)
        if self.weights is not None:
            root = np.sqrt(self.weights[rows])
            motion *= root[:, None]
            first *= root
        return Tile(rows, motion, first)

    def _read(self, worker: int = 0, workers: int = 1) -> Iterator[tuple[int, NDArray[Any]]]:
        """Every so many blocks as the source keeps them, and where they begin; one thread alone reads ahead."""
        # memory is read by tiles: no share of a thread is larger than another's by more than one
        step = self._height if self.in_memory else self.block_rows
        starts = range(self.own.start + worker * step, self.own.stop, workers * step)
        if self.in_memory or workers > 1:
            yield from ((start, self._rows(start, step)) for start in starts)
            return
        with ThreadPoolExecutor(1) as reader:
            ahead = [(start, reader.submit(self._rows, start, step)) for start in starts[:1]]
            for following in [*starts[1:], None]:
                start, block = ahead.pop()
                values = block.result()
                if following is not None:
                    ahead.append((following, reader.submit(self._rows, following, step)))
                yield start, values

    def _rows(self, start: int, count: int) -> NDArray[Any]:
        values = self._source[start : min(start + count, self.own.stop)]
        block = real(values.detach().cpu().numpy() if isinstance(values, Tensor) else values)
        return block if self._columns is None else block[:, _as_slice(self._columns)]

    def gram(self) -> Array:
        """(W - w₀)ᵀ(W - w₀), (N_t, N_t), w₀ the first snapshot: rounding is measured against motion, not position."""
        total: Array = self.gram_groups(1)[0]
        return total

    def gram_groups(self, groups: int) -> Array:
        """Gram matrix split over groups of particles, (groups, N_t, N_t), from one pass; their sum is `gram()`."""
        found: Array = self._parts(groups, (range(self.rows_per_particle),))[0]
        return found

    def component_gram_groups(self, groups: int, components: Sequence[int]) -> Array:
        """Gram matrices of some components of a vector, likewise split: (components, groups, N_t, N_t), from one pass.

        Summed over all components they are `gram_groups()`. Raises InputError for a component that there is not.
        """
        if not set(components) <= set(range(self.rows_per_particle)):
            raise InputError(f"components: {list(components)} of {self.rows_per_particle}")
        return self._parts(groups, [(row,) for row in components])

    def _parts(self, groups: int, components: Sequence[Sequence[int]]) -> Array:
        if groups < 1:
            raise InputError(f"groups: {groups}; give at least 1")
        return self.summed(self.ranks.agreed(lambda: self._own_parts(groups, components)))

    def _own_parts(self, groups: int, components: Sequence[Sequence[int]]) -> Array:
        size, per, device = self.shape[1], self.rows_per_particle, self.device

        def own(tiles: Iterator[Tile]) -> Parts:
            return gram_parts(tiles, size, groups, components, per, device)

        parts = self.each(own, held=len(components) * groups * size**2)
        found, moved = sum_of([part.grams for part in parts]), np.any([part.moved for part in parts], axis=0)
        squares = np.einsum("cgtt->ct", found)
        for k in np.flatnonzero(moved):
            self.check_energy(squares[k], components[int(k)])
        self.near = sum(part.still for part in parts) <= NEAR**2 * float(squares.sum(axis=0).mean())
        return found

    def summed(self, values: Array) -> Array:
        """Sum of what each process has computed from its own rows."""
        return self.ranks.summed(values)

    def centred_product(self, V: Tensor) -> Tensor:
        """W̃ᵀ(W̃ V) by one pass over the rows, W̃ = W - W̄: the product that Lanczos asks for. V: (N_t, b)."""
        lead = V - V.mean(dim=0)

        def own(tiles: Iterator[Tile]) -> Array:
            total = torch.zeros_like(lead)
            for tile in tiles:
                rows = torch.from_numpy(tile.motion).to(self.device)
                total.addmm_(rows.T, rows @ lead)
            return np.asarray(total.cpu().numpy())

        total = torch.from_numpy(self.summed(sum_of(self.each(own)))).to(self.device)
        return total - total.mean(dim=0)

    def centred_square_norms(self) -> Array:
        """Squared norm of every centred snapshot, (N_t,); their sum is ‖W̃‖²_F, N_t times the total energy."""
        return self.summed(self.ranks.agreed(self._own_square_norms))

    def _own_square_norms(self) -> Array:
        def own(tiles: Iterator[Tile]) -> Array:
            total = np.zeros(self.shape[1])
            for tile in tiles:
                with np.errstate(invalid="ignore", over="ignore"):  # check_energy() says where they come from
                    moved = tile.motion - tile.motion.mean(axis=1, keepdims=True)
                    total += np.einsum("rt,rt->t", moved, moved)
            return total

        total = sum_of(self.each(own))
        self.check_energy(total)
        return total

    def check_energy(self, squares: Array, components: Sequence[int] | None = None) -> None:
        """Refuse squares (N_t,) of snapshots that are not finite, or where motion is lost in them (InputError).

        components: of a vector that the squares are of, default all.
        """
        largest = float(squares.max(initial=0.0)) if np.isfinite(squares).all() else np.inf
        if SQUARES_FIT[0] < largest < SQUARES_FIT[1]:
            return
        moved, per = 0.0, self.rows_per_particle
        for start, values in self._read():
            block = self._finite(start, values)  # stops at the first NaN or infinity, and says where
            own = np.isin(np.arange(start, start + len(block)) % per, range(per) if components is None else components)
            with np.errstate(over="ignore"):
                moved = max(moved, float(np.abs(block - block[:, :1])[own].max(initial=0.0)))
        if moved > 0.0:
            raise InputError(
                f"snapshots: they move by {moved:.3g}, whose square a double cannot hold; choose a unit in which they "
                "move by 1e-140 to 1e140"
            )

    def _finite(self, start: int, values: NDArray[Any]) -> Array:
        """Return a block in double precision, or refuse it."""
        block = np.ascontiguousarray(values, dtype=np.float64)
        if not np.isfinite(block).all():
            row, snapshot = np.argwhere(~np.isfinite(block))[0]
            particle, component = divmod(start + row, self.rows_per_particle)
            place = f" (component {component} of particle or cell {particle})" if self.rows_per_particle > 1 else ""
            raise InputError(
                f"snapshots: row {start + row}{place} of snapshot {snapshot} is {block[row, snapshot]}; "
                "repair the run or leave the snapshot out"
            )
        return block


def _as_slice(columns: NDArray[np.intp]) -> "slice | NDArray[np.intp]":
    """Evenly spaced columns as a slice, which needs no copy."""
    steps = np.unique(np.diff(columns))
    if len(steps) == 1 and steps[0] > 0 and columns[0] >= 0:
        return slice(int(columns[0]), int(columns[-1]) + 1, int(steps[0]))
    return columns


def as_matrix(W: "SnapshotMatrix | RowSource", device: str | None = None) -> SnapshotMatrix:
    """W itself if it is a snapshot matrix already, else wrapped as one."""
    return W if isinstance(W, SnapshotMatrix) else SnapshotMatrix(W, device=device)
