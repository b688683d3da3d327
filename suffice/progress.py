"""How far a long command is, how fast, and how long it will take."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Advance = Callable[[int, int], None]  # (done, all)
SECONDS_BETWEEN_LINES = 1.0


class Reporter:
    """Shows stages on standard error: as bars, or as lines of JSON for other programs."""

    def __init__(self, as_json: bool = False) -> None:
        self.as_json = as_json

    @contextmanager
    def stage(self, name: str, unit: str, work: float = 1.0) -> Iterator[Advance]:
        """Show a stage while the block runs; `work` is what one step of it does, counted in `unit`."""
        with self._lines(name, unit, work) if self.as_json else self._bar(name, unit, work) as advance:
            yield advance

    @contextmanager
    def _lines(self, name: str, unit: str, work: float) -> Iterator[Advance]:
        began, first, said = time.monotonic(), -1, 0.0

        def advance(done: int, total: int) -> None:
            nonlocal first, said
            now = time.monotonic()
            first = done if first < 0 else first  # a resumed stage does not begin at zero
            if done < total and now - said < SECONDS_BETWEEN_LINES:
                return
            said, elapsed = now, now - began
            rate = (done - first) / elapsed if elapsed > 0 and done > first else None
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
