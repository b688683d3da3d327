"""Who may touch whom: a list of pairs closer than a skin, rebuilt when a particle has moved far enough.

Particles are kept sorted by cells of space and dealt to a fixed number of chunks, whatever the number of threads. A
pair stands once in the list, with the first of the two, nearest partners first. A chunk applies the forces of its own
pairs; what it owes to a particle of another chunk it leaves in a letter box, which that chunk empties before it moves
its particles. No two chunks ever write to the same particle, and sums run in the same order on any number of threads.
"""

from math import floor, sqrt
from typing import NamedTuple

import numpy as np
from numba import prange

from sim.kernel import Array, Flags, Indices, Partners, inlined, kernel, parallel_kernel

BLOCK = 4  # cells per side of a block; blocks are numbered in turn, so that a chunk is compact in space
PARTICLES_PER_CHUNK = 2500  # fewer, larger chunks list fewer pairs twice
FEWEST_TO_SHARE = 1000  # particles; below it a second thread gains nothing
MOST_CHUNKS = 64


class Neighbors(NamedTuple):
    """Entries of particle i are first[i] to last[i] (excluded) of `partner`, a region of the list per chunk."""

    chunks: Indices  # (chunks + 1,) first particle of each chunk
    first: Indices  # (n,)
    last: Indices  # (n,)
    owner: Partners  # (capacity,) particle i
    partner: Partners  # (capacity,) particle, behind the listing one
    touching: Flags  # (capacity,) phase of the contact, 0 while apart
    target: Partners  # (capacity,) the partner itself, or n + letter box where it is in another chunk
    boxes: Indices  # (chunks + 1,) first letter box of each receiving chunk
    receiver: Partners  # (boxes,) particle whose letter box it is


class CellGrid(NamedTuple):
    """Cubic cells over the bounding box of the particles, numbered block by block."""

    lowest: Array  # (3,) m
    inverse_size: float  # 1/m
    cells: Indices  # (3,)
    blocks: Indices  # (3,)


def chunk_bounds(n: int) -> Indices:
    """Deal n particles to chunks of about equal size: shape (chunks + 1,)."""
    chunks = 1 if n < FEWEST_TO_SHARE else min(max(1, n // PARTICLES_PER_CHUNK), MOST_CHUNKS)
    if n >= FEWEST_TO_SHARE:  # a multiple of four, so that two or four threads get equal shares
        chunks = -(-chunks // 4) * 4
    return np.linspace(0, n, chunks + 1).astype(np.int64)


def empty_neighbors(n: int, region: int) -> Neighbors:
    """Return a list without entries that has room for `region` of them in every chunk."""
    chunks = chunk_bounds(n)
    capacity = region * (len(chunks) - 1)
    return Neighbors(
        chunks,
        first=np.zeros(n, np.int64),
        last=np.zeros(n, np.int64),
        owner=np.zeros(capacity, np.uint32),
        partner=np.zeros(capacity, np.uint32),
        touching=np.zeros(capacity, np.uint8),
        target=np.zeros(capacity, np.uint32),
        boxes=np.zeros(len(chunks), np.int64),
        receiver=np.zeros(0, np.uint32),
    )


def cell_grid(position: Array, cutoff: float) -> CellGrid:
    """Lay cells no smaller than the cutoff (m) over the particles, and no more than a few per particle."""
    lowest, extent = position.min(axis=0), np.ptp(position, axis=0)
    size = cutoff
    while np.prod(np.floor(extent / size) + 1.0) > 8.0 * len(position) + 64.0:
        size *= 1.5  # few particles far apart: a larger cell is slower to search but bounded in memory
    cells = np.floor(extent / size).astype(np.int64) + 1
    return CellGrid(lowest, 1.0 / size, cells, -(-cells // BLOCK))


@inlined
def cell_number(ix: int, iy: int, iz: int, blocks: Indices) -> int:
    """Return the number of a cell: its block's, then its place within the block."""
    block: int = ((iz // BLOCK) * blocks[1] + iy // BLOCK) * blocks[0] + ix // BLOCK
    return ((block * BLOCK + iz % BLOCK) * BLOCK + iy % BLOCK) * BLOCK + ix % BLOCK


@inlined
def cell_of(x: float, y: float, z: float, grid: CellGrid) -> tuple[int, int, int]:
    """Return the three indices of the cell that holds a point (m)."""
    ix = floor((x - grid.lowest[0]) * grid.inverse_size)
    iy = floor((y - grid.lowest[1]) * grid.inverse_size)
    iz = floor((z - grid.lowest[2]) * grid.inverse_size)
    return min(ix, grid.cells[0] - 1), min(iy, grid.cells[1] - 1), min(iz, grid.cells[2] - 1)


@kernel
def sort_by_cell(position: Array, grid: CellGrid) -> tuple[Indices, Indices]:
    """Return the order of the particles by cell, shape (n,), and where each cell begins in it, shape (cells + 1,)."""
    n = position.shape[0]
    start = np.zeros(grid.blocks[0] * grid.blocks[1] * grid.blocks[2] * BLOCK**3 + 1, np.int64)
    cell = np.empty(n, np.int64)
    for i in range(n):
        ix, iy, iz = cell_of(position[i, 0], position[i, 1], position[i, 2], grid)
        cell[i] = cell_number(ix, iy, iz, grid.blocks)
        start[cell[i] + 1] += 1
    for c in range(start.shape[0] - 1):
        start[c + 1] += start[c]
    order = np.empty(n, np.int64)
    filled = start[:-1].copy()
    for i in range(n):
        order[filled[cell[i]]] = i
        filled[cell[i]] += 1
    return order, start


@inlined
def place_by_gap(entry: int, beginning: int, j: int, gap: float, partner: Partners, gaps: Array) -> None:
    """Insert partner j among the entries of its particle, which are kept in the order of their gaps (m)."""
    while entry > beginning and gaps[entry - 1 - beginning] > gap:
        partner[entry] = partner[entry - 1]
        gaps[entry - beginning] = gaps[entry - 1 - beginning]
        entry -= 1
    partner[entry] = j
    gaps[entry - beginning] = gap


@kernel
def list_chunk(
    c: int, position: Array, radius: Array, grid: CellGrid, start: Indices, skin: float, listed: Neighbors
) -> int:
    """List the pairs of the particles of chunk c; return how many there are, even where its region holds fewer."""
    region = listed.partner.shape[0] // (listed.chunks.shape[0] - 1)
    entry, full = c * region, (c + 1) * region
    gaps = np.empty(region)
    for i in range(listed.chunks[c], listed.chunks[c + 1]):
        listed.first[i] = min(entry, full)
        beginning = entry
        x, y, z = position[i, 0], position[i, 1], position[i, 2]
        ix, iy, iz = cell_of(x, y, z, grid)
        for kz in range(max(iz - 1, 0), min(iz + 2, grid.cells[2])):
            for ky in range(max(iy - 1, 0), min(iy + 2, grid.cells[1])):
                for kx in range(max(ix - 1, 0), min(ix + 2, grid.cells[0])):
                    cell = cell_number(kx, ky, kz, grid.blocks)
                    for j in range(max(start[cell], i + 1), start[cell + 1]):
                        dx, dy, dz = x - position[j, 0], y - position[j, 1], z - position[j, 2]
                        reach = radius[i] + radius[j]
                        square = dx * dx + dy * dy + dz * dz
                        if square < (reach + skin) * (reach + skin):
                            if entry < full:
                                listed.owner[entry] = i
                                place_by_gap(entry, beginning, j, sqrt(square) - reach, listed.partner, gaps)
                            entry += 1
        listed.last[i] = min(entry, full)
    wanted: int = entry - c * region
    return wanted


@parallel_kernel
def fill_neighbors(
    position: Array, radius: Array, grid: CellGrid, start: Indices, skin: float, listed: Neighbors
) -> Indices:
    """Fill the list with all pairs closer than the sum of radii and skin; return the entries each chunk wanted.

    A chunk that wanted more than its region holds is left incomplete: the caller makes room and calls again.
    """
    wanted = np.zeros(listed.chunks.shape[0] - 1, np.int64)
    for c in prange(wanted.shape[0]):
        wanted[c] = list_chunk(c, position, radius, grid, start, skin, listed)
    return wanted


@inlined
def inherited_entry(old: Neighbors, i: int, j: int) -> int:
    """Entry of the old list in which i lists j while touching it, or −1."""
    for entry in range(old.first[i], old.last[i]):
        if old.partner[entry] == j and old.touching[entry]:
            return entry
    return -1


@kernel
def inherit_chunk(c: int, order: Indices, old: Neighbors, old_spring: Array, new: Neighbors, new_spring: Array) -> None:
    """Carry over the contacts of the particles of chunk c."""
    columns = old_spring.shape[1]
    for i in range(new.chunks[c], new.chunks[c + 1]):
        for entry in range(new.first[i], new.last[i]):
            sign = 1.0
            before = inherited_entry(old, order[i], order[new.partner[entry]])
            if before < 0:
                sign = -1.0
                before = inherited_entry(old, order[new.partner[entry]], order[i])
            if before < 0:
                continue
            new.touching[entry] = old.touching[before]
            for axis in range(columns):
                new_spring[entry, axis] = sign * old_spring[before, axis]


@parallel_kernel
def inherit_contacts(order: Indices, old: Neighbors, old_spring: Array, new: Neighbors, new_spring: Array) -> None:
    """Carry contacts over from a list that numbers the particles in another order.

    A pair may be listed by the other partner now: its displacements then change sign. Frictionless lists pass springs
    of no columns.
    """
    for c in prange(new.chunks.shape[0] - 1):
        inherit_chunk(c, order, old, old_spring, new, new_spring)


@kernel
def count_crossings(c: int, listed: Neighbors, crossings: Indices) -> None:
    """Count the pairs of chunk c with each other chunk, in row c of `crossings` (chunks, chunks)."""
    for entry in range(listed.first[listed.chunks[c]], listed.last[listed.chunks[c + 1] - 1]):
        crossings[c, chunk_of(listed, c, listed.partner[entry])] += 1
    crossings[c, c] = 0


@inlined
def chunk_of(listed: Neighbors, c: int, j: int) -> int:
    """Chunk of particle j, which is not before chunk c."""
    while j >= listed.chunks[c + 1]:
        c += 1
    return c


@kernel
def assign_boxes(c: int, listed: Neighbors, following: Indices) -> None:
    """Give every pair of chunk c with another chunk d the next box of row c, column d of `following`."""
    for entry in range(listed.first[listed.chunks[c]], listed.last[listed.chunks[c + 1] - 1]):
        j = listed.partner[entry]
        listed.target[entry] = j
        if j >= listed.chunks[c + 1]:
            d = chunk_of(listed, c, j)
            listed.target[entry] = listed.first.shape[0] + following[c, d]
            listed.receiver[following[c, d]] = j
            following[c, d] += 1


def with_boxes(listed: Neighbors) -> Neighbors:
    """Return the list with a letter box for every pair that crosses chunks, ordered by receiving chunk."""
    chunks = len(listed.chunks) - 1
    crossings = np.zeros((chunks, chunks), np.int64)
    for c in range(chunks):
        count_crossings(c, listed, crossings)
    end = np.cumsum(crossings.T.ravel())
    following = (end - crossings.T.ravel()).reshape(chunks, chunks).T.copy()
    listed = listed._replace(
        boxes=np.concatenate([[0], end[chunks - 1 :: chunks]]), receiver=np.zeros(int(end[-1]), np.uint32)
    )
    for c in range(chunks):
        assign_boxes(c, listed, following)
    return listed


def rebuilt_neighbors(
    position: Array,
    radius: Array,
    order: Indices,
    start: Indices,
    grid: CellGrid,
    skin: float,
    old: Neighbors,
    old_spring: Array | None,
) -> tuple[Neighbors, Array | None]:
    """Return the list for particles already put in `order`, and its springs, with the contacts of the old list."""
    region = len(old.partner) // (len(old.chunks) - 1)
    while True:
        new = empty_neighbors(len(radius), region)
        most = int(fill_neighbors(position, radius, grid, start, skin, new).max())
        if most <= region:
            break
        region = int(1.25 * most) + 1
    new = with_boxes(new)
    none = np.zeros((0, 0))
    spring = None if old_spring is None else np.zeros((len(new.partner), old_spring.shape[1]))
    inherit_contacts(order, old, none if old_spring is None else old_spring, new, none if spring is None else spring)
    return new, spring
