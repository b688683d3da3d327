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

from sim.cells import CellGrid, around, cell_number, cell_of, wrapped
from sim.kernel import (
    Array,
    Flags,
    Images,
    Indices,
    Partners,
    Vector,
    difference,
    inlined,
    kernel,
    parallel_kernel,
    signed,
)

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
    image: Images  # (capacity, 3) periods from the partner to its nearest image; no rows where nothing repeats
    period: Array  # (3,) m


def chunk_bounds(n: int) -> Indices:
    """Deal n particles to chunks of about equal size: shape (chunks + 1,)."""
    chunks = 1 if n < FEWEST_TO_SHARE else min(max(1, n // PARTICLES_PER_CHUNK), MOST_CHUNKS)
    if n >= FEWEST_TO_SHARE:  # a multiple of four, so that two or four threads get equal shares
        chunks = -(-chunks // 4) * 4
    return np.linspace(0, n, chunks + 1).astype(np.int64)


def empty_neighbors(n: int, region: int, period: Array) -> Neighbors:
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
        image=np.zeros((capacity if period.any() else 0, 3), np.int8),
        period=period,
    )


@inlined
def images_between(d: float, axis: int, period: Array) -> int:
    """Periods between a particle and the nearest image of another, a distance d (m) away along an axis."""
    return floor(d / period[axis] + 0.5) if period[axis] > 0.0 else 0


@inlined
def nearest_image(dx: float, dy: float, dz: float, listed: Neighbors, entry: int) -> Vector:
    """Take the vector (m) from a partner to a particle to the partner's nearest image."""
    image, period = listed.image, listed.period
    return dx - image[entry, 0] * period[0], dy - image[entry, 1] * period[1], dz - image[entry, 2] * period[2]


@inlined
def separation(position: Array, i: int, j: int, listed: Neighbors, entry: int) -> Vector:
    """Vector (m) to particle i from the nearest image of its partner j."""
    dx, dy, dz = difference(position, i, j)
    if listed.image.shape[0] > 0:
        return nearest_image(dx, dy, dz, listed, entry)
    return dx, dy, dz


@inlined
def place_by_gap(entry: int, beginning: int, j: int, gap: float, partner: Partners, gaps: Array) -> None:
    """Insert partner j among the entries of its particle, which are kept in the order of their gaps (m)."""
    while entry > beginning and gaps[entry - 1 - beginning] > gap:
        partner[entry] = partner[entry - 1]
        gaps[entry - beginning] = gaps[entry - 1 - beginning]
        entry -= 1
    partner[entry] = j
    gaps[entry - beginning] = gap


@inlined
def list_cell(
    i: int,
    cell: int,
    entry: int,
    full: int,
    position: Array,
    radius: Array,
    inverse_mass: Array,
    start: Indices,
    skin: float,
    listed: Neighbors,
    gaps: Array,
) -> int:
    """List the partners of particle i that are behind it and in this cell; return the next free entry."""
    wraps = listed.image.shape[0] > 0
    beginning = listed.first[i]
    for j in range(max(start[cell], i + 1), start[cell + 1]):
        dx, dy, dz = difference(position, i, j)
        if wraps:
            dx -= images_between(dx, 0, listed.period) * listed.period[0]
            dy -= images_between(dy, 1, listed.period) * listed.period[1]
            dz -= images_between(dz, 2, listed.period) * listed.period[2]
        touch = radius[i] + radius[j]
        square = dx * dx + dy * dy + dz * dz
        if square < (touch + skin) * (touch + skin) and inverse_mass[i] + inverse_mass[j] > 0.0:  # not two fixed ones
            if entry < full:
                listed.owner[entry] = i
                place_by_gap(entry, beginning, j, sqrt(square) - touch, listed.partner, gaps)
            entry += 1
    return entry


@kernel
def list_chunk(
    c: int,
    position: Array,
    radius: Array,
    inverse_mass: Array,
    grid: CellGrid,
    start: Indices,
    skin: float,
    listed: Neighbors,
) -> int:
    """List the pairs of the particles of chunk c; return how many there are, even where its region holds fewer."""
    region = listed.partner.shape[0] // (listed.chunks.shape[0] - 1)
    entry, full = c * region, (c + 1) * region
    gaps = np.empty(region)
    for i in range(listed.chunks[c], listed.chunks[c + 1]):
        listed.first[i] = min(entry, full)
        ix, iy, iz = cell_of(position[i, 0], position[i, 1], position[i, 2], grid)
        x0, x1 = around(ix, 0, grid)
        y0, y1 = around(iy, 1, grid)
        z0, z1 = around(iz, 2, grid)
        for kz in range(z0, z1):
            for ky in range(y0, y1):
                for kx in range(x0, x1):
                    cell = cell_number(wrapped(kx, 0, grid), wrapped(ky, 1, grid), wrapped(kz, 2, grid), grid.blocks)
                    entry = list_cell(i, cell, entry, full, position, radius, inverse_mass, start, skin, listed, gaps)
        listed.last[i] = min(entry, full)
    for e in range(c * region if listed.image.shape[0] > 0 else full, min(entry, full)):
        for axis in range(3):
            d = position[listed.owner[e], axis] - position[listed.partner[e], axis]
            listed.image[e, axis] = images_between(d, axis, listed.period)
    wanted: int = entry - c * region
    return wanted


@parallel_kernel
def fill_neighbors(
    position: Array, radius: Array, inverse_mass: Array, grid: CellGrid, start: Indices, skin: float, listed: Neighbors
) -> Indices:
    """Fill the list with all pairs closer than the sum of radii and skin; return the entries each chunk wanted.

    A chunk that wanted more than its region holds is left incomplete: the caller makes room and calls again.
    """
    wanted = np.zeros(listed.chunks.shape[0] - 1, np.int64)
    for c in prange(wanted.shape[0]):
        wanted[c] = list_chunk(signed(c), position, radius, inverse_mass, grid, start, skin, listed)
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
        inherit_chunk(signed(c), order, old, old_spring, new, new_spring)


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
    inverse_mass: Array,
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
        new = empty_neighbors(len(radius), region, grid.period)
        most = int(fill_neighbors(position, radius, inverse_mass, grid, start, skin, new).max())
        if most <= region:
            break
        region = int(1.25 * most) + 1
    new = with_boxes(new)
    none = np.zeros((0, 0))
    spring = None if old_spring is None else np.zeros((len(new.partner), old_spring.shape[1]))
    inherit_contacts(order, old, none if old_spring is None else old_spring, new, none if spring is None else spring)
    return new, spring
