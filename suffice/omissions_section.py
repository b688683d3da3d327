"""Section of the report: what each omission saves, and what it costs in observables."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import sqrt
from typing import Any

from suffice.plots import COLOURS, QUIET, Figure, ticks
from suffice.section import Section
from suffice.wording import bytes_text, escape, number, seconds_text, threads_text

Row = Mapping[str, Any]
FRONT, TERMS, SPECTRUM = "front", "terms", "spectrum"
SHOWN = {FRONT: "error against cost", TERMS: "seconds by term", SPECTRUM: "impacts by energy"}
ROUNDED = 0.0995  # differences above it are shown in whole per cent
SEEN = 1e-3  # of the largest power: bins below it at either end are not drawn
PER_DECADE = 5  # bins of the spectrum of impacts in a decade of energy


def omissions_section(results: Mapping[str, Any]) -> Section | None:
    """Show cost and differences of every variant of a scene, the front of both, and what is chosen.

    results["omissions"]: as `compare_omissions` answers.
    """
    answer = results.get("omissions")
    if not answer:
        return None
    scatter = answer["scatter_error"]
    window = " to ".join(f"{time:g}" for time in answer["window"])
    text = (
        f"Means over {window} s, in % of those of {len(scatter)} runs of the scene itself with other packings. "
        f"<i>Error</i>: the largest of these differences. Bold: more than the packings explain (above "
        f"{number(answer['floors_to_be_real'])} standard deviations of a further one); what is not bold may be noise. "
        f"That noise alone makes errors of {_percent(min(scatter))} to {_percent(max(scatter))}; the largest is dashed "
        f"below, the limit dotted. <i>Δτ</i>: what suffices for {escape(answer['variable'])} by the paper's rule."
    )
    body = (
        f'<ul class="verdicts"><li>{escape(str(answer["choice"]["sentence"]))}</li></ul>'
        f'<p class="quiet">{text}</p>{_table(answer)}'
    )
    figures = {FRONT: front_figure(answer), TERMS: terms_figure(answer)}
    if answer["spectra"]:
        figures[SPECTRUM] = spectrum_figure(answer["spectra"], len(scatter))
    below = f"<details><summary>Every observable and cost, and what was left out</summary>{_details(answer)}</details>"
    return Section("Physics left out", body, figures, {"shown": {key: SHOWN[key] for key in figures}}, below)


def _percent(share: Any) -> str:
    return "–" if share is None else f"{number(100 * share, 2)} %"


def _signed(row: Row, name: str) -> str:
    """Write a difference in %, with a sign where it has one, bold where it is real."""
    value = row["differences"].get(name)
    if value is None:
        return "–"
    sign = "" if name.startswith("void_fraction") else "+"  # the difference of a profile has none
    text = f"{100 * value:{sign}.{0 if abs(value) >= ROUNDED else 1}f}"
    return f"<b>{text}</b>" if row["real"].get(name) else text


def _table(answer: Mapping[str, Any]) -> str:
    asked: Sequence[str] = answer["asked"]
    keeps = f"keeps<br>{_percent(answer['max_difference'])}"
    titles = ["of the<br>scene", "error", keeps, "seconds", *(_broken(name) for name in asked), "Δτ"]
    scene = answer["reference"]
    chosen = _chosen(scene["feasibility"])
    first = _cells(["1", "0", "", seconds_text(scene["seconds"]), *("0" for _ in asked), chosen])
    rows = [f"<tr><td><i>the scene itself</i></td>{first}</tr>", *(_table_row(row, asked) for row in answer["rows"])]
    return _framed("variant", titles, rows)


def _broken(name: str) -> str:
    """Write the name of an observable over several lines."""
    return escape(name.replace("_", " ")).replace(".", "<br>").replace(" ", "<br>") + "<br>(%)"


def _framed(corner: str, titles: Sequence[str], rows: Sequence[str]) -> str:
    head = "".join(f'<th class="number">{title}</th>' for title in titles)
    return f'<div class="scroll"><table class="plain"><tr><th>{corner}</th>{head}</tr>{"".join(rows)}</table></div>'


def _cells(texts: Sequence[str]) -> str:
    return "".join(f'<td class="number">{text}</td>' for text in texts)


def _table_row(row: Row, asked: Sequence[str]) -> str:
    name = f'<td title="{escape(str(row["left_out"]))}">{escape(str(row["variant"]))}</td>'
    if row["refused"] is not None:
        return f'<tr>{name}<td colspan="{5 + len(asked)}">refused, see below</td></tr>'
    judged = [number(row["relative_cost"], 2), _percent(row["error"]), _pill(row), seconds_text(row["seconds"])]
    differences = (_signed(row, key) for key in asked)
    return f"<tr>{name}{_cells([*judged, *differences, _chosen([row['feasibility']])])}</tr>"


def _pill(row: Row) -> str:
    """Say whether a row keeps the limit, and whether that is sure."""
    text = ("yes" if row["keeps"] else "no") if row["certain"] else "perhaps" if row["keeps"] else "perhaps not"
    style = "undecidable" if not row["certain"] else "sufficient" if row["keeps"] else "insufficient"
    return f'<span class="pill {style}">{text}</span>'


def _chosen(found: Sequence[Mapping[str, Any]]) -> str:
    """Largest Δτ that suffices by the paper's rule, of each run."""
    intervals = dict.fromkeys(one["chosen_interval"] for one in found)
    return " or ".join("none" if interval is None else seconds_text(interval) for interval in intervals)


def front_figure(answer: Mapping[str, Any]) -> Figure:
    """Error against cost relative to the scene itself, the Pareto front as a line, the scene's own scatter dashed."""
    rows = [row for row in answer["rows"] if row.get("error") is not None]
    front = sorted((row for row in rows if row["on_front"]), key=lambda row: float(row["relative_cost"]))
    line = {"color": QUIET, "width": 1.5, "shape": "hv"}
    xs, ys = [row["relative_cost"] for row in front], [100 * row["error"] for row in front]
    scatter = 100 * max(answer["scatter_error"])
    data: list[Figure] = [
        {"type": "scatter", "mode": "lines", "name": "front", "x": xs, "y": ys, "line": line, "hoverinfo": "skip"}
    ]
    for i, row in enumerate(rows):
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": escape(str(row["variant"])),
                "x": [row["relative_cost"]],
                "y": [100 * row["error"]],
                "marker": {"size": 10, "color": COLOURS[i % len(COLOURS)], "symbol": i // len(COLOURS)},
                "hovertemplate": f"<b>{escape(str(row['variant']))}</b><br>{escape(str(row['left_out']))}<br>"
                f"{number(row['relative_cost'])} of the cost, {number(100 * row['error'])} % in "
                f"{escape(str(row['error_in']))}<extra></extra>",
            }
        )
    levels = ((scatter, "dash"), (100 * answer["max_difference"], "dot"))
    layout: Figure = {
        "xaxis": {"title": {"text": "cost / cost of the scene itself"}, "type": "log"},
        "yaxis": {"title": {"text": "largest difference (%)"}, "type": "log"},
        "hovermode": "closest",
        "shapes": [_level(y, dash) for y, dash in levels],
    }
    layout["xaxis"] |= ticks([*(row["relative_cost"] for row in rows), 1.0])
    layout["yaxis"] |= ticks([*(100 * row["error"] for row in rows), scatter])
    return {"data": data, "layout": layout}


def _level(y: float, dash: str) -> Figure:
    line = {"color": QUIET, "width": 1.5, "dash": dash}
    return {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y, "line": line}


def terms_figure(answer: Mapping[str, Any]) -> Figure:
    """Seconds of each run by term, stacked; the scene itself at the top."""
    costs = [("the scene itself", answer["reference"])]
    costs += [(str(row["variant"]), row) for row in answer["rows"] if row["refused"] is None]
    terms = dict.fromkeys(term for _, cost in costs for term in cost["seconds_of"])
    data = [
        {
            "type": "bar",
            "orientation": "h",
            "name": escape(str(term)),
            "y": [escape(name) for name, _ in costs],
            "x": [cost["seconds_of"].get(term, 0.0) for _, cost in costs],
            "marker": {"color": COLOURS[i % len(COLOURS)]},
            "hovertemplate": f"%{{y}}: {escape(str(term))} %{{x:.3g}} s<extra></extra>",
        }
        for i, term in enumerate(terms)
    ]
    layout = {
        "xaxis": {"title": {"text": "time of computing (s)"}, "type": "linear"},
        "yaxis": {"autorange": "reversed", "type": "category"},
        "barmode": "stack",
        "hovermode": "closest",
        "height": 150 + 30 * len(costs),
    }
    return {"data": data, "layout": layout}


def spectrum_figure(spectra: Mapping[str, Any], seeds: int) -> Figure:
    """Power of the impacts of pairs in each decade of their energy; runs of the scene itself in grey."""
    edges = spectra["energy"]
    middles = [sqrt(a * b) for a, b in pairwise(edges)]
    runs = spectra["runs"]
    least = SEEN * max(max(power) for power in runs.values())
    shown = [k for k in range(len(middles)) if any(power[k] > least for power in runs.values())]
    used = range(shown[0], shown[-1] + 1) if shown else range(0)
    data = []
    for i, (name, power) in enumerate(runs.items()):
        own = i < seeds
        line = {"color": QUIET, "width": 4} if own else {"color": COLOURS[(i - seeds) % len(COLOURS)], "width": 1.8}
        line |= {} if own or i - seeds < len(COLOURS) else {"dash": "dash"}
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": "the scene itself" if own else escape(name),
                "showlegend": i == 0 or not own,
                "legendgroup": "scene" if own else name,
                "x": [middles[k] for k in used],
                "y": [PER_DECADE * power[k] for k in used],
                "line": line,
            }
        )
    layout = {
        "xaxis": {"title": {"text": "energy of an impact (J)"}, "type": "log", "exponentformat": "power"},
        "yaxis": {"title": {"text": "power of impacts (W per decade)"}, "type": "linear"},
        "hovermode": "closest",
    }
    return {"data": data, "layout": layout}


def _details(answer: Mapping[str, Any]) -> str:
    said = "".join(_said(row) for row in answer["rows"])
    return f"{_observables(answer)}{_costs(answer)}<ul>{said}</ul>"


def _observables(answer: Mapping[str, Any]) -> str:
    """Tabulate every observable: the scene's own value and scatter, differences of every variant in %."""
    known = [row for row in answer["rows"] if row["refused"] is None]
    rows = []
    for name, what in answer["observables"].items():
        unit = "" if what["unit"] == "1" else f" {escape(str(what['unit']))}"
        own = "profile" if what["mean"] is None else f"{number(what['mean'])}{unit}"
        cells = _cells([own, _percent(what["floor"]), *(_signed(row, name) for row in known)])
        rows.append(f'<tr><td title="{escape(what["text"])}">{escape(name)}</td>{cells}</tr>')
    names = (escape(str(row["variant"])).replace(" ", "<br>") for row in known)
    return _framed("difference (%)", ["the scene itself", "noise", *names], rows)


def _costs(answer: Mapping[str, Any]) -> str:
    """Tabulate what every run took, and what `--explain` foresaw."""
    known = [("the scene itself", answer["reference"])]
    known += [(str(row["variant"]), row) for row in answer["rows"] if row["refused"] is None]
    rows = [
        f"<tr><td>{escape(name)}</td>"
        + _cells(
            [
                seconds_text(cost["seconds"]),
                seconds_text(cost["predicted_seconds"]),
                _percent(cost["waited"]),
                seconds_text(cost["time_step"]),
                f"{cost['particle_steps'] / 1e6:.0f}",
                number(cost["particle_steps_per_second"] / 1e6),
                bytes_text(cost["bytes_per_snapshot"]),
            ]
        )
        + "</tr>"
        for name, cost in known
    ]
    titles = [
        "seconds",
        "foreseen",
        "waited<br>besides",
        "time step",
        "10⁶ particle-<br>steps",
        "10⁶ a second",
        "a snapshot",
    ]
    return _framed(f"cost on {threads_text(answer['reference']['threads'])}", titles, rows)


def _said(row: Row) -> str:
    refused = "" if row["refused"] is None else f"; refused: {row['refused']}"
    return f"<li><b>{escape(str(row['variant']))}</b>: {escape(str(row['left_out']) + refused)}</li>"
