"""Curves of the paper's experiment: Figures 2, 6 and 7, numbered as there."""

from collections.abc import Mapping, Sequence
from typing import Any

from suffice.plots import COLOURS, QUIET, Figure, axes_layout, drawn_line, level_across, ramp, ticks
from suffice.wording import escape, finite, seconds_text

Curves = Mapping[str, Any]
NOISE = 1e-14  # of the energy: below it 1 - I is the rounding of a sum


def energies_figure(ratios: Mapping[str, Sequence[Any]], levels: Sequence[float]) -> Figure:
    """Energy that p modes leave out, 1 - I(p), one line per variable. ratios: I(p) at p = 0, 1, …; levels: of n_lr."""
    data = []
    for i, (name, ratio) in enumerate(ratios.items()):
        left = [None if finite(x) is None or 1 - x < NOISE else float(f"{1 - x:.4g}") for x in ratio[1:]]
        data.append(drawn_line(escape(name), list(range(1, len(ratio))), left, _colour(i)))
    layout = axes_layout("modes p", "energy left out, 1 − I(p)", "log", "log")
    layout["yaxis"]["exponentformat"] = "power"
    layout["shapes"] = [level_across(1 - energy) for energy in sorted(set(levels))]
    return {"data": data, "layout": layout}


def convergence_figure(curves: Mapping[str, Curves]) -> Figure:
    """Lanczos ratio of the n_lr leading Ritz pairs against Lanczos steps, one line per variable (paper eq. (28))."""
    data = []
    for i, (name, curve) in enumerate(curves.items()):
        ratio = [float(f"{x:.5g}") for x in curve["ratio"]]
        data.append(drawn_line(f"{escape(name)}, {curve['modes']} modes", list(curve["steps"]), ratio, _colour(i)))
    layout = axes_layout("Lanczos steps k", "Lanczos ratio I<sub>k</sub>(n<sub>lr</sub>)", "log", "linear")
    layout["shapes"] = [level_across(energy) for energy in sorted({curve["energy"] for curve in curves.values()})]
    return {"data": data, "layout": layout}


def coefficient_figure(found: Curves, unit: str) -> Figure:
    """Return a coefficient over time: the dense truth, wide, and what ROMs trained at several Δτ predict."""
    data = [drawn_line("simulated", found["times"], _short(found["truth"]), {"color": QUIET, "width": 5})]
    for i, one in enumerate(found["predicted"]):
        name = f"ROM, Δτ = {seconds_text(one['interval'])}"
        style = {"color": ramp(i, len(found["predicted"])), "width": 1.6}
        data.append(drawn_line(name, found["times"][: len(one["values"])], _short(one["values"]), style))
    return {
        "data": data,
        "layout": axes_layout("time (s)", f"c<sub>{found['mode']}</sub> ({escape(unit)})", "linear", "linear"),
    }


def history_figure(history: Sequence[Curves], unit: str, diameter: float | None) -> Figure:
    """Error of projection on all modes over time (paper eqs. (33)-(34)): testing lines, and training marks near zero.

    diameter: in m, of errors in m, which are then shown in diameters.
    """
    scale = 1.0 if diameter is None else 1.0 / diameter
    data: list[Figure] = []
    for i, one in enumerate(history):
        colour, name = ramp(i, len(history)), seconds_text(one["interval"])
        errors = _short([scale * error for error in one["error"]])
        data.append(drawn_line(f"testing, {name}", one["times"], errors, {"color": colour, "width": 1.2}))
        training = [(one["times"][k], errors[k]) for k in one["training"]]
        marks = {"type": "scatter", "mode": "markers", "name": f"training, {name}", "legendrank": 2000}
        place = {"x": [time for time, _ in training], "y": [error for _, error in training]}
        data.append({**marks, **place, "marker": {"color": colour, "size": 4}})
    shown = "d" if diameter is not None else escape(unit)
    return {"data": data, "layout": axes_layout("time (s)", f"RMSE of all modes ({shown})", "linear", "linear")}


def promise_figure(trials: Mapping[str, Sequence[Curves]], consistency: float, feasibility: float) -> Figure:
    """R_c of the trained ROM on n_lr modes against K_f: a mark per variable, case and Δτ; both limits across."""
    data: list[Figure] = []
    for k, (case, own) in enumerate(trials.items()):
        for i, name in enumerate(dict.fromkeys(trial["variable"] for trial in own)):
            known = [t for t in own if t["variable"] == name and t["K_f"] and t["R_rom_n_lr"] is not None]
            mark = {"color": COLOURS[i % len(COLOURS)], "size": 9, "symbol": k, "line": {"width": 0}}
            place = {"x": [t["K_f"] for t in known], "y": [float(f"{t['R_rom_n_lr']:.5g}") for t in known]}
            label = {"name": f"{escape(name)}, {escape(case)}", "text": [seconds_text(t["interval"]) for t in known]}
            hover = "%{text}: K_f %{x:.2f}, R_c %{y:.3f}<extra></extra>"
            kind = {"type": "scatter", "mode": "markers", "marker": mark, "hovertemplate": hover}
            data.append(kind | place | label)
    layout = axes_layout("K<sub>f</sub>", "R<sub>c</sub> of the ROM on n<sub>lr</sub> modes", "log", "log")
    every = [line for line in data if line["x"]]
    layout["xaxis"] |= ticks(x for line in every for x in line["x"])
    layout["yaxis"] |= {"tickvals": [1, consistency, 1.2, 1.5, 2, 3, 5, 10], "tickformat": ".3~g"}
    upright = {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": feasibility, "x1": feasibility}
    layout["shapes"] = [level_across(consistency), {**upright, "line": level_across(0.0)["line"]}]
    return {"data": data, "layout": layout}


def _colour(i: int) -> Figure:
    dash = {} if i < len(COLOURS) else {"dash": "dash"}
    return {"color": COLOURS[i % len(COLOURS)], "width": 1.8, **dash}


def _short(values: Sequence[float]) -> list[float]:
    return [float(f"{value:.4g}") for value in values]
