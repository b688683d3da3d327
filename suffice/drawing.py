"""Strokes of an engineering drawing in SVG: outlines, dimension lines, leaders, in the colour of the text around."""

import re
from collections.abc import Sequence

from suffice.wording import escape

Point = tuple[float, float]

SUBSCRIPT = re.compile(r"\b([A-Za-z])_([a-z]+)\b")

ARROW = 5.0  # length of an arrow head
LETTER = 6.0  # width of a letter of a dimension
STYLE = (
    "<style>.drawn{fill:none;stroke:currentColor;stroke-width:1.3}.drawn.solid{fill:var(--card,Canvas)}"
    ".drawn.thin{stroke-width:.6;opacity:.75}.drawn.axis{stroke-width:.6;opacity:.75;stroke-dasharray:9 2.5 1.5 2.5}"
    ".drawn.grid{stroke-width:.8;opacity:.22}.drawn.tip{fill:currentColor;stroke:none}"
    ".drawn.curve{stroke-width:2}.drawing .head{font-weight:600}"
    ".drawing text{fill:currentColor;font:11.5px system-ui,sans-serif;"
    "text-anchor:middle}.drawing .left{text-anchor:start}.drawing .right{text-anchor:end}</style>"
)


def svg(size: Point, parts: Sequence[str], label: str) -> str:
    """Return a drawing of a width and height; `label` says what it shows to those who cannot see it."""
    return (
        f'<svg class="drawing" viewBox="0 0 {_n(size[0])} {_n(size[1])}" role="img" aria-label="{escape(label)}">'
        f"{STYLE}{''.join(parts)}</svg>"
    )


def circle(centre: Point, radius: float, kind: str = "") -> str:
    """Return a circle."""
    return f'<circle class="drawn {kind}" cx="{_n(centre[0])}" cy="{_n(centre[1])}" r="{_n(radius)}"/>'


def path(d: str, kind: str = "") -> str:
    """Return a path."""
    return f'<path class="drawn {kind}" d="{d}"/>'


def polygon(points: Sequence[Point], kind: str = "") -> str:
    """Return a closed outline."""
    return path("M" + "L".join(f"{_n(x)} {_n(y)}" for x, y in points) + "Z", kind)


def line(a: Point, b: Point, kind: str = "") -> str:
    """Return a straight line."""
    return path(f"M{_n(a[0])} {_n(a[1])}L{_n(b[0])} {_n(b[1])}", kind)


def text(at: Point, words: str, kind: str = "") -> str:
    """Return words about a place, or of kind `left` or `right` with that end there; K_f is set with a subscript."""
    return f'<text class="{kind}" x="{_n(at[0])}" y="{_n(at[1])}">{SUBSCRIPT.sub(_lowered, escape(words))}</text>'


def arrow(at: Point, towards: Point) -> str:
    """Return an arrow head with its tip at a place, pointing along a direction."""
    size = (towards[0] ** 2 + towards[1] ** 2) ** 0.5
    x, y = ARROW * towards[0] / size, ARROW * towards[1] / size
    back = at[0] - x, at[1] - y
    side = -0.32 * y, 0.32 * x
    return polygon([at, (back[0] + side[0], back[1] + side[1]), (back[0] - side[0], back[1] - side[1])], "tip")


def _lowered(symbol: re.Match[str]) -> str:
    low = f'<tspan dy="3" font-size="75%">{symbol[2]}</tspan>'
    return f'{symbol[1]}{low}<tspan dy="-3">\u200b</tspan>'


def fits(length: float, words: str) -> bool:
    """Whether words have room over a dimension line between its arrows."""
    return length > LETTER * len(words) + 2.4 * ARROW


def across(low: float, high: float, y: float, words: str, edge: tuple[float, float]) -> str:
    """Return a horizontal dimension at a height y, with lines that extend what is measured from the heights `edge`.

    Where the words do not fit between the arrows these stand outside, and the words to their right.
    """
    gap, extends = 2.0, 3.0
    parts = [line((x, e + gap), (x, y + extends), "thin") for x, e in zip((low, high), edge, strict=True)]
    if fits(high - low, words):
        parts += [line((low, y), (high, y), "thin"), arrow((low, y), (-1, 0)), arrow((high, y), (1, 0))]
        return "".join(parts) + text(((low + high) / 2, y - 3), words)
    out = 2.2 * ARROW
    parts += [line((low - out, y), (high + out, y), "thin"), arrow((low, y), (1, 0)), arrow((high, y), (-1, 0))]
    return "".join(parts) + text((high + out + 2, y + 4), words, "left")


def _n(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")
