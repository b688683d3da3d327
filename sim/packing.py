"""Random packing of spheres between walls, without overlap."""

import numpy as np

from sim.errors import InputError
from sim.extent import extent_of
from sim.kernel import Array
from sim.motion import Bodies
from sim.scene import Scene
from sim.vessel import Shape
from sim.walls import beyond_shells, count_near_walls

MOST_SITES = 64  # per particle, so that a few particles in a large box cost little
CLEARANCE = 1e-3  # of a diameter, kept between neighbouring sites


def bounds(scene: Scene) -> tuple[Array, Array]:
    """Return the corners (m) of the box in which particles may be placed.

    The scene's own filling box, or the bounds of the first closed wall that holds particles.
    """
    if scene.filling is not None:
        return np.array(scene.filling.lowest), np.array(scene.filling.highest)
    for wall in scene.walls:
        for shape in wall.shapes:
            extent = extent_of(shape)
            if extent is not None and isinstance(shape, Shape) and shape.particles == "inside":
                return extent
    raise InputError(
        "particles.count: no wall encloses the particles, so there is no place to pack them; "
        "add a table [filling] with lowest and highest in m, or give their positions"
    )


def close_packed_sites(lowest: Array, highest: Array, spacing: float) -> Array:
    """Sites of a hexagonal close packing with this distance (m) of neighbours inside a box, shape (sites, 3)."""
    rise = np.array([spacing, spacing * np.sqrt(3.0) / 2.0, spacing * np.sqrt(2.0 / 3.0)])
    counts = np.floor((highest - lowest) / rise).astype(int) + 2
    i, j, k = np.meshgrid(*(np.arange(c) for c in counts), indexing="ij")
    x = spacing * (i + 0.5 * ((j + k) % 2))
    y = rise[1] * (j + (k % 2) / 3.0)
    sites = np.stack([x, y, rise[2] * k], axis=-1).reshape(-1, 3) + lowest
    return sites[(sites <= highest).all(axis=1)]


def free_sites(lowest: Array, highest: Array, spacing: float, radius: float, walls: Bodies | None) -> Array:
    """Sites at least a radius (m) from the faces of the box and from every wall."""
    sites = close_packed_sites(lowest + radius, highest - radius, spacing)
    if walls is None or not len(sites):
        return sites
    _, least = count_near_walls(sites, np.full(len(sites), radius), walls, 0.0)
    return sites[(least > radius) & ~beyond_shells(sites, walls)]


def pack(scene: Scene, walls: Bodies | None, rng: np.random.Generator) -> Array:
    """Place all counted particles of a scene at random, shape (count, 3) m, in the order of its tables.

    The widest close packing that has room for all of them is shaken within its gaps; spheres of several sizes all get
    the room of the largest. Raises InputError where not even the tightest packing has room.
    """
    wanted = sum(table.count or 0 for table in scene.particles)
    if not wanted:
        return np.zeros((0, 3))
    lowest, highest = bounds(scene)
    diameter = max(table.diameter for table in scene.particles if table.count)
    tightest = diameter * (1.0 + CLEARANCE)
    low = max(tightest, (np.sqrt(2.0) * np.prod(highest - lowest) / (MOST_SITES * wanted)) ** (1.0 / 3.0))
    sites = free_sites(lowest, highest, low, diameter / 2.0, walls)
    if len(sites) < wanted and low > tightest:  # most of the box is wall: try again with every site there is
        low, sites = tightest, free_sites(lowest, highest, tightest, diameter / 2.0, walls)
    if len(sites) < wanted:
        raise InputError(
            f"particles.count = {wanted}: only {len(sites)} spheres of {diameter:g} m fit between the walls without "
            "overlap; lower the count, or enlarge the vessel or the [filling] box"
        )
    high = float(np.ptp(np.stack([lowest, highest]), axis=0).max())
    for _ in range(40):
        middle = 0.5 * (low + high)
        trial = free_sites(lowest, highest, middle, diameter / 2.0, walls)
        if len(trial) >= wanted:
            low, sites = middle, trial
        else:
            high = middle
    chosen = sites[np.sort(rng.permutation(len(sites))[:wanted])]
    moved = np.clip(_shift(chosen, low - tightest, rng), lowest + diameter / 2.0, highest - diameter / 2.0)
    return rng.permutation(_unless_touching(walls, moved, chosen, diameter / 2.0))


def _shift(sites: Array, gap: float, rng: np.random.Generator) -> Array:
    """Displace sites at random by less than half the gap (m) between them."""
    return np.asarray(sites + rng.uniform(-1.0, 1.0, sites.shape) * max(gap, 0.0) / (2.0 * np.sqrt(3.0)))


def _unless_touching(walls: Bodies | None, moved: Array, sites: Array, radius: float) -> Array:
    """Take the moved sites, but where one would touch a wall the site itself."""
    if walls is None:
        return moved
    _, least = count_near_walls(moved, np.full(len(moved), radius), walls, 0.0)
    free = (least > radius) & ~beyond_shells(moved, walls)
    return np.where(free[:, None], moved, sites)
