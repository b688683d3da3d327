"""Pictures of the moments of a run, simulated and predicted, always from the same side."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import parse_scene
from suffice.bead_pictures import View, bead_picture
from suffice.bridge import Bridge, bridges_of
from suffice.ramps import colours_of
from suffice.refusal import Refusal
from suffice.rods import Rod, rods_of
from suffice.run import Run
from suffice.slice_pictures import slice_picture
from suffice.variables import mean_diameter
from suffice.viewpoint import down_of, end_view
from suffice.wording import number

Array = NDArray[np.float64]

BRIGHTEST = 0.995  # share of speeds below the end of their scale


class Moment(NamedTuple):
    """A snapshot of a run, and the view on it."""

    time: float  # s
    position: Array  # (n, 3) m
    speed: Array  # (n,) m/s
    rods: list[Rod]  # where the walls stand
    view: View


class Gallery:
    """The pictures of a run. Raises `Refusal` where it lacks positions, velocities or radii."""

    def __init__(self, run: Run, pixels: int) -> None:
        missing = [name for name in ("position", "velocity") if name not in run.quantities]
        diameter = mean_diameter(run)
        if missing or diameter is None:
            raise Refusal(f"{run.path} has no {' and no '.join(missing) or 'radii'}; pictures of beads need them")
        text = run.provenance.get("scene")
        self.run, self.pixels, self.diameter = run, pixels, diameter
        self.radius = np.asarray(run.radius, np.float64)
        self.scene = None if text is None else parse_scene(text, str(run.path))

    def moment(self, k: int) -> Moment:
        """Return snapshot k."""
        snapshot = self.run.snapshot(k)
        position, velocity = (np.asarray(snapshot.values[name], np.float64) for name in ("position", "velocity"))
        rods = [] if self.scene is None else rods_of(self.scene, snapshot.time).rods
        view = end_view(rods, position, down_of(self.scene), self.pixels)
        return Moment(snapshot.time, position, np.linalg.norm(velocity, axis=1), rods, view)

    def by_speed(self, moment: Moment, position: Array, speed: Array, fastest: float) -> bytes:
        """Return beads at positions (n, 3) m, coloured by speed (n,) m/s, among the walls of a moment."""
        return bead_picture(moment.view, position, self.radius, colours_of(speed, fastest, "speed"), moment.rods)

    def by_distance(self, moment: Moment, position: Array) -> bytes:
        """Return beads at positions (n, 3) m, coloured by their distance from the truth up to a diameter."""
        colours = colours_of(self.distance(moment, position), 1.0, "error")
        return bead_picture(moment.view, position, self.radius, colours, moment.rods)

    def distance(self, moment: Moment, position: Array) -> Array:
        """Return how far positions (n, 3) m are from those of a moment, in diameters, (n,)."""
        return np.asarray(np.linalg.norm(position - moment.position, axis=1) / self.diameter)

    def off(self, moment: Moment, position: Array) -> str:
        """Say how far positions (n, 3) m are from those of a moment, in the mean and at most."""
        distance = self.distance(moment, position)
        return f"off by {number(float(distance.mean()), 2)} d, at most {number(float(distance.max()), 2)} d"


def predicted(bridge: Bridge, time: float) -> tuple[Array, Array]:
    """Return positions (n, 3) m and speeds (n,) m/s of a bridge of positions at a time (s)."""
    position = bridge.at([time])[0].reshape(-1, 3)
    return position, np.asarray(np.linalg.norm(bridge.rate_at([time])[0].reshape(-1, 3), axis=1))


def fastest_of(speed: Array) -> float:
    """Return the end of a scale of speeds (n,) m/s, which but few exceed."""
    return float(np.quantile(speed, BRIGHTEST)) or 1.0


def unseen_moment(trainings: Sequence[NDArray[np.intp]]) -> int:
    """Return the snapshot in the second half of the common window that lies farthest from those trained on.

    That is, whose smallest distance to a training snapshot, as a share of the training interval, is largest over all
    trainings, of which none may have every snapshot; of equals the first.
    """
    last = min(int(training[-1]) for training in trainings)
    k = np.arange(last // 2, last)
    share = np.full(len(k), np.inf)
    for training in trainings:
        stride = int(training[1] - training[0])
        share = np.minimum(share, np.minimum(k % stride, -k % stride) / stride)
    return int(k[share.argmax()])


def fluid_pictures(gallery: Gallery, moment: Moment, interval: float) -> tuple[bytes, bytes, float]:
    """Return the speed of the fluid on the cut, simulated and predicted, and the end of its scale (m/s).

    The surrogate is trained on the snapshots kept every `interval` (s). Raises `Refusal` for a run without a fluid.
    """
    grid = gallery.run.grid
    if grid is None or "fluid.velocity" not in gallery.run.quantities:
        raise Refusal(f"{gallery.run.path} holds no velocity of a fluid")
    k = int(np.searchsorted(gallery.run.times, moment.time))
    truth = np.asarray(gallery.run.snapshot(k).values["fluid.velocity"], np.float64)
    bridge = bridges_of(gallery.run, "fluid.velocity", [interval])[interval]
    guess = bridge.at([moment.time])[0].reshape(truth.shape)
    speeds = [np.linalg.norm(field, axis=-1) for field in (truth, guess)]
    end = fastest_of(speeds[0])
    simulated, surrogate = (slice_picture(moment.view, grid, speed, end, moment.rods) for speed in speeds)
    return simulated, surrogate, end
