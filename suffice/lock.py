"""One writer at a time, of a run or of a study's folder."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from suffice.refusal import Refusal


@contextmanager
def only_writer(path: Path) -> Iterator[None]:
    """Keep other processes from writing the same file or folder while the block runs; the system lets go of the dead.

    Raises Refusal where another process is at it.
    """
    place = path / ".lock" if path.is_dir() else path.with_name(f".{path.name}.lock")
    try:
        handle = os.open(place, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise Refusal(f"output {path} cannot be written ({error}); choose a folder you may write to") from None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        holder = os.read(handle, 20).decode(errors="replace").strip() or "unknown"
        os.close(handle)
        raise Refusal(
            f"output {path} is being written by another suffice (process {holder}); wait for it, stop it, or choose "
            "another name"
        ) from None
    try:
        os.truncate(handle, 0)
        os.write(handle, str(os.getpid()).encode())
        yield
    finally:
        place.unlink(missing_ok=True)
        os.close(handle)
