"""Solid walls in a box that repeats: they reach through it, stand clear of its borders, or are there twice."""

import numpy as np

from sim.errors import InputError
from sim.extent import Extent, extent_of
from sim.kernel import Array
from sim.scene import Scene
from sim.vessel import AnyShape, Combination, Oscillation, Plane, Rotation, Translation

ROUND_OFF = 1e-9  # of the period: how far what is meant to end on a border may miss it


def check_repeating(scene: Scene) -> None:
    """Refuse solids that come closer to a border of a periodic box than a particle's radius (InputError).

    Walls act where they stand, not on the images of particles: beyond the border there has to be another one.
    """
    if scene.periodic is None:
        return
    radius = max((table.largest / 2.0 for table in scene.particles), default=0.0)
    solids = _solids(scene)
    for k, axis in enumerate("xyz"):
        period = scene.periodic.period[k]
        if not period:
            continue
        first, last = scene.periodic.lowest[k], scene.periodic.highest[k]
        near, through = radius - ROUND_OFF * period, ROUND_OFF * period
        for field, here, covered in solids:
            low, high = covered[0][k], covered[1][k]
            if low <= first + through and high >= last - through:
                continue
            beyond = period * np.eye(3)[k]
            cut_below = low < first + near and not _stands(here, beyond, solids)
            if cut_below or (high > last - near and not _stands(here, -beyond, solids)):
                raise InputError(
                    f"{field}: is or comes between {low:.5g} and {high:.5g} m in {axis}, within a radius of a border "
                    f"of the box that repeats from {first:g} to {last:g} m, and would end there; draw the borders "
                    "elsewhere, let it reach through the box, or give another one a period away"
                )


def _solids(scene: Scene) -> list[tuple[str, Extent, Extent]]:
    """Return field, extent at time zero, and what it covers until the end, of every solid whose extent is known."""
    found = []
    for b, wall in enumerate(scene.walls):
        for s, shape in enumerate(wall.shapes):
            extent = extent_of(shape) if _is_solid(shape) and _is_tight(shape) else None
            if extent is not None:
                covered = _covered(extent, wall.motion, scene.time.duration)
                found.append((f"walls.{b}.shapes.{s}", extent, covered))
    return found


def _is_solid(shape: AnyShape) -> bool:
    return not isinstance(shape, Plane) and shape.particles == "outside"


def _is_tight(shape: AnyShape) -> bool:
    """Tell whether the extent of a shape has no room to spare."""
    if isinstance(shape, Combination):
        return shape.operation == "union" and all(map(_is_tight, shape.of))
    return True


def _covered(extent: Extent, motion: Rotation | Oscillation | Translation | None, duration: float) -> Extent:
    """Return the extent (m) that a moving shape covers at least in a time (s): no solid is refused that stays clear."""
    low, high = extent
    if isinstance(motion, Translation):
        way = np.array(motion.velocity) * duration
        return low + np.minimum(way, 0.0), high + np.maximum(way, 0.0)
    if isinstance(motion, Oscillation) and duration * motion.frequency >= 1.0:
        amplitude, middle = np.abs(motion.amplitude), np.array(motion.amplitude) * np.sin(motion.phase)
        return low - middle - amplitude, high - middle + amplitude
    if isinstance(motion, Rotation) and duration * abs(motion.rpm) >= 60.0:
        return _turned(low, high, np.array(motion.axis), np.array(motion.point))
    return extent


def _turned(low: Array, high: Array, axis: Array, point: Array) -> Extent:
    """Return what a shape covers at least in a turn about an axis of the scene; about another, where it stands."""
    if np.count_nonzero(axis) != 1:
        return low, high
    across = axis == 0.0
    reach = float(np.maximum(point - low, high - point)[across].max())
    return np.where(across, np.minimum(low, point - reach), low), np.where(
        across, np.maximum(high, point + reach), high
    )


def _stands(extent: Extent, shift: Array, solids: list[tuple[str, Extent, Extent]]) -> bool:
    """Tell whether another solid stands where this one would be after a shift (m)."""
    wanted, close = np.array(extent) + shift, ROUND_OFF * np.abs(shift).max()
    return any(np.abs(np.array(other) - wanted).max() <= close for _, other, _ in solids)
