"""The box of a LAMMPS or LIGGGHTS snapshot, upright or tilted: where it begins, and its three edges."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.readers.header import Header


class Box(NamedTuple):
    """A parallelepiped."""

    corner: NDArray[np.float64]  # (3,) m
    edges: NDArray[np.float64]  # (3, 3) m, one edge in each row

    def at(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the places (n, 3) in m of scaled coordinates (n, 3): corner + Σ fraction_i edge_i."""
        return self.corner + self.shift(fraction)

    def shift(self, crossings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far (n, 3) in m these multiples (n, 3) of the edges lead."""
        # term by term: what a zero edge adds is exactly zero, so an upright box stays as exact as high − low
        way: NDArray[np.float64] = sum((crossings[:, [i]] * self.edges[i] for i in range(3)), np.zeros(3))
        return way


def box_of(header: Header) -> Box | None:
    """Return the box of a snapshot from its `ITEM: BOX BOUNDS`, None where there is none.

    A line holds low and high; of a tilted box, xy, xz or yz beside the bounds of the whole parallelepiped; of a general
    one ("abc origin") the edge and a coordinate of the corner. Source: LAMMPS manual, dump and Howto_triclinic.
    """
    lines = header.box
    if lines.shape == (3, 4):
        return Box(lines[:, 3], lines[:, :3])
    if lines.shape not in ((3, 2), (3, 3)):
        return None
    xy, xz, yz = lines[:, 2] if lines.shape == (3, 3) else (0.0, 0.0, 0.0)
    lean = (0.0, xy, xz, xy + xz)
    low = lines[:, 0] - (min(lean), min(0.0, yz), 0.0)
    length = lines[:, 1] - (max(lean), max(0.0, yz), 0.0) - low
    return Box(low, np.array([[length[0], 0.0, 0.0], [xy, length[1], 0.0], [xz, yz, length[2]]]))
