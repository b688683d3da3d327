"""The speed of a fluid on a plane through a vessel, and the walls behind that plane."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from suffice.bead_pictures import FINER, View, add_rods
from suffice.png import png_of
from suffice.quantities import Grid
from suffice.ramps import colours_of
from suffice.rods import Rod
from suffice.shading import blank, pixels_of

Array = NDArray[np.float64]

BEHIND = 0.01  # rays: the cut through a wall lies in the same plane and is what is seen
EDGE_ON = 1e-6  # cosine of the angle between a plane and the direction of view that is rounding


def slice_picture(view: View, grid: Grid, field: Array, end: float, rods: Sequence[Rod] = ()) -> bytes:
    """Return a field of cells (z, y, x) on the cutting plane of a view as a PNG, linear between the cells.

    Colours are those of a speed from 0 to `end`. Where there are vessels, only what lies in one is shown. Raises
    ValueError for a view without a cutting plane, or one that looks along it.
    """
    cut = view.cut_in_rays()
    if cut is None or view.cut is None or abs(cut[0][2]) < EDGE_ON:
        raise ValueError("a slice needs a view with a cutting plane that it does not look along")
    buffer = blank(view.rows * FINER, view.pixels * FINER)
    row, column = (np.indices(buffer.depth.shape) + 0.5).astype(np.float64)
    depth = (cut[1] - cut[0][0] * column - cut[0][1] * row) / cut[0][2]
    on_plane = np.stack([column, row, depth], axis=-1) - view.rays_of(view.centre[None])[0]
    point = on_plane @ view.frame / view.scale + view.centre
    place = (point - np.array(grid.origin)) / np.array(grid.spacing) - 0.5  # cells, from the middle of the first
    shown = ((place >= -0.5) & (place <= np.array(grid.shape[::-1]) - 0.5)).all(axis=-1)
    vessels = [rod for rod in rods if rod.hollow]
    if vessels:
        shown &= np.any([_within(rod, point) for rod in vessels], axis=0)
    values = map_coordinates(field, [place[..., axis] for axis in (2, 1, 0)], order=1, mode="nearest")
    buffer.depth[shown] = depth[shown] - BEHIND
    buffer.normal[shown], buffer.opacity[shown] = (0.0, 0.0, 1.0), 1.0
    buffer.colour[shown] = colours_of(values[shown], end, "speed")
    add_rods(buffer, view, rods)
    return png_of(pixels_of(buffer, FINER, 0.03 * view.width * view.scale))


def _within(rod: Rod, point: Array) -> NDArray[np.bool_]:
    """Whether points (…, 3) m lie in a cylinder."""
    arm = point - rod.centre
    along = arm @ rod.axis
    out = np.linalg.norm(arm - along[..., None] * rod.axis, axis=-1)
    return np.asarray(
        (out <= rod.radius_at(along)) & (np.abs(along) <= (np.inf if rod.length is None else 0.5 * rod.length))
    )
