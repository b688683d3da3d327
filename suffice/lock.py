"""One writer at a time, of a file or of a folder."""

import fcntl
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from suffice.refusal import Refusal


@contextmanager
def only_writer(path: Path) -> Iterator[None]:
    """Keep other processes from writing the same file or folder while the block runs; the system lets go of the dead.

    Raises Refusal where another process is at it.
    """
    place = path / ".lock" if path.is_dir() else path.with_name(f".{path.name}.lock")
    handle = _taken(path, place)
    try:
        os.truncate(handle, 0)
        os.write(handle, str(os.getpid()).encode())
        yield
    finally:
        place.unlink(missing_ok=True)
        os.close(handle)


@contextmanager
def only_writer_in(folder: Path) -> Iterator[None]:
    """Make a folder where there is none, and be its only writer; it goes again where nothing came into it.

    Raises Refusal where it cannot be made, or another process is at it.
    """
    made = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from None
    try:
        with only_writer(folder):
            yield
    finally:
        if made:
            with suppress(OSError):
                folder.rmdir()


def _taken(path: Path, place: Path) -> int:
    """Return the handle of a lock that stands at its place and is ours."""
    while True:
        try:
            handle = os.open(place, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise _unwritable(path, error) from None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(handle, 20).decode(errors="replace").strip() or "unknown"
            os.close(handle)
            raise Refusal(
                f"output {path} is being written by another suffice (process {holder}); wait for it, stop it, or "
                "choose another name"
            ) from None
        except OSError as error:  # some parallel file systems are mounted without locks
            print(f"suffice: {path} cannot be locked ({error}); let no other suffice write it", file=sys.stderr)
            return handle
        if _stands(place, handle):
            return handle
        os.close(handle)  # whoever had it has removed it between our two calls: a third process would make a new one


def _stands(place: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.stat(place), os.fstat(handle))
    except FileNotFoundError:
        return False


def _unwritable(path: Path, error: OSError) -> Refusal:
    return Refusal(f"output {path} cannot be written ({error}); choose a folder you may write to")
