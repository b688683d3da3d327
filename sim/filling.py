"""How much a vessel holds: its free volume, the number of spheres that fill it, the share of it that they take."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.errors import InputError
from sim.extent import extent_of
from sim.kernel import Array
from sim.memory import OF_PARTICLE, check_memory
from sim.motion import Bodies
from sim.near_walls import count_near_walls
from sim.scene import Scene
from sim.sizes import mean_volume
from sim.species import ParticleTable
from sim.surface import beyond_shells
from sim.vessel import Shape

BULK_SOLIDS = 0.6  # volume of the beads in their bulk volume, the convention of stirred media mills
SAMPLES = 500_000  # cells that a free volume is summed over


class Region(NamedTuple):
    """Where particles may be placed: what lies within a box and within the walls."""

    lowest: Array  # (3,) m
    highest: Array  # (3,) m
    volume: float  # m³, free of walls


def bounds(scene: Scene) -> tuple[Array, Array]:
    """Return the corners (m) of the box in which particles may be placed.

    The scene's own filling box, or the bounds of the first closed wall that holds particles, or the periodic box.
    """
    if scene.filling is not None:
        return np.array(scene.filling.lowest), np.array(scene.filling.highest)
    for wall in scene.walls:
        for shape in wall.shapes:
            extent = extent_of(shape)
            if extent is not None and isinstance(shape, Shape) and shape.particles == "inside":
                return _within_period(scene, *extent)
    if scene.periodic is not None and len(scene.periodic.directions) == 3:
        return np.array(scene.periodic.lowest), np.array(scene.periodic.highest)
    raise InputError(
        "particles: no wall encloses the particles, so there is no place to pack them; "
        "add a table [filling] with lowest and highest in m, or give their positions"
    )


def _within_period(scene: Scene, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Cut a box down to the period in the directions that repeat."""
    if scene.periodic is not None:
        repeats = np.array(scene.periodic.period) > 0.0
        lowest, highest = (
            np.where(repeats, own, corner)
            for own, corner in ((scene.periodic.lowest, lowest), (scene.periodic.highest, highest))
        )
    return lowest, highest


def free_volume(lowest: Array, highest: Array, walls: Bodies | None) -> float:
    """Return the volume (m³) of a box that no wall takes, Σ V_cell clip(½ + φ / h) over cubic cells of edge h."""
    extent = highest - lowest
    if walls is None:
        return float(np.prod(extent))
    cells = _cells(extent)
    edges = extent / cells
    axes = [low + h * (np.arange(n) + 0.5) for low, h, n in zip(lowest, edges, cells, strict=True)]
    free = 0.0
    for z in axes[2]:  # a layer at a time bounds the memory
        layer = np.stack(np.meshgrid(axes[0], axes[1], [z], indexing="ij"), axis=-1).reshape(-1, 3)
        _, distance = count_near_walls(layer, np.zeros(len(layer)), walls, 0.0)
        distance[beyond_shells(layer, walls)] = -np.inf
        free += float(np.clip(0.5 + distance / edges.mean(), 0.0, 1.0).sum())
    return free * float(np.prod(edges))


def _cells(extent: Array) -> NDArray[np.int64]:
    """Return the numbers of cubic cells along three edges (m), some `SAMPLES` in all; an edge below theirs has one."""
    long = extent > 0.0
    while True:
        edge = float((np.prod(extent[long]) / SAMPLES) ** (1.0 / max(long.sum(), 1)))
        short = long & (extent < edge)
        if not short.any():
            break
        long &= ~short
    return np.where(long, np.ceil(extent / edge), 1).astype(np.int64)


def region_of(scene: Scene, walls: Bodies | None) -> Region:
    """Return where the particles of a scene may be placed.

    Raises InputError where nothing bounds it, or where walls leave no room in it.
    """
    lowest, highest = bounds(scene)
    volume = free_volume(lowest, highest, walls)
    if not volume > 0.0:
        raise InputError(
            f"particles: walls leave no room between {lowest.tolist()} and {highest.tolist()} m; "
            "move the [filling] box, or the walls"
        )
    return Region(lowest, highest, volume)


def solid_volume_asked_for(table: ParticleTable, region: Region) -> float:
    """Volume of the spheres that a table asks for by a share of the free volume, m³.

    A filling degree is the volume of the bulk, of which 60 % is solid, over the free volume; a volume fraction is that
    of the spheres themselves.
    """
    return region.volume * (table.volume_fraction or BULK_SOLIDS * (table.filling_degree or 0.0))


def numbers_of(scene: Scene, walls: Bodies | None) -> list[int]:
    """Return how many spheres every species has.

    Raises InputError where a share of the free volume is less than one sphere, or where they do not fit into memory.
    """
    numbers = _numbers_of(scene, walls)
    check_memory("particles", sum(numbers), OF_PARTICLE)
    return numbers


def _numbers_of(scene: Scene, walls: Bodies | None) -> list[int]:
    if all(table.number is not None for table in scene.particles):
        return [table.number or 0 for table in scene.particles]
    region = region_of(scene, walls)
    numbers = []
    for k, table in enumerate(scene.particles):
        volume, each = solid_volume_asked_for(table, region), mean_volume(table)
        number = table.number if table.number is not None else round(volume / each)
        if number < 1:
            raise InputError(
                f"particles.{k}: {volume:.3g} m³ of spheres asked for is less than one of {each:.3g} m³; "
                "ask for more, or for a count"
            )
        numbers.append(number)
    return numbers


def solid_fraction(scene: Scene, walls: Bodies | None, radius: Array) -> float | None:
    """Return the volume of all spheres over the free volume of the scene's region, None where nothing bounds it."""
    try:
        region = region_of(scene, walls)
    except InputError:
        return None
    return float(4.0 / 3.0 * np.pi * np.sum(radius**3) / region.volume)
