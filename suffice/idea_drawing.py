"""The idea as a diagram: snapshots kept, their coefficients, and predictions in between (paper Figure 3)."""

from math import cos, pi, sin

from suffice.drawing import arrow, circle, line, path, svg, text
from suffice.wording import seconds_text

WIDTH, HEIGHT = 360.0, 396.0
LEFT, RIGHT = 40.0, 320.0  # of the axis of time, which spans two intervals
MOST_BETWEEN = 3  # predictions drawn between two snapshots
KEPT, BETWEEN = "var(--good,#187546)", "#3b8fd0"


def idea_drawing(interval: float, dense: float, n_lr: int, n_c: int, limit: float) -> str:
    """Return the diagram as HTML, with Δτ and the dense interval in s, n_lr, n_c and the limit of K_f = n_c / n_lr."""
    between = min(max(round(interval / dense) - 1, 1), MOST_BETWEEN)
    step = (RIGHT - LEFT) / 2.0 / (between + 1)
    moments = [(LEFT + k * step, k % (between + 1) == 0) for k in range(2 * (between + 1) + 1)]
    kept = [x for x, trained_on in moments if trained_on]
    small = min(0.42 * step, 19.0)
    verdict = f"≥ {limit:g}: sufficient" if n_c >= limit * n_lr else f"< {limit:g}: not sufficient"
    parts = [
        text((WIDTH / 2, 13), f"1  Simulate, keep a snapshot every Δτ = {seconds_text(interval)}", "head"),
        *(_mill(x, 44, 19.0, x) for x in kept),
        line((kept[0], 71), (kept[1], 71), "thin"), arrow((kept[0], 71), (-1, 0)), arrow((kept[1], 71), (1, 0)),
        text(((kept[0] + kept[1]) / 2, 67), "Δτ"),
        _down(84, "project on the modes:  c = φ · (W − mean)"),
        text((WIDTH / 2, 126), "2  Coefficients, a regressor between them", "head"),
        path(_wave([LEFT - 14 + k for k in range(int(RIGHT - LEFT) + 29)]), "curve"),
        *(_mark(x, _height(x), trained_on) for x, trained_on in moments),
        line((LEFT - 14, 210), (RIGHT + 14, 210), "thin"), arrow((RIGHT + 18, 210), (1, 0)),
        text((RIGHT + 27, 214), "t"),
        text((LEFT - 20, 148), "c", "right"),
        _down(222, "sum of n modes:  W(t) = mean + Σ c(t) φ"),
        text((WIDTH / 2, 264), f"3  Any time in between, here every {seconds_text(dense)}", "head"),
        *(
            f'<g style="color:{KEPT if trained_on else BETWEEN}">{_mill(x, 296, small, x)}</g>'
            for x, trained_on in moments
        ),
        _mark(56, 333, True), text((66, 337), "reproduction", "left"),
        _mark(186, 333, False), text((196, 337), "prediction", "left"),
        text((WIDTH / 2, 366), f"modes n: at least n_lr = {n_lr}, at most n_c = {n_c}"),
        text((WIDTH / 2, 386), f"K_f = n_c / n_lr = {n_c / n_lr:.2f} {verdict}", "head"),
    ]  # fmt: skip
    return svg((WIDTH, HEIGHT), parts, "snapshots kept, coefficients between them, predictions")


def _mark(x: float, y: float, trained_on: bool) -> str:
    colour, radius, kind = (KEPT, 4.2, "tip") if trained_on else (BETWEEN, 3.4, "solid")
    return f'<g style="color:{colour}">{circle((x, y), radius, kind)}</g>'


def _height(x: float) -> float:
    """Height of the coefficient at a time, in the drawing."""
    s = (x - LEFT) / (RIGHT - LEFT)
    return 172.0 - 22.0 * sin(2.0 * pi * 1.15 * s + 0.5) - 8.0 * sin(2.0 * pi * 2.6 * s)


def _wave(places: list[float]) -> str:
    return "M" + "L".join(f"{x:.1f} {_height(x):.1f}" for x in places)


def _down(y: float, words: str) -> str:
    """Return an arrow to the next row, and what happens on the way."""
    x = 40.0
    return line((x, y), (x, y + 20), "") + arrow((x, y + 23), (0, 1)) + text((x + 14, y + 15), words, "left")


def _mill(x: float, y: float, radius: float, phase: float) -> str:
    """Return a mill as a sign, turned by its time: a vessel, four pins and some beads."""
    turn = 2.0 * pi * phase / 330.0
    parts = [circle((x, y), radius), circle((x, y), 0.2 * radius, "tip")]
    for k in range(4):
        angle = turn + k * pi / 2.0
        parts.append(line((x, y), (x + 0.68 * radius * cos(angle), y - 0.68 * radius * sin(angle))))
        beads = ((0.42, 0.78), (0.85, 0.55), (1.15, 0.82))
        for ahead, out in beads:
            place = x + out * radius * cos(angle + ahead), y - out * radius * sin(angle + ahead)
            parts.append(circle(place, 0.085 * radius, "tip"))
    return "".join(parts)
