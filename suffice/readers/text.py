"""Text of a source, plain or compressed, read forward line by line."""

import bz2
import gzip
import io
import lzma
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import IO, Any

from suffice.refusal import Refusal

OPENERS: dict[bytes, Callable[[Path], Any]] = {b"\x1f\x8b": gzip.open, b"\xfd7zXZ\x00": lzma.open, b"BZh": bz2.open}

_BUFFER = 1 << 20


class Text:
    """Lines of a file that know where they stand. `number` is the count of lines read so far."""

    def __init__(self, path: Path, stream: IO[bytes]) -> None:
        self.path, self.number, self._stream = path, 0, stream

    def line(self) -> str | None:
        """Return the next line without its white space, or None at the end. Raises `Refusal` on a broken archive."""
        with _refusing_broken(self.path):
            line = self._stream.readline()
        self.number += bool(line)
        return line.decode("latin-1").strip() if line else None

    def block(self, n: int) -> bytes:
        """Return the next n lines as they are, fewer at the end. Raises `Refusal` on a broken archive."""
        with _refusing_broken(self.path):
            lines = list(islice(self._stream, n))
        self.number += len(lines)
        return b"".join(lines)


@contextmanager
def open_text(path: Path) -> Iterator[Text]:
    """Open a file whose content says how it is compressed (gzip, xz, bzip2 or not at all).

    Raises `Refusal` when it is missing, not a file, or may not be read.
    """
    if not path.is_file():
        problem = "is a folder; name the files in it" if path.is_dir() else "is missing or not a file; check its name"
        raise Refusal(f"source {path} {problem}")
    with _refusing_broken(path), path.open("rb") as file:
        start = file.read(8)
    opener = next((opener for magic, opener in OPENERS.items() if start.startswith(magic)), None)
    raw = opener(path) if opener else path.open("rb", buffering=0)
    with io.BufferedReader(raw, _BUFFER) as stream:
        yield Text(path, stream)


@contextmanager
def _refusing_broken(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, EOFError, lzma.LZMAError, zlib.error) as error:
        raise Refusal(
            f"source {path} cannot be read to its end ({error}); copy it again, or unpack what is left"
        ) from None
