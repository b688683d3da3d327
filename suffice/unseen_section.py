"""Section of the report: fields at a rotor speed that no surrogate was shown."""

from collections.abc import Mapping
from typing import Any

from suffice.plots import COLOURS, QUIET, Figure
from suffice.section import Section
from suffice.unseen_tables import title_of
from suffice.unseen_verdicts import OVERALL
from suffice.wording import escape, number

TEXT = (
    "Error over the field's spread over the speeds shown: 1 is what their mean costs. "
    "Fields are amounts per volume of a cell, averaged over the rotor's phase or over time. Dashed: the standard error "
    "of the averages held out. Dotted: what the modes cannot hold."
)


def unseen_section(results: Mapping[str, Any]) -> Section | None:
    """Show the errors at the unseen speeds, per field and surrogate, with the floors and a sentence each."""
    answer = results.get("unseen")
    if not answer:
        return None
    cases = {title_of(case): case for case in answer["cases"]}
    held_out = " and ".join(f"{rpm:g}" for rpm in answer["held_out"])
    shown = ", ".join(f"{run['rpm']:g}" for run in answer["runs"] if run["rpm"] not in answer["held_out"])
    verdicts = "".join(
        f"<li><b>{escape(title)}</b>: {escape(str(case['sentences'][OVERALL]))}</li>" for title, case in cases.items()
    )
    body = (
        f"<p>Shown: {shown} rpm. Predicted: <b>{held_out} rpm</b>.</p>"
        f'<ul class="verdicts">{verdicts}</ul><p class="quiet">{TEXT}</p>'
    )
    figures = {title: _figure(case) for title, case in cases.items()}
    below = "".join(_table(title, case) for title, case in cases.items())
    folded = f"<details><summary>Each field, in numbers and sentences</summary>{below}</details>"
    return Section("Fields at an unseen speed", body, figures, {"case": {title: title for title in figures}}, folded)


def _figure(case: Mapping[str, Any]) -> Figure:
    """Bars of error per field, one colour per surrogate, and the two floors as lines."""
    fields = [key.replace("_", " ") for key in case["statistical_floor"]]
    data: list[Figure] = [
        {
            "type": "bar",
            "name": escape(row["surrogate"]),
            "x": fields,
            "y": list(row["errors"].values()),
            "error_y": {"type": "data", "array": list(row["seed_spread"].values()), "visible": row["seeds"] > 1},
            "marker": {"color": COLOURS[i % len(COLOURS)]},
        }
        for i, row in enumerate(case["rows"])
    ]
    for name, dash in (("statistical_floor", "dash"), ("projection_floor", "dot")):
        line = {"color": QUIET, "width": 2, "dash": dash, "shape": "hvh"}
        values = list(case[name].values())
        data.append(
            {"type": "scatter", "mode": "lines", "name": name.replace("_", " "), "x": fields, "y": values, "line": line}
        )
    layout = {
        "xaxis": {"type": "category"},
        "yaxis": {"title": {"text": "error / spread over speeds"}, "rangemode": "tozero"},
        "barmode": "group",
    }
    return {"data": data, "layout": layout}


def _table(title: str, case: Mapping[str, Any]) -> str:
    keys = list(case["statistical_floor"])
    head = "".join(f'<th class="number">{escape(key)}</th>' for key in keys)
    rows = [(row["surrogate"], row["errors"]) for row in case["rows"]]
    rows += [(name.replace("_", " "), case[name]) for name in ("statistical_floor", "projection_floor")]
    body = "".join(
        f"<tr><td>{escape(name)}</td>"
        + "".join(f'<td class="number">{number(values[key])}</td>' for key in keys)
        + "</tr>"
        for name, values in rows
    )
    said = "".join(f"<li>{escape(str(case['sentences'][key]))}</li>" for key in keys)
    table = f'<table class="plain"><tr><th>{escape(title)}</th>{head}</tr>{body}</table>'
    return f'<div class="scroll">{table}</div><ul>{said}</ul>'
