"""Figures of a page made of pictures side by side, with their captions, and a small chart of paths."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.drawing import circle, line, path, svg, text
from suffice.png import data_uri
from suffice.wording import escape, number

Array = NDArray[np.float64]

WIDTH, HEIGHT = 340.0, 210.0  # of a chart
LEFT, RIGHT, ABOVE, BELOW = 48.0, 16.0, 10.0, 36.0


class Picture(NamedTuple):
    """A picture and what is said of it, in plain words."""

    png: bytes
    title: str
    note: str = ""
    kind: str = ""  # `kept`: at a time trained on; `between`: at an unseen one


class Curve(NamedTuple):
    """A line of a chart."""

    name: str
    x: Array
    y: Array
    colour: str
    dashed: bool = False
    dots: bool = False  # points instead of a line


def numbered(label: str, title: str, body: str, caption: str) -> str:
    """Return a figure with its number; title in plain words, body and caption as HTML."""
    return (
        f'<figure class="numbered"><h3>{escape(label)} · {escape(title)}</h3>{body}'
        f'<figcaption class="quiet">{caption}</figcaption></figure>'
    )


def not_shown(label: str, title: str, reason: str) -> str:
    """Return a figure that says why there is none."""
    return numbered(label, title, "", f"Not shown: {escape(reason)}.")


def side_by_side(pictures: Sequence[Sequence[Picture]]) -> str:
    """Return pictures in a row that wraps; those of an inner sequence stay one above the other."""
    stacks = "".join(f"<div>{''.join(map(_picture, stack))}</div>" for stack in pictures)
    return f'<div class="pictures">{stacks}</div>'


def _picture(picture: Picture) -> str:
    note = f"<small>{escape(picture.note)}</small>" if picture.note else ""
    title = escape(picture.title)
    image = f'<img src="{data_uri(picture.png)}" alt="{title}">'
    return f'<figure class="{picture.kind}"><figcaption>{title}{note}</figcaption>{image}</figure>'


def chart(curves: Sequence[Curve], x_name: str, y_name: str) -> str:
    """Return lines and points over common axes, with a legend below, as HTML."""
    drawn = [curve for curve in curves if len(curve.x)]
    if not drawn:
        raise ValueError("a chart needs at least one curve with points")
    (x0, x1), (y0, y1) = _bounds([curve.x for curve in drawn], 0.0), _bounds([curve.y for curve in drawn], 0.06)

    def at(x: float, y: float) -> tuple[float, float]:
        right, up = (x - x0) / (x1 - x0), (y - y0) / (y1 - y0)
        return LEFT + right * (WIDTH - LEFT - RIGHT), HEIGHT - BELOW - up * (HEIGHT - ABOVE - BELOW)

    parts = []
    for mark in ticks(x0, x1):
        parts += [line(at(mark, y0), at(mark, y1), "grid"), text((at(mark, 0)[0], HEIGHT - BELOW + 15), _plain(mark))]
    for mark in ticks(y0, y1):
        parts += [line(at(x0, mark), at(x1, mark), "grid"), text((LEFT - 6, at(0, mark)[1] + 4), _plain(mark), "right")]
    parts += [_curve(curve, [at(x, y) for x, y in zip(curve.x, curve.y, strict=True)]) for curve in drawn]
    parts.append(text(((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 4), x_name))
    parts.append(
        f'<g transform="translate(11 {(HEIGHT - BELOW + ABOVE) / 2:.0f}) rotate(-90)">{text((0, 0), y_name)}</g>'
    )
    legend = "".join(f"<li>{_swatch(curve)} {escape(curve.name)}</li>" for curve in drawn)
    drawing = svg((WIDTH, HEIGHT), parts, f"{y_name} against {x_name}: {', '.join(c.name for c in drawn)}")
    return f'<div class="chart">{drawing}<ul class="legend">{legend}</ul></div>'


def _plain(value: float) -> str:
    return number(value, 4).replace("-", "−")


def _bounds(values: Sequence[Array], pad: float) -> tuple[float, float]:
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    room = pad * (high - low) if high > low else 0.5
    return low - room, high + room


def ticks(low: float, high: float) -> list[float]:
    """Return four to eight round numbers from low to high."""
    step = 10.0 ** np.floor(np.log10((high - low) / 4.0))
    step *= max(factor for factor in (1.0, 2.0, 2.5, 5.0) if factor * step <= (high - low) / 4.0)
    return [float(f"{k * step:.12g}") for k in range(int(np.ceil(low / step - 1e-9)), int(high / step + 1e-9) + 1)]


def _curve(curve: Curve, points: Sequence[tuple[float, float]]) -> str:
    if curve.dots:
        return f'<g style="color:{curve.colour}">{"".join(circle(point, 3.4, "tip") for point in points)}</g>'
    dashes = ";stroke-dasharray:6 4" if curve.dashed else ""
    d = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return f'<g style="color:{curve.colour}{dashes}">{path(d, "curve")}</g>'


def _swatch(curve: Curve) -> str:
    if curve.dots:
        return f'<i class="dot" style="background:{curve.colour}"></i>'
    style = "dashed" if curve.dashed else "solid"
    return f'<i class="stroke" style="border-top:2.5px {style} {curve.colour}"></i>'
