"""Cells of a fluid that fill a box evenly, whatever order another code keeps them in."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import QUANTITIES, Grid
from suffice.readers.vtk_process import Piece
from suffice.refusal import Refusal

EVEN = 1e-3  # of a cell: corners in single precision differ by far less, graded meshes by more
REMEDY = (
    "fields are read on a uniform box: map them onto one (OpenFOAM's mapFields, ParaView's Resample To Image), or "
    "leave the fluid out with --map fluid=none"
)


class Cells(NamedTuple):
    """A uniform grid, and where in it (z, y, x, flat) each cell of the source lies."""

    grid: Grid
    place: NDArray[np.intp]  # (cells,)

    def field(self, name: str, values: NDArray[Any], where: str) -> NDArray[np.float64]:
        """Return a field (z, y, x[, 3]) from its values in the source's cells. Raises `Refusal` for another shape."""
        components = QUANTITIES[name].components
        rows = values.reshape(len(values), -1)
        if rows.shape != (len(self.place), components):
            raise Refusal(
                f"{where}: {name} has {rows.shape[1]} components in {len(rows)} cells, not {components} in "
                f"{len(self.place)}; say what is {name} with --map"
            )
        ordered = np.empty(rows.shape)
        ordered[self.place] = rows
        return ordered.reshape(*self.grid.shape, *((components,) if components > 1 else ()))


def cells_of(piece: Piece, where: str) -> Cells:
    """Return the uniform grid of an image or of hexahedra. Raises `Refusal` saying why they are none."""
    return _of_image(piece.facts, where) if piece.facts["kind"] == "image" else _of_hexahedra(piece, where)


def _of_image(facts: dict[str, Any], where: str) -> Cells:
    low, spacing = np.array(facts["extent"][::2], np.int64), np.array(facts["spacing"], float)
    n = np.array(facts["extent"][1::2], np.int64) - low
    if facts["turned"] or (n < 1).any() or not (spacing > 0).all():
        raise Refusal(f"{where}: its image is turned, flat or empty; {REMEDY}")
    origin = np.array(facts["origin"], float) + low * spacing
    return Cells(_grid(n, origin, spacing), np.arange(n.prod()))


def _of_hexahedra(piece: Piece, where: str) -> Cells:
    if "hexahedra" not in piece.arrays:
        raise Refusal(f"{where}: its mesh has cells that are no hexahedra; {REMEDY}")
    corners = piece.arrays["points"].astype(np.float64)[piece.arrays["hexahedra"]]
    low, size = corners.min(axis=1), np.ptp(corners, axis=1)
    origin, spacing = low.min(axis=0), np.median(size, axis=0)
    if not (spacing > 0).all() or (np.abs(size - spacing) > EVEN * spacing).any():
        axis = int(np.argmax(np.ptp(size, axis=0) / spacing))
        raise Refusal(
            f"{where}: its cells are not all alike, from {size[:, axis].min():g} to {size[:, axis].max():g} m along "
            f"{'xyz'[axis]}; {REMEDY}"
        )
    at = (low - origin) / spacing
    index = np.rint(at).astype(np.intp)
    n = index.max(axis=0) + 1
    place = (index[:, 2] * n[1] + index[:, 1]) * n[0] + index[:, 0]
    if (np.abs(at - index) > 0.1).any() or len(place) != n.prod() or len(np.unique(place)) != len(place):
        raise Refusal(f"{where}: its {len(place)} cells do not fill a box; {REMEDY}")
    spacing = (low.max(axis=0) - origin + spacing) / n  # over all of them, where single precision averages out
    return Cells(_grid(n, origin, spacing), place)


def _grid(n: NDArray[Any], origin: NDArray[Any], spacing: NDArray[Any]) -> Grid:
    x, y, z = (int(cells) for cells in n)
    return Grid((z, y, x), tuple(map(float, origin)), tuple(map(float, spacing)))  # type: ignore[arg-type]
