"""Spheres and cylinders as they look from a side, cut open, on a clear ground."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.png import png_of
from suffice.rods import Rod
from suffice.shading import Buffer, blank, pixels_of

Array = NDArray[np.float64]

FINER = 2  # rays per pixel in each direction
CHUNK = 2_000_000  # rays of spheres followed at once
STEEL, GLASS = (0.66, 0.69, 0.73), (0.58, 0.65, 0.72)
SEEN_THROUGH = 0.32  # opacity of the far wall of a vessel
WALL = 0.04  # of its radius: how thick a vessel is drawn
ENDLESS = 1e3  # radii: half the length of a cylinder without one
ALONG = 1e-6  # sine of the angle between a cylinder and the cut, or radii, that is rounding


class View(NamedTuple):
    """A parallel projection on a picture, of all that lies behind a plane."""

    frame: Array  # (3, 3) rows: unit vectors to the right, up, and towards the eye
    centre: Array  # (3,) m, shown in the middle of the picture
    width: float  # m, shown
    height: float  # m
    pixels: int  # of the width
    cut: tuple[Array, float] | None = None  # unit normal n and m: what has n·x > m is taken away, beads by their centre

    @property
    def scale(self) -> float:
        """Rays per metre."""
        return self.pixels * FINER / self.width

    @property
    def rows(self) -> int:
        """Height in pixels."""
        return max(round(self.pixels * self.height / self.width), 1)

    def rays_of(self, position: Array) -> Array:
        """Return positions (n, 3) m as column, row from the bottom and depth towards the eye, in rays."""
        middle = 0.5 * FINER * np.array([self.pixels, self.rows, 0.0])
        return np.asarray((position - self.centre) @ self.frame.T * self.scale + middle)

    def cut_in_rays(self) -> tuple[Array, float] | None:
        """Return the cutting plane of positions in rays."""
        if self.cut is None:
            return None
        normal = self.frame @ self.cut[0]
        on_it = self.rays_of((self.cut[1] * self.cut[0])[None])[0]
        return normal, float(normal @ on_it)


def bead_picture(view: View, position: Array, radius: Array, colours: Array, rods: Sequence[Rod] = ()) -> bytes:
    """Return beads and cylinders as a PNG on a clear ground.

    position: (n, 3) m; radius: (n,) m; colours: (n, 3) red, green and blue from 0 to 1; rods: the walls, of which
    hollow ones are shown by their cut and their far side. Beads without a place or a radius are left out.
    """
    buffer = blank(view.rows * FINER, view.pixels * FINER)
    seen = np.isfinite(position).all(axis=1) & (radius > 0)
    if view.cut is not None:
        seen &= position @ view.cut[0] <= view.cut[1]
    add_spheres(buffer, view.rays_of(position[seen]), radius[seen] * view.scale, colours[seen])
    add_rods(buffer, view, rods)
    reach = 3.0 * float(np.median(radius[seen])) if seen.any() else 0.05 * view.width
    return png_of(pixels_of(buffer, FINER, reach * view.scale))


def add_rods(buffer: Buffer, view: View, rods: Sequence[Rod]) -> None:
    """Draw cylinders, in m, where they are nearer than what is drawn."""
    cut = view.cut_in_rays()
    for rod in rods:
        length = None if rod.length is None else rod.length * view.scale
        centre, axis = view.rays_of(rod.centre[None])[0], view.frame @ rod.axis
        add_rod(buffer, rod._replace(centre=centre, axis=axis, radius=rod.radius * view.scale, length=length), cut)


def add_spheres(buffer: Buffer, centres: Array, radius: Array, colours: Array) -> None:
    """Draw spheres, centres (n, 3) and radii (n,) in rays, where they are nearer than what is drawn."""
    height, width = buffer.depth.shape
    near_first = np.argsort(-centres[:, 2])
    owner = np.full(height * width, -1)
    depth = buffer.depth.reshape(-1)
    side = int(np.ceil(2.0 * radius.max())) + 1 if len(radius) else 1
    across, down = np.meshgrid(np.arange(side), np.arange(side))
    step = max(CHUNK // side**2, 1)
    for start in range(0, len(near_first), step):
        which = near_first[start : start + step]
        x, y, z = (centres[which, k, None, None] for k in range(3))
        r = radius[which, None, None]
        column, row = np.floor(x - r).astype(int) + across, np.floor(y - r).astype(int) + down
        inside = r**2 - (column + 0.5 - x) ** 2 - (row + 0.5 - y) ** 2
        hit = (inside > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        place, at = (row * width + column)[hit], (z + np.sqrt(np.maximum(inside, 0.0)))[hit]
        bead = np.broadcast_to(which[:, None, None], hit.shape)[hit]
        nearer = at > depth[place]
        place, at, bead = place[nearer], at[nearer], bead[nearer]
        np.maximum.at(depth, place, at)
        first = at == depth[place]
        owner[place[first]] = bead[first]
    place = np.flatnonzero(owner >= 0)
    bead = owner[place]
    point = np.stack([place % width + 0.5, place // width + 0.5, depth[place]], axis=1)
    buffer.normal.reshape(-1, 3)[place] = (point - centres[bead]) / radius[bead, None]
    buffer.colour.reshape(-1, 3)[place] = colours[bead]
    buffer.opacity.reshape(-1)[place] = 1.0


def add_rod(buffer: Buffer, rod: Rod, cut: tuple[Array, float] | None) -> None:
    """Draw a cylinder given in rays, or the cut and the far side of a hollow one.

    A solid one that lies along the cut stays whole where its axis is behind it, as shafts do in drawings.
    """
    thick = WALL * rod.radius if rod.hollow else 0.0
    length = None if rod.length is None else rod.length + 2.0 * thick
    outside = rod._replace(radius=rod.radius + thick, length=length)
    if not rod.hollow and cut is not None and abs(cut[0] @ rod.axis) < ALONG:
        if cut[0] @ rod.centre > cut[1] + ALONG * rod.radius:
            return
        cut = None
    window = _window(buffer, outside)
    outer = _through(window, outside, cut)
    meets = outer.enters > outer.leaves
    if rod.hollow:
        inner = _through(window, rod, cut)
        hollow = meets & (inner.enters > inner.leaves) & (inner.enters >= outer.enters - 1e-6)
        _put(buffer, window, hollow, inner.leaves, -inner.back, GLASS, SEEN_THROUGH)
        meets &= ~hollow
    _put(buffer, window, meets, outer.enters, outer.front, STEEL, 1.0)


Window = tuple[slice, slice]  # rows and columns of the buffer


def _window(buffer: Buffer, rod: Rod) -> Window:
    """Return the rows and columns in which a cylinder can be seen."""
    half = ENDLESS * rod.radius if rod.length is None else rod.length / 2.0
    reach = half * np.abs(rod.axis) + rod.radius * np.sqrt(np.maximum(1.0 - rod.axis**2, 0.0))
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
    """Follow the rays through a cylinder: the overlap of a tube, of the slab between its ends, and of what is not cut.

    A ray is x = (column, row, ζ); the eye is at ζ = ∞.
    """
    column, row = np.meshgrid(
        np.arange(window[1].start, window[1].stop) + 0.5 - rod.centre[0],
        np.arange(window[0].start, window[0].stop) + 0.5 - rod.centre[1],
    )
    a, axial = rod.axis, column * rod.axis[0] + row * rod.axis[1]
    bend = max(1.0 - a[2] ** 2, 1e-12)  # of a ray along the axis, which meets the side at infinity
    square = (axial * a[2]) ** 2 - bend * (column**2 + row**2 - axial**2 - rod.radius**2)
    root = np.sqrt(np.maximum(square, 0.0))
    enters = np.where(square > 0, (axial * a[2] + root) / bend, -np.inf)
    leaves = np.where(square > 0, (axial * a[2] - root) / bend, np.inf)
    found = Passage(enters, leaves, *(_radial(rod, column, row, axial, at) for at in (enters, leaves)))
    half = ENDLESS * rod.radius if rod.length is None else rod.length / 2.0
    for sign in (-1.0, 1.0):
        found = _halved(found, sign * a, half - sign * axial)
    if cut is not None:
        found = _halved(found, cut[0], cut[1] - cut[0] @ rod.centre - column * cut[0][0] - row * cut[0][1])
    return found._replace(enters=found.enters + rod.centre[2], leaves=found.leaves + rod.centre[2])


def _radial(rod: Rod, column: Array, row: Array, axial: Array, depth: Array) -> Array:
    """Return the unit vector away from the axis at a depth, (h, w, 3)."""
    at = np.where(np.isfinite(depth), depth, 0.0)
    along = axial + at * rod.axis[2]
    return np.asarray((np.stack([column, row, at], axis=-1) - along[..., None] * rod.axis) / rod.radius)


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
    colour: Sequence[float],
    opacity: float,
) -> None:
    """Draw a surface in a window where it is nearer than what is drawn."""
    nearer = where & (depth > buffer.depth[window])
    buffer.depth[window][nearer], buffer.normal[window][nearer] = depth[nearer], normal[nearer]
    buffer.colour[window][nearer], buffer.opacity[window][nearer] = colour, opacity
