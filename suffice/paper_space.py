"""The paper's figures in space, of the cases of a study: 1, 3, 4, 5 and 9."""

from collections.abc import Callable, Mapping
from typing import Any

from suffice.fields import scene_of
from suffice.paper_pictures import figure_1, figure_3, figure_4, figure_5, figure_9
from suffice.run import Run
from suffice.section import Section
from suffice.wording import escape

Results = Mapping[str, Any]
CALIBRATION, VALIDATION = 0, -1


def insufficient_in_space(results: Results) -> Section:
    """Figure 1: the calibration case, and a surrogate trained at the coarsest Δτ."""
    return _drawn(results, CALIBRATION, lambda run, found: figure_1(run, _intervals(results)[0], found))


def idea(results: Results) -> Section:
    """Figure 3: the idea, with the numbers of the validation case."""
    row, dense = results["paper"]["verdicts"][VALIDATION], results["cases"][VALIDATION]["select"]["dense_interval"]
    return Section("", figure_3(row["interval"], dense, row["n_lr"], row["n_c"]))


def dimensions(results: Results) -> Section:
    """Figure 4: the mill."""
    return _drawn(results, CALIBRATION, lambda run, _: figure_4(scene_of(run)))


def moments(results: Results) -> Section:
    """Figure 5: a moment of the calibration case at several Δτ, coarse to fine."""
    intervals = _intervals(results)
    some = sorted({intervals[0], results["paper"]["verdicts"][CALIBRATION]["interval"], intervals[-1]}, reverse=True)
    return _drawn(results, CALIBRATION, lambda run, found: figure_5(run, some, found))


def predictions(results: Results) -> Section:
    """Figure 9: the validation case, reproduced and predicted over one Δτ."""
    interval = results["paper"]["verdicts"][VALIDATION]["interval"]
    return _drawn(results, VALIDATION, lambda run, _: figure_9(run, interval))


def _intervals(results: Results) -> list[float]:
    return [row["interval"] for row in results["paper"]["tables"]["3"]["rows"]]


def _drawn(results: Results, which: int, draw: Callable[[Run, float | None], str]) -> Section:
    """Draw from the run of a case, told which Δτ the verdict finds sufficient, None for none."""
    verdict = results["paper"]["verdicts"][which]
    with Run(results["cases"][which]["run"]["path"]) as run:
        drawn = draw(run, verdict["interval"] if verdict["sufficient"] else None)
    return Section("", f'<p class="quiet">{escape(verdict["case"])}</p>{drawn}')
