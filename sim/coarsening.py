"""Coefficients of the coarse grids of the multigrid, and the shares with which it interpolates between them.

Two cells side by side are joined by resistances in series: half of what lies between the two cells of a pair, the face
between the pairs, half of what lies between the cells of the other pair. A coarse face is the faces it covers in
parallel.
"""

from itertools import pairwise

import numpy as np

from sim.kernel import Array, inlined, kernel
from sim.multigrid import INVERSE, TX, TY, TZ, WX, WY, WZ, Level, layers

UNIFORM_SHARES = 0.75 + 1e-9  # a quarter for each axis


@inlined
def inner_resistance(w: Array, origin: int, stride: int, pair: int, n: int, wraps: int) -> float:
    """Half the resistance between the two cells of a pair: 0 outside the grid and where a cell is alone."""
    pairs = (n + 1) // 2
    if wraps:
        pair = (pair + pairs - 1) % pairs + 1
    if pair < 1 or 2 * pair > n:
        return 0.0
    inner = w[origin + 2 * pair * stride]
    return 0.5 / inner if inner > 0.0 else np.inf


@inlined
def coarse_face(w: Array, origin: int, stride: int, pair: int, n: int, wraps: int, joined: int) -> float:
    """Coefficient of the fine faces in series at the lower face of a coarse cell; `origin`: the row's ghost cell."""
    if joined == 1:
        return w[origin + pair * stride]  # type: ignore[no-any-return]
    face = w[origin + min(2 * pair - 1, n + 1) * stride]
    if face == 0.0:
        return 0.0
    before = inner_resistance(w, origin, stride, pair - 1, n, wraps)
    behind = inner_resistance(w, origin, stride, pair, n, wraps)
    return 1.0 / (1.0 / face + before + behind)  # type: ignore[no-any-return]


@inlined
def covered(number: int, joined: int, n: int, along: bool) -> tuple[int, int]:
    """First fine cell of a coarse one, and the cell behind its last; along the axis the ghost cell at its end."""
    first = joined * (number - 1) + 1
    return (0, 1) if along else (first, min(first + joined, n + 1))


@kernel
def coarsen_(
    w: Array, nx: int, ny: int, nz: int, coarse: Array, fx: int, fy: int, fz: int, axis: int, wraps: int
) -> None:
    """Fill the coarse coefficients of the faces across an axis."""
    sy, sz = nx + 2, (nx + 2) * (ny + 2)
    cx, cy, cz = (nx + fx - 1) // fx, (ny + fy - 1) // fy, (nz + fz - 1) // fz
    n, joined, stride = (nx, fx, 1) if axis == 0 else (ny, fy, sy) if axis == 1 else (nz, fz, sz)
    for Z in range(1, cz + 1 + (axis == 2)):
        k0, k1 = covered(Z, fz, nz, axis == 2)
        for Y in range(1, cy + 1 + (axis == 1)):
            j0, j1 = covered(Y, fy, ny, axis == 1)
            for X in range(1, cx + 1 + (axis == 0)):
                i0, i1 = covered(X, fx, nx, axis == 0)
                pair = X if axis == 0 else Y if axis == 1 else Z
                total = 0.0
                for k in range(k0, k1):
                    for j in range(j0, j1):
                        for i in range(i0, i1):
                            total += coarse_face(w, k * sz + j * sy + i, stride, pair, n, wraps, joined)
                coarse[(Z * (cy + 2) + Y) * (cx + 2) + X] = total


@kernel
def fill_shares(w: Array, nx: int, ny: int, nz: int, share: Array, axis: int, wraps: int) -> None:
    """Fill the share of the neighbouring pair along an axis in the interpolated value of each cell."""
    sy, sz = nx + 2, (nx + 2) * (ny + 2)
    n, stride = (nx, 1) if axis == 0 else (ny, sy) if axis == 1 else (nz, sz)
    for k in range(1, nz + 1):
        for j in range(1, ny + 1):
            for x in range(1, nx + 1):
                m, i = k * sz + j * sy + x, x if axis == 0 else j if axis == 1 else k
                origin, own = m - i * stride, (i + 1) // 2
                leans, face = (own - 1, i) if i % 2 == 1 else (own + 1, i + 1)
                share[m] = 0.0
                if 2 * own > n or w[origin + face * stride] == 0.0:
                    continue
                there = 1.0 / w[origin + face * stride] + inner_resistance(w, origin, stride, leans, n, wraps)
                inner = w[origin + 2 * own * stride]
                if inner > 0.0:
                    share[m] = 1.0 / (1.0 + 2.0 * there * inner)


@inlined
def same_colour(lower: float, upper: float, i: int, n: int, wraps: int) -> float:
    """Coefficient between cell i and one of its own colour: across the seam of an odd periodic axis."""
    if not wraps or n % 2 == 0 or n == 1:
        return 0.0
    return lower if i == 1 else upper if i == n else 0.0


@inlined
def odds(share: float) -> float:
    """Ratio of a share to what it leaves, finite."""
    return share / max(1.0 - share, 1e-12)


@kernel
def fill_inverse(fields: Array, nx: int, ny: int, nz: int, px: int, py: int, pz: int) -> None:
    """Fill 1/Σw, and where the shares of a cell leave too little to its own pair, weigh them by their odds.

    A cell whose face to a neighbouring pair is far more open than its others then follows that neighbour alone.

    Cells of one colour that touch are relaxed at once, so their coefficient counts twice: else they overshoot.
    """
    wx, wy, wz, tx, ty, tz = fields[WX], fields[WY], fields[WZ], fields[TX], fields[TY], fields[TZ]
    inverse, sy, sz = fields[INVERSE], nx + 2, (nx + 2) * (ny + 2)
    for k in range(1, nz + 1):
        for j in range(1, ny + 1):
            for i in range(1, nx + 1):
                m = k * sz + j * sy + i
                total = wx[m] + wx[m + 1] + wy[m] + wy[m + sy] + wz[m] + wz[m + sz]
                total += same_colour(wx[m], wx[m + 1], i, nx, px)
                total += same_colour(wy[m], wy[m + sy], j, ny, py) + same_colour(wz[m], wz[m + sz], k, nz, pz)
                inverse[m] = 1.0 / total if total > 0.0 else 0.0
                if tx[m] + ty[m] + tz[m] > UNIFORM_SHARES:
                    ox, oy, oz = odds(tx[m]), odds(ty[m]), odds(tz[m])
                    total = odds(0.25) + ox + oy + oz
                    tx[m], ty[m], tz[m] = ox / total, oy / total, oz / total


def fill_level(level: Level) -> None:
    """Fill what follows from the coefficients of a level."""
    for axis in range(3):
        w = level.fields[WX + axis]
        if level.wraps[axis]:
            faces = layers(w, level.cells, axis)[1:]
            faces[-1] = faces[0]  # the two ends are one face
            if len(faces) == 2:  # a cell is its own neighbour
                faces[:] = 0.0
        if level.joined[axis] == 2:
            fill_shares(w, *level.cells, level.fields[TX + axis], axis, level.wraps[axis])
    fill_inverse(level.fields, *level.cells, *level.wraps)


def fill_levels(levels: list[Level]) -> None:
    """Fill every level from the coefficients of the finest."""
    fill_level(levels[0])
    for fine, coarse in pairwise(levels):
        for axis in range(3):
            w, to = fine.fields[WX + axis], coarse.fields[WX + axis]
            coarsen_(w, *fine.cells, to, *fine.joined, axis, fine.wraps[axis])
        fill_level(coarse)
