"""Inner products of the snapshots: all that a choice of Δτ needs to know about the rows."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from selection.errors import InputError

Array = NDArray[np.float64]
EPSILON = float(np.finfo(np.float64).eps)
SQUARES_FIT = (1e-290, 1e290)  # sums of squares outside have lost digits, or overflow soon


class Snapshots(Protocol):
    """A snapshot matrix W (rows, N_t) known by its products; it may stream from disk or live on other machines.

    `gram()` is (W - a)ᵀ(W - a) in double precision for any fixed snapshot a; the first one is best, because then
    rounding is measured against the motion and not against the position. `row_blocks()` yields W by blocks of
    rows. An optional `gram_groups(k)` (k, N_t, N_t) splits the sum over the particles into k groups. Where the blocks
    are those of one process of several, `shape` and `gram()` are those of all, and `summed(x)` adds up over them.
    """

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and snapshots."""
        ...

    def gram(self) -> Any:
        """(N_t, N_t) inner products."""
        ...

    def row_blocks(self) -> Iterable[Any]:
        """Blocks (some rows, N_t) of W."""
        ...


class ArraySnapshots:
    """A snapshot matrix held in memory.

    array: (rows, N_t); rows_per_particle rows belong together when particles are resampled. Raises InputError for an
    array that is not a matrix or holds a value that is not finite.
    """

    def __init__(self, array: Any, rows_per_particle: int = 1, block_rows: int = 16384) -> None:
        if np.ma.is_masked(array) or np.iscomplexobj(array):
            raise InputError("W: complex or masked values; give real ones, and fill or leave out what is masked")
        self._array = np.asarray(array)
        if self._array.ndim != 2:
            raise InputError(f"W: {self._array.ndim} dimension(s); give a matrix (rows, snapshots)")
        self.rows_per_particle = rows_per_particle
        self._block_rows = block_rows
        self.shape: tuple[int, int] = (self._array.shape[0], self._array.shape[1])

    def row_blocks(self) -> Iterator[Array]:
        """Blocks of rows in double precision, checked to be finite."""
        for start in range(0, self.shape[0], self._block_rows):
            block = np.asarray(self._array[start : start + self._block_rows], dtype=np.float64)
            if not np.isfinite(block).all():
                row, column = np.argwhere(~np.isfinite(block))[0]
                raise InputError(f"W: row {start + row}, snapshot {column} is {block[row, column]}; repair or drop it")
            yield block

    def gram(self) -> Array:
        """(W - w₀)ᵀ(W - w₀), summed by row blocks in fixed order."""
        return np.asarray(self.gram_groups(1)[0])

    def gram_groups(self, groups: int) -> Array:
        """Gram matrix split over groups of particles, dealt in turn: (groups, N_t, N_t).

        Raises InputError where the rows move by more or less than has a square in double precision.
        """
        total = np.zeros((groups, self.shape[1], self.shape[1]))
        start, moved = 0, 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for block in self.row_blocks():
                motion = block - block[:, :1]
                moved = max(moved, float(np.abs(motion).max(initial=0.0)))
                group = (start + np.arange(len(block))) // self.rows_per_particle % groups
                for g in range(groups):
                    part = motion[group == g]
                    total[g] += part.T @ part
                start += len(block)
        if moved > 0.0 and not SQUARES_FIT[0] < np.einsum("gtt->gt", total).max() < SQUARES_FIT[1]:
            raise InputError(
                f"W: it moves by {moved:.3g}, whose square a double cannot hold; choose a unit in which it moves by "
                "1e-140 to 1e140"
            )
        return total


class InnerProducts(NamedTuple):
    """What one pass over the rows leaves behind, all that verdicts rest on.

    gram: (N_t, N_t) (W - a)ᵀ(W - a), symmetric, double precision, in the unit of W squared and summed over the rows,
    not averaged; a is any fixed snapshot, best the first one: rounding is ε times the trace. It may grow: w_k - a
    against all before it is row and column k. groups: (k, N_t, N_t) the same, about the same a, of k ≥ 2 disjoint
    groups of particles, as equal as they can be (particle i in group i mod k) and of two particles at least; they sum
    to gram. None leaves out the interval of K_f. rows: of W, over which mean squares are taken; 3 a particle for a
    vector. Those of several components, or processes, add up: gram, groups and rows each.
    """

    gram: Array
    groups: Array | None
    rows: int


def as_snapshots(W: Any) -> Snapshots:
    """W itself where it knows its products, else the array (rows, N_t) wrapped. Raises InputError for neither."""
    if all(hasattr(W, name) for name in ("shape", "gram", "row_blocks")):
        return cast(Snapshots, W)
    try:
        return ArraySnapshots(W)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("W: neither an array (rows, snapshots) nor an object with gram() and row_blocks()") from error


def inner_products(W: Snapshots, groups: int | None) -> InnerProducts:
    """One pass over the rows: the Gram matrix and, where W can, its parts per group of particles.

    What is not finite in W, or overflows, is so in them.
    """
    rows = W.shape[0]
    particles = rows // int(getattr(W, "rows_per_particle", 1))
    parts: Array | None = None
    if groups is not None and particles >= 2 * groups and hasattr(W, "gram_groups"):
        parts = np.asarray(W.gram_groups(groups), dtype=np.float64)
    gram = np.asarray(W.gram(), dtype=np.float64) if parts is None else np.asarray(parts.sum(axis=0), dtype=np.float64)
    return InnerProducts(gram, parts, rows)


def square_root(W: Snapshots, gram: Array) -> Array:
    """F with FᵀF = (W - w₀)ᵀ(W - w₀), accurate to ε‖W‖ itself and not only in its square; (N_t, N_t).

    One more pass over the rows. G = VΛVᵀ from the first pass only serves to scale: B = (W - w₀) V Λ^-½ has columns of
    about unit length, so its own inner products BᵀB = U M Uᵀ lose nothing, and F = M^½ Uᵀ Λ^½ Vᵀ (a QR factor in two
    matrix products, like CholeskyQR2).
    """
    square, vectors = np.linalg.eigh(gram)
    # below this an eigenvalue of G is rounding; scaling by it leaves a short column, which is harmless
    scale = np.sqrt(np.maximum(square, EPSILON * len(gram) * max(square[-1], 0.0)))
    if not scale.any():
        return np.zeros_like(gram)
    scaled = np.zeros_like(gram)
    for block in W.row_blocks():
        values = np.asarray(block, dtype=np.float64)
        rows = (values - values[:, :1]) @ (vectors / scale)
        scaled += rows.T @ rows
    if hasattr(W, "summed"):
        scaled = np.asarray(W.summed(scaled))
    middle, turn = np.linalg.eigh(scaled)
    return np.asarray((np.sqrt(np.maximum(middle, 0.0)) * turn).T * scale @ vectors.T)
