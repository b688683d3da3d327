"""Arrays of numpy in an .npz, read member by member and row by row, without unpickling anything."""

import math
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from suffice.refusal import Refusal

# the last two by numpy's parser of a header
DAMAGES = (OSError, zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, SyntaxError, TokenError)
REMEDY = "write it again with np.savez"
AT_ONCE = 2**26  # bytes of a snapshot, up to which anything may be packed however well
DENSEST = 100  # bytes packed into one, that numbers of a simulation do not reach: positions differ in their last digits


class Member(NamedTuple):
    """One array as its header declares it."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class Npz:
    """The arrays of one .npz by name. Raises `Refusal` where it is damaged or holds anything but numbers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._archive() as archive:
            names = [info.filename for info in archive.infolist()]
            self.members = {name.removesuffix(".npy"): self._member(archive, name) for name in names}

    @property
    def names(self) -> list[str]:
        """The names of its arrays."""
        return list(self.members)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of an array. Raises `Refusal` where there is none of that name."""
        if name not in self.members:
            raise Refusal(f"{self.path} has no array {name}; it has {', '.join(self.names)}: say which with --map")
        return self.members[name].shape

    def whole(self, name: str) -> NDArray[Any]:
        """Return an array."""
        shape = self.shape(name)
        return next(self._blocks(name, 1, shape)) if math.prod(shape) else np.zeros(shape)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Yield an array along its first axis, holding one part in memory."""
        shape = self.shape(name)
        return self._blocks(name, shape[0], shape[1:])

    def _blocks(self, name: str, n: int, shape: tuple[int, ...]) -> Iterator[NDArray[Any]]:
        dtype = self.members[name].dtype
        size = math.prod(shape) * dtype.itemsize
        with self._archive() as archive, archive.open(f"{name}.npy") as stream:
            if size > AT_ONCE and n * size > DENSEST * archive.getinfo(f"{name}.npy").compress_size:
                raise Refusal(f"{self.path}: {name} unpacks to over {DENSEST} times its size; write it with np.savez")
            _header(stream)
            for _ in range(n):
                if len(raw := stream.read(size)) < size:
                    raise Refusal(f"{self.path}: {name} ends early; {REMEDY}")
                yield np.frombuffer(raw, dtype).reshape(shape)

    def _member(self, archive: zipfile.ZipFile, name: str) -> Member:
        where = f"{self.path}: {name}"
        if not name.endswith(".npy"):
            raise Refusal(f"{where} is no array; {REMEDY}")
        with archive.open(name) as stream:
            shape, by_column, dtype = _header(stream)
            begins = stream.tell()
        if dtype.hasobject or dtype.kind not in "fiu":
            raise Refusal(f"{where} holds {dtype}, not numbers; {REMEDY}")
        if by_column and len(shape) > 1:
            raise Refusal(f"{where} is stored by columns; write np.ascontiguousarray of it")
        declared, held = math.prod(shape) * dtype.itemsize, archive.getinfo(name).file_size - begins
        if min(shape, default=0) < 0 or declared != held:
            raise Refusal(f"{where} declares {declared} bytes and holds {held}; {REMEDY}")
        return Member(shape, dtype)

    @contextmanager
    def _archive(self) -> Iterator[zipfile.ZipFile]:
        try:
            with zipfile.ZipFile(self.path) as archive:
                yield archive
        except Refusal:
            raise
        except DAMAGES as error:
            raise Refusal(
                f"{self.path} cannot be read to its end ({str(error)[:200]}); copy it again, or {REMEDY}"
            ) from None


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read what stands before the numbers: a Python literal, which numpy bounds and does not evaluate."""
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, by_column, dtype = read(stream)
    return shape, by_column, dtype
