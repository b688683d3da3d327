"""The one door to compiled code: decorators that own the on-disk cache.

Numba keys its cache by the file of the outermost function only, so an edit in a law called from another file would
silently run the old machine code. Here the cache folder is named by a digest of every file of the package and of
numba's version: any edit starts a fresh one.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import config as numba_config
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.uint8]
Images = NDArray[np.int8]
Vector = tuple[float, float, float]
Partners = NDArray[np.uint32]  # unsigned: numba then leaves out the code for negative indices

config: Any = numba_config  # its settings are made at import time, out of a type checker's sight
# numba would take TBB first where it is installed: as fast on idle cores, but its waiting threads starve the working
# ones where other programs run (a step of 20,000 beads took 12 ms instead of 1)
LAYERS = ["omp", "workqueue", "tbb"]
if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    config.THREADING_LAYER_PRIORITY = LAYERS

F = TypeVar("F", bound=Callable[..., Any])


def _cache_folder() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = home / "suffice" / f"numba-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # a read-only home: compile again in every process rather than not at all
        return tempfile.mkdtemp(prefix="suffice-numba-")
    return str(folder)


_FOLDER = _cache_folder()


def _compiled(function: F, **options: Any) -> F:
    previous = config.CACHE_DIR
    config.CACHE_DIR = _FOLDER
    try:
        compiled: F = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    finally:
        config.CACHE_DIR = previous
    return compiled


def most_threads() -> int:
    """Return the largest number of threads that this process can use."""
    return int(config.NUMBA_NUM_THREADS)


@contextmanager
def threads_for(pieces: int) -> Iterator[None]:
    """Use no more threads than there are pieces of work: an idle one costs a hand-over every step."""
    allowed = numba.get_num_threads()
    numba.set_num_threads(max(1, min(allowed, pieces)))
    try:
        yield
    finally:
        numba.set_num_threads(allowed)


def kernel(function: F) -> F:
    """Compile a function for one thread; callers and type checkers see its own signature."""
    return _compiled(function)


def inlined(function: F) -> F:
    """Compile a short function into each of its callers, as laws evaluated for every contact must be."""
    return _compiled(function, forceinline=True)


def parallel_kernel(function: F) -> F:
    """Compile a function whose `prange` loops run on all threads of `numba.set_num_threads`.

    The body of such a loop hands named tuples to an ordinary kernel and never writes to their arrays itself: numba
    loses those writes (numba #5872, #10338).
    """
    return _compiled(function, parallel=True)


@inlined
def signed(index: int) -> int:
    """Give the index of a parallel loop, which is unsigned there, the type of every other one.

    Otherwise numba compiles what the loop calls twice.
    """
    return np.int64(index)  # type: ignore[return-value]


@inlined
def add_to_row(rows: Array, i: int, scale: float, vector: Vector) -> None:
    """Add a multiple of a vector to row i of `rows` (n, 3)."""
    rows[i, 0] += scale * vector[0]
    rows[i, 1] += scale * vector[1]
    rows[i, 2] += scale * vector[2]


@inlined
def difference(rows: Array, i: int, j: int) -> Vector:
    """Row i less row j of `rows` (n, 3)."""
    return rows[i, 0] - rows[j, 0], rows[i, 1] - rows[j, 1], rows[i, 2] - rows[j, 2]
