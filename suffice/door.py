"""The door between the program and its user: every failure becomes one message and an exit code."""

import json
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Timer, get_ident
from types import TracebackType
from typing import Any

import typer

from suffice.interrupt import heard_by
from suffice.ranks import is_first
from suffice.refusal import Refusal

DONE, FAILED, REFUSED, INTERRUPTED = 0, 1, 2, 130
INTERRUPTION = "interrupted; finished stages are kept, run the same command again"
SECONDS_AFTER_CALLBACK = 0.01
REPEATED = "Can't decrement id ref count"  # HDF5's words
UsageError: Any = typer.BadParameter.__mro__[1]  # typer has a click of its own, of which only this is public


class InterruptedRunError(Exception):
    """A signal stopped a command at a point from which it can be resumed; the message says how."""

    def __init__(self, message: str, asked_by: int = signal.SIGINT) -> None:
        super().__init__(message)
        self.asked_by = asked_by  # the signal


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
    """Hear a Ctrl-C that Python drops, and keep what libraries repeat for each object after a failure or a Ctrl-C.

    To be called inside of typer, which brings a hook of its own.
    """
    unraisable, uncaught = sys.unraisablehook, sys.excepthook

    def note_unraisable(found: Any) -> None:
        if issubclass(found.exc_type, KeyboardInterrupt):
            # it came in a callback, which drops it: once more, when this one, which drops it, too, is over
            again = Timer(SECONDS_AFTER_CALLBACK, signal.pthread_kill, (get_ident(), signal.SIGINT))
            again.daemon = True
            again.start()
        elif REPEATED not in str(found.exc_value) and not _half_made(found):
            unraisable(found)

    def note_uncaught(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if REPEATED not in str(error):
            uncaught(kind, error, trace)

    sys.unraisablehook, sys.excepthook = note_unraisable, note_uncaught


def _half_made(found: Any) -> bool:
    """Tell an object of llvmlite that Ctrl-C stopped in the making: it misses parts when it is let go of."""
    maker = str(getattr(found.object, "__module__", ""))
    return issubclass(found.exc_type, AttributeError) and maker.startswith("llvmlite")


def disk_words(error: Exception) -> str:
    """Return what the system said about a write, without what HDF5 wraps around it."""
    found = re.search(r"errno = (\d+)", str(error))
    return os.strerror(int(found[1])) if found else str(error)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name the run and the remedy where its disk is full, for which HDF5 has two names."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if disk_words(error) == str(error):
            raise
        raise OSError(
            f"run {path} cannot be written ({disk_words(error)}); make room and repeat the command, with --resume "
            "where it has that"
        ) from None


def run_command(command: Callable[[], Any]) -> int:
    """Run a command and return its exit code; what went wrong is said on standard error in one message.

    A signal that asks to stop raises KeyboardInterrupt, and the code is 128 and its number.
    """
    heard: list[int] = []
    over = False

    def hear(number: int, _frame: object) -> None:
        heard.append(number)
        if not over:
            raise KeyboardInterrupt

    with heard_by(hear):
        try:
            try:
                code = command()
                if sys.stdout is not None:
                    sys.stdout.flush()  # a disk that is full is told here, and not by Python when it ends
            finally:
                over = True  # what comes now, an impatient second one, must not spoil the message
            if code == INTERRUPTED:  # typer answers Ctrl-C by this number, in silence
                raise KeyboardInterrupt
            return code if isinstance(code, int) else DONE
        except UsageError as error:
            error.show(sys.stderr)
            return REFUSED
        except (KeyboardInterrupt, typer.Abort):
            return _say(INTERRUPTION, code_of(heard))
        except InterruptedRunError as stopped:
            return _say(str(stopped), code_of([*heard, stopped.asked_by]))
        except BrokenPipeError:
            return FAILED
        except refusals() as error:
            # torchrun's processes are all refused alike; the first one says so
            return _say(f"refused: {error}", REFUSED) if is_first() else REFUSED
        except failures() as error:
            return _say(f"failed: {disk_words(error) or type(error).__name__}", FAILED)
        except (SystemError, RuntimeError) as error:
            if heard:  # Ctrl-C while compiled code is loaded comes out of numba as one of these
                return _say(INTERRUPTION, code_of(heard))
            if disk_words(error) != str(error):  # HDF5's other name for a disk that is full
                return _say(f"failed: {disk_words(error)}", FAILED)
            raise


def forget_unwritten() -> None:
    """Let go of what standard output did not take: Python would try again at its end, and spoil the exit code."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def code_of(heard: Sequence[int]) -> int:
    """Return the exit code of a command that a signal has stopped: 130 after Ctrl-C, 143 after SIGTERM."""
    return 128 + heard[0] if heard else INTERRUPTED


def _say(message: str, code: int) -> int:
    with suppress(OSError):  # of a terminal that was closed, nobody listens
        print(f"suffice: {message}", file=sys.stderr)
    return code


def _may_be_replaced(path: Path) -> bool:
    """Tell whether nothing stands there, a device, or JSON: a run named by mistake must survive."""
    if not path.is_file():
        return True
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
    try:
        write_text(path, text + "\n")
    except OSError as error:
        raise Refusal(f"--json {target} cannot be written ({error}); name a file in a folder that exists") from None


def write_text(path: Path, text: str) -> None:
    """Write a text beside and rename it; into a device or a pipe at once: /dev/null must stay what it is.

    Raises OSError, and then leaves nothing beside.
    """
    if path.exists() and not path.is_file():
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)  # a pipe that nobody reads is an error, not waited for
        os.set_blocking(descriptor, True)
        with open(descriptor, "w", encoding="utf-8") as device:
            device.write(text)
        return
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
