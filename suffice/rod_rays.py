"""Where rays meet cylinders and cones, solid, hollow and cut."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.rods import Rod
from suffice.shading import Buffer

Array = NDArray[np.float64]
Colour = tuple[float, float, float]
Window = tuple[slice, slice]  # rows and columns of the buffer

STEEL: Colour = (0.66, 0.69, 0.73)
GLASS: Colour = (0.58, 0.65, 0.72)
SEEN_THROUGH = 0.32  # opacity of the far wall of a vessel
WALL = 0.04  # of its radius: how thick a vessel is drawn
ENDLESS = 1e3  # radii: half the length of a cylinder without one
FLAT = 1e-12  # squared sine of an angle that is rounding
ALONG = 1e-6  # sine of the angle between a cylinder and the cut, or radii, that is rounding


def add_rod(buffer: Buffer, rod: Rod, cut: tuple[Array, float] | None) -> None:
    """Draw a cylinder or cone given in rays, or the cut and the far side of a hollow one.

    A solid one that lies along the cut stays whole where its axis is behind it, as shafts do in drawings.
    """
    if not rod.hollow:
        if cut is not None and abs(cut[0] @ rod.axis) < ALONG:
            if cut[0] @ rod.centre > cut[1] + ALONG * rod.widest:
                return
            cut = None
        window = _window(buffer, rod)
        met = _through(window, rod, cut)
        _put(buffer, window, met.enters > met.leaves, met.enters, met.front, STEEL, 1.0)
        return
    thick = WALL * rod.widest
    outside = rod.thicker(thick).longer(
        {"-": 0.0 if "-" in rod.open else thick, "+": 0.0 if "+" in rod.open else thick}
    )
    window = _window(buffer, outside)
    outer = _through(window, outside, cut)
    # an open end is no wall
    inner = _through(window, rod.longer(dict.fromkeys(rod.open, thick)), cut)
    meets = outer.enters > outer.leaves
    hollow = meets & (inner.enters > inner.leaves) & (inner.enters >= outer.enters - 1e-6)
    behind = hollow & (inner.leaves > outer.leaves + 1e-6)
    _put(buffer, window, behind, inner.leaves, -inner.back, GLASS, SEEN_THROUGH)
    _put(buffer, window, meets & ~hollow, outer.enters, outer.front, STEEL, 1.0)


def _window(buffer: Buffer, rod: Rod) -> Window:
    """Return the rows and columns in which a cylinder or cone can be seen."""
    reach = _half(rod) * np.abs(rod.axis) + rod.widest * np.sqrt(np.maximum(1.0 - rod.axis**2, 0.0))
    ends = [
        np.clip([int(np.floor(rod.centre[k] - reach[k])), int(np.ceil(rod.centre[k] + reach[k]))], 0, most)
        for k, most in ((1, buffer.depth.shape[0]), (0, buffer.depth.shape[1]))
    ]
    return slice(*ends[0]), slice(*ends[1])


class Passage(NamedTuple):
    """Where rays, coming from the eye, enter and leave a convex body."""

    enters: Array  # (h, w)
    leaves: Array  # (h, w); where it exceeds `enters` the ray misses
    front: Array  # (h, w, 3) outer normal where they enter
    back: Array  # (h, w, 3) and where they leave


def _through(window: Window, rod: Rod, cut: tuple[Array, float] | None) -> Passage:
    """Follow the rays through a cone: the overlap of its mantle's inside, of the slab between its ends and of the rest.

    A ray is x = (column, row, ζ); the eye is at ζ = ∞. With t = x·a along the axis and R + w t the radius there, the
    inside of the mantle is |x - t a|² ≤ (R + w t)², a square in ζ; a cylinder has w = 0.
    """
    column, row = np.meshgrid(
        np.arange(window[1].start, window[1].stop) + 0.5 - rod.centre[0],
        np.arange(window[0].start, window[0].stop) + 0.5 - rod.centre[1],
    )
    a, axial, half = rod.axis, column * rod.axis[0] + row * rod.axis[1], _half(rod)
    found = _mantle(rod, column, row, axial)
    for sign in (-1.0, 1.0):
        found = _halved(found, sign * a, half - sign * axial)
    if cut is not None:
        found = _halved(found, cut[0], cut[1] - cut[0] @ rod.centre - column * cut[0][0] - row * cut[0][1])
    return found._replace(enters=found.enters + rod.centre[2], leaves=found.leaves + rod.centre[2])


def _half(rod: Rod) -> float:
    return ENDLESS * rod.radius if rod.length is None else rod.length / 2.0


def _mantle(rod: Rod, column: Array, row: Array, axial: Array) -> Passage:
    """Return where rays are inside the mantle, endlessly long."""
    widens, slope = rod.widens, rod.axis[2]
    radius = rod.radius_at(axial)
    square = 1.0 - slope**2 - (widens * slope) ** 2
    if abs(square) < FLAT:  # of a ray along the mantle, which meets it at infinity
        square = FLAT
    half = -axial * slope - radius * widens * slope
    rest = column**2 + row**2 - axial**2 - radius**2
    inside = half**2 - square * rest
    root = np.sqrt(np.maximum(inside, 0.0))
    high, low = (-half + root) / square, (-half - root) / square
    nothing = np.full_like(root, np.inf)
    if square > 0:
        enters, leaves = np.where(inside > 0, high, -np.inf), np.where(inside > 0, low, np.inf)
    elif widens * slope > 0:  # steeper than the cone, a ray is inside from where it is wide enough
        enters, leaves = nothing, low
    else:
        enters, leaves = high, -nothing
    return Passage(enters, leaves, *(_outward(rod, column, row, axial, at) for at in (enters, leaves)))


def _outward(rod: Rod, column: Array, row: Array, axial: Array, depth: Array) -> Array:
    """Return the outer normal of the mantle at a depth, (h, w, 3)."""
    at = np.where(np.isfinite(depth), depth, 0.0)
    along = axial + at * rod.axis[2]
    away = np.stack([column, row, at], axis=-1) - along[..., None] * rod.axis
    away /= np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-12)
    return np.asarray((away - rod.widens * rod.axis) / np.hypot(1.0, rod.widens))


def _halved(found: Passage, normal: Array, room: Array) -> Passage:
    """Keep what lies behind a plane: n_ζ ζ ≤ room, (h, w)."""
    if abs(normal[2]) < 1e-9:
        return found._replace(enters=np.where(room >= 0, found.enters, -np.inf))
    at = room / normal[2]
    if normal[2] > 0:
        first = at < found.enters
        return found._replace(
            enters=np.where(first, at, found.enters), front=np.where(first[..., None], normal, found.front)
        )
    last = at > found.leaves
    return found._replace(leaves=np.where(last, at, found.leaves), back=np.where(last[..., None], normal, found.back))


def _put(
    buffer: Buffer,
    window: Window,
    where: NDArray[np.bool_],
    depth: Array,
    normal: Array,
    colour: Colour,
    opacity: float,
) -> None:
    """Draw a surface in a window where it is nearer than what is drawn."""
    nearer = where & (depth > buffer.depth[window])
    buffer.depth[window][nearer], buffer.normal[window][nearer] = depth[nearer], normal[nearer]
    buffer.colour[window][nearer], buffer.opacity[window][nearer] = colour, opacity
