"""The report's section on what the runs tell about themselves, and on what the stages warned of."""

from collections.abc import Iterator, Mapping
from typing import Any

from suffice.section import Section
from suffice.summary import Summary
from suffice.summary_text import OUTCOMES, summary_figures, summary_rows
from suffice.wording import escape, seconds_text

Results = Mapping[str, Any]
SEVERAL = (
    '<p class="quiet">Energy: the most that its ledger missed, of what was put in. Overlap, speed, Courant number and '
    "what the solvers of the fluid left: the largest value, of the limit that stops a run. Neighbours: steps between "
    "lists. <code>suffice info</code> says more of each run.</p>"
)


def told_section(results: Results) -> Section | None:
    """Return the figures of every run side by side, and all warnings counted by kind; None where nothing was told.

    results: `told`, the summary of each run by its name, and `stages` with their `warnings`.
    """
    told = {name: Summary.model_validate(found) for name, found in (results.get("told") or {}).items()}
    stages = [stage for stage in results.get("stages") or [] if stage.get("warnings") is not None]
    if not told and not stages:
        return None
    warned = list(_warnings(told, stages))
    text = '<p class="quiet">No stage has warned of anything.</p>' if not warned else _table(
        ("stage", "warning", "times", "the first of them"), warned, "plain wrapped"
    )  # fmt: skip
    return Section("What the runs tell about themselves", _figures(told) + text)


def _figures(told: Mapping[str, Summary]) -> str:
    """Return the lines of a summary as rows; of several runs a figure of each line, the runs as columns."""
    if not told:
        return ""
    lines = summary_figures if len(told) > 1 else lambda found: dict(summary_rows(found))
    columns = {name: {"ended": _ended(found), **lines(found)} for name, found in told.items()}
    names = dict.fromkeys(name for column in columns.values() for name in column)
    rows = [(name, *(column.get(name, "–") for column in columns.values())) for name in names]
    return (SEVERAL if len(told) > 1 else "") + _table(("", *columns), rows, "plain wrapped")


def _ended(found: Summary) -> str:
    return f"{OUTCOMES[found.outcome]} at t = {seconds_text(found.time)}"


def _warnings(told: Mapping[str, Summary], stages: Any) -> Iterator[tuple[str, ...]]:
    """Yield stage, kind, count and first of all warnings: those of runs, then those of the stages after them."""
    for name, found in told.items():
        for kind, warning in found.warnings.items():
            yield f"simulate {name}", kind, f"{warning.count:,}", warning.first
    for stage in stages:
        for kind, warning in stage["warnings"].items():
            yield stage["name"], kind, f"{warning['count']:,}", warning["first"]


def _table(heads: tuple[str, ...], rows: list[tuple[str, ...]], kind: str) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return f'<div class="scroll"><table class="{kind}"><tr>{head}</tr>{body}</table></div>'
