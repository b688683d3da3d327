"""Spheres and cylinders as they look from a side, cut open, on a clear ground."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.png import png_of
from suffice.rod_rays import add_rod
from suffice.rods import Rod
from suffice.shading import Buffer, blank, pixels_of

Array = NDArray[np.float64]

FINER = 2  # rays per pixel in each direction
CHUNK = 2_000_000  # rays of spheres followed at once


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
        add_rod(buffer, rod.scaled(view.scale, view.frame, view.rays_of(rod.centre[None])[0]), cut)


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
