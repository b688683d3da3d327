"""Open HDF5 and look names up in it within bounded memory.

HDF5 follows the list of free places in a group's heap until it ends. In a damaged or hostile file that list may be a
circle, and HDF5 2.0 keeps what it met until no memory is left.
"""

import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import RLock

import h5py

MOST = 1 << 29  # bytes: a group of a million names takes a fifth
_ONE_AT_A_TIME = RLock()


@contextmanager
def bounded_memory() -> Iterator[None]:
    """Let the process take no more than `MOST` bytes (Linux); also a decorator. HDF5 then says that memory failed.

    For names and shapes only, which are soon found: other threads are held to it, too. Raises RuntimeError where
    Python itself gets no memory.
    """
    if sys.platform != "linux":
        yield
        return
    with _ONE_AT_A_TIME:
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        most = _address_space() + MOST
        if soft == resource.RLIM_INFINITY or most < soft:
            resource.setrlimit(resource.RLIMIT_AS, (most, hard))
        try:
            yield
        except MemoryError:
            raise RuntimeError(f"its structure needs more than {MOST >> 20} MiB of memory") from None
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@bounded_memory()
def open_hdf5(path: Path, *, locking: bool | None = None) -> h5py.File:
    """Open a file for reading. Raises OSError or RuntimeError where it is not HDF5, or damaged."""
    return h5py.File(path, "r", locking=locking)


@bounded_memory()
def names_in(group: h5py.Group) -> list[str]:
    """Return the names in a group. Raises RuntimeError where it is damaged."""
    return list(group)


def _address_space() -> int:
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[0]
    return int(pages) * resource.getpagesize()
