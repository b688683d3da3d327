"""Text of a source, plain or compressed, read forward line by line."""

import bz2
import gzip
import io
import lzma
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from suffice.refusal import Refusal

OPENERS: dict[bytes, Callable[[Path], Any]] = {b"\x1f\x8b": gzip.open, b"\xfd7zXZ\x00": lzma.open, b"BZh": bz2.open}
ZSTD = b"(\xb5/\xfd"

_BUFFER = 1 << 20
_LONGEST_LINE = 1 << 16  # bytes
_LINE = 200  # bytes of a line of atoms, about; more are taken in several pieces
_NEWLINE = 10


class Text:
    """Lines of a file that know where they stand. `number` is the count of lines read so far.

    What is in memory is bounded: a file of one endless line is refused.
    """

    def __init__(self, path: Path, stream: IO[bytes]) -> None:
        self.path, self.number, self._stream = path, 0, stream
        self._held, self._at = b"", 0  # what was read, and how much of it was given out

    def line(self) -> str | None:
        """Return the next line without its white space, or None at the end. Raises `Refusal` on a broken archive."""
        if not self._fill():
            return None
        end = self._held.find(b"\n", self._at) + 1 or len(self._held)
        return self._take(end, 1).decode("latin-1").strip()

    def pieces(self, n: int) -> Iterator[bytes]:
        """Yield the next n lines as they are, in pieces of whole lines; fewer at the end.

        Raises `Refusal` on a broken archive.
        """
        while n > 0 and self._fill():
            window = self._at + _LINE * n + _LONGEST_LINE
            count = self._held.count(b"\n", self._at, window)
            if count <= n:
                end = self._held.rfind(b"\n", self._at, window) + 1 or len(self._held)
                count = max(count, 1)
            else:
                text = np.frombuffer(self._held, np.uint8)[self._at : window]
                count, end = n, self._at + int(np.flatnonzero(text == _NEWLINE)[n - 1]) + 1
            n -= count
            yield self._take(end, count)

    def block(self, n: int) -> bytes:
        """Return the next n lines as they are, fewer at the end. Raises `Refusal` on a broken archive."""
        return b"".join(self.pieces(n))

    def _take(self, end: int, lines: int) -> bytes:
        taken, self._at = self._held[self._at : end], end
        self.number += lines
        return taken

    def _fill(self) -> bool:
        """Hold a whole line or the last one, and tell whether there is any."""
        while self._held.find(b"\n", self._at) < 0:
            if len(self._held) - self._at > _LONGEST_LINE:
                raise Refusal(
                    f"source {self.path} line {self.number + 1} has over {_LONGEST_LINE} bytes; it is no text"
                )
            with _refusing_broken(self.path):
                more = self._stream.read(_BUFFER)
            if not more:
                return self._at < len(self._held)
            self._held, self._at = self._held[self._at :] + more, 0
        return True


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
    if start.startswith(ZSTD):
        raise Refusal(f"source {path} is packed by zstd, which Python does not read; unpack it with `zstd -d`")
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
