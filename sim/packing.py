"""Random packing of spheres between walls, without overlap."""

import numpy as np

from sim.errors import InputError
from sim.filling import Region
from sim.kernel import Array
from sim.motion import Bodies
from sim.near_walls import count_near_walls
from sim.spreading import spread
from sim.surface import beyond_shells

CLEARANCE = 1e-3  # of a diameter, kept between neighbouring sites of a close packing
DENSEST_AT_RANDOM = 0.64  # volume fraction; nothing beyond is tried at random
MOST_DRAWS = 200  # of places for all spheres that are still within a wall
FEWER_ROUNDS, REMOVED = 300, 0.02  # of the spheres at a time, to find out how many fit


def close_packed_sites(lowest: Array, highest: Array, spacing: float) -> Array:
    """Sites of a hexagonal close packing with this distance (m) of neighbours inside a box, shape (sites, 3)."""
    rise = np.array([spacing, spacing * np.sqrt(3.0) / 2.0, spacing * np.sqrt(2.0 / 3.0)])
    counts = np.maximum(np.floor((highest - lowest) / rise).astype(int) + 2, 0)
    i, j, k = np.meshgrid(*(np.arange(c) for c in counts), indexing="ij")
    x = spacing * (i + 0.5 * ((j + k) % 2))
    y = rise[1] * (j + (k % 2) / 3.0)
    sites = np.stack([x, y, rise[2] * k], axis=-1).reshape(-1, 3) + lowest
    return sites[(sites <= highest).all(axis=1)]


def free_sites(region: Region, radius: float, walls: Bodies | None) -> Array:
    """Sites of the tightest packing at least a radius (m) from the faces of the box and from every wall."""
    sites = close_packed_sites(region.lowest + radius, region.highest - radius, 2.0 * radius * (1.0 + CLEARANCE))
    if walls is None or not len(sites):
        return sites
    _, least = count_near_walls(sites, np.full(len(sites), radius), walls, 0.0)
    return sites[(least > radius) & ~beyond_shells(sites, walls)]


def pack(
    region: Region, walls: Bodies | None, radius: Array, given: tuple[Array, Array], rng: np.random.Generator
) -> Array:
    """Place spheres of these radii (n,) m at random in a region, shape (n, 3) m, clear of each other and of walls.

    `given` are centres and radii of spheres that stand there already. Spheres are thrown in and pushed apart; where
    that does not end and all are of one size, they are put on sites of a close packing. Raises InputError with the
    number that fits where that is less.
    """
    n = len(radius)
    if n == 0:
        return np.zeros((0, 3))
    others = within(region, *given)
    held = (np.arange(n + len(others[1])) >= n).astype(np.uint8)
    crowded = 4.0 / 3.0 * np.pi * float(np.sum(radius**3)) / region.volume > DENSEST_AT_RANDOM
    if not crowded:
        start = np.concatenate([thrown(region, walls, radius, rng), others[0]])
        done = spread(start, np.concatenate([radius, others[1]]), held, walls, region.lowest, region.highest)
        if done.overlap.max() <= 0.0:
            return done.position[:n]
    sites = np.zeros((0, 3))
    if np.ptp(radius) == 0.0 and not held.any():
        sites = free_sites(region, float(radius[0]), walls)
        if len(sites) >= n:
            return rng.permutation(sites)[:n]
    fits = max(number_that_fits(region, walls, radius, others, rng), len(sites))
    low, high = 2.0 * radius.min(), 2.0 * radius.max()
    raise InputError(
        f"particles: only about {fits} of {n} spheres of {low:g}{f' to {high:g}' if low < high else ''} m fit between "
        "the walls without overlap; ask for fewer, or enlarge the vessel or the [filling] box"
    )


def within(region: Region, position: Array, radius: Array) -> tuple[Array, Array]:
    """Return those spheres that reach into the box of a region."""
    reach = radius[:, None]
    inside = ((position > region.lowest - reach) & (position < region.highest + reach)).all(axis=1)
    return position[inside], radius[inside]


def thrown(region: Region, walls: Bodies | None, radius: Array, rng: np.random.Generator) -> Array:
    """Return a random place for every sphere that touches no wall, whatever other spheres are there; (n, 3) m.

    Raises InputError where a sphere finds none.
    """
    position = np.empty((len(radius), 3))
    left = np.arange(len(radius))
    for _ in range(MOST_DRAWS):
        low, high = region.lowest + radius[left, None], region.highest - radius[left, None]
        position[left] = low + rng.uniform(size=(len(left), 3)) * (high - low)
        least = np.full(len(left), np.inf)
        if walls is not None:
            least = count_near_walls(position[left], radius[left], walls, 0.0)[1]
            least[beyond_shells(position[left], walls)] = -np.inf
        left = left[(least < radius[left]) | (low > high).any(axis=1)]
        if not len(left):
            return position
    raise InputError(
        f"particles: no place between the walls was found for a sphere of {2.0 * radius[left].max():g} m; "
        "lower its diameter, or enlarge the vessel or the [filling] box"
    )


def number_that_fits(
    region: Region, walls: Bodies | None, radius: Array, others: tuple[Array, Array], rng: np.random.Generator
) -> int:
    """Return about how many of the spheres can be spread out, found by taking out the most crowded ones."""
    share = 4.0 / 3.0 * np.pi * float(np.sum(radius**3)) / region.volume
    kept = rng.permutation(radius)[: int(len(radius) * min(1.0, DENSEST_AT_RANDOM / share))]
    position = thrown(region, walls, kept, rng)
    while len(kept):
        held = (np.arange(len(kept) + len(others[1])) >= len(kept)).astype(np.uint8)
        start, sizes = np.concatenate([position, others[0]]), np.concatenate([kept, others[1]])
        done = spread(start, sizes, held, walls, region.lowest, region.highest, FEWER_ROUNDS)
        if done.overlap.max() <= 0.0:
            break
        overlap = done.overlap[: len(kept)]
        stays = np.sort(np.argsort(overlap)[: len(kept) - max(1, int(REMOVED * len(kept)))])
        position, kept = done.position[stays], kept[stays]
    return len(kept)
