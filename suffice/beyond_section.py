"""Section of the report: what lies beyond the snapshots trained on, error against horizon."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from suffice.plots import QUIET, Figure, colours_of, error_field, ticks
from suffice.section import Section
from suffice.wording import escape, seconds_text

Rows = Sequence[Mapping[str, Any]]

ORIGINS = {"end": "the end of training", "starts": "all starts"}
BASELINES = {"persistence": "solid", "ballistic": "dot"}  # in grey; how their lines are drawn
WAITING: Figure = {"visible": "legendonly", "legendgroup": "few", "legendrank": 2000, "name": "all on fewer modes"}
HIGHEST = 10  # times the largest error of persistence: what errs more than that leaves the figure

TEXT = (
    "Modes and surrogates see the first part of the run only, and predict what follows; root mean square over "
    "particles. From <i>the end of training</i> all can go on; from <i>all starts</i>, snapshots spread over the rest, "
    "only what steps from state to state, and what needs no modes: there errors are means. What the modes miss of the "
    "snapshot that a prediction starts from is kept as it is. Dashed: what exact coefficients would leave. Grey: "
    "nothing moves (persistence), everything flies on (ballistic). Lines that leave the figure err more than "
    f"{HIGHEST} times as much as persistence ever does."
)


def beyond_section(results: Mapping[str, Any]) -> Section | None:
    """Error against horizon of each variable and Δτ, and who errs least; None where nothing was predicted.

    results["compare"]["beyond"]: list of answers of `compare_beyond`.
    """
    answers: Rows = (results.get("compare") or {}).get("beyond") or []
    if not answers:
        return None
    figures = {
        f"{base['variable']}|{seconds_text(answer['interval'])}|{origin}": horizon_figure(
            answer, base["variable"], origin
        )
        for answer in answers
        for base in answer["bases"]
        for origin in ORIGINS
    }
    steps = [seconds_text(answer["interval"]) for answer in answers]
    pickers = {
        "variable": {base["variable"]: base["variable"] for answer in answers for base in answer["bases"]},
        "Δτ": dict(zip(steps, steps, strict=True)),
        "from": ORIGINS,
    }
    said = "".join(f"<li>{escape(sentence)}</li>" for answer in answers for sentence in answer["sentences"].values())
    body = f'<ul class="verdicts">{said}</ul><p class="quiet">{TEXT}</p>'
    return Section("Beyond the window", body, figures, pickers, _omitted(answers))


def horizon_figure(answer: Mapping[str, Any], variable: str, origin: str) -> Figure:
    """Error of each surrogate against snapshots ahead, on the most modes; those on fewer can be switched on."""
    rows = [row for row in answer["rows"] if row["variable"] == variable]
    field, unit = error_field(rows)
    scale = answer["diameter"] if field == "rmse_diameters" else 1.0
    colours = colours_of(row for row in rows if row["surrogate"] not in BASELINES)
    rows = [row for row in rows if origin == "end" or row["starts"] > 1]
    most = max((row["modes"] for row in rows if row["modes"] is not None), default=None)
    data = [_baseline(row, origin, scale) for row in rows if row["surrogate"] in BASELINES]
    data += _floors(rows, origin, most, scale)
    data += [_drawn(r, origin, most, colours[r["surrogate"]], scale) for r in rows if r["surrogate"] in colours]
    few = [line for line in data if "legendgroup" in line]
    for line in few[1:]:  # one entry of the legend switches all of them
        line["showlegend"] = False
    title = f"snapshots ahead, {seconds_text(answer['interval'])} each"
    layout = {
        "xaxis": {"title": {"text": title}, "type": "linear"},
        "yaxis": {"title": {"text": f"error ({unit})"}, "type": "log", **_range(rows, data, origin, scale)},
        "hovermode": "closest",
    }
    return {"data": data, "layout": layout}


def _errors(row: Mapping[str, Any], origin: str) -> Sequence[float | None]:
    curve: Sequence[float | None] = row["from_end"]["rmse"] if origin == "end" else row["rmse"]
    return curve


def _drawn(row: Mapping[str, Any], origin: str, most: int | None, colour: str, scale: float) -> Figure:
    """Draw one surrogate; what is on fewer modes than most waits in the legend."""
    raw, few = row["modes"] is None, row["modes"] not in (None, most)
    line = {"color": colour, "width": 3 if raw else 2, "dash": "dashdot" if raw else "dot" if few else "solid"}
    name = escape(str(row["surrogate"])) + (f", {row['modes']} modes" if few else "")
    return _line(name, _errors(row, origin), line, scale) | (WAITING if few else {})


def _baseline(row: Mapping[str, Any], origin: str, scale: float) -> Figure:
    line = {"color": QUIET, "width": 3, "dash": BASELINES[row["surrogate"]]}
    return _line(row["surrogate"], _errors(row, origin), line, scale)


def _floors(rows: Rows, origin: str, most: int | None, scale: float) -> list[Figure]:
    """Draw what exact coefficients would leave from the same starts, once for each number of modes."""
    # a row's floor is a mean over its own starts: from the end of training alone where it has no other
    known = {r["modes"]: r["floor"] for r in rows if r["floor"] is not None and (r["starts"] == 1) == (origin == "end")}
    line = {"color": QUIET, "width": 1.5, "dash": "dash"}
    return [
        _line(f"floor, {modes} modes", floor, line, scale) | (WAITING if modes != most else {})
        for modes, floor in sorted(known.items(), reverse=True)
    ]


def _line(name: str, curve: Sequence[float | None], line: Figure, scale: float) -> Figure:
    """Draw a curve from one snapshot ahead on; nothing where a rollout is lost, nor where the error is zero."""
    y = [float(f"{error / scale:.6g}") if error else None for error in curve]
    hover = f"{name}: %{{y:.3g}}, %{{x}} ahead<extra></extra>"
    x = list(range(1, len(curve) + 1))
    return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": line, "hovertemplate": hover}


def _range(rows: Rows, data: Rows, origin: str, scale: float) -> Figure:
    """Cut the axis above what is far worse than persistence, which is always among the rows."""
    still = [error for row in rows if row["surrogate"] == "persistence" for error in _errors(row, origin) if error]
    shown = [y for line in data for y in line["y"] if y]
    if not still or not shown:
        return {}
    top = HIGHEST * max(still) / scale
    low, high = min(shown), min(max(shown), top)
    # plotly takes the powers of ten; a tenth of a decade keeps lines off the frame
    return ticks([low, high]) | {"range": [math.log10(low) - 0.1, math.log10(high) + 0.1]}


def _omitted(answers: Rows) -> str:
    """Say what was left out."""
    lines = [f"{seconds_text(a['interval'])}: {left['reason']}" for a in answers for left in a["left_out"]]
    items = "".join(f"<li>{escape(line)}</li>" for line in dict.fromkeys(lines))
    return f"<details><summary>Left out</summary><ul>{items}</ul></details>" if items else ""
