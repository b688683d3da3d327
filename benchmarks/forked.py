"""A command of `suffice` in a forked process: bounded, killed at a moment of one's choice, and weighed.

Packages are imported once, by the parent, so that the moments of a kill fall into the work and not into the imports.
The parent must not compute before it forks: threads do not survive a fork.
"""

import mmap
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

CHANGES = ("os.rename", "os.remove", "os.truncate", "os.mkdir", "os.rmdir", "os.link", "os.symlink")
LIMITS = {"memory": resource.RLIMIT_AS, "file": resource.RLIMIT_FSIZE}
STOPS = (signal.SIGINT, signal.SIGTERM)
SECONDS_BETWEEN_SIGNALS = 5.0
BROKEN = 70  # exit code of a child in which an exception went through the door


class Outcome(NamedTuple):
    """How a forked command ended."""

    code: int  # exit code, or minus the signal that killed it
    said: str  # on standard error
    memory: int  # bytes, largest resident memory, of which the parent's pages are a part
    seconds: float
    changes: int  # files that were opened for writing, renamed or removed
    outside: tuple[str, ...]  # of them, those outside the folder
    heard: bool  # whether a signal came while Python listened
    seconds_after: float  # from the first signal that was sent to the end


def import_all() -> None:
    """Import what the commands import on their own, once for all children."""
    import numba  # noqa: F401
    import torch

    import suffice.combining
    import suffice.decomposing
    import suffice.predicting
    import suffice.readers
    import suffice.simulating
    import suffice.study
    import suffice.tables  # noqa: F401

    torch.set_num_threads(1)


class Child:
    """A command that has been started in a folder; `wait` for it, or kill it.

    `limits` are bytes of `LIMITS` (memory is added to what the parent has), `dies_at` the change of a file before which
    it kills itself, `prepare` what is done in the child before the command, `writes` the folder in which it may write,
    by default the whole of its own.
    """

    def __init__(
        self,
        words: Sequence[str],
        folder: Path,
        *,
        limits: dict[str, int] | None = None,
        dies_at: int | None = None,
        prepare: Callable[[], Any] | None = None,
        writes: Path | None = None,
    ) -> None:
        self.folder, self.began = folder.resolve(), time.monotonic()
        self._home = str((writes or folder).resolve())
        self._said = self.folder.parent / f"{folder.name}.said"
        self._shared = mmap.mmap(-1, 1 << 16)
        self._heard, self._hears = os.pipe2(os.O_NONBLOCK)
        self._signalled = inf
        signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)  # until the child's command listens
        self.pid = os.fork()
        if self.pid == 0:
            self._work(words, limits or {}, dies_at, prepare)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)

    def _work(
        self, words: Sequence[str], limits: dict[str, int], dies_at: int | None, prepare: Callable[[], Any] | None
    ) -> None:
        code = BROKEN
        try:
            self._leave_parent()
            for name, size in limits.items():
                most = size + (_address_space() if name == "memory" else 0)
                resource.setrlimit(LIMITS[name], (most, most))
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            for number in STOPS:
                signal.signal(number, lambda *_: None)  # when the command is over it comes too late
            signal.set_wakeup_fd(self._hears)
            if prepare is not None:
                prepare()
            self._watch(dies_at)
            from suffice.__main__ import app
            from suffice.door import run_command

            def command() -> Any:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
                return app(list(words), standalone_mode=False)

            code = run_command(command)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(code)

    def _leave_parent(self) -> None:
        os.chdir(self.folder)
        said = os.open(self._said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(said, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115

    def _watch(self, dies_at: int | None) -> None:
        """Count what changes files, note what does so outside the folder, and die where asked to."""
        noted, home, places = [0], self._home, 16

        def hook(event: str, arguments: tuple[Any, ...]) -> None:
            if event == "open" and isinstance(arguments[0], str):
                writes = isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
            else:
                writes = event in CHANGES
            if not writes:
                return
            noted[0] += 1
            self._shared[:8] = noted[0].to_bytes(8, "little")
            if noted[0] == dies_at:
                os.kill(os.getpid(), signal.SIGKILL)
            for place in arguments[: 2 if event == "os.rename" else 1]:
                path = os.fsdecode(place) if isinstance(place, str | bytes | os.PathLike) else home
                # a link that is renamed or removed is changed itself, not what it leads to
                whole = event in ("open", "os.truncate")
                folder, name = ("", os.path.realpath(path)) if whole else os.path.split(os.path.abspath(path))
                path = os.path.join(os.path.realpath(folder), name)
                if not path.startswith((home, "/dev/", "/proc/")) and "numba" not in path and "suffice-" not in path:
                    told = (path + "\n").encode()
                    end = self._shared.find(b"\0", places)
                    self._shared[end : end + len(told)] = told

        sys.addaudithook(hook)

    def wait(self, most: float = 120.0, again: signal.Signals | None = None) -> Outcome:
        """Wait until it ends; where asked it gets a signal every five seconds; after `most` seconds it is killed."""
        told = time.monotonic()
        while True:
            pid, status, used = os.wait4(self.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() - self.began > most:
                os.kill(self.pid, signal.SIGKILL)
            if again is not None and time.monotonic() - told > SECONDS_BETWEEN_SIGNALS:
                told = time.monotonic()
                os.kill(self.pid, again)
            time.sleep(0.002)
        seconds, after = time.monotonic() - self.began, max(time.monotonic() - self._signalled, 0.0)
        said = self._said.read_text(errors="replace") if self._said.exists() else ""
        self._said.unlink(missing_ok=True)
        outside = self._shared[16 : self._shared.find(b"\0", 16)].decode().splitlines()
        changes = int.from_bytes(self._shared[:8], "little")
        code = os.waitstatus_to_exitcode(status)
        heard = self._was_heard()
        return Outcome(code, said, 1024 * used.ru_maxrss, seconds, changes, tuple(outside), heard, after)

    def _was_heard(self) -> bool:
        os.close(self._hears)
        with open(self._heard, "rb") as heard:
            return bool(heard.read(1))

    def kill_after(self, seconds: float, how: signal.Signals = signal.SIGKILL) -> Outcome:
        """Send a signal after some seconds, if it still runs then, and again, as an impatient user does."""
        while time.monotonic() - self.began < seconds:
            if os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                break
            time.sleep(0.001)
        self._signalled = time.monotonic()
        os.kill(self.pid, how)
        return self.wait(again=how)


def _address_space() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * mmap.PAGESIZE
