"""VTK's XML files, written without VTK: particles as .vtu, fields on a grid as .vti, lists of them as .pvd.

Arrays are appended raw: the size of each in eight bytes, then its numbers as they stand in memory.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import Grid

TYPES = {"f4": "Float32", "f8": "Float64", "i8": "Int64", "u1": "UInt8"}
ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
VERTEX = 1  # VTK's number of that type of cell


class _Appended:
    """Arrays that follow the text of a file, and the elements that stand for them."""

    def __init__(self) -> None:
        self.arrays: list[NDArray[Any]] = []
        self._offset = 0

    def element(self, name: str, values: NDArray[Any], tuples: int | None = None) -> str:
        """Return the element of an array (n,) or (n, components); arrays of no points or cells say their `tuples`."""
        array = np.ascontiguousarray(values)
        components = array.shape[1] if array.ndim > 1 else 1
        counted = "" if tuples is None else f' NumberOfTuples="{tuples}"'
        text = (
            f'<DataArray type="{TYPES[array.dtype.str[1:]]}" Name={quoteattr(name)} NumberOfComponents="{components}"'
            f'{counted} format="appended" offset="{self._offset}"/>'
        )
        self.arrays.append(array)
        self._offset += 8 + array.nbytes
        return text

    def side(self, tag: str, arrays: Mapping[str, NDArray[Any]]) -> str:
        """Return an element that holds arrays."""
        return f"<{tag}>{''.join(self.element(name, values) for name, values in arrays.items())}</{tag}>"

    def write(self, path: Path, kind: str, body: str) -> None:
        """Write a file of one kind of dataset."""
        head = f'<VTKFile type="{kind}" version="1.0" byte_order="{ORDER}" header_type="UInt64">'
        with path.open("wb") as file:
            file.write(
                f'<?xml version="1.0"?>\n{head}\n<{kind}{body}</{kind}>\n<AppendedData encoding="raw">_'.encode()
            )
            for array in self.arrays:
                file.write(np.uint64(array.nbytes).tobytes())
                file.write(array.data)
            file.write(b"</AppendedData>\n</VTKFile>\n")


def write_particles(path: Path, time: float, position: NDArray[Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write particles (n, 3) and what is known of each, (n,) or (n, 3), at a time in s: one vertex each."""
    n, appended = len(position), _Appended()
    cells: dict[str, NDArray[Any]] = {
        "connectivity": np.arange(n),
        "offsets": np.arange(1, n + 1),
        "types": np.full(n, VERTEX, np.uint8),
    }
    piece = (
        appended.side("PointData", arrays)
        + appended.side("Points", {"Points": position})
        + appended.side("Cells", cells)
    )
    body = f'>{_time(appended, time)}<Piece NumberOfPoints="{n}" NumberOfCells="{n}">{piece}</Piece>'
    appended.write(path, "UnstructuredGrid", body)


def write_fields(path: Path, time: float, grid: Grid, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write fields (z, y, x[, 3]) in the cells of a grid, at a time in s."""
    appended = _Appended()
    extent = " ".join(f"0 {cells}" for cells in reversed(grid.shape))
    origin, spacing = (" ".join(repr(float(x)) for x in three) for three in (grid.origin, grid.spacing))
    flat = {name: values.reshape(-1, *values.shape[3:]) for name, values in arrays.items()}
    place = f' WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}">'
    piece = f'<Piece Extent="{extent}">{appended.side("CellData", flat)}</Piece>'
    appended.write(path, "ImageData", f"{place}{_time(appended, time)}{piece}")


def write_list(path: Path, files: Sequence[str], times: Sequence[float]) -> None:
    """Write which file holds which time, s."""
    sets = [f'<DataSet timestep="{time!r}" file={quoteattr(file)}/>' for file, time in zip(files, times, strict=True)]
    text = "\n".join(
        ['<VTKFile type="Collection" version="0.1">', "<Collection>", *sets, "</Collection>", "</VTKFile>"]
    )
    path.write_text(f'<?xml version="1.0"?>\n{text}\n', encoding="utf-8")


def _time(appended: _Appended, time: float) -> str:
    """Return the element of the time, under the name that ParaView looks for."""
    return f"<FieldData>{appended.element('TimeValue', np.array([time]), tuples=1)}</FieldData>"
