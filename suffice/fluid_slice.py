"""The speed of the fluid on planes through the middle of its grid, over time, in few bytes."""

import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import RowSource
from sim.motion import FIXED, Bodies
from suffice.frames import pack
from suffice.modelled import Modelled
from suffice.quantities import AXES, Grid
from suffice.setting import Setting
from suffice.solids import wall_distances
from suffice.variables import columns_of

Array = NDArray[np.float64]

VARIABLE = "fluid.velocity"
LEVELS = 255  # of a speed, from none to the largest
ALONG = 0.99  # cosine of the angle between a rotor's axis and one of the grid's, above which they are the same


class Plane(NamedTuple):
    """The layer of cells in the middle of a grid, across one of its axes."""

    across: int  # 0, 1, 2 for x, y, z
    shape: tuple[int, int]  # cells along the second and the first of the other two axes
    cells: NDArray[np.intp]  # (shape) their numbers in a field
    corner: Array  # (3,) m, the lowest, in the middle of the layer's depth
    edges: Array  # (2, 3) m, from the corner along the first and the second of the other two axes


class Slices(NamedTuple):
    """What the player shows of the fluid: facts in plain types, and its frames."""

    facts: dict[str, Any]
    streams: dict[str, bytes]  # deflated: speeds `slice_P_truth`, `slice_P_0` …, and `open_P` of each plane P


def planes_of(grid: Grid, axis: Array | None) -> list[Plane]:
    """Return the three middle planes, that across the axis (3,) of what turns first; else across the shortest edge.

    A direction of n cells is cut through cell n // 2.
    """
    edges = np.array(grid.spacing) * grid.shape[::-1]
    turned = [] if axis is None else [k for k in range(3) if abs(axis[k]) > ALONG]
    first = turned[0] if turned else int(np.argmin(edges))
    return [_plane(grid, k) for k in sorted(range(3), key=lambda k: (k != first, k))]


def _plane(grid: Grid, across: int) -> Plane:
    layer = grid.shape[2 - across] // 2
    numbers = np.arange(np.prod(grid.shape)).reshape(grid.shape)
    cells: NDArray[np.intp] = np.take(numbers, layer, axis=2 - across)
    spacing, corner = np.array(grid.spacing), np.array(grid.origin)
    corner[across] += (layer + 0.5) * spacing[across]
    others = [k for k in range(3) if k != across]
    edges = np.diag(spacing * grid.shape[::-1])[others]
    rows, columns = (grid.shape[2 - k] for k in reversed(others))
    return Plane(across, (rows, columns), cells, corner, edges)


def slices_of(
    values: RowSource, grid: Grid, setting: Setting, frames: NDArray[np.intp], models: Sequence[Modelled]
) -> Slices:
    """Return the speed of the fluid on its middle planes, simulated and as each model says, in 255 steps.

    values: `fluid.velocity` as rows, (3 cells, snapshots) in m/s; models: of it, at the times of the frames. What they
    say above the largest simulated speed is cut off there.
    """
    planes = planes_of(grid, None if setting.axis is None else setting.axis.along)
    rows = [(3 * plane.cells.ravel()[:, None] + np.arange(3)).ravel() for plane in planes]
    wanted, where = np.unique(np.concatenate(rows), return_inverse=True)
    found = [columns_of(values, frames)[:, wanted], *(model.at(wanted) for model in models)]
    speeds = [_speeds(each[:, where], planes) for each in found]
    fastest = max(float(each.max()) for each in speeds[0]) or 1.0
    streams = {}
    for p, plane in enumerate(planes):
        streams[f"open_{p}"] = zlib.compress(_open(plane, grid, setting.walls).tobytes())
        for name, each in zip(["truth", *map(str, range(len(models)))], speeds, strict=True):
            streams[f"slice_{p}_{name}"] = pack(levels_of(each[p], fastest))
    said = [{"surrogate": model.surrogate, "modes": model.modes, "rmse": model.rmse} for model in models]
    return Slices({"fastest": fastest, "planes": list(map(_facts, planes)), "predictions": said}, streams)


def levels_of(speed: Array, fastest: float) -> NDArray[np.uint16]:
    """Return speeds as whole numbers from 0 to 255, the largest being `fastest`: half a step off at most."""
    return np.asarray(np.rint(np.minimum(speed / fastest, 1.0) * LEVELS), np.uint16)


def _speeds(velocity: NDArray[Any], planes: Sequence[Plane]) -> list[Array]:
    """Split velocities (frames, 3 cells of all planes) into speeds of each plane, (frames, cells)."""
    speed = np.linalg.norm(velocity.reshape(len(velocity), -1, 3).astype(np.float64), axis=-1)
    return np.split(speed, np.cumsum([plane.cells.size for plane in planes])[:-1], axis=1)


def _open(plane: Plane, grid: Grid, walls: Bodies | None) -> NDArray[np.uint8]:
    """Distance of each cell's middle to walls at rest, (shape): 128 at the wall, 0 and 255 two cells within and off."""
    still = None if walls is None else resting(walls)
    if still is None:
        return np.full(plane.shape, 255, np.uint8)
    z, y, x = np.unravel_index(plane.cells.ravel(), grid.shape)
    places = np.array(grid.origin) + (np.stack([x, y, z], axis=-1) + 0.5) * np.array(grid.spacing)
    off = wall_distances(places, still, 0.0) / (2.0 * max(grid.spacing))
    return np.rint(127.5 * (1.0 + np.clip(off, -1.0, 1.0))).astype(np.uint8).reshape(plane.shape)


def resting(walls: Bodies) -> Bodies | None:
    """Return the walls without the shapes of bodies that move, None where nothing is left."""
    kept = walls.motion[walls.body] == FIXED
    if not kept.any():
        return None
    return walls._replace(
        kind=walls.kind[kept], parameter=walls.parameter[kept], side=walls.side[kept], body=walls.body[kept]
    )


def _facts(plane: Plane) -> dict[str, Any]:
    return {
        "across": AXES[plane.across],
        "at": float(plane.corner[plane.across]),
        "shape": list(plane.shape),
        "corner": plane.corner.tolist(),
        "edges": plane.edges.tolist(),
    }
