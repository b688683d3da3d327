"""Where a vessel is looked at from: along its axis, upright, cut open in the middle."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim import Scene
from suffice.bead_pictures import View
from suffice.rods import Rod
from suffice.solids import frame_of

Array = NDArray[np.float64]

PARALLEL = 1e-6  # sine of an angle that is rounding
MARGIN = 1.06  # radii shown of a vessel, of which the wall takes 1.04


def down_of(scene: Scene | None) -> Array | None:
    """Return the direction of gravity, a unit vector, None where there is none."""
    pull = np.array(scene.gravity.acceleration) if scene is not None and scene.gravity else np.zeros(3)
    size = float(np.linalg.norm(pull))
    return pull / size if size else None


def frame_along(axis: Array, down: Array | None) -> Array:
    """Return rows (3, 3) to the right, up and along an axis, towards the eye; gravity points down where it can."""
    if down is None or np.linalg.norm(np.cross(axis, down)) < PARALLEL:
        return frame_of(axis)
    up = -down + (down @ axis) * axis
    up /= np.linalg.norm(up)
    return np.array([np.cross(up, axis), up, axis])


def end_view(rods: Sequence[Rod], position: Array, down: Array | None, pixels: int) -> View:
    """Return the view along the axis of the widest vessel, cut in its middle; without one, along z through the beads.

    position: (n, 3) m, which give the middle and the width where no vessel does.
    """
    vessel = max(
        (rod for rod in rods if rod.hollow and rod.other_radius is None), key=lambda rod: rod.radius, default=None
    )
    axis = np.array([0.0, 0.0, 1.0]) if vessel is None else vessel.axis
    frame = frame_along(axis, down)
    low, high = position.min(axis=0), position.max(axis=0)
    if vessel is None:
        reach = float(np.abs((position - (low + high) / 2.0) @ frame[:2].T).max())
        centre = (low + high) / 2.0
    else:
        reach = vessel.radius
        # of an endless vessel the middle is that of the beads
        ahead = 0.0 if vessel.length is not None else float(((low + high) / 2.0 - vessel.centre) @ axis)
        centre = vessel.centre + ahead * axis
    size = 2.0 * MARGIN * reach
    return View(frame, centre, size, size, pixels, (axis, float(axis @ centre)))
