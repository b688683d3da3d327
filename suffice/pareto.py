"""A Pareto figure: error against one cost or several, every choice a mark, those that no other beats on a line."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from selection.tradeoff import pareto_front
from suffice.plots import COLOURS, QUIET, Figure, ticks
from suffice.wording import escape

BELOW = 3.0  # how many times below the least positive value nothing at all is drawn, which has no logarithm
GAP = 0.12  # of the width or height, between two diagrams
SIZE, SMALL, PALE = 10, 7, 0.35  # pixels of marks on the front and off it, and how faint the latter are
TALL = 760  # pixels of a narrow page for each two diagrams, one above the other


class Point(NamedTuple):
    """One choice: what it errs and what it costs."""

    label: str  # its name, in bold
    group: str  # its colour, and its entry in the legend
    error: float  # at least 0
    costs: tuple[float, ...]  # at least 0, one for each diagram
    hover: str = ""  # more lines about it, parted by line feeds
    symbol: str = "circle"


class Quantity(NamedTuple):
    """What an axis shows, and how its values are written."""

    title: str
    text: Callable[[float], str] = "{:.6g}".format


def pareto_figure(points: Sequence[Point], error: Quantity, costs: Sequence[Quantity]) -> Figure:
    """Diagrams of error against each cost, side by side with one legend; on a narrow page one above the other.

    Both axes are logarithmic; a value of zero stands at the lower edge, marked 0. The line joins the choices that none
    beats in error and that cost; all others are pale. Texts are escaped; `narrow` of the result is what the layout
    becomes below 600 pixels.
    """
    errors = _Scale.of([point.error for point in points])
    scales = [_Scale.of([point.costs[k] for point in points]) for k in range(len(costs))]
    fronts = [_best(points, k) for k in range(len(costs))]
    data = [_line(best, errors, scale, k) for k, (best, scale) in enumerate(zip(fronts, scales, strict=True))]
    for i, group in enumerate(dict.fromkeys(point.group for point in points)):
        own = [point for point in points if point.group == group]
        colour = COLOURS[i % len(COLOURS)]
        data.append(_entry(group, colour))
        for k, (best, scale) in enumerate(zip(fronts, scales, strict=True)):
            data.append(_marks(own, [point in best for point in own], (errors, scale), k, colour))
    layout: Figure = {"hovermode": "closest", "legend": {"y": 1}}
    narrow: Figure = {"height": TALL if len(costs) > 1 else 470}
    for k, (cost, scale) in enumerate(zip(costs, scales, strict=True)):
        x, y = f"xaxis{_number(k)}", f"yaxis{_number(k)}"
        layout[x] = {"title": {"text": cost.title}, "type": "log", "anchor": f"y{_number(k)}", **scale.ticks(cost)}
        layout[y] = {"title": {"text": error.title}, "type": "log", "anchor": f"x{_number(k)}", **errors.ticks(error)}
        if k:
            layout[y] |= {"title": {"text": ""}, "matches": "y"}
        layout[x]["domain"] = _part(k, len(costs))
        narrow[x] = {"domain": [0.0, 1.0]}
        narrow[y] = {"domain": _part(len(costs) - 1 - k, len(costs)), "title": {"text": error.title}}
    return {"data": data, "layout": layout, "narrow": narrow}


class _Scale(NamedTuple):
    """A logarithmic axis on which zero has a place."""

    values: list[float]  # as drawn
    zero: float | None  # where zero is drawn; None where no value is zero

    @classmethod
    def of(cls, values: Sequence[float]) -> "_Scale":
        zero = min((value for value in values if value > 0), default=1.0) / BELOW
        drawn = [value if value > 0 else zero for value in values]
        return cls(drawn, zero if zero in drawn else None)

    def at(self, value: float) -> float:
        """Return where a value is drawn."""
        return value if value > 0 or self.zero is None else self.zero

    def ticks(self, quantity: Quantity) -> Figure:
        """Return marks at round values, and one at zero."""
        found = ticks((value for value in self.values if value != self.zero), quantity.text)
        if self.zero is not None:
            known = [(mark, text) for mark, text in _pairs(found) if mark > self.zero]
            found = {"tickvals": [self.zero, *(m for m, _ in known)], "ticktext": ["0", *(t for _, t in known)]}
        return found


def _pairs(found: Figure) -> list[tuple[float, str]]:
    return list(zip(found.get("tickvals", []), found.get("ticktext", []), strict=True))


def _best(points: Sequence[Point], k: int) -> list[Point]:
    """Return the choices that none beats in error and the cost k, from cheap to dear."""
    marked = pareto_front([point.error for point in points], [point.costs[k] for point in points])
    best = [point for point, on in zip(points, marked, strict=True) if on]
    return sorted(best, key=lambda point: point.costs[k])


def _line(best: Sequence[Point], errors: _Scale, scale: _Scale, k: int) -> Figure:
    """Join the choices that none beats."""
    return {
        "type": "scatter",
        "mode": "lines",
        "name": "front",
        "legendgroup": "front",
        "showlegend": not k,
        "line": {"color": QUIET, "width": 2, "shape": "hv"},
        "hoverinfo": "skip",
        "x": [scale.at(point.costs[k]) for point in best],
        "y": [errors.at(point.error) for point in best],
        **_axes(k),
    }


def _marks(points: Sequence[Point], best: Sequence[bool], at: tuple[_Scale, _Scale], k: int, colour: str) -> Figure:
    """Draw one group against the cost k, pale what is not among the best. at: scales of the errors and of the cost."""
    name, (errors, scale) = escape(points[0].group), at
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "legendgroup": name,
        "showlegend": False,
        "x": [scale.at(point.costs[k]) for point in points],
        "y": [errors.at(point.error) for point in points],
        "marker": {
            "color": colour,
            "size": [SIZE if on else SMALL for on in best],
            "opacity": [1.0 if on else PALE for on in best],
            "symbol": [point.symbol for point in points],
            "line": {"width": 1.5, "color": colour},
        },
        "text": ["<br>".join([f"<b>{escape(p.label)}</b>", *escape(p.hover).splitlines()]) for p in points],
        "hovertemplate": "%{text}<extra></extra>",
        **_axes(k),
    }


def _entry(group: str, colour: str) -> Figure:
    """Draw no mark at all, but the entry of a group in the legend, which is pale as its first mark may be otherwise."""
    name = escape(group)
    marker = {"color": colour, "size": SIZE, "symbol": "circle"}
    shared = {"type": "scatter", "mode": "markers", "name": name, "legendgroup": name, "x": [None], "y": [None]}
    return {**shared, "marker": marker, "hoverinfo": "skip", **_axes(0)}


def _axes(k: int) -> Figure:
    return {"xaxis": f"x{_number(k)}", "yaxis": f"y{_number(k)}"}


def _number(k: int) -> str:
    """Return how plotly numbers its axes: x, x2, x3."""
    return "" if k == 0 else str(k + 1)


def _part(k: int, count: int) -> list[float]:
    """Return the part of the width, or of the height from below, that diagram k of so many takes."""
    size = (1.0 - GAP * (count - 1)) / count
    return [k * (size + GAP), k * (size + GAP) + size]
