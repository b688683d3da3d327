"""HDF5 of other codes, opened so that it leads nowhere else and declares no more than it holds."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from suffice.hdf5_memory import bounded_memory, open_hdf5
from suffice.refusal import Refusal

DENSEST = 2000  # values stored in the room of one: deflate reaches 1032
LARGEST_CHUNK = 1 << 30  # bytes that HDF5 unpacks at once
DEEPEST = 8  # links that lead to links
MAGIC = b"\x89HDF\r\n\x1a\n"


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open a file for reading. Raises `Refusal` where it is damaged, also while the block reads it."""
    try:
        with open_hdf5(path) as file:
            yield file
    except Refusal:
        raise
    except (OSError, RuntimeError, LookupError, ValueError, TypeError) as error:
        raise Refusal(f"{path} cannot be read ({str(error)[:200]}); copy it again, or write it again") from None


@bounded_memory()
def node_of(file: Any, name: str, beside: bool = False) -> Any:
    """Return a group or dataset, None where there is none; `beside` allows links to files in the same folder.

    Raises `Refusal` where it leads out of the file, holds no numbers, or declares more of them than the file can hold.
    """
    node = _walk(file, file, name, beside, DEEPEST)
    return _checked(node) if isinstance(node, h5py.Dataset) else node


def _walk(file: Any, node: Any, name: str, beside: bool, depth: int) -> Any:
    for part in [part for part in name.split("/") if part]:
        link = node.get(part, getlink=True) if isinstance(node, h5py.Group) else None
        if link is None:
            return None
        if isinstance(link, h5py.SoftLink) and depth > 0:
            start = node.file if link.path.startswith("/") else node
            node = _walk(file, start, link.path, beside, depth - 1)
        elif isinstance(link, h5py.ExternalLink) and beside and _lies_beside(file, link.filename):
            # opened here, not by following the link: its path in there may lead on
            other = open_hdf5(Path(file.filename).parent / link.filename)
            node = _walk(other, other, link.path, False, depth - 1)
        elif isinstance(link, h5py.HardLink):
            node = node[part]
        else:
            raise Refusal(f"{file.filename}: {name} is a link that leads out of the file; copy the data into it")
    return node


def _lies_beside(file: Any, name: str) -> bool:
    path = Path(file.filename).parent / name
    return Path(name).name == name and path.is_file() and not path.is_symlink()


def _checked(data: Any) -> Any:
    where = f"{data.file.filename}: {data.name}"
    if data.is_virtual or data.external:
        raise Refusal(f"{where} lies in another file; copy the data into it")
    if data.dtype.kind not in "fiu":
        raise Refusal(f"{where} holds {data.dtype}, not numbers; say with --map which dataset is meant")
    chunk = data.dtype.itemsize
    for edge in data.chunks or ():
        chunk *= int(edge)
    stored = data.id.get_storage_size()
    if chunk > LARGEST_CHUNK or data.nbytes > DENSEST * stored:
        raise Refusal(
            f"{where} declares {data.nbytes} bytes and holds {stored} in chunks of {chunk}; write it again, in chunks "
            "of a snapshot at most"
        )
    return data
