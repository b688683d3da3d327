"""Multigrid for Σ_f w_f (x_neighbour − x) = −b: one symmetric V-cycle from b to an approximate x.

Cells of a level are joined in pairs along the axes whose spacing is small. All numbers of all levels lie in one table,
a row per field, and each level is padded with a layer of ghost cells: zeros behind a wall or an opening, copies of the
other side on a periodic axis. Face i of an axis is the lower face of cell i.

Between grids x is interpolated along each axis as the flux through resistances in series would have it, so that
nothing crosses a closed face, a jump of the coefficient is followed, and uniform coefficients give linear
interpolation; residuals come back through its transpose. Smoothing by red-black Gauss-Seidel, with the colours in
reverse order on the way up, makes the cycle a symmetric positive operator, as conjugate gradients require.
"""

from typing import NamedTuple

import numpy as np
from numba import prange

from sim.kernel import Array, Indices, inlined, kernel, parallel_kernel, signed

FIELDS = 10
FEWEST_TO_SHARE = 20_000  # cells of a level; two idle threads gain from 4,000 on, but each hand-over may have to wait
RED, BLACK, RESIDUAL, RESTRICT, PROLONG = range(5)  # what can be done to rows of cells


class Grids(NamedTuple):
    """All levels, finest first; axes in order x, y, z."""

    fields: Array  # (FIELDS, padded cells of all levels), in the order of `Level`
    start: Indices  # (levels + 1,) first padded cell of each
    cells: Indices  # (levels, 3)
    joined: Indices  # (levels, 3) cells that become one on the next level: 1 or 2
    periodic: Indices  # (3,) 0 or 1


class Level(NamedTuple):
    """Fields of one level, flat over its padded cells, x fastest; the unit of w is that of b/x."""

    x: Array  # correction
    b: Array  # right-hand side
    rest: Array  # b − A x
    wx: Array  # coefficient of the lower face
    wy: Array
    wz: Array
    inverse: Array  # 1/Σw, 0 in a closed cell
    tx: Array  # share of the neighbour along each axis when the coarse x is interpolated
    ty: Array
    tz: Array
    cells: tuple[int, int, int]
    joined: tuple[int, int, int]
    periodic: tuple[int, int, int]


def joined_cells(cells: Indices, spacing: Array) -> Indices:
    """Return along which axes cells are joined in pairs (2) or left (1), shape (3,): the strongly coupled ones."""
    several = cells > 1
    if not several.any():
        return np.ones(3, np.int64)
    return np.where(several & (spacing < 1.5 * spacing[several].min()), 2, 1)


def empty_grids(cells: tuple[int, int, int], spacing: tuple[float, float, float], periodic: Indices) -> Grids:
    """Return room for all levels down to a single cell: spacing (m) decides what is joined."""
    sizes, pairs, h = [np.array(cells, np.int64)], [], np.array(spacing)
    while (sizes[-1] > 1).any():
        pairs.append(joined_cells(sizes[-1], h))
        sizes.append(-(-sizes[-1] // pairs[-1]))
        h = h * pairs[-1]
    pairs.append(np.ones(3, np.int64))
    start = np.cumsum([0] + [int(np.prod(size + 2)) for size in sizes])
    return Grids(np.zeros((FIELDS, start[-1])), start, np.array(sizes), np.array(pairs), periodic)


@kernel
def level_of(grids: Grids, number: int) -> Level:
    """Return the fields of one level."""
    f = grids.fields[:, grids.start[number] : grids.start[number + 1]]
    n, joined, periodic = grids.cells[number], grids.joined[number], grids.periodic
    return Level(
        f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9],
        (n[0], n[1], n[2]), (joined[0], joined[1], joined[2]), (periodic[0], periodic[1], periodic[2]),
    )  # fmt: skip


@inlined
def strides(level: Level) -> tuple[int, int, int]:
    """Distance between neighbours along each axis in a flat padded field."""
    return 1, level.cells[0] + 2, (level.cells[0] + 2) * (level.cells[1] + 2)


@inlined
def rows_of(level: Level) -> int:
    """Rows of cells along x."""
    return level.cells[1] * level.cells[2]


@inlined
def row_start(level: Level, row: int) -> int:
    """Return the padded number of the first cell of a row."""
    _, sy, sz = strides(level)
    k = row // level.cells[1]
    return (k + 1) * sz + (row - k * level.cells[1] + 1) * sy + 1


@kernel
def wrap_axis(level: Level, field: Array, axis: int) -> None:
    """Copy the cells at both ends of an axis to the ghosts behind the other end."""
    n, s = level.cells, strides(level)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    for i in range(1, n[a] + 1):
        for j in range(1, n[b] + 1):
            low = i * s[a] + j * s[b]
            field[low] = field[low + n[axis] * s[axis]]
            field[low + (n[axis] + 1) * s[axis]] = field[low + s[axis]]


@kernel
def wrap_(level: Level, field: Array) -> None:
    """Make the ghosts of the periodic axes true."""
    for axis in range(3):
        if level.periodic[axis]:
            wrap_axis(level, field, axis)


@inlined
def outflow(x: Array, wx: Array, wy: Array, wz: Array, m: np.uint64, sy: np.uint64, sz: np.uint64) -> float:
    """Σ_f w_f (x_m − x_neighbour) of cell m."""
    one = np.uint64(1)
    here = x[m]
    return (  # type: ignore[no-any-return]
        wx[m] * (here - x[m - one])
        + wx[m + one] * (here - x[m + one])
        + wy[m] * (here - x[m - sy])
        + wy[m + sy] * (here - x[m + sy])
        + wz[m] * (here - x[m - sz])
        + wz[m + sz] * (here - x[m + sz])
    )


@kernel
def relax_rows(level: Level, colour: int, first: int, last: int) -> None:
    """Balance the cells of one colour: x += (b − A x)/Σw."""
    sy, sz = np.uint64(strides(level)[1]), np.uint64(strides(level)[2])
    x, b, inverse, (wx, wy, wz) = level.x, level.b, level.inverse, (level.wx, level.wy, level.wz)
    for row in range(first, last):
        k = row // level.cells[1]
        shift = (row - k * level.cells[1] + k + colour) % 2
        m = np.uint64(row_start(level, row) + shift)
        for _ in range((level.cells[0] + 1 - shift) // 2):
            x[m] += inverse[m] * (b[m] - outflow(x, wx, wy, wz, m, sy, sz))
            m += np.uint64(2)


@kernel
def rest_of_rows(level: Level, first: int, last: int) -> None:
    """Fill rest = b − A x."""
    x, b, rest, (wx, wy, wz) = level.x, level.b, level.rest, (level.wx, level.wy, level.wz)
    sy, sz = np.uint64(strides(level)[1]), np.uint64(strides(level)[2])
    for row in range(first, last):
        begin = row_start(level, row)
        for i in range(level.cells[0]):
            m = np.uint64(begin + i)
            rest[m] = b[m] - outflow(x, wx, wy, wz, m, sy, sz)


@kernel
def restrict_rows(fine: Level, coarse: Level, first: int, last: int) -> None:
    """Gather b of the coarse level: the transpose of the interpolation applied to the fine rest; and forget its x."""
    (fx, fy, fz), (_, sy, sz), n = fine.joined, strides(fine), fine.cells
    rest, tx, ty, tz, b, x = fine.rest, fine.tx, fine.ty, fine.tz, coarse.b, coarse.x
    for row in range(first, last):
        Z, Y = row // coarse.cells[1], row % coarse.cells[1]
        k0, j0 = fz * Z + 1, fy * Y + 1
        k1, j1 = min(k0 + fz, n[2] + 1), min(j0 + fy, n[1] + 1)
        to = row_start(coarse, row)
        for X in range(coarse.cells[0]):
            i0 = fx * X + 1
            i1 = min(i0 + fx, n[0] + 1)
            total = 0.0
            for k in range(k0, k1):
                for j in range(j0, j1):
                    base = k * sz + j * sy
                    for m in range(base + i0, base + i1):
                        total += rest[m] * (1.0 - tx[m] - ty[m] - tz[m])
                    total += rest[base + i0 - 1] * tx[base + i0 - 1] + rest[base + i1] * tx[base + i1]
            if fy == 2:
                for k in range(k0, k1):
                    low, high = k * sz + (j0 - 1) * sy, k * sz + j1 * sy
                    for i in range(i0, i1):
                        total += rest[low + i] * ty[low + i] + rest[high + i] * ty[high + i]
            if fz == 2:
                for j in range(j0, j1):
                    low, high = (k0 - 1) * sz + j * sy, k1 * sz + j * sy
                    for i in range(i0, i1):
                        total += rest[low + i] * tz[low + i] + rest[high + i] * tz[high + i]
            b[to + X] = total
            x[to + X] = 0.0


@inlined
def parent(index: int, joined: int) -> tuple[int, int]:
    """Return the padded coarse numbers of the cell that a fine cell belongs to and of the one it leans to."""
    if joined == 1:
        return index, index
    own = (index + 1) // 2
    return own, own - 1 + 2 * (1 - index % 2)


@kernel
def prolong_rows(fine: Level, coarse: Level, first: int, last: int) -> None:
    """Add the interpolated coarse x to the fine one."""
    (_, sy, sz), x = strides(coarse), coarse.x
    to, tx, ty, tz = fine.x, fine.tx, fine.ty, fine.tz
    for row in range(first, last):
        k, j = row // fine.cells[1] + 1, row % fine.cells[1] + 1
        (Z, above), (Y, beside) = parent(k, fine.joined[2]), parent(j, fine.joined[1])
        own, up, side = Z * sz + Y * sy, above * sz + Y * sy, Z * sz + beside * sy
        begin = row_start(fine, row)
        for i in range(fine.cells[0]):
            m = begin + i
            X, ahead = parent(i + 1, fine.joined[0])
            c = x[own + X]
            to[m] += c + tx[m] * (x[own + ahead] - c) + ty[m] * (x[side + X] - c) + tz[m] * (x[up + X] - c)


@kernel
def do_rows(task: int, grids: Grids, number: int, first: int, last: int) -> None:
    """Do one of the tasks to some rows of a level, or of the next one when restricting."""
    fine = level_of(grids, number)
    if task <= BLACK:
        relax_rows(fine, task, first, last)
    elif task == RESIDUAL:
        rest_of_rows(fine, first, last)
    elif task == RESTRICT:
        restrict_rows(fine, level_of(grids, number + 1), first, last)
    else:
        prolong_rows(fine, level_of(grids, number + 1), first, last)


@parallel_kernel
def share_rows(task: int, grids: Grids, number: int, rows: int, shares: int) -> None:
    """Do a task to all rows; any number of shares gives the same numbers."""
    for c in prange(shares):
        do_rows(task, grids, number, signed(c) * rows // shares, (signed(c) + 1) * rows // shares)


@kernel
def run(task: int, grids: Grids, number: int, threads: int) -> None:
    """Do a task to all rows, and before it make the ghosts true that it reads."""
    fine = level_of(grids, number)
    rows = rows_of(fine)
    if task == PROLONG:
        coarse = level_of(grids, number + 1)
        wrap_(coarse, coarse.x)
    elif task == RESTRICT:
        rows = rows_of(level_of(grids, number + 1))
        wrap_(fine, fine.rest)
    else:
        wrap_(fine, fine.x)
    if threads == 1 or rows_of(fine) * fine.cells[0] < FEWEST_TO_SHARE:
        do_rows(task, grids, number, 0, rows)
    else:
        share_rows(task, grids, number, rows, threads)


@kernel
def cycle_(grids: Grids, sweeps: int, threads: int) -> None:
    """Replace x of the finest level by that of one V-cycle which starts from zero."""
    last = grids.cells.shape[0] - 1
    level_of(grids, 0).x[:] = 0.0
    for number in range(last):
        for _ in range(sweeps):
            run(RED, grids, number, threads)
            run(BLACK, grids, number, threads)
        run(RESIDUAL, grids, number, threads)
        run(RESTRICT, grids, number, threads)
    run(RED, grids, last, 1)  # a single cell: exact
    for number in range(last - 1, -1, -1):
        run(PROLONG, grids, number, threads)
        for _ in range(sweeps):
            run(BLACK, grids, number, threads)
            run(RED, grids, number, threads)
