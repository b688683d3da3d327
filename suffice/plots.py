"""Figures of the report, as plain plotly data: which lines, on which axes."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from suffice.wording import escape, finite, seconds_text

Figure = dict[str, Any]

COLOURS = (
    *("#3b8fd0", "#e08214", "#2ca089", "#b35bb0", "#d6404e", "#93913f", "#7a6fd0", "#5c9e45"),
    *("#a0683c", "#d9799f", "#4fb3bf", "#c2a417"),
)
COARSE, MIDDLE, FINE = (217, 102, 43), (160, 95, 181), (31, 147, 168)  # colours of Δτ; readable on light and dark
QUIET = "#8791a0"
STEPS = (
    (1,),
    (1, 2, 5),
    (1, 1.5, *range(2, 10)),
    [k / 10 for k in range(10, 100)],
)  # marks of a decade
NOISE = 1e-14  # of the energy: below it 1 - I is the rounding of a sum
ENERGIES = ("kinetic", "rotational", "potential", "elastic", "dissipated", "wall_work", "fluid_work", "balance")


def consistency_figure(curves: Mapping[str, Any], judged: Sequence[Mapping[str, Any]], limit: float) -> Figure:
    """R_c against the number of modes, one line per Δτ, n_c and n_lr marked, the threshold across.

    curves: by Δτ, with `R_c` and `R_gap` at n = 0, 1, …; judged: the candidates of the same variable, for the marks.
    """
    by_interval = _coarse_to_fine(curves)
    marks = {float(candidate["interval"]): candidate for candidate in judged}
    data: list[Figure] = []
    for i, (interval, curve) in enumerate(by_interval):
        colour = ramp(i, len(by_interval))
        data.append(_curve(seconds_text(interval), curve.get("R_c") or [], 0, colour))
        gap = _curve("gaps alone", curve.get("R_gap") or [], 0, colour, "dot")
        data.append({**gap, "legendgroup": "gap", "showlegend": i == 0, "visible": "legendonly", "legendrank": 2000})
        data.extend(_marks(marks.get(interval), curve.get("R_c") or [], colour))
    layout = axes_layout("modes n", "R<sub>c</sub> = mean E<sub>test</sub> / mean E<sub>train</sub>", "log", "log")
    layout["yaxis"] |= {"range": [-0.008, 0.5], "tickvals": [1, limit, 1.2, 1.5, 2, 3], "tickformat": ".3~g"}
    layout["shapes"] = [level_across(limit)]
    return {"data": data, "layout": layout}


def spectrum_figure(ratios: Mapping[str, Any], energy: float) -> Figure:
    """Energy that p modes leave out, 1 - I(p), one line per Δτ, the share that defines n_lr across."""
    by_interval = _coarse_to_fine(ratios)
    data = []
    for i, (interval, ratio) in enumerate(by_interval):
        first = 0 if ratio and ratio[0] == 0 else 1
        left = [None if finite(x) is None or 1 - x < NOISE else 1 - x for x in ratio]
        data.append(_curve(seconds_text(interval), left, first, ramp(i, len(by_interval))))
    layout = axes_layout("modes p", "energy left out, 1 − I(p)", "log", "log")
    layout["yaxis"]["exponentformat"] = "power"
    layout["shapes"] = [level_across(1 - energy)]
    return {"data": data, "layout": layout}


def lanczos_figure(found: Mapping[str, Any], modes: int) -> Figure:
    """Share of the energy that the leading Ritz pairs hold against Lanczos steps, for both denominators."""
    steps = list(found["steps"])
    data = [
        drawn_line(
            f"of the total energy, {modes} modes", steps, list(found["ratio"]), {"color": COLOURS[0], "width": 3}
        ),
        drawn_line(
            "of all Ritz values, the paper's", steps, list(found["paper_ratio"]),
            {"color": COLOURS[1], "width": 2, "dash": "dot"},
        ),
    ]  # fmt: skip
    return {"data": data, "layout": axes_layout("Lanczos steps k", "Lanczos ratio I<sub>k</sub>", "linear", "linear")}


def error_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Error at unseen times against Δτ for each surrogate and baseline, with the floor that projection sets."""
    field, unit = error_field(rows)
    data = [_floor_line(rows, field, most=True), _floor_line(rows, field, most=False)]
    for name, colour in colours_of(rows).items():
        own = [row for row in rows if row["surrogate"] == name]
        raw = all(row["modes"] is None for row in own)
        data.append(_error_line(escape(name), _levels(own, True), field, {"color": colour, "width": 3 if raw else 2}))
        if not raw:
            few = _error_line(
                "all on n<sub>lr</sub> modes", _levels(own, False), field, {"color": colour, "dash": "dot"}
            )
            first = not any(line.get("legendgroup") for line in data)
            data.append({**few, "legendgroup": "few", "showlegend": first, "visible": "legendonly", "legendrank": 2000})
    data = [line for line in data if line["x"]]
    layout = axes_layout("Δτ (ms)", f"error ({unit})", "log", "log")
    values = sorted({row["interval"] * 1e3 for row in rows})
    layout["xaxis"] |= {"tickvals": values, "ticktext": [f"{value:.3g}" for value in values]}
    layout["yaxis"] |= ticks(y for line in data for y in line["y"])
    return {"data": data, "layout": layout}


def ledger_figure(series: Mapping[str, Any]) -> Figure | None:
    """Change of each energy since the start, over time; None where the run recorded no energy."""
    times, names = series.get("times") or [], [name for name in ENERGIES if series.get(name)]
    if not times or not names:
        return None
    data = []
    for i, name in enumerate(names):
        start = finite(series[name][0]) or 0.0
        change = [None if finite(x) is None else x - start for x in series[name]]
        line = {"color": COLOURS[i % len(COLOURS)]} if name != "balance" else {"color": QUIET, "dash": "dash"}
        data.append(drawn_line(name.replace("_", " "), list(times), change, line))
    layout = axes_layout("time (s)", "change since the start (J)", "linear", "linear")
    layout["yaxis"]["exponentformat"] = "power"
    return {"data": data, "layout": layout}


def stages_figure(stages: Sequence[Mapping[str, Any]]) -> Figure:
    """Wall time of each stage, first at the top."""
    names = [escape(str(stage["name"])) for stage in stages]
    seconds = [finite(stage.get("seconds")) for stage in stages]
    bar = {
        "type": "bar",
        "orientation": "h",
        "x": seconds,
        "y": names,
        "text": [seconds_text(value) for value in seconds],
        "textposition": "auto",
        "customdata": [escape(str(stage.get("detail") or "")) for stage in stages],
        "hovertemplate": "%{y}: %{text}<br>%{customdata}<extra></extra>",
        "marker": {"color": COLOURS[0]},
    }
    layout = axes_layout("wall time (s)", "", "linear", "category")
    layout["yaxis"] = {"autorange": "reversed", "type": "category"}
    layout["height"] = 90 + 36 * len(names)
    return {"data": [bar], "layout": layout}


def error_field(rows: Iterable[Mapping[str, Any]]) -> tuple[str, str]:
    """Return the key and the unit in which errors are shown: diameters where they are known."""
    first = next(iter(rows))
    if first.get("rmse_diameters") is not None:
        return "rmse_diameters", "diameters"
    return "rmse", escape(str(first.get("unit", "")))


def _coarse_to_fine(by_interval: Mapping[str, Any]) -> list[tuple[float, Any]]:
    return sorted(((float(interval), value) for interval, value in by_interval.items()), reverse=True)


def ramp(i: int, count: int) -> str:
    """Colour i of `count`, from coarse to fine."""
    s = 2 * i / max(count - 1, 1)
    low, high = (COARSE, MIDDLE) if s <= 1 else (MIDDLE, FINE)
    s -= s > 1
    return "#" + "".join(f"{round(a + s * (b - a)):02x}" for a, b in zip(low, high, strict=True))


def drawn_line(name: str, x: list[Any], y: list[Any], line: Figure) -> Figure:
    """Return a line through points."""
    return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": line}


def _curve(name: str, values: Sequence[Any], first: int, colour: str, dash: str = "solid") -> Figure:
    """One value per number of modes, from `first`; n = 0 has no place on a logarithmic axis."""
    points = [(first + k, _rounded(value)) for k, value in enumerate(values) if first + k > 0]
    line = {"color": colour, "width": 1.8, "dash": dash}
    return drawn_line(name, [n for n, _ in points], [value for _, value in points], line)


def _rounded(value: Any) -> float | None:
    known = finite(value)
    return None if known is None else float(f"{known:.6g}")


def _marks(candidate: Mapping[str, Any] | None, ratio: Sequence[Any], colour: str) -> list[Figure]:
    """Mark the line: filled at n_c, open at n_lr."""
    found = []
    for key, symbol in (("n_c", "circle"), ("n_lr", "circle-open")):
        n = (candidate or {}).get(key)
        if n and n < len(ratio) and finite(ratio[n]) is not None:
            mark = {"color": colour, "size": 9, "symbol": symbol, "line": {"width": 2, "color": colour}}
            name = key.replace("_c", "<sub>c</sub>").replace("_lr", "<sub>lr</sub>")
            point = {"type": "scatter", "mode": "markers", "x": [n], "y": [_rounded(ratio[n])], "marker": mark}
            found.append({**point, "showlegend": False, "hovertemplate": f"{name} = {n}<extra></extra>"})
    return found


def colours_of(rows: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return a colour for each surrogate of the rows, in their order."""
    names = dict.fromkeys(row["surrogate"] for row in rows)
    return {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}


def _levels(rows: Sequence[Mapping[str, Any]], most: bool) -> list[Mapping[str, Any]]:
    """Of each Δτ the row with the most modes, or with the fewest, coarse to fine."""
    by_interval: dict[float, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_interval.setdefault(row["interval"], []).append(row)
    pick = max if most else min
    return [pick(own, key=lambda row: row["modes"] or 0) for _, own in sorted(by_interval.items(), reverse=True)]


def _error_line(name: str, rows: Sequence[Mapping[str, Any]], field: str, line: Figure) -> Figure:
    drawn = drawn_line(name, [row["interval"] * 1e3 for row in rows], [_rounded(row[field]) for row in rows], line)
    return {**drawn, "mode": "lines+markers", "hovertemplate": f"{name}: %{{y:.3g}} at %{{x:.3g}} ms<extra></extra>"}


def _floor_line(rows: Sequence[Mapping[str, Any]], field: str, *, most: bool) -> Figure:
    """Error of projection itself; in diameters if errors are."""
    on_modes = _levels([row for row in rows if row["modes"] is not None], most)
    scale = [
        row["rmse_diameters"] / row["rmse"] if field == "rmse_diameters" and row["rmse"] else 1 for row in on_modes
    ]
    floor = [_rounded(row["projection_rmse"] * s) for row, s in zip(on_modes, scale, strict=True)]
    name = f"floor, {'all' if most else 'n<sub>lr</sub>'} modes"
    line = {"color": QUIET, "dash": "dash" if most else "dot"}
    return drawn_line(name, [row["interval"] * 1e3 for row in on_modes], floor, line)


def axes_layout(x: str, y: str, x_type: str, y_type: str) -> Figure:
    """Return two axes with their titles and types, `linear` or `log`."""
    return {
        "xaxis": {"title": {"text": x}, "type": x_type},
        "yaxis": {"title": {"text": y}, "type": y_type},
        "hovermode": "closest",
    }


def level_across(y: float) -> Figure:
    """Return a dashed level from side to side."""
    line = {"color": QUIET, "width": 1.5, "dash": "dash"}
    return {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y, "line": line}


def ticks(values: Iterable[Any], text: Callable[[float], str] = "{:.6g}".format) -> Figure:
    """Put marks at 1, 2 and 5 times a power of ten, in plain figures; at the powers alone where there are many.

    Three lie between the least and the largest value, at finer steps if need be: with fewer a scale cannot be read.
    """
    known = [value for value in map(finite, values) if value is not None and value > 0]
    if not known:
        return {}
    low, high = math.floor(math.log10(min(known))), math.floor(math.log10(max(known)))
    marks = _at_steps(STEPS[1] if high - low < 4 else STEPS[0], low, high)
    for steps in STEPS[2:] if max(known) > 1.1 * min(known) else ():  # of one value plotly shows two decades
        if sum(min(known) <= mark <= max(known) for mark in marks) >= 3:
            break
        marks = [mark for mark in _at_steps(steps, low, high) if min(known) / 1.3 <= mark <= 1.3 * max(known)]
    return {"tickvals": marks, "ticktext": [text(mark) for mark in marks]}


def _at_steps(steps: Sequence[float], low: int, high: int) -> list[float]:
    return [float(f"{step}e{power}") for power in range(low, high + 2) for step in steps]
