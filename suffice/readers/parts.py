"""A dataset that was written in several parts: one for each process, or several files at one time."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from suffice.readers.vtk_process import Piece
from suffice.refusal import Refusal

GHOSTS = "vtkGhostType"  # VTK's name: not zero where a point or cell belongs to another part, or is hidden
NOTHING = Piece({"kind": "particles", "known": {"point": [], "cell": []}}, {"points": np.zeros((0, 3))})


def is_empty(piece: Piece) -> bool:
    """Tell whether a dataset has neither particles nor cells."""
    return "points" in piece.arrays and not len(piece.arrays["points"])


def join(parts: Sequence[Piece], where: str) -> Piece:
    """Return the parts as one dataset, without ghosts; parts without points say nothing of its arrays.

    Raises `Refusal` where they are not all particles or all cells of hexahedra.
    """
    parts = [_without_ghosts(part) for part in parts] or [NOTHING]
    filled = [part for part in parts if not is_empty(part)] or parts[:1]
    if len(filled) == 1:
        return filled[0]
    kinds = {part.facts["kind"] for part in filled}
    if kinds == {"particles"}:
        return _stacked(filled)
    if kinds == {"cells"}:
        first = np.cumsum([0, *(len(part.arrays["points"]) for part in filled[:-1])])
        return _stacked([_numbered_from(part, start) for part, start in zip(filled, first, strict=True)])
    raise Refusal(
        f"{where} is made of {' and '.join(sorted(kinds))} in {len(filled)} parts; give the files of the particles "
        "alone, or those of one kind each"
    )


def _without_ghosts(part: Piece) -> Piece:
    """Leave out particles or cells that other parts hold as well."""
    side = "point" if part.facts["kind"] == "particles" else "cell"
    ghosts = part.arrays.get(f"{side}:{GHOSTS}")
    if ghosts is None or not ghosts.any():
        return part
    sides = (f"{side}:", "points" if side == "point" else "hexahedra")
    arrays = {name: rows[ghosts == 0] if name.startswith(sides) else rows for name, rows in part.arrays.items()}
    return Piece(part.facts, arrays)


def _stacked(parts: Sequence[Piece]) -> Piece:
    """Put the rows of all parts one after another; arrays that only some have are left out."""
    names = [name for name in parts[0].arrays if all(name in part.arrays for part in parts)]
    known = {
        side: [name for name in names if all(name in part.facts["known"][side] for part in parts)]
        for side, names in parts[0].facts["known"].items()
    }
    return Piece(
        {**parts[0].facts, "known": known}, {name: _rows([part.arrays[name] for part in parts], name) for name in names}
    )


def _rows(arrays: Sequence[NDArray[np.generic]], name: str) -> NDArray[np.generic]:
    return arrays[0] if name.startswith("field:") else np.concatenate(arrays)


def _numbered_from(part: Piece, start: int) -> Piece:
    """Let the corners of cells be numbered among the points of all parts."""
    arrays = {name: rows + start if name == "hexahedra" else rows for name, rows in part.arrays.items()}
    return Piece(part.facts, arrays)
