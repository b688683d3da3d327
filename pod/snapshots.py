"""The snapshot matrix W (rows, N_t), one snapshot per column, read by blocks of rows and never held whole."""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pod.errors import InputError
from pod.gram import compute_device, gram_groups

Array = NDArray[np.float64]
BLOCK_VALUES = 8 * 2**20  # 64 MiB of doubles: large enough for full speed of the product, small beside any run


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
    default 64 MiB of doubles. columns: which snapshots, default all. device: where products are formed, default a GPU
    if there is one.
    Raises InputError for a source that is not a matrix or has no row or no snapshot.
    """

    def __init__(
        self,
        source: RowSource,
        block_rows: int | None = None,
        *,
        columns: Sequence[int] | NDArray[np.intp] | None = None,
        device: str | None = None,
    ) -> None:
        if len(source.shape) != 2 or 0 in source.shape:
            raise InputError(
                f"snapshots: shape {tuple(source.shape)}; give a matrix (rows, snapshots) with both above 0"
            )
        if block_rows is not None and block_rows < 1:
            raise InputError(f"block_rows: {block_rows}; give at least 1 row, or None")
        self._source = source
        self._columns = None if columns is None else np.asarray(columns, dtype=np.intp)
        n_times = int(source.shape[1]) if self._columns is None else len(self._columns)
        self.shape: tuple[int, int] = (int(source.shape[0]), n_times)
        self.rows_per_particle = int(getattr(source, "rows_per_particle", 1))
        self.block_rows = block_rows or max(BLOCK_VALUES // int(source.shape[1]), 1)
        self.device = compute_device(device)

    def columns(self, indices: Sequence[int] | NDArray[np.intp]) -> "SnapshotMatrix":
        """View of some of the snapshots, in the order given."""
        chosen = np.asarray(indices, dtype=np.intp)
        if self._columns is not None:
            chosen = self._columns[chosen]
        return SnapshotMatrix(self._source, self.block_rows, columns=chosen, device=str(self.device))

    def row_blocks(self) -> Iterator[Array]:
        """Blocks (b, N_t) of rows in double precision, in order. Raises InputError for NaN or infinity."""
        for start in range(0, self.shape[0], self.block_rows):
            values = self._source[start : min(start + self.block_rows, self.shape[0])]
            block = _as_numpy(values)
            if self._columns is not None:
                block = block[:, self._columns]
            block = np.ascontiguousarray(block, dtype=np.float64)
            if not np.isfinite(block).all():
                row, snapshot = np.argwhere(~np.isfinite(block))[0]
                raise InputError(
                    f"snapshots: row {start + row} of snapshot {snapshot} is {block[row, snapshot]}; "
                    "repair the run or leave the snapshot out"
                )
            yield block

    def gram(self) -> Array:
        """(W - w₀)ᵀ(W - w₀), (N_t, N_t), w₀ the first snapshot: rounding is measured against motion, not position."""
        total: Array = self.gram_groups(1)[0]
        return total

    def gram_groups(self, groups: int) -> Array:
        """Gram matrix split over groups of particles, (groups, N_t, N_t), from one pass; their sum is `gram()`."""
        if groups < 1:
            raise InputError(f"groups: {groups}; give at least 1")
        return gram_groups(self.row_blocks(), self.shape[1], groups, self.rows_per_particle, self.device)

    def centred_product(self, v: Tensor) -> Tensor:
        """W̃ᵀ(W̃ v) by one pass over the rows, W̃ = W - W̄: the product that Lanczos asks for, (N_t,)."""
        total = torch.zeros(self.shape[1], dtype=torch.float64, device=self.device)
        for block in self.row_blocks():
            rows = torch.from_numpy(block - block.mean(axis=1, keepdims=True)).to(self.device)
            total += rows.T @ (rows @ v)
        return total

    def centred_square_norms(self) -> Array:
        """Squared norm of every centred snapshot, (N_t,); their sum is ‖W̃‖²_F, N_t times the total energy."""
        total = np.zeros(self.shape[1])
        for block in self.row_blocks():
            total += np.square(block - block.mean(axis=1, keepdims=True)).sum(axis=0)
        return total


def _as_numpy(values: Any) -> NDArray[Any]:
    """Rows as a numpy array, wherever the source keeps them."""
    return np.asarray(values.detach().cpu().numpy() if isinstance(values, Tensor) else values)


def as_matrix(W: "SnapshotMatrix | RowSource", device: str | None = None) -> SnapshotMatrix:
    """W itself if it is a snapshot matrix already, else wrapped as one."""
    return W if isinstance(W, SnapshotMatrix) else SnapshotMatrix(W, device=device)
