"""How far a long command is, how fast, how long it will take, and what it warns of."""

import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from suffice.warned import Warned

Advance = Callable[[int, int], None]  # (done, all)
SECONDS_BETWEEN_LINES = 1.0
SECONDS_BETWEEN_NOTES = 60.0  # in a file, for who looks into it now and then


class Reporter:
    """Shows stages on standard error: as bars, as a line a minute in a file, or as lines of JSON for other programs.

    `warned` holds the warnings that nobody has taken yet.
    """

    def __init__(self, as_json: bool = False) -> None:
        self.as_json = as_json
        self.warned = Warned()

    def warn(self, kind: str, text: str, times: int = 1) -> None:
        """Count a warning; the first of its kind is said."""
        if self.warned.add(kind, text, times):
            self.tell({"warning": kind, "text": text, "count": times}, f"warning: {kind}: {text}")

    def tell(self, line: dict[str, Any], text: str) -> None:
        """Say something beside the progress, to programs as a line of JSON, to people as a text."""
        print(json.dumps(line) if self.as_json else text, file=sys.stderr, flush=True)

    @contextmanager
    def hearing(self) -> Iterator[None]:
        """Count the warnings of libraries as well while the block runs, and tell the counts at its end.

        What filters raise or ignore stays raised or ignored; of the rest Python would say only the first of each place.
        """

        def hear(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
            self.warn(category.__name__, f"{message} ({Path(filename).name}, line {lineno})")

        python: Any = warnings  # whose types forbid what its manual advises
        with warnings.catch_warnings():
            warnings.simplefilter("always", append=True)
            python.showwarning = hear
            try:
                yield
            finally:
                for kind, found in self.warned.taken().items():
                    if found.times > 1:
                        self.tell({"warning": kind, "count": found.times}, f"warning: {kind}: {found.times} in all")

    @contextmanager
    def stage(self, name: str, unit: str, work: float = 1.0) -> Iterator[Advance]:
        """Show a stage while the block runs; `work` is what one step of it does, counted in `unit`."""
        show = self._lines if self.as_json else self._bar if sys.stderr.isatty() else self._notes
        with show(name, unit, work) as advance:
            yield advance

    @contextmanager
    def _lines(self, name: str, unit: str, work: float) -> Iterator[Advance]:
        pace, said = _Pace(), 0.0

        def advance(done: int, total: int) -> None:
            nonlocal said
            elapsed, rate = pace.at(done)
            if done < total and pace.now - said < SECONDS_BETWEEN_LINES:
                return
            said = pace.now
            line = {
                "stage": name,
                "done": done,
                "all": total,
                "seconds": round(elapsed, 3),
                "rate": rate and rate * work,
                "unit": f"{unit}/s",
                "seconds_left": rate and round((total - done) / rate, 1),
            }
            print(json.dumps(line), file=sys.stderr, flush=True)

        yield advance

    @contextmanager
    def _notes(self, name: str, unit: str, work: float) -> Iterator[Advance]:
        pace = _Pace()
        said = pace.now

        def advance(done: int, total: int) -> None:
            nonlocal said
            _, rate = pace.at(done)
            if rate is None or pace.now - said < SECONDS_BETWEEN_NOTES:
                return
            said = pace.now
            left = f"{(total - done) / rate / 60.0:.0f} min left"
            print(f"{name}: {done} of {total}, {rate * work:.3g} {unit}/s, {left}", file=sys.stderr, flush=True)

        yield advance

    @contextmanager
    def _bar(self, name: str, unit: str, work: float) -> Iterator[Advance]:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description:<10}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(elapsed_when_finished=True),
        )
        with Progress(*columns, console=Console(stderr=True)) as bars:
            task = bars.add_task(name, total=None, rate="")

            def advance(done: int, total: int) -> None:
                speed = bars.tasks[task].speed
                rate = f"{speed * work:.3g} {unit}/s" if speed else ""
                bars.update(task, completed=done, total=total, rate=rate)

            yield advance


class _Pace:
    """How fast a stage has been since it began, or went on: a resumed one does not begin at zero."""

    def __init__(self) -> None:
        self.began = self.now = time.monotonic()
        self.first = -1

    def at(self, done: int) -> tuple[float, float | None]:
        """Return seconds since the beginning, and steps a second where there were any."""
        self.now = time.monotonic()
        self.first = done if self.first < 0 else self.first
        elapsed = self.now - self.began
        return elapsed, (done - self.first) / elapsed if elapsed > 0 and done > self.first else None
