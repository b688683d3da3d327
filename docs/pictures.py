"""Picture of one moment of a run: its beads coloured by speed, between the walls of its scene.

    python docs/pictures.py mini/run.h5 docs/mill.png [--time 0.15] [--fastest 0.9] [--upright] [--width 1000]

The vessel is open towards the eye: at its near end, or, `--upright` where its axis is vertical, cut through its middle.
Boxes and planes are left out.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from suffice.bead_pictures import View
from suffice.gallery import Gallery, Moment
from suffice.rods import Rod
from suffice.run import Run

Array = NDArray[np.float64]

FROM_THE_END, FROM_THE_SIDE = np.array([-2.4, 2.0, 8.2]), np.array([1.5, -8.4, 1.6])  # towards the eye
ROOM = 1.08  # around what is shown


def view_of(moment: Moment, upright: bool, pixels: int) -> View:
    """Return the view on the widest cylinder that holds particles, or on all particles where there is none."""
    eye = FROM_THE_SIDE if upright else FROM_THE_END
    eye = eye / np.linalg.norm(eye)
    right = np.cross(np.eye(3)[2 if upright else 1], eye)
    right /= np.linalg.norm(right)
    frame = np.array([right, np.cross(eye, right), eye])
    low, high = moment.position.min(axis=0), moment.position.max(axis=0)
    vessels = [rod for rod in moment.rods if rod.hollow]
    # what the projection of a cylinder reaches about its middle: along its axis, and its radius across
    reach = [(rod.centre @ frame.T, _reach(rod, frame)) for rod in vessels]
    least = np.min([low @ frame.T, high @ frame.T, *(middle - half for middle, half in reach)], axis=0)[:2]
    most = np.max([low @ frame.T, high @ frame.T, *(middle + half for middle, half in reach)], axis=0)[:2]
    size, centre = ROOM * (most - least), (least + most) / 2.0 @ frame[:2]
    normal = np.array([eye[0], eye[1], 0.0]) / np.hypot(eye[0], eye[1]) if upright else np.eye(3)[2]
    ends = [rod.centre[2] + rod.length / 2.0 for rod in vessels if rod.length is not None]
    at = 0.0 if upright else min(ends, default=float(high[2]))
    return View(frame, centre, float(size[0]), float(size[1]), pixels, (normal, at))


def _reach(rod: Rod, frame: Array) -> Array:
    along = frame @ rod.axis
    return np.asarray(0.5 * (rod.length or 0.0) * np.abs(along) + rod.widest * np.sqrt(1.0 - along**2))


def draw(run_file: str, path: str, time: float, fastest: float, upright: bool, width: int) -> None:
    """Draw the snapshot nearest to a time (s), speeds coloured up to `fastest` (m/s)."""
    with Run(run_file) as run:
        gallery = Gallery(run, width)
        moment = gallery.moment(int(np.abs(run.times - time).argmin()))
    moment = moment._replace(view=view_of(moment, upright, width))
    Path(path).write_bytes(gallery.by_speed(moment, moment.position, moment.speed, fastest))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", help="a run.h5 of a scene with cylinders, such as that of the study `mini`")
    parser.add_argument("picture", help="PNG file to write")
    parser.add_argument("--time", type=float, default=0.15, help="s")
    parser.add_argument("--fastest", type=float, default=0.9, help="m/s, end of the scale, blue over green to yellow")
    parser.add_argument("--upright", action="store_true", help="the axis is vertical")
    parser.add_argument("--width", type=int, default=1000, help="pixels")
    given = parser.parse_args()
    draw(given.run, given.picture, given.time, given.fastest, given.upright, given.width)
