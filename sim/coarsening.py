"""Coefficients of the coarse grids of the multigrid, and the shares with which it interpolates between them.

Two cells side by side are joined by resistances in series: half of what lies between the two cells of a pair, the face
between the pairs, half of what lies between the cells of the other pair. A coarse face is the faces it covers in
parallel.
"""

from sim.kernel import Array, inlined, kernel
from sim.multigrid import Grids, Level, level_of, row_start, rows_of, strides, wrap_, wrap_axis

UNIFORM_SHARES = 0.75 + 1e-9  # a quarter for each axis


@inlined
def inner_resistance(w: Array, origin: int, stride: int, pair: int, n: int, wraps: int) -> float:
    """Half the resistance between the two cells of a pair: 0 outside the grid and where a cell is alone."""
    pairs = (n + 1) // 2
    if wraps:
        pair = (pair + pairs - 1) % pairs + 1
    if pair < 1 or 2 * pair > n:
        return 0.0
    return 0.5 / w[origin + 2 * pair * stride]  # type: ignore[no-any-return]


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
def covered(number: int, joined: int, n: int) -> tuple[int, int]:
    """First fine cell of a coarse one, and the cell behind its last."""
    first = joined * (number - 1) + 1
    return first, min(first + joined, n + 1)


@kernel
def coarsen_axis(fine: Level, coarse: Level, w: Array, coarse_w: Array, axis: int) -> None:
    """Fill the coarse coefficients of the faces across an axis."""
    (fx, fy, fz), (nx, ny, nz), stride = fine.joined, fine.cells, strides(fine)[axis]
    joined, n, wraps = fine.joined[axis], fine.cells[axis], fine.periodic[axis]
    (_, sy, sz), (_, ty, tz) = strides(fine), strides(coarse)
    for Z in range(1, coarse.cells[2] + 1 + (axis == 2)):
        k0, k1 = covered(Z, fz, nz) if axis != 2 else (0, 1)  # along the axis: from the ghost cell at its end
        for Y in range(1, coarse.cells[1] + 1 + (axis == 1)):
            j0, j1 = covered(Y, fy, ny) if axis != 1 else (0, 1)
            for X in range(1, coarse.cells[0] + 1 + (axis == 0)):
                i0, i1 = covered(X, fx, nx) if axis != 0 else (0, 1)
                pair = X if axis == 0 else Y if axis == 1 else Z
                total = 0.0
                for k in range(k0, k1):
                    for j in range(j0, j1):
                        for i in range(i0, i1):
                            total += coarse_face(w, k * sz + j * sy + i, stride, pair, n, wraps, joined)
                coarse_w[Z * tz + Y * ty + X] = total
    if wraps:
        if coarse.cells[axis] == 1:  # a cell is its own neighbour
            coarse_w[:] = 0.0
        wrap_axis(coarse, coarse_w, axis)


@inlined
def neighbour_share(w: Array, origin: int, stride: int, i: int, n: int, wraps: int) -> float:
    """Share of the neighbouring pair in the interpolated value of cell i."""
    own = (i + 1) // 2
    if 2 * own > n:
        return 0.0
    leans, face = (own - 1, i) if i % 2 == 1 else (own + 1, i + 1)
    if w[origin + face * stride] == 0.0:
        return 0.0
    there = 1.0 / w[origin + face * stride] + inner_resistance(w, origin, stride, leans, n, wraps)
    inner = w[origin + 2 * own * stride]
    if inner == 0.0:
        return 0.0
    return 1.0 / (1.0 + 2.0 * there * inner)  # type: ignore[no-any-return]


@kernel
def fill_shares(level: Level, w: Array, share: Array, axis: int) -> None:
    """Fill the shares of the neighbours along an axis."""
    (nx, ny, nz), (_, sy, sz), stride = level.cells, strides(level), strides(level)[axis]
    n, wraps = level.cells[axis], level.periodic[axis]
    for k in range(1, nz + 1):
        for j in range(1, ny + 1):
            for i in range(1, nx + 1):
                m, along = k * sz + j * sy + i, i if axis == 0 else j if axis == 1 else k
                share[m] = neighbour_share(w, m - along * stride, stride, along, n, wraps)


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
def fill_inverse(level: Level) -> None:
    """Fill 1/Σw, and where the shares of a cell leave too little to its own pair, weigh them by their odds.

    A cell whose face to a neighbouring pair is far more open than its others then follows that neighbour alone.

    Cells of one colour that touch are relaxed at once, so their coefficient counts twice: else they overshoot.
    """
    (_, sy, sz), (nx, ny, nz), (px, py, pz) = strides(level), level.cells, level.periodic
    wx, wy, wz, tx, ty, tz, inverse = level.wx, level.wy, level.wz, level.tx, level.ty, level.tz, level.inverse
    for row in range(rows_of(level)):
        k, j = row // ny + 1, row % ny + 1
        begin = row_start(level, row)
        for m in range(begin, begin + nx):
            total = wx[m] + wx[m + 1] + wy[m] + wy[m + sy] + wz[m] + wz[m + sz]
            total += same_colour(wx[m], wx[m + 1], m - begin + 1, nx, px)
            total += same_colour(wy[m], wy[m + sy], j, ny, py) + same_colour(wz[m], wz[m + sz], k, nz, pz)
            inverse[m] = 1.0 / total if total > 0.0 else 0.0
            if tx[m] + ty[m] + tz[m] > UNIFORM_SHARES:
                ox, oy, oz = odds(tx[m]), odds(ty[m]), odds(tz[m])
                total = odds(0.25) + ox + oy + oz
                tx[m], ty[m], tz[m] = ox / total, oy / total, oz / total


@kernel
def fill_levels(grids: Grids) -> None:
    """Fill every level from the coefficients of the finest."""
    levels = grids.cells.shape[0]
    for number in range(levels):
        fine = level_of(grids, number)
        for axis, w, share in ((0, fine.wx, fine.tx), (1, fine.wy, fine.ty), (2, fine.wz, fine.tz)):
            if fine.periodic[axis]:
                wrap_axis(fine, w, axis)
            if fine.joined[axis] == 2:
                fill_shares(fine, w, share, axis)
        fill_inverse(fine)
        wrap_(fine, fine.tx)
        wrap_(fine, fine.ty)
        wrap_(fine, fine.tz)
        if number < levels - 1:
            coarse = level_of(grids, number + 1)
            coarsen_axis(fine, coarse, fine.wx, coarse.wx, 0)
            coarsen_axis(fine, coarse, fine.wy, coarse.wy, 1)
            coarsen_axis(fine, coarse, fine.wz, coarse.wz, 2)
