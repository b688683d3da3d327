"""The two views of a mill, along its axis and from the side, with dimension lines."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.drawing import Point, across, arrow, circle, fits, line, path, polygon, svg, text
from suffice.rods import Rod

Array = NDArray[np.float64]
Place = Callable[[float, float], Point]  # mm to the right and up -> where in the drawing

LARGEST = 240.0  # length in the drawing of the largest dimension
WIDTH = 340.0  # of each view
TOP, STEP = 54.0, 20.0  # room above, and between two dimension lines
ALIGNED = 1e-6  # mm or sine of an angle that is rounding
BEYOND = 0.14  # radii of the vessel: how far an endless shaft is drawn out of it


class Mill(NamedTuple):
    """Cylinders along an axis and across it; lengths in mm, directions to the right, up and along the axis.

    The view along the axis looks against its direction; the middle of the widest vessel is the origin.
    """

    vessels: list[Rod]  # widest first
    shafts: list[Rod]
    pins: list[Rod]
    missing: list[str]  # in words, what is not drawn
    rpm: float | None  # 1/min, positive where the view along the axis shows it counter-clockwise
    bead: float | None  # mm, largest diameter
    down: Array | None  # (3,) unit vector of gravity

    @property
    def scale(self) -> float:
        """Units of the drawing per mm."""
        return LARGEST / max(2.0 * self.vessels[0].radius, self.length)

    @property
    def length(self) -> float:
        """Length of the widest vessel, mm; of an endless one what is drawn."""
        vessel = self.vessels[0]
        return 2.0 * vessel.radius if vessel.length is None else vessel.length


def mm(value: float) -> str:
    """Return a length in mm as the drawing gives it."""
    return f"{value:.4g}"


def tip_of(mill: Mill) -> float:
    """Return the distance of the pins' tips from the axis, mm."""
    reach = []
    for pin in mill.pins:
        half = 0.5 * (pin.length or 0.0) * pin.axis[:2]
        reach += [float(np.linalg.norm(pin.centre[:2] + sign * half)) for sign in (-1.0, 1.0)]
    return max(reach)


def rows_of(mill: Mill) -> list[float]:
    """Return the places of the rows of pins along the axis, mm."""
    return sorted({round(float(pin.centre[2]), 6) for pin in mill.pins})


def end_view(mill: Mill) -> str:
    """Return the view along the axis."""
    scale, radius = mill.scale, mill.vessels[0].radius

    def place(x: float, y: float) -> Point:
        return WIDTH / 2.0 + scale * x, TOP + scale * (radius - y)

    parts = [circle(place(*rod.centre[:2]), scale * rod.radius) for rod in mill.vessels]
    parts += [_from_the_end(rod, scale, place) for rod in sorted([*mill.pins, *mill.shafts], key=_front)]
    cross = 1.05 * radius
    parts += [line(place(-cross, 0), place(cross, 0), "axis"), line(place(0, -cross), place(0, cross), "axis")]
    parts += _notes(mill)
    widths = [2.0 * rod.radius for rod in [*mill.shafts, *mill.vessels] if np.linalg.norm(rod.centre[:2]) < ALIGNED]
    y, edge = place(0, -radius)[1] + STEP, place(0, 0)[1]
    for width in sorted({*widths, *([2.0 * tip_of(mill)] if mill.pins else [])}):
        low, high = place(-width / 2, 0)[0], place(width / 2, 0)[0]
        parts.append(across(low, high, y, f"Ø {mm(width)}", (edge, edge)))
        y += STEP
    return svg((WIDTH, y - STEP / 2), parts, "view along the axis, with diameters in mm")


def _front(rod: Rod) -> float:
    """Place along the axis of the end that is nearest to the eye; of what is nearest least is hidden."""
    if rod.length is None:
        return np.inf
    return float(rod.centre[2] + 0.5 * rod.length * abs(rod.axis[2]))


def _from_the_end(rod: Rod, scale: float, place: Place) -> str:
    if np.linalg.norm(rod.axis[:2]) < ALIGNED:
        return circle(place(*rod.centre[:2]), scale * rod.radius, "solid")
    half, side = 0.5 * (rod.length or 0.0) * rod.axis[:2], rod.radius * np.array([-rod.axis[1], rod.axis[0]])
    corners = [rod.centre[:2] + a * half + b * side for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return polygon([place(*corner) for corner in corners], "solid")


def _notes(mill: Mill) -> list[str]:
    """Return how the rotor turns, where gravity pulls and how large a bead is, all above the view."""
    parts, x = [], WIDTH / 2.0
    if mill.rpm:
        to = -1.0 if mill.rpm > 0 else 1.0  # over the top, counter-clockwise is to the left
        parts += [path(f"M{x - 26 * to} 34Q{x} 18 {x + 22 * to} 31"), arrow((x + 26 * to, 34), (to, 0.75))]
        parts.append(text((x, 17), f"{abs(mill.rpm):g} rpm"))
    if mill.down is not None and np.linalg.norm(mill.down[:2]) > ALIGNED:
        parts += [line((20, 8), (20, 34), "thin"), arrow((20, 36), (0, 1)), text((27, 24), "g", "left")]
    if mill.bead:
        radius = 0.5 * mill.bead * mill.scale
        parts.append(circle((WIDTH - 72 - radius, 20), radius))
        parts.append(text((WIDTH - 66, 24), f"bead Ø {mm(mill.bead)}", "left"))
    return parts


def side_view(mill: Mill) -> str:
    """Return the view from the side, the axis from left to right; what is turned towards the eye hides what is not."""
    scale, radius, half = mill.scale, mill.vessels[0].radius, mill.length / 2.0

    def place(x: float, y: float) -> Point:
        return WIDTH / 2.0 + scale * x, TOP + scale * (radius - y)

    parts = [_vessel_from_the_side(rod, half, place) for rod in mill.vessels]
    ends = half + BEYOND * radius
    pins = [(float(rod.centre[0]), _pin(_outside(rod, mill.shafts), scale, place)) for rod in mill.pins]
    shafts = [(float(rod.centre[0]), _shaft(rod, ends, place)) for rod in mill.shafts]
    # the eye is at the left of the view along the axis
    parts += [drawn for _, drawn in sorted([*pins, *shafts], key=lambda pair: -pair[0])]
    parts.append(line(place(-ends - 0.05 * radius, 0), place(ends + 0.05 * radius, 0), "axis"))
    low, y = place(0, -radius)[1], place(0, -radius)[1] + STEP
    if mill.pins:
        parts.append(_thickness(mill, place))
    steps = row_steps(mill)
    if steps is not None:
        parts += [_between(a, b, place, low, y) for a, b in pairwise(np.cumsum([-half, *steps]))]
        y += STEP
    if mill.vessels[0].length is not None:
        parts.append(_between(-half, half, place, low, y))
        y += STEP
    if mill.down is not None and abs(mill.down[2]) > ALIGNED:
        to = float(np.sign(mill.down[2]))
        parts += [line((28 - 14 * to, 22), (28 + 12 * to, 22), "thin"), arrow((28 + 14 * to, 22), (to, 0))]
        parts.append(text((28, 16), "g"))
    return svg((WIDTH, y - STEP / 2), parts, "view from the side, with lengths in mm")


def row_steps(mill: Mill) -> list[float] | None:
    """Return the steps (mm) from the end of the vessel over the rows of pins to its other end, as far as they fit.

    None without pins, where the vessel is endless, or where a step is too short for its number.
    """
    if not mill.pins or mill.vessels[0].length is None:
        return None
    half = mill.length / 2.0
    steps = [float(step) for step in np.diff([-half, *rows_of(mill), half])]
    return steps if all(fits(mill.scale * step, f"{step:.3g}") for step in steps) else None


def _between(a: float, b: float, place: Place, edge: float, y: float) -> str:
    return across(place(a, 0)[0], place(b, 0)[0], y, f"{b - a:.3g}", (edge, edge))


def _thickness(mill: Mill, place: Place) -> str:
    """Return the diameter of the pin that reaches up most, above it."""
    pin = max(mill.pins, key=lambda rod: float(rod.centre[1]) + 1e-3 * float(rod.centre[2]))
    low, high = (place(float(pin.centre[2]) + sign * pin.radius, 0)[0] for sign in (-1.0, 1.0))
    tip = place(0, float(pin.centre[1]) + 0.5 * (pin.length or 0.0) * abs(float(pin.axis[1])))[1]
    y = TOP - STEP
    sides = line((low, tip), (low, y - 3), "thin") + line((high, tip), (high, y - 3), "thin")
    return sides + across(low, high, y, f"Ø {mm(2.0 * pin.radius)}", (y, y))


def _vessel_from_the_side(rod: Rod, half: float, place: Place) -> str:
    middle = float(rod.centre[2])
    reach, up = (half if rod.length is None else rod.length / 2.0), float(rod.centre[1])
    low, high = middle - reach, middle + reach
    parts = [line(place(low, up + s * rod.radius), place(high, up + s * rod.radius)) for s in (-1.0, 1.0)]
    for end, name in ((low, "-"), (high, "+")):
        ahead = name if rod.axis[2] > 0 else {"-": "+", "+": "-"}[name]
        if rod.length is not None and ahead not in rod.open:
            parts.append(line(place(end, up - rod.radius), place(end, up + rod.radius)))
    return "".join(parts)


def _shaft(rod: Rod, ends: float, place: Place) -> str:
    """Return a cylinder along the axis; an endless one ends in a line of break."""
    up, r = float(rod.centre[1]), rod.radius
    if rod.length is not None:
        low, high = (float(rod.centre[2]) + sign * rod.length / 2.0 for sign in (-1.0, 1.0))
        return polygon([place(low, up - r), place(high, up - r), place(high, up + r), place(low, up + r)], "solid")
    (x0, top), (x1, low) = place(-ends, up + r), place(ends, up - r)
    quarter = (low - top) / 4.0
    down, up_again = (
        f"q{s * quarter / 2:.1f} {s * quarter:.1f} 0 {s * 2 * quarter:.1f}t0 {s * 2 * quarter:.1f}" for s in (1, -1)
    )
    return path(f"M{x0:.1f} {top:.1f}H{x1:.1f}{down}H{x0:.1f}{up_again}Z", "solid")


def _outside(pin: Rod, shafts: list[Rod]) -> Rod:
    """Return what of a pin stands out of the shaft that it is fixed in: its root inside is not seen."""
    out, half = pin.centre[:2], 0.5 * (pin.length or 0.0)
    far = float(np.linalg.norm(out))
    radial = far > ALIGNED and abs(float(out @ pin.axis[:2])) > (1.0 - ALIGNED) * far
    hidden = max((shaft.radius for shaft in shafts if np.linalg.norm(shaft.centre[:2]) < ALIGNED), default=0.0)
    if not radial or not far - half < hidden < far + half:
        return pin
    middle, length = (far + half + hidden) / 2.0, far + half - hidden
    return pin._replace(centre=np.array([*(out * middle / far), pin.centre[2]]), length=length)


def _pin(rod: Rod, scale: float, place: Place) -> str:
    """Return a cylinder across the axis: its two ends are ellipses, as wide as it is thick."""
    x, up = float(rod.centre[2]), float(rod.centre[1])
    half = 0.5 * (rod.length or 0.0) * abs(float(rod.axis[1]))
    rx, ry = scale * rod.radius, scale * rod.radius * abs(float(rod.axis[0]))
    (left, top), (right, low) = place(x - rod.radius, up + half), place(x + rod.radius, up - half)
    cap = f"A{rx:.2f} {max(ry, 0.01):.2f} 0 0 1"
    return path(f"M{left:.2f} {top:.2f}{cap} {right:.2f} {top:.2f}V{low:.2f}{cap} {left:.2f} {low:.2f}Z", "solid")
