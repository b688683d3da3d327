"""Particles that touch: how many, and how deep they overlap."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]


def pair_overlaps(position: Array, radius: Array, period: tuple[Array, Array] | None = None) -> Array:
    """Overlap of every pair that touches, (pairs,) in diameters of the smaller one: (r_i + r_j − |x_i − x_j|) / 2r.

    position: (n, 3) m; radius: (n,) m; period: lowest corner and lengths of a box that repeats, (3,) m, 0 where not.
    """
    boxed, length = _offsets(position, period)
    tree = cKDTree(boxed, boxsize=None if period is None else length)
    pairs = tree.query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    apart = boxed[pairs[:, 0]] - boxed[pairs[:, 1]]
    apart -= length * np.round(apart / np.where(length > 0.0, length, np.inf))
    r, s = radius[pairs[:, 0]], radius[pairs[:, 1]]
    overlap = (r + s - np.sqrt(np.einsum("ij,ij->i", apart, apart))) / (2.0 * np.minimum(r, s))
    return np.asarray(overlap[overlap > 0.0])


def wrapped(position: Array, period: tuple[Array, Array] | None) -> Array:
    """Positions (n, 3) m put back into the box that repeats; as they are where none does."""
    if period is None:
        return position
    offsets, length = _offsets(position, period)
    return np.where(length > 0.0, offsets + period[0], offsets)


def _offsets(position: Array, period: tuple[Array, Array] | None) -> tuple[Array, Array]:
    """Places from the lowest corner in directions that repeat, others as they are; and the lengths, 0 for no period."""
    if period is None:
        return position, np.zeros(3)
    low, length = period
    safe = np.where(length > 0.0, length, 1.0)
    place = position - low
    place -= safe * np.floor(place / safe)
    place[place >= safe] = 0.0  # rounding has put it on the far side
    return np.where(length > 0.0, place, position), length
