"""What the answers of a stage warn of: what could not be judged, was left out, or was trained too briefly."""

from collections.abc import Iterable, Mapping
from typing import Any

from suffice.progress import Reporter
from suffice.wording import seconds_text

EARLY = "training ended early"
Answer = Mapping[str, Any]


def warn_of_verdicts(reporter: Reporter, variables: Answer) -> None:
    """Warn of every Δτ without a verdict, and of doubtful forecasts; variables: as `select` writes them."""
    for name, found in variables.items():
        for remark in found.get("forecast", {}).get("remarks", []):
            reporter.warn("doubtful forecast", f"{name}: {remark}")
        for candidate in found.get("candidates", []):
            if candidate["verdict"] == "undecidable":
                place = f"{name} at {seconds_text(candidate['interval'])}"
                reporter.warn("undecidable verdict", f"{place}: {'; '.join(candidate['reasons'])}")


def warn_of_comparisons(reporter: Reporter, *answers: Answer) -> None:
    """Warn of everything that comparisons left out, with its reason, and of trainings that were cut short."""
    for answer in answers:
        for left in answer["left_out"]:
            interval = left.get("interval") or answer.get("interval")
            at = None if interval is None else seconds_text(interval)
            place = [left.get("variable") or left.get("observable"), at, left.get("surrogate")]
            reporter.warn("left out of a comparison", f"{', '.join(filter(None, place))}: {left['reason']}")
        warn_of_trainings(reporter, answer["rows"])


def warn_of_trainings(reporter: Reporter, rows: Iterable[Answer]) -> None:
    """Warn of the networks among the rows of a comparison whose training ended before it was done."""
    seen = set()
    for row in rows:
        if not row.get("early"):
            continue
        case = row["variable"], row["interval"], row["surrogate"], row["modes"]
        if case not in seen:  # the precisions of one training are rows of their own
            seen.add(case)
            place = f"{case[0]}, {seconds_text(case[1])}, {case[2]} on {case[3]} modes"
            reporter.warn(EARLY, f"{place}: {row['remark']}")
