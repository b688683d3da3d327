"""The door between the program and its user: every failure becomes one message and an exit code."""

import json
import os
import re
import signal
import sys
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import current_thread, main_thread
from types import TracebackType
from typing import Any

import typer

from suffice.ranks import is_first
from suffice.refusal import Refusal

DONE, FAILED, REFUSED, INTERRUPTED = 0, 1, 2, 130
INTERRUPTION = "interrupted; finished stages are kept, run the same command again"
REPEATED = "Can't decrement id ref count"  # HDF5's words
UsageError: Any = typer.BadParameter.__mro__[1]  # typer has a click of its own, of which only this is public


class InterruptedRunError(Exception):
    """The user stopped a command at a point from which it can be resumed; the message says how."""


def refusals() -> tuple[type[Exception], ...]:
    """Return the exceptions that mean refused input; a package that was not imported cannot have raised its own."""
    packages = (sys.modules.get(name) for name in ("sim", "pod", "selection", "surrogates"))
    return (Refusal, *(package.InputError for package in packages if package is not None))


def failures() -> tuple[type[Exception], ...]:
    """Return the exceptions that mean: begun, but failed on the way."""
    sim, pod = sys.modules.get("sim"), sys.modules.get("pod")
    limits = () if sim is None else (sim.LimitError,)
    tensors = sys.modules.get("safetensors")  # its name for a disk that is full
    limits += () if tensors is None else (tensors.SafetensorError,)
    return (OSError, MemoryError, *limits, *(() if pod is None else (pod.LostRankError,)))


def hear_what_is_dropped() -> None:
    """Hear a Ctrl-C that Python drops, and keep what HDF5 repeats for each object after a write has failed.

    To be called inside of typer, which brings a hook of its own.
    """
    unraisable, uncaught = sys.unraisablehook, sys.excepthook

    def note_unraisable(found: Any) -> None:
        if issubclass(found.exc_type, KeyboardInterrupt):
            interrupt_main()  # it came in a callback, which drops it: once more
        elif REPEATED not in str(found.exc_value):
            unraisable(found)

    def note_uncaught(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if REPEATED not in str(error):
            uncaught(kind, error, trace)

    sys.unraisablehook, sys.excepthook = note_unraisable, note_uncaught


def disk_words(error: Exception) -> str:
    """Return what the system said about a write, without what HDF5 wraps around it."""
    found = re.search(r"errno = (\d+)", str(error))
    return os.strerror(int(found[1])) if found else str(error)


def run_command(command: Callable[[], Any]) -> int:
    """Run a command and return its exit code; what went wrong is said on standard error in one message."""
    heard: list[bool] = []
    try:
        with _listening(heard):
            code = command()
        if code == INTERRUPTED:  # typer answers Ctrl-C by this number, in silence
            raise KeyboardInterrupt
        return code if isinstance(code, int) else DONE
    except UsageError as error:
        error.show(sys.stderr)
        return REFUSED
    except (KeyboardInterrupt, typer.Abort):
        return _say(INTERRUPTION, INTERRUPTED)
    except InterruptedRunError as stopped:
        return _say(str(stopped), INTERRUPTED)
    except BrokenPipeError:
        return FAILED
    except refusals() as error:
        # torchrun's processes are all refused alike; the first one says so
        return _say(f"refused: {error}", REFUSED) if is_first() else REFUSED
    except failures() as error:
        return _say(f"failed: {disk_words(error) or type(error).__name__}", FAILED)
    except (SystemError, RuntimeError):
        if heard:  # Ctrl-C while compiled code is loaded comes out of numba as one of these
            return _say(INTERRUPTION, INTERRUPTED)
        raise


@contextmanager
def _listening(heard: list[bool]) -> Iterator[None]:
    """Note every Ctrl-C of the block, which raises KeyboardInterrupt as ever."""

    def hear(_signal: int, _frame: object) -> None:
        heard.append(True)
        raise KeyboardInterrupt

    if current_thread() is not main_thread():  # nobody sends signals there
        yield
        return
    before = signal.signal(signal.SIGINT, hear)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _say(message: str, code: int) -> int:
    print(f"suffice: {message}", file=sys.stderr)
    return code


def _may_be_replaced(path: Path) -> bool:
    """Tell whether nothing stands there, or JSON: a run named by mistake must survive, a pipe is not waited for."""
    if path.exists() and not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return file.read(1) in (b"{", b"[", b"")
    except OSError:
        return True


def write_json(value: Any, target: str) -> None:
    """Write a value as JSON to a file, beside and renamed, or to standard output for '-'."""
    text = json.dumps(value, indent=1, allow_nan=False)
    if target == "-":
        print(text)
        return
    path = Path(target)
    if path.is_dir():
        raise Refusal(f"--json {target} is a folder; name a file, or - for standard output")
    if not _may_be_replaced(path):
        raise Refusal(f"--json {target} exists and is no JSON; choose another name or remove it")
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise Refusal(f"--json {target} cannot be written ({error}); name a file in a folder that exists") from None
