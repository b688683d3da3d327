"""Where the volume of the particles lies: in slabs along a direction, or in shells around an axis."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.kernel import threads_for
from sim.motion import Bodies, move_bodies
from sim.near_walls import count_near_walls
from sim.surface import beyond_shells
from suffice.setting import Axis
from suffice.swept import distance_from

Array = NDArray[np.float64]
MOST_BINS = 20
SAMPLES = 60_000  # points at which a free volume is looked for: some 3000 in a bin
POINTS_PER_THREAD = 20_000  # below which handing work over to another thread costs more than it saves


class Profile(NamedTuple):
    """A quantity along a direction or away from an axis."""

    place: Array  # (bins,) m, middle of each bin
    values: Array  # (bins,), NaN where walls leave next to no room
    room: Array  # (bins,) m³ free of walls


class Bins(NamedTuple):
    """Slabs or shells, with points in each at which walls are looked for."""

    axis: Axis
    radial: bool  # shells around the axis instead of slabs along it
    edges: Array  # (bins + 1,) m
    points: Array  # (bins, k, 3) m
    volumes: Array  # (bins, k) m³ that a point stands for
    spacing: float  # m between points

    def place(self, position: Array) -> Array:
        """Coordinate of each position (n, 3) that the bins divide, (n,) m."""
        if self.radial:
            return distance_from(self.axis.point, self.axis.along, position)
        return np.asarray((position - self.axis.point) @ self.axis.along)


def share_below(place: Array, radius: Array, edge: float) -> Array:
    """Share of the volume of each sphere below a plane at `edge`, (n,); place, radius (n,) and edge in m.

    (2 + 3s − s³) / 4 with s = (edge − place) / radius within ±1. For shells around an axis the plane stands for the
    cylinder, which moves the border of a sphere of radius r at distance R by up to r² / 2R.
    """
    s = np.clip((edge - place) / radius, -1.0, 1.0)
    return np.asarray((2.0 + 3.0 * s - s**3) / 4.0)


def solid_volumes(bins: Bins, position: Array, radius: Array) -> Array:
    """Volume of the spheres in each bin, (bins,) m³; what lies beyond the first or the last edge counts in that bin."""
    place, volume = bins.place(position), 4.0 / 3.0 * np.pi * radius**3
    below = [0.0, *(float(share_below(place, radius, edge) @ volume) for edge in bins.edges[1:-1]), float(volume.sum())]
    return np.diff(below)


def free_volumes(bins: Bins, walls: Bodies | None, time: float) -> Array:
    """Volume of each bin that walls leave free at a time (s), (bins,) m³: Σ V clip(½ + φ / spacing) over its points."""
    if walls is None:
        return np.asarray(bins.volumes.sum(axis=1))
    points = bins.points.reshape(-1, 3)
    distance = wall_distances(points, walls, time)
    distance[beyond_shells(points, walls)] = -np.inf
    free = np.clip(0.5 + distance / bins.spacing, 0.0, 1.0).reshape(bins.volumes.shape)
    return np.asarray((bins.volumes * free).sum(axis=1))


def wall_distances(points: Array, walls: Bodies, time: float) -> Array:
    """Least distance φ of each point (n, 3) m to the walls where they stand at a time (s), (n,) m; negative within."""
    move_bodies(walls, time)
    with threads_for(len(points) // POINTS_PER_THREAD):
        _, least = count_near_walls(np.ascontiguousarray(points), np.zeros(len(points)), walls, 0.0)
    return least


def void_fraction(bins: Bins, position: Array, radius: Array, room: Array) -> Profile:
    """Share of the free volume (bins,) m³ that the spheres leave, 1 − V_solid / V_free."""
    known = room > 0.1 * bins.volumes.sum(axis=1)
    solid = solid_volumes(bins, position, radius)
    values = np.full(len(room), np.nan)
    values[known] = 1.0 - solid[known] / room[known]
    return Profile((bins.edges[1:] + bins.edges[:-1]) / 2.0, values, np.where(known, room, 0.0))


def slabs(up: Array, lowest: Array, highest: Array, diameter: float) -> Bins:
    """Slabs across a unit vector through the box from `lowest` to `highest` (3,) m, of a frame that has `up` as z.

    At most 20, none thinner than a diameter (m). lowest, highest: in the frame of `frame_of(up)`.
    """
    frame, extent = frame_of(up), highest - lowest
    edges = _edges(lowest[2], highest[2], diameter)
    cell = float(np.prod(extent) / SAMPLES) ** (1.0 / 3.0)
    across = [_middles(lowest[k], highest[k], max(round(extent[k] / cell), 1)) for k in (0, 1)]
    deep = max(round((edges[1] - edges[0]) / cell), 1)
    levels = _middles(edges[0], edges[-1], deep * (len(edges) - 1))
    grid = np.stack(np.meshgrid(levels, *across, indexing="ij"), axis=-1).reshape(len(edges) - 1, -1, 3)
    points = grid[..., [1, 2, 0]] @ frame
    return Bins(
        Axis(np.zeros(3), up),
        False,
        edges,
        points,
        np.full(points.shape[:2], np.prod(extent) / grid[..., 0].size),
        cell,
    )


def shells(axis: Axis, reach: float, low: float, high: float, diameter: float) -> Bins:
    """Shells around an axis out to `reach`, between the heights `low` and `high` over its point, m."""
    edges = _edges(0.0, reach, diameter)
    n, length = len(edges) - 1, high - low
    cell = float(np.pi * reach**2 * length / SAMPLES) ** (1.0 / 3.0)
    radii = _middles(0.0, reach, n * max(round((edges[1] - edges[0]) / cell), 1))
    angles = _middles(0.0, 2.0 * np.pi, max(round(2.0 * np.pi * reach / cell), 8))
    heights = _middles(low, high, max(round(length / cell), 1))
    r, angle, z = (part.reshape(n, -1) for part in np.meshgrid(radii, angles, heights, indexing="ij"))
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1) @ frame_of(axis.along) + axis.point
    ring = r * (reach / len(radii)) * (2.0 * np.pi / len(angles)) * (length / len(heights))
    return Bins(axis, True, edges, points, ring, cell)


def frame_of(up: Array) -> Array:
    """Rows are three unit vectors, (3, 3), the last of which is `up`; along the axes where `up` is."""
    first = np.eye(3)[(int(np.argmax(np.abs(up))) + 1) % 3]
    first = first - (first @ up) * up
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def _edges(low: float, high: float, diameter: float) -> Array:
    whole = int((high - low) / diameter + 1e-6)  # five diameters are five bins, however they are rounded
    return np.linspace(low, high, 1 + min(max(whole, 1), MOST_BINS))


def _middles(low: float, high: float, count: int) -> Array:
    edges = np.linspace(low, high, count + 1)
    return np.asarray((edges[1:] + edges[:-1]) / 2.0)
