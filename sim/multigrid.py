"""Multigrid for Σ_f w_f (x_neighbour − x) = −b: one symmetric V-cycle from b to an approximate x.

Cells of a level are joined in pairs along the axes whose spacing is small. Each level is padded with a layer of ghost
cells: zeros behind a wall or an opening, copies of the other side on a periodic axis. Face i of an axis is the lower
face of cell i.

Between grids x is interpolated along each axis as the flux through resistances in series would have it, so that
nothing crosses a closed face, a jump of the coefficient is followed, and uniform coefficients give linear
interpolation; residuals come back through its transpose. Smoothing by red-black Gauss-Seidel, with the colours in
reverse order on the way up, makes the cycle a symmetric positive operator, as conjugate gradients require.

Kernels take few plain arrays and numbers, never call one another, and run on one thread: each layer of compiled code
on top of them would compile them anew, for minutes in all.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.kernel import Array, inlined, kernel

X, B, WX, WY, WZ, INVERSE, TX, TY, TZ = FIELDS = range(9)
RED, BLACK = 0, 1
Cells = tuple[int, int, int]


class Level(NamedTuple):
    """One level; axes in order x, y, z."""

    fields: Array  # (FIELDS, padded cells), x fastest:
    # X correction, B right-hand side, WX WY WZ coefficients of the lower faces, INVERSE 1/Σw, 0 in a closed cell,
    # TX TY TZ share of the neighbour along each axis when the coarse x is interpolated; the unit of w is that of B/X
    cells: Cells
    joined: Cells  # cells that become one on the next level: 1 or 2
    wraps: Cells  # 1 where an axis is periodic, else 0


def layers(field: NDArray[Any], cells: Cells, axis: int) -> NDArray[Any]:
    """Return a padded field as layers across an axis, shape (n + 2, cells of the other axes)."""
    nx, ny, nz = cells
    return np.moveaxis(field.reshape(nz + 2, ny + 2, nx + 2), 2 - axis, 0)[:, 1:-1, 1:-1]


def empty_levels(cells: Cells, spacing: tuple[float, float, float], periodic: tuple[bool, bool, bool]) -> list[Level]:
    """Return room for all levels, finest first, down to a single cell: spacing (m) decides what is joined."""
    levels, h, (px, py, pz) = [], np.array(spacing), periodic
    while True:
        several = np.array(cells) > 1
        near = several & (h < 1.5 * h[several].min(initial=np.inf))  # strongly coupled
        nx, ny, nz = cells
        fx, fy, fz = (2 if one else 1 for one in near)
        fields = np.zeros((len(FIELDS), (nx + 2) * (ny + 2) * (nz + 2)))
        levels.append(Level(fields, cells, (fx, fy, fz), (int(px), int(py), int(pz))))
        if not several.any():
            return levels
        cells, h = (-(-nx // fx), -(-ny // fy), -(-nz // fz)), h * levels[-1].joined


@kernel
def wrap_axes(x: Array, nx: int, ny: int, nz: int, px: int, py: int, pz: int, folds: bool) -> None:
    """Copy the cells at both ends of periodic axes to the ghosts behind the other end, or move these back to them."""
    sy, sz = nx + 2, (nx + 2) * (ny + 2)
    for wraps, n, s, na, sa, nb, sb in (
        (px, nx, 1, nz, sz, ny, sy),
        (py, ny, sy, nz, sz, nx, 1),
        (pz, nz, sz, ny, sy, nx, 1),
    ):
        for a in range(1, na * wraps + 1):
            for b in range(1, nb + 1):
                low = a * sa + b * sb
                high = low + n * s
                if folds:
                    x[high] += x[low]
                    x[low + s] += x[high + s]
                    x[low], x[high + s] = 0.0, 0.0
                else:
                    x[low], x[high + s] = x[high], x[low + s]


def wrap_(level: Level, x: Array, folds: bool = False) -> None:
    """Make the ghosts of the periodic axes true, or fold what they hold back into the cells."""
    if level.wraps != (0, 0, 0):
        wrap_axes(x, *level.cells, *level.wraps, folds)


@inlined
def outflow(x: Array, wx: Array, wy: Array, wz: Array, m: np.uint64, sy: np.uint64, sz: np.uint64) -> float:
    """Σ_f w_f (x_m − x_neighbour) of cell m; unsigned numbers, or numba looks for negative ones."""
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
def relax_(fields: Array, nx: int, ny: int, nz: int, colour: int) -> None:
    """Balance the cells of one colour: x += (b − A x)/Σw."""
    x, b, inverse, wx, wy, wz = fields[X], fields[B], fields[INVERSE], fields[WX], fields[WY], fields[WZ]
    sy, sz = np.uint64(nx + 2), np.uint64((nx + 2) * (ny + 2))
    for k in range(1, nz + 1):
        for j in range(1, ny + 1):
            shift = (k + j + colour) % 2
            m = np.uint64((k * (ny + 2) + j) * (nx + 2) + 1 + shift)
            for _ in range((nx + 1 - shift) // 2):
                x[m] += inverse[m] * (b[m] - outflow(x, wx, wy, wz, m, sy, sz))
                m += np.uint64(2)


@inlined
def parents(index: int, joined: int) -> tuple[int, int]:
    """Return the padded coarse numbers of the cell that a fine cell belongs to and of the one it leans to."""
    if joined == 1:
        return index, index
    own = (index + 1) // 2
    return own, own - 1 + 2 * (1 - index % 2)


@kernel
def restrict_(fields: Array, nx: int, ny: int, nz: int, coarse: Array, fx: int, fy: int, fz: int) -> None:
    """Add b − A x to b of the coarse level by the transpose of the interpolation."""
    x, b, wx, wy, wz = fields[X], fields[B], fields[WX], fields[WY], fields[WZ]
    tx, ty, tz, to = fields[TX], fields[TY], fields[TZ], coarse[B]
    sy, sz = np.uint64(nx + 2), np.uint64((nx + 2) * (ny + 2))
    row = (nx + fx - 1) // fx + 2
    plane = row * ((ny + fy - 1) // fy + 2)
    for k in range(1, nz + 1):
        ck, above = parents(k, fz)
        for j in range(1, ny + 1):
            cj, beside = parents(j, fy)
            own, side, up = ck * plane + cj * row, ck * plane + beside * row, above * plane + cj * row
            m = np.uint64((k * (ny + 2) + j) * (nx + 2) + 1)
            for i in range(1, nx + 1):
                ci, ahead = parents(i, fx)
                rest = b[m] - outflow(x, wx, wy, wz, m, sy, sz)
                to[own + ci] += rest * (1.0 - tx[m] - ty[m] - tz[m])
                to[own + ahead] += rest * tx[m]
                to[side + ci] += rest * ty[m]
                to[up + ci] += rest * tz[m]
                m += np.uint64(1)


@kernel
def prolong_(fields: Array, nx: int, ny: int, nz: int, coarse: Array, fx: int, fy: int, fz: int) -> None:
    """Add the interpolated coarse x to the fine one."""
    x, tx, ty, tz, given = fields[X], fields[TX], fields[TY], fields[TZ], coarse[X]
    row = (nx + fx - 1) // fx + 2
    plane = row * ((ny + fy - 1) // fy + 2)
    for k in range(1, nz + 1):
        ck, above = parents(k, fz)
        for j in range(1, ny + 1):
            cj, beside = parents(j, fy)
            own, side, up = ck * plane + cj * row, ck * plane + beside * row, above * plane + cj * row
            m = np.uint64((k * (ny + 2) + j) * (nx + 2) + 1)
            for i in range(1, nx + 1):
                ci, ahead = parents(i, fx)
                c = given[own + ci]
                x[m] += (
                    c + tx[m] * (given[own + ahead] - c) + ty[m] * (given[side + ci] - c) + tz[m] * (given[up + ci] - c)
                )
                m += np.uint64(1)


def smooth_(level: Level, colours: tuple[int, ...]) -> None:
    """Relax colours one after the other."""
    for colour in colours:
        wrap_(level, level.fields[X])
        relax_(level.fields, *level.cells, colour)


def cycle_(levels: list[Level]) -> None:
    """Replace x of the finest level by that of one V-cycle which starts from zero."""
    levels[0].fields[X] = 0.0
    for fine, coarse in pairwise(levels):
        smooth_(fine, (RED, BLACK))
        wrap_(fine, fine.fields[X])
        coarse.fields[X : B + 1] = 0.0
        restrict_(fine.fields, *fine.cells, coarse.fields, *fine.joined)
        wrap_(coarse, coarse.fields[B], folds=True)
    smooth_(levels[-1], (RED,))  # a single cell: exact
    for coarse, fine in pairwise(levels[::-1]):
        wrap_(coarse, coarse.fields[X])
        prolong_(fine.fields, *fine.cells, coarse.fields, *fine.joined)
        smooth_(fine, (BLACK, RED))
