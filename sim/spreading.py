"""Spheres that overlap are pushed apart until none does, between walls: a random packing.

Every sphere moves by a share of each of its overlaps, the smaller of two spheres by more, and keeps most of its last
move, so that what is crowded spreads quickly; where the moves turn against the pushes all of them are stopped. Each
row is written by one thread only, from the places of the last round: the result does not depend on their number.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import prange

from sim.kernel import Array, Flags, Indices, Partners, kernel, parallel_kernel, signed, threads_for
from sim.motion import Bodies
from sim.near_walls import count_near_walls
from sim.surface import distance_to_wall

MOST_ROUNDS = 1500
KEPT = 0.97  # of the last move
STRENGTH = 0.35  # of a push; half would part a lone pair at once
FARTHEST = 0.3  # radii that a sphere moves in one round
ROOM = 2e-3  # of the distance of two centres: how much farther apart they are pushed than touching
SKIN = 0.3  # of the smallest diameter, as in the lists of a run


class SizeGrid(NamedTuple):
    """Cells over a box, one set for every halving of the radius, so that small spheres get small cells."""

    lowest: Array  # (3,) m
    size: Array  # (levels,) m
    largest: Array  # (levels,) m, radius
    cells: Indices  # (levels, 3)
    begins: Indices  # (levels,) number of the level's first cell
    level: Indices  # (n,)


class NearSpheres(NamedTuple):
    """Spheres near sphere i are `partner[first[i]]` up to `last[i]` (excluded); each pair stands twice."""

    first: Indices  # (n,)
    last: Indices  # (n,)
    partner: Partners  # (pairs,)


def size_grid(radius: Array, lowest: Array, highest: Array) -> SizeGrid:
    """Return cells no smaller than the diameters of their level, and no more than a few per sphere."""
    level = np.floor(np.log2(radius.max() / radius) + 1e-9).astype(np.int64)
    largest = radius.max() / 2.0 ** np.arange(level.max() + 1)
    extent = highest - lowest
    size = np.maximum(2.0 * largest, (np.prod(extent) / (4.0 * len(radius))) ** (1.0 / 3.0))
    cells = np.maximum((extent / size[:, None]).astype(np.int64), 1)
    return SizeGrid(lowest, size, largest, cells, np.cumsum(cells.prod(axis=1)) - cells.prod(axis=1), level)


@kernel
def sort_by_size_and_cell(position: Array, grid: SizeGrid) -> tuple[Indices, Indices]:
    """Return the order of the spheres by level and cell, and where each cell begins in it."""
    n, cells = position.shape[0], grid.cells
    total = grid.begins[-1] + cells[-1, 0] * cells[-1, 1] * cells[-1, 2]
    start = np.zeros(total + 1, np.int64)
    cell = np.empty(n, np.int64)
    for i in range(n):
        m = grid.level[i]
        place = 0
        for axis in range(2, -1, -1):
            k = int((position[i, axis] - grid.lowest[axis]) / grid.size[m])
            place = place * cells[m, axis] + min(max(k, 0), cells[m, axis] - 1)
        cell[i] = grid.begins[m] + place
        start[cell[i] + 1] += 1
    for c in range(total):
        start[c + 1] += start[c]
    order = np.empty(n, np.int64)
    filled = start[:-1].copy()
    for i in range(n):
        order[filled[cell[i]]] = i
        filled[cell[i]] += 1
    return order, start


@kernel
def list_near(
    i: int, position: Array, radius: Array, skin: float, grid: SizeGrid, start: Indices, entry: int, partner: Partners
) -> int:
    """Write the spheres near sphere i to `partner` from `entry` on, if that has rows at all; return their number."""
    x, y, z = position[i, 0], position[i, 1], position[i, 2]
    found = 0
    for m in range(grid.size.shape[0]):
        reach = radius[i] + grid.largest[m] + skin
        cx, cy, cz = grid.cells[m, 0], grid.cells[m, 1], grid.cells[m, 2]
        dx, dy, dz = x - grid.lowest[0], y - grid.lowest[1], z - grid.lowest[2]
        size = grid.size[m]
        x0, x1 = min(max(int((dx - reach) / size), 0), cx - 1), min(max(int((dx + reach) / size), 0), cx - 1)
        y0, y1 = min(max(int((dy - reach) / size), 0), cy - 1), min(max(int((dy + reach) / size), 0), cy - 1)
        z0, z1 = min(max(int((dz - reach) / size), 0), cz - 1), min(max(int((dz + reach) / size), 0), cz - 1)
        for kz in range(z0, z1 + 1):
            for ky in range(y0, y1 + 1):
                row = grid.begins[m] + (kz * cy + ky) * cx
                for j in range(start[row + x0], start[row + x1 + 1]):
                    limit = radius[i] + radius[j] + skin
                    square = (x - position[j, 0]) ** 2 + (y - position[j, 1]) ** 2 + (z - position[j, 2]) ** 2
                    if square < limit * limit and j != i:
                        if partner.shape[0] > 0:
                            partner[entry + found] = j
                        found += 1
    return found


@parallel_kernel
def list_all(
    position: Array, radius: Array, skin: float, grid: SizeGrid, start: Indices, first: Indices, partner: Partners
) -> Indices:
    """Return how many spheres are near each, having written them where `partner` has rows."""
    found = np.zeros(radius.shape[0], np.int64)
    for i in prange(radius.shape[0]):
        found[i] = list_near(signed(i), position, radius, skin, grid, start, first[i], partner)
    return found


def near_spheres(position: Array, radius: Array, skin: float, grid: SizeGrid, start: Indices) -> NearSpheres:
    """List all pairs closer than the sum of radii and skin (m) of spheres that are sorted."""
    none = np.zeros(len(radius), np.int64)
    last = np.cumsum(list_all(position, radius, skin, grid, start, none, np.zeros(0, np.uint32)))
    first = np.concatenate([[0], last[:-1]])
    partner = np.zeros(int(last[-1]), np.uint32)
    if len(partner):
        list_all(position, radius, skin, grid, start, first, partner)
    return NearSpheres(first, last, partner)


@kernel
def push_by_spheres(i: int, position: Array, radius: Array, yielding: Array, near: NearSpheres, push: Array) -> float:
    """Add to row i of `push` (n, 3) m its share of all overlaps; return the largest in radii of the smaller sphere."""
    worst = 0.0
    for entry in range(near.first[i], near.last[i]):
        j = near.partner[entry]
        dx, dy, dz = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1], position[i, 2] - position[j, 2]
        square = dx * dx + dy * dy + dz * dz
        reach = radius[i] + radius[j]
        wanted = reach * (1.0 + ROOM)
        if square >= wanted * wanted:
            continue
        if square == 0.0:  # two in one place part along x
            dx = 1e-6 * reach if i < j else -1e-6 * reach
            square = dx * dx
        distance = sqrt(square)
        scale = (wanted - distance) * yielding[i] / (yielding[i] + yielding[j]) / distance
        push[i, 0] += scale * dx
        push[i, 1] += scale * dy
        push[i, 2] += scale * dz
        worst = max(worst, (reach - distance) / min(radius[i], radius[j]))
    return worst


@kernel
def push_by_walls(i: int, position: Array, radius: Array, walls: Bodies, push: Array) -> float:
    """Add to row i of `push` (n, 3) m its overlaps with walls; return the largest in radii."""
    worst = 0.0
    for s in range(walls.kind.shape[0]):
        d, nx, ny, nz = distance_to_wall(walls, s, position[i, 0], position[i, 1], position[i, 2])
        lacking = radius[i] * (1.0 + ROOM) - d
        if lacking <= 0.0:
            continue
        push[i, 0] += lacking * nx
        push[i, 1] += lacking * ny
        push[i, 2] += lacking * nz
        worst = max(worst, 1.0 - d / radius[i])
    return worst


@kernel
def fill_push(
    i: int,
    position: Array,
    radius: Array,
    yielding: Array,
    near: NearSpheres,
    walls: Bodies | None,
    near_wall: Flags,
    push: Array,
) -> float:
    """Set row i of `push` (n, 3) m; return the largest overlap in radii."""
    push[i, 0] = push[i, 1] = push[i, 2] = 0.0
    if yielding[i] == 0.0:
        return 0.0
    worst = push_by_spheres(i, position, radius, yielding, near, push)
    if walls is not None and near_wall[i]:
        worst = max(worst, push_by_walls(i, position, radius, walls, push))
    return worst


@parallel_kernel
def fill_pushes(
    position: Array,
    radius: Array,
    yielding: Array,
    near: NearSpheres,
    walls: Bodies | None,
    near_wall: Flags,
    push: Array,
    overlap: Array,
) -> None:
    """Set `push` (n, 3) m and the largest overlap (n,) in radii of every sphere."""
    for i in prange(radius.shape[0]):
        overlap[i] = fill_push(signed(i), position, radius, yielding, near, walls, near_wall, push)


@kernel
def move_sphere(
    i: int, kept: float, position: Array, move: Array, push: Array, radius: Array, lowest: Array, highest: Array
) -> None:
    """Move a sphere that is pushed, by no more than a part of its radius, and within a box."""
    farthest = FARTHEST * radius[i]
    for axis in range(3):
        step = min(max(kept * move[i, axis] + STRENGTH * push[i, axis], -farthest), farthest)
        least = lowest[axis] + radius[i]
        most = highest[axis] - radius[i]
        gap = min(0.25 * ROOM * radius[i], 0.25 * max(most - least, 0.0))
        place = min(max(position[i, axis] + step, least + gap), most - gap)
        move[i, axis] = place - position[i, axis]
        position[i, axis] = place


@parallel_kernel
def move_all(
    kept: float,
    position: Array,
    move: Array,
    push: Array,
    radius: Array,
    yielding: Array,
    lowest: Array,
    highest: Array,
) -> None:
    """Move every sphere that yields."""
    for i in prange(radius.shape[0]):
        if yielding[i] > 0.0:
            move_sphere(signed(i), kept, position, move, push, radius, lowest, highest)


class Spread(NamedTuple):
    """What spreading reached."""

    position: Array  # (n, 3) m
    overlap: Array  # (n,) radii, the largest of each sphere; 0 where it overlaps nothing


def spread(
    position: Array,
    radius: Array,
    held: Flags,
    walls: Bodies | None,
    lowest: Array,
    highest: Array,
    rounds: int = MOST_ROUNDS,
) -> Spread:
    """Push overlapping spheres apart, between walls and within a box (m), until none overlaps or no rounds are left.

    Held spheres, `held` (n,), stay where they are.
    """
    with threads_for(1 + len(radius) // 1000):
        return _spread(position, radius, held, walls, lowest, highest, rounds)


def _spread(
    position: Array, radius: Array, held: Flags, walls: Bodies | None, lowest: Array, highest: Array, rounds: int
) -> Spread:
    skin = SKIN * 2.0 * float(radius.min())
    rank = np.arange(len(radius))
    x, r, yielding = position.copy(), radius, np.where(held, 0.0, radius.min() / radius) ** 3
    push, move, overlap = np.zeros_like(x), np.zeros_like(x), np.zeros(len(r))
    listed = np.full_like(x, np.inf)
    for _ in range(rounds):
        if not 4.0 * ((x - listed) ** 2).sum(axis=1).max() < skin**2:
            order, start = sort_by_size_and_cell(x, size_grid(r, lowest, highest))
            x, r, yielding, move, rank = x[order], r[order], yielding[order], move[order], rank[order]
            near = near_spheres(x, r, skin, size_grid(r, lowest, highest), start)
            near_wall = np.zeros(len(r), np.uint8)
            if walls is not None:
                near_wall = (count_near_walls(x, r, walls, skin)[0] > 0).astype(np.uint8)
            listed = x.copy()
        fill_pushes(x, r, yielding, near, walls, near_wall, push, overlap)
        if overlap.max() <= 0.0:
            break
        kept = KEPT if float(np.vdot(move, push)) >= 0.0 else 0.0
        move_all(kept, x, move, push, r, yielding, lowest, highest)
    back = np.argsort(rank)
    return Spread(x[back], overlap[back])
