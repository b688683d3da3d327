"""Signals that ask a command to stop: Ctrl-C, what a batch system sends before it kills, a terminal that is closed."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def heard_by(hear: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Let a function hear every signal that asks to stop while the block runs.

    One that is ignored stays so, as `nohup` wants it, but for Ctrl-C, which every background job of a shell ignores.
    Of torchrun's processes none hears its SIGTERM: who waits for another rank would not get to hear it.
    """
    if current_thread() is not main_thread():  # nobody sends signals there
        yield
        return
    alone = int(os.environ.get("WORLD_SIZE", "1")) < 2
    wanted = [number for number in STOPS if number == signal.SIGINT or alone]
    before = {number: signal.getsignal(number) for number in wanted}
    heard = [number for number in wanted if number == signal.SIGINT or before[number] != signal.SIG_IGN]
    try:
        for number in heard:
            signal.signal(number, hear)
        yield
    finally:
        for number in heard:
            signal.signal(number, before[number])


@contextmanager
def asked_to_stop() -> Iterator[list[int]]:
    """Collect signals instead of raising KeyboardInterrupt in the middle of a step; a second one stops at once."""
    asked: list[int] = []

    def ask(number: int, _frame: FrameType | None) -> None:
        asked.append(number)
        if len(asked) > 1:
            raise KeyboardInterrupt

    with heard_by(ask):
        yield asked
