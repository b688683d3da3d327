"""Which walls a particle may touch: a list of shapes closer than a skin, rebuilt with that of the neighbours."""

from typing import NamedTuple

import numpy as np
from numba import prange

from sim.kernel import Array, Flags, Indices, kernel, parallel_kernel, signed
from sim.motion import Bodies
from sim.surface import distance_to_wall


class NearWalls(NamedTuple):
    """Entries of particle i are first[i] to last[i] (excluded): shapes it may touch before the next rebuild."""

    first: Indices  # (n,)
    last: Indices  # (n,)
    surface: Indices  # (capacity,)
    touching: Flags  # (capacity,) phase of the contact, 0 while apart


@parallel_kernel
def count_near_walls(position: Array, radius: Array, walls: Bodies, skin: float) -> tuple[Indices, Array]:
    """Return how many shapes each particle is near, and its least distance φ to any (m)."""
    n = radius.shape[0]
    near = np.zeros(n, np.int64)
    least = np.full(n, np.inf)
    for i in prange(n):
        for s in range(walls.kind.shape[0]):
            d = distance_to_wall(walls, s, position[i, 0], position[i, 1], position[i, 2])[0]
            least[i] = min(least[i], d)
            if d < radius[i] + skin:
                near[i] += 1
    return near, least


@kernel
def list_walls(
    i: int,
    position: Array,
    radius: Array,
    walls: Bodies,
    skin: float,
    before: int,
    old: NearWalls,
    old_spring: Array,
    new: NearWalls,
    new_spring: Array,
) -> None:
    """List the shapes near particle i, with the contacts that its row `before` of the old list had."""
    entry = new.first[i]
    for s in range(walls.kind.shape[0]):
        d = distance_to_wall(walls, s, position[i, 0], position[i, 1], position[i, 2])[0]
        if d >= radius[i] + skin or entry >= new.last[i]:
            continue
        new.surface[entry] = s
        for e in range(old.first[before], old.last[before]):
            if old.surface[e] == s and old.touching[e]:
                new.touching[entry] = old.touching[e]
                for column in range(old_spring.shape[1]):
                    new_spring[entry, column] = old_spring[e, column]
        entry += 1


@parallel_kernel
def fill_near_walls(
    position: Array,
    radius: Array,
    walls: Bodies,
    skin: float,
    order: Indices,
    old: NearWalls,
    old_spring: Array,
    new: NearWalls,
    new_spring: Array,
) -> None:
    """Fill the list, and carry contacts over from the old one, which numbers the particles in another order."""
    for i in prange(radius.shape[0]):
        list_walls(signed(i), position, radius, walls, skin, order[i], old, old_spring, new, new_spring)


def no_near_walls(n: int) -> NearWalls:
    """Return a list without entries for n particles."""
    none = np.zeros(n, np.int64)
    return NearWalls(none, none.copy(), np.zeros(0, np.int64), np.zeros(0, np.uint8))


def rebuilt_near_walls(
    position: Array,
    radius: Array,
    inverse_mass: Array,
    walls: Bodies,
    skin: float,
    order: Indices,
    old: NearWalls,
    old_spring: Array | None,
) -> tuple[NearWalls, Array | None, Array]:
    """Return the list with the contacts of the old one, its springs, and every particle's least distance φ (m)."""
    radius = np.where(inverse_mass > 0.0, radius, -np.inf)  # a fixed particle takes no notice of walls
    near, least = count_near_walls(position, radius, walls, skin)
    last = np.cumsum(near)
    entries = int(last[-1])
    new = NearWalls(last - near, last, np.zeros(entries, np.int64), np.zeros(entries, np.uint8))
    none = np.zeros((0, 0))
    spring = None if old_spring is None else np.zeros((entries, old_spring.shape[1]))
    fill_near_walls(
        position,
        radius,
        walls,
        skin,
        order,
        old,
        none if old_spring is None else old_spring,
        new,
        none if spring is None else spring,
    )
    return new, spring, least
