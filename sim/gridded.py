"""Signed distance on a grid: quadratic B-splines in blocks near the surface.

φ(x) = Σ c_ijk B(x/h − i) B(y/h − j) B(z/h − k) has a continuous gradient, which is evaluated as the exact derivative of
the same sum: a force k |∇φ| (r − φ) along it is the exact gradient of ½ k (φ − r)² (paper eqs. (14)–(17)). The
coefficients c = φ − δ²φ/8, with δ² the second differences of all three directions, reproduce quadratic φ exactly and
look no farther than two nodes, so that a flat face is flat from 2.5 h beside any edge.

Trilinear interpolation would be cheaper, but its ∇φ jumps at every cell: an elastic bead that slides over the edge of
a block, in steps of t_c/50 on 8 nodes per diameter, changed its energy by 1e-3 of the kinetic one, here by 4e-7.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from sim.kernel import Array, Indices, kernel

BLOCK = 8  # nodes of a block in each direction
STORED = BLOCK + 2  # and a spline reaches one node to either side
FAR = -1.0  # instead of the place of a block that is not stored
ORIGIN, SPACING, COUNTS, FIRST, MARGIN = 0, 3, 4, 7, 8  # columns of a mesh's parameters


class Gridded(NamedTuple):
    """Distance of one mesh on a grid of blocks."""

    origin: Array  # (3,) m, of node 0, 0, 0
    spacing: float  # m
    counts: Indices  # (3,) blocks
    margin: float  # m, distance to the surface that no stored block is needed for
    blocks: Array  # (blocks, 2) place among the stored ones, or FAR; and a bound of φ there (m)
    spline: Array  # (stored, 10, 10, 10) coefficients (m)


@kernel
def outside_grid(p: Array, s: int, x: float, y: float, z: float) -> float:
    """Lower bound of φ (m) where a point is not among the nodes; 0 where it is."""
    square, beyond = 0.0, False
    for axis, place in enumerate((x, y, z)):
        low = p[s, ORIGIN + axis]
        high = low + (p[s, COUNTS + axis] * BLOCK - 1.0) * p[s, SPACING]
        over = max(low - place, place - high)
        if over > 0.0:
            square += over * over
            beyond = True
    return sqrt(square) + p[s, MARGIN] if beyond else 0.0


@kernel
def gridded_distance(
    p: Array, s: int, blocks: Array, spline: Array, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Distance φ of a point to a mesh, negative inside (m), and ∇φ, whose length is near 1 but not 1.

    Farther from the surface than any particle reaches it is a bound with the right sign, and the gradient is zero.
    """
    bound = outside_grid(p, s, x, y, z)
    if bound > 0.0:
        return bound, 0.0, 0.0, 0.0
    h = p[s, SPACING]
    u, v, w = (x - p[s, 0]) / h, (y - p[s, 1]) / h, (z - p[s, 2]) / h
    i, j, k = int(u + 0.5), int(v + 0.5), int(w + 0.5)
    ny, nz = int(p[s, COUNTS + 1]), int(p[s, COUNTS + 2])
    block = int(p[s, FIRST]) + ((i // BLOCK) * ny + j // BLOCK) * nz + k // BLOCK
    place = int(blocks[block, 0])
    if place < 0:
        return blocks[block, 1], 0.0, 0.0, 0.0
    return spline_at(spline, place, i % BLOCK, j % BLOCK, k % BLOCK, u - i, v - j, w - k, 1.0 / h)


@kernel
def spline_at(
    spline: Array, b: int, i: int, j: int, k: int, u: float, v: float, w: float, per_metre: float
) -> tuple[float, float, float, float]:
    """Value and gradient of the spline of block b, by u, v, w (−½ to ½ spacings) beside its node i, j, k."""
    (a0, a1, a2), (da0, da1, da2) = weights(u)
    (b0, b1, b2), (db0, db1, db2) = weights(v)
    (c0, c1, c2), (dc0, dc1, dc2) = weights(w)
    value, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for m, a, da in ((i, a0, da0), (i + 1, a1, da1), (i + 2, a2, da2)):
        for n, f, df in ((j, b0, db0), (j + 1, b1, db1), (j + 2, b2, db2)):
            q0, q1, q2 = spline[b, m, n, k], spline[b, m, n, k + 1], spline[b, m, n, k + 2]
            line = c0 * q0 + c1 * q1 + c2 * q2
            value += a * f * line
            gx += da * f * line
            gy += a * df * line
            gz += a * f * (dc0 * q0 + dc1 * q1 + dc2 * q2)
    return value, gx * per_metre, gy * per_metre, gz * per_metre


@kernel
def weights(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Quadratic B-splines of the nodes before, at and after, at t from −½ to ½ spacings, and their derivatives."""
    before, after = 0.5 - t, 0.5 + t
    return (0.5 * before * before, 0.75 - t * t, 0.5 * after * after), (-before, -2.0 * t, after)


def coefficients(phi: Array) -> Array:
    """Return c = φ − δ²φ/8 of the inner nodes of each block, (blocks, n, n, n) from (blocks, n + 2, n + 2, n + 2)."""
    inner = phi[:, 1:-1, 1:-1, 1:-1]
    second = -6.0 * inner
    for axis in (1, 2, 3):
        for start in (0, 2):
            window = [slice(None)] + [slice(1, -1)] * 3
            window[axis] = slice(start, phi.shape[axis] - 2 + start)
            second = second + phi[tuple(window)]
    return np.asarray(inner - second / 8.0)


def gridded_parameters(grid: Gridded, first_block: int) -> list[float]:
    """Return the numbers that describe a grid whose blocks stand from this row on."""
    return [*grid.origin, grid.spacing, *grid.counts, first_block, grid.margin]
