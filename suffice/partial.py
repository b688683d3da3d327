"""Verdicts on a run that is not the whole truth: too coarse to be tested by itself, or the pilot of a longer one."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import ALONE, Ranks, SnapshotMatrix
from selection import (
    InputError,
    Sweep,
    check_duration,
    default_intervals,
    forecast,
    intervals_without_truth,
    sweep,
    without_truth,
)
from suffice.progress import Advance
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import default_variables, select_json, thresholds_of

Array = NDArray[np.float64]


class Asked(NamedTuple):
    """What is asked of such a run."""

    coarse: bool = False  # whether its own Δτ suffices, without dense truth
    duration: float | None = None  # s, of the run that it is the pilot of


class _Remembering(SnapshotMatrix):
    """A snapshot matrix that keeps its inner products, so that a forecast needs no second reading."""

    known: Array

    def gram(self) -> Array:
        self.known = np.asarray(super().gram(), dtype=np.float64)
        return self.known

    def gram_groups(self, groups: int) -> Array:
        parts = np.asarray(super().gram_groups(groups), dtype=np.float64)
        self.known = parts.sum(axis=0)
        return parts


def select_partial(
    run: Run,
    asked: Asked,
    variables: Sequence[str] | None = None,
    intervals: Sequence[float] | None = None,
    thresholds: Mapping[str, float] | None = None,
    progress: Advance | None = None,
    ranks: Ranks = ALONE,
) -> dict[str, Any]:
    """Judge every Δτ as `select_run` does, and add to each variable the blocks `coarse` and `forecast` asked for.

    Returns what `suffice select --json` writes. With `coarse` the Δτ of 4, 2 and 1 recorded intervals are judged as
    well. Raises Refusal for unknown variables, and for times, intervals or a duration that cannot be used.
    """
    names = list(dict.fromkeys(variables)) if variables else default_variables(run)
    table: dict[str, Sweep] = {}
    blocks: dict[str, dict[str, Any]] = {}
    try:
        if asked.coarse:
            alone = intervals_without_truth(run.times)
            intervals = [*(default_intervals(run.times) if intervals is None else intervals), *alone]
        if asked.duration is not None:
            check_duration(asked.duration, float(run.times[-1] - run.times[0]) if len(run.times) else 0.0)
        for name, found, gram in _judged(run, names, intervals, thresholds, progress, ranks):
            table[name], blocks[name] = found, {}
            if asked.coarse:
                blocks[name]["coarse"] = without_truth(found, gram).as_dict()
            if asked.duration is not None:
                blocks[name]["forecast"] = forecast(found, gram, asked.duration).as_dict()
    except InputError as error:
        raise Refusal(f"{run.path}: {error}") from None
    answer = select_json(run, table)
    for name, block in blocks.items():
        answer["variables"][name] |= block
    return answer


def _judged(
    run: Run,
    names: Sequence[str],
    intervals: Sequence[float] | None,
    thresholds: Mapping[str, float] | None,
    progress: Advance | None,
    ranks: Ranks,
) -> Iterator[tuple[str, Sweep, Array]]:
    """Yield the sweep and the inner products of each variable."""
    sources = [run.variable(name) for name in names]
    for done, (name, rows) in enumerate(zip(names, sources, strict=True)):
        if progress:
            progress(done, len(names))
        matrix = _Remembering(rows, ranks=ranks)
        yield name, sweep(matrix, run.times, intervals, thresholds_of(name, thresholds)), matrix.known
    if progress:
        progress(len(names), len(names))
