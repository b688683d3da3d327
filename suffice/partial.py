"""Verdicts on a run that is not the whole truth: too coarse to be tested by itself, or the pilot of a longer one."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pod import ALONE, Ranks
from selection import (
    InputError,
    Sweep,
    check_duration,
    default_intervals,
    forecast,
    intervals_without_truth,
    without_truth,
)
from suffice.progress import Advance
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import default_variables, judge_variables, select_json


class Asked(NamedTuple):
    """What is asked of such a run."""

    coarse: bool = False  # whether its own Δτ suffices, without dense truth
    duration: float | None = None  # s, of the run that it is the pilot of


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
        for name, found, gram in judge_variables(run, names, intervals, thresholds, progress, ranks):
            table[name], blocks[name] = found, {}
            if asked.coarse:
                blocks[name]["coarse"] = without_truth(found, gram).as_dict()
            if asked.duration is not None:
                blocks[name]["forecast"] = forecast(found, gram, asked.duration).as_dict()
    except InputError as error:
        raise Refusal(f"{run.path}: {error}") from None
    answer = select_json(run, {name: table[name] for name in names})
    for name, block in blocks.items():
        answer["variables"][name] |= block
    return answer
