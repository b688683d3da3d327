"""Sections of the report: who wins, and what the snapshots of each surrogate are worth physically."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from suffice.plots import COLOURS, QUIET, Figure
from suffice.section import Section
from suffice.winners import EQUAL, winners
from suffice.wording import escape, finite, number, seconds_text

SHORT = {  # heads of columns; the full text is in their titles
    "overlap.largest": "largest overlap",
    "overlap.mean": "mean overlap",
    "overlap.pairs": "pairs per bead",
    "overlap.walls": "into walls",
    "kinetic_energy": "kinetic energy",
    "void_fraction.height": "void, height",
    "void_fraction.axis": "void, axis",
    "void_fraction.radius": "void, radius",
    "bed_height": "bed height",
    "rotor_side": "rotor side",
}
FLOOR = "projection"


def winners_section(results: Mapping[str, Any]) -> Section | None:
    """Who wins each variable and Δτ; None where nothing was compared."""
    found = winners((results.get("compare") or {}).get("rows") or [])
    if not found:
        return None
    body = "".join(_winner_row(entry) for entry in found)
    head = (
        "<tr><th>variable</th><th>Δτ</th><th>on n<sub>lr</sub> modes</th><th>on all modes</th><th>without any</th></tr>"
    )
    items = "".join(f"<li>{escape(entry['sentence'])}</li>" for entry in found)
    text = (
        "The surrogate of the same number of modes that errs least between the snapshots, and how much more the next "
        "one errs; the best baseline without modes is held against the best surrogate, and wins where it is bold. All "
        "on modes of positions alone and in the precision of the run; the sentences name both bases. What differs "
        "by less than 1 %, or than the spread over seeds, is a tie."
    )
    below = f'<details><summary>In sentences</summary><ul class="verdicts">{items}</ul></details>'
    table = f'<div class="scroll"><table class="plain words">{head}{body}</table></div>'
    return Section("Who wins", f'<p class="quiet">{text}</p>{table}', below=below)


def _winner_row(entry: Mapping[str, Any]) -> str:
    levels = entry["levels"]
    least, most = (levels[0], levels[-1]) if levels else (None, None)
    cells = (_level_cell(least if len(levels) > 1 else None), _level_cell(most), _raw_cell(entry))
    shown = "".join(f"<td>{cell}</td>" for cell in cells)
    return f"<tr><td>{escape(str(entry['variable']))}</td><td>{seconds_text(entry['interval'])}</td>{shown}</tr>"


def _raw_cell(entry: Mapping[str, Any]) -> str:
    name = escape(str(entry["raw"] or "–"))
    against = "" if entry["raw_by"] is None else f" {_signed(100 * entry['raw_by'])} %"
    return f"<b>{name}</b>{against}" if entry["raw_wins"] else f"{name}{against}"


def _signed(percent: float) -> str:
    """Write a difference in percent; one that is rounding is none."""
    return "±0" if abs(percent) < 5e-3 else f"{percent:+.3g}"


def _level_cell(level: Mapping[str, Any] | None) -> str:
    if level is None:
        return "–"
    names = [level["winner"], *level["tied"]]
    who = " = ".join(f"<b>{escape(str(name))}</b>" for name in names)
    ahead = f", {escape(str(level['next']))} +{100 * level['by']:.3g} %" if level["by"] is not None else ""
    return f'{who}{ahead} <span class="quiet">({level["modes"]})</span>'


def observables_section(results: Mapping[str, Any]) -> Section | None:
    """Errors in observables of each surrogate, a table per Δτ; None where none were observed.

    results["observables"]: list of answers of `compare_observables`.
    """
    answers: Sequence[Mapping[str, Any]] = results.get("observables") or []
    if not answers:
        return None
    figures = {
        f"{seconds_text(answer['interval'])}|{name}": observable_figure(answer, name)
        for answer in answers
        for name in answer["observables"]
    }
    pickers = {
        "Δτ": {seconds_text(answer["interval"]): seconds_text(answer["interval"]) for answer in answers},
        "observable": {name: what["text"] for answer in answers for name, what in answer["observables"].items()},
    }
    text = (
        "Whole snapshots between those kept, put together from all three components, and what can be measured in them; "
        "means over the unseen times. Overlaps: what the surrogate adds to the truth's. Others: size of the error, "
        "with a sign where it is always the same. <i>projection</i>: the truth itself on these modes, the best that "
        "any surrogate of them can know. Bold: the least error of a surrogate, and what is within 1 % of it."
    )
    tables = "".join(_table(answer) for answer in answers)
    return Section(
        "What the snapshots are worth", f'<p class="quiet">{text}</p>{tables}', figures, pickers, _omitted(answers)
    )


def shown_error(row: Mapping[str, Any], name: str, what: Mapping[str, Any], digits: int = 3) -> str:
    """Write one error: what a surrogate creates with its sign, another's sign only where it is always the same."""
    size, bias = finite(row["errors"].get(name)), finite(row["bias"].get(name))
    if bias is not None and (what["error"] == "created" or abs(bias) > 0.99 * (size or 0.0)):
        return number(bias, digits, "+") if bias else "0"
    return number(size, digits)


def ranked_error(row: Mapping[str, Any], name: str, what: Mapping[str, Any]) -> float | None:
    """Size of an error, by which surrogates are ranked."""
    value = finite(row["bias" if what["error"] == "created" else "errors"].get(name))
    return None if value is None else abs(value)


def heads_of(answer: Mapping[str, Any]) -> dict[str, str]:
    """Heads of the columns of an answer, with units."""
    units = {name: what["error_unit"] for name, what in answer["observables"].items()}
    return {name: SHORT.get(name, name) + (f" ({unit})" if unit != "1" else "") for name, unit in units.items()}


def truth_text(what: Mapping[str, Any]) -> str:
    """Return the mean of an observable in the truth, with its unit where the head of its column has another."""
    return number(what["truth"]) + ("" if what["unit"] == what["error_unit"] else f" {what['unit']}")


def _table(answer: Mapping[str, Any]) -> str:
    described, rows = answer["observables"], answer["rows"]
    heads = heads_of(answer)
    head = "".join(
        f'<th class="number" title="{escape(_title(described[name]))}">{"<br>".join(map(escape, _lines(text)))}</th>'
        for name, text in heads.items()
    )
    truth = "".join(f'<td class="number">{escape(truth_text(what))}</td>' for what in described.values())
    best = {name: _least(rows, name, what) for name, what in described.items()}
    body = "".join(_table_row(row, described, best) for row in rows)
    unit = "RMSE<br>(d)" if answer["diameter"] else "RMSE<br>(m)"
    title = f"Δτ {seconds_text(answer['interval'])}"
    return (
        f'<div class="scroll"><table class="plain"><tr><th>{title}</th><th class="number">modes</th>'
        f'<th class="number">{unit}</th>{head}</tr><tr><td><i>truth</i></td><td></td><td></td>{truth}</tr>{body}'
        "</table></div>"
    )


def _title(what: Mapping[str, Any]) -> str:
    return what["text"] if what["unit"] == what["error_unit"] else f"{what['text']}; the truth in {what['unit']}"


def _lines(text: str) -> list[str]:
    """Break a head into its words and its unit, for a narrow column."""
    words, _, unit = text.partition(" (")
    first, _, last = words.rpartition(" ")
    return [*filter(None, (first, last)), *([f"({unit}"] if unit else [])]


def _least(rows: Iterable[Mapping[str, Any]], name: str, what: Mapping[str, Any]) -> float | None:
    sizes = [ranked_error(row, name, what) for row in rows if row["surrogate"] != FLOOR]
    return min((size for size in sizes if size is not None), default=None)


def _table_row(row: Mapping[str, Any], described: Mapping[str, Any], best: Mapping[str, float | None]) -> str:
    floor = row["surrogate"] == FLOOR
    rmse = row["rmse_diameters"] if row["rmse_diameters"] is not None else row["rmse"]
    cells = []
    for name, what in described.items():
        text = shown_error(row, name, what, digits=2)
        size, least = ranked_error(row, name, what), best[name]
        first = not floor and size is not None and least is not None and size <= least * (1.0 + EQUAL)
        cells.append(f'<td class="number">{f"<b>{text}</b>" if first else text}</td>')
    name = escape(str(row["surrogate"]))
    modes = "–" if row["modes"] is None else str(row["modes"])
    return (
        f'<tr><td>{f"<i>{name}</i>" if floor else name}</td><td class="number">{modes}</td>'
        f'<td class="number">{number(rmse)}</td>{"".join(cells)}</tr>'
    )


def _omitted(answers: Sequence[Mapping[str, Any]]) -> str:
    """Say what was left out, and how observables are meant."""
    lines = dict.fromkeys(note for answer in answers for note in answer["notes"])
    for answer in answers:
        for left in answer["left_out"]:
            what = left["observable"]
            lines[
                f"{what}: {left['reason']}" if what else f"Δτ {seconds_text(answer['interval'])}: {left['reason']}"
            ] = None
    items = "".join(f"<li>{escape(str(line))}</li>" for line in lines)
    return f"<details><summary>Left out, and notes</summary><ul>{items}</ul></details>" if items else ""


def observable_figure(answer: Mapping[str, Any], name: str) -> Figure:
    """Error of one observable by surrogate; of a profile, prediction less truth from place to place."""
    what = answer["observables"][name]
    return _profile_figure(answer, name) if what["profile"] else _dots_figure(answer, name, what)


def _dots_figure(answer: Mapping[str, Any], name: str, what: Mapping[str, Any]) -> Figure:
    """Sizes of the errors, on all modes (filled), on n_lr (open), on none (diamond), as elsewhere on the page."""
    levels = {row["modes"] for row in answer["rows"] if row["modes"] is not None}
    most = max(levels, default=None)
    labels = {most: ("all modes", "circle"), None: ("no modes", "diamond")}
    data = []
    for i, modes in enumerate([*sorted(levels, reverse=True), None]):
        label, symbol = labels.get(modes, ("n<sub>lr</sub> modes", "circle-open"))
        own = [row for row in answer["rows"] if row["modes"] == modes and row["errors"].get(name) is not None]
        mark = {"size": 10, "symbol": symbol, "color": COLOURS[i], "line": {"width": 2, "color": COLOURS[i]}}
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": label,
                "x": [row["errors"][name] for row in own],
                "y": [escape(str(row["surrogate"])) for row in own],
                "marker": mark,
                "hovertemplate": "%{y}: %{x:.3g}<extra></extra>",
            }
        )
    names = list(dict.fromkeys(escape(str(row["surrogate"])) for row in answer["rows"]))
    unit = f" ({escape(what['error_unit'])})" if what["error_unit"] != "1" else ""
    axis = {"title": {"text": f"size of the error{unit}"}, "type": "linear", "rangemode": "tozero"}
    order = {
        "type": "category",
        "categoryorder": "array",
        "categoryarray": names[::-1],
        "range": [-0.5, len(names) - 0.5],
    }
    return {
        "data": data,
        "layout": {"xaxis": axis, "yaxis": order, "hovermode": "closest", "height": 120 + 30 * len(names)},
    }


def _profile_figure(answer: Mapping[str, Any], name: str) -> Figure:
    truth, place = answer["profiles"][name]["values"], answer["profiles"][name]["place"]
    most = max((row["modes"] for row in answer["rows"] if row["modes"] is not None), default=None)
    names = list(dict.fromkeys(row["surrogate"] for row in answer["rows"]))
    data: list[Figure] = []
    for row in answer["rows"]:
        known = zip(row["profiles"][name], truth, strict=True)
        floor, few = row["surrogate"] == FLOOR, row["modes"] not in (None, most)
        colour = QUIET if floor else COLOURS[names.index(row["surrogate"]) % len(COLOURS)]
        line = {"color": colour, "width": 3 if floor else 2, "dash": "dot" if few else "dash" if floor else "solid"}
        label = escape(str(row["surrogate"])) + (f", {row['modes']} modes" if few else "")
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "name": label,
                "x": [1e3 * value for value in place],
                "y": [None if a is None or b is None else a - b for a, b in known],
                "line": line,
                "visible": "legendonly" if few else True,
                "legendrank": 2000 if few else 1000,
            }
        )
    where = {"height": "height", "axis": "place along the axis", "radius": "distance from the axis"}[name.split(".")[1]]
    return {
        "data": data,
        "layout": {
            "xaxis": {"title": {"text": f"{where} (mm)"}, "type": "linear"},
            "yaxis": {"title": {"text": "void fraction, less the truth's"}, "type": "linear"},
            "hovermode": "closest",
        },
    }
