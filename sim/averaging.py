"""Cells of space over which particles are averaged."""

import numpy as np

from sim.kernel import Array, Indices

DIAMETERS_PER_CELL = 4.0  # of the largest particle: some tens of particles in a dense cell


def cell_width(radius: Array) -> float:
    """Edge of a cell, m: four of the largest diameters."""
    return DIAMETERS_PER_CELL * 2.0 * float(radius.max())


def cells_of(position: Array, width: float) -> Indices:
    """Return in which occupied cube of this edge (m) each particle is, numbered from 0; shape (n,)."""
    place = np.floor((position - position.min(axis=0)) / width).astype(np.int64)
    size = place.max(axis=0) + 1
    _, cell = np.unique((place[:, 2] * size[1] + place[:, 1]) * size[0] + place[:, 0], return_inverse=True)
    return np.asarray(cell.reshape(-1), np.int64)


def sums_over(cell: Indices, values: Array) -> Array:
    """Sum rows (n,) or (n, …) over the cells, shape (cells,) or (cells, …)."""
    cells = int(cell.max()) + 1
    columns = values.reshape(len(values), -1).T
    summed: Array = np.stack(
        [np.bincount(cell, weights=column, minlength=cells).astype(np.float64) for column in columns], axis=-1
    )
    return summed.reshape(cells, *values.shape[1:])
