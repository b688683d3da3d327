"""VTKHDF: all snapshots of a run in one file, as ParaView, VTK and our own views have them.

The format is plain HDF5, read here without VTK, whose reader stops the process where a dataset is missing.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from suffice.hdf5_memory import names_in
from suffice.readers.clock import Stamps
from suffice.readers.hdf5 import MAGIC, node_of, opened
from suffice.readers.piece_run import Read
from suffice.readers.vtk_process import Piece
from suffice.refusal import Refusal

ROOT = "VTKHDF"
KINDS = {"PolyData": "particles", "UnstructuredGrid": "particles", "ImageData": "image"}


def is_vtkhdf(path: Path) -> bool:
    """Tell whether a file is HDF5 with the group of VTK."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return False
    with opened(path) as root:
        return node_of(root, ROOT) is not None


class VtkHdf:
    """The datasets of one VTKHDF file, temporal or a single one."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with opened(path) as file:
            root = node_of(file, ROOT)
            if not isinstance(root, h5py.Group):  # HDF5 may know a name in a damaged file, but not what it stands for
                raise Refusal(f"{path} is damaged: {ROOT} is no group in it; write it again")
            kind = root.attrs.get("Type", b"nothing")
            self.type = kind.decode(errors="replace") if isinstance(kind, bytes) else str(kind)
            if self.type not in KINDS:
                raise Refusal(f"{path} holds {self.type}; give PolyData or UnstructuredGrid of particles, or ImageData")
            times = node_of(file, f"{ROOT}/Steps/Values", beside=True)
            self.times = None if times is None else np.asarray(times[()], float).reshape(-1)
            self.facts = self._facts(file, root)
        if self.times is not None and not len(self.times):
            raise Refusal(f"{path} holds no snapshots; write it again")

    @property
    def stamps(self) -> Stamps:
        """The times the file says."""
        return (
            Stamps(1) if self.times is None else Stamps(len(self.times), None, self.times, "Steps/Values of the file")
        )

    @property
    def head(self) -> Piece:
        """The first dataset without its arrays of values."""
        with self.opened() as read:
            return read(0, ())

    def where(self, k: int) -> str:
        """Return file and snapshot."""
        return str(self.path) if self.times is None else f"{self.path} snapshot {k}"

    @contextmanager
    def opened(self) -> Iterator[Read]:
        """Open the file, and return what reads snapshot k from it."""
        with opened(self.path) as file:
            yield lambda k, names: self._read(file, k, names)

    def _facts(self, file: Any, root: Any) -> dict[str, Any]:
        groups = {side.lower(): node_of(file, f"{ROOT}/{side}Data") for side in ("Point", "Cell")}
        known = {side: names_in(group) if isinstance(group, h5py.Group) else [] for side, group in groups.items()}
        facts: dict[str, Any] = {"kind": KINDS[self.type], "known": known, "turned": False}
        if self.type == "ImageData":
            for name, attribute in (("extent", "WholeExtent"), ("origin", "Origin"), ("spacing", "Spacing")):
                facts[name] = np.asarray(root.attrs[attribute]).reshape(-1)
            direction = np.asarray(root.attrs.get("Direction", np.eye(3).ravel())).reshape(-1)
            facts["turned"] = not np.array_equal(direction, np.eye(3).ravel())
        return facts

    def _read(self, file: Any, k: int, names: Sequence[str] | None) -> Piece:
        image = self.type == "ImageData"
        start, count = (k, 1) if image else self._points(file, k)
        side = "Cell" if image else "Point"
        known = self.facts["known"][side.lower()]
        arrays = {}
        for name in known if names is None else names:
            at = self._offset(file, f"{side}DataOffsets/{name}", k, start)
            rows = self._rows(file, f"{side}Data/{name}", at, count)
            arrays[f"{side.lower()}:{name}"] = self._flat(rows) if image else rows
        if not image:
            arrays["points"] = self._rows(file, "Points", start, count)
        return Piece(self.facts, arrays)

    def _flat(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return one (z, y, x[, 3]) block of an image as a list of cells."""
        n = int(np.prod(self.facts["extent"][1::2] - self.facts["extent"][::2]))
        return rows.reshape(n, -1) if n > 0 and rows.size % n == 0 else rows

    def _points(self, file: Any, k: int) -> tuple[int, int]:
        """Return where the points of snapshot k begin, and how many there are in all its parts."""
        counts = self._whole(file, "NumberOfPoints")
        first, parts = self._offset(file, "PartOffsets", k, 0), self._offset(file, "NumberOfParts", k, len(counts))
        if self.times is not None and node_of(file, f"{ROOT}/Steps/NumberOfParts") is None:
            parts = 1
        return self._offset(file, "PointOffsets", k, 0), int(counts[first : first + parts].sum())

    def _offset(self, file: Any, name: str, k: int, otherwise: int) -> int:
        values = None if self.times is None else node_of(file, f"{ROOT}/Steps/{name}", beside=True)
        return otherwise if values is None else int(values[k])

    def _whole(self, file: Any, name: str) -> NDArray[np.int64]:
        node = node_of(file, f"{ROOT}/{name}", beside=True)
        if node is None:
            raise Refusal(f"{self.path} has no {ROOT}/{name}; write it again")
        return np.asarray(node[()], np.int64).reshape(-1)

    def _rows(self, file: Any, name: str, start: int, count: int) -> NDArray[Any]:
        node = node_of(file, f"{ROOT}/{name}", beside=True)
        rows = getattr(node, "shape", None) or ()  # a group has none, a single number no first axis
        if not rows or start < 0 or count < 0 or start + count > rows[0]:
            held = f"{rows[0]} rows" if rows else "no such dataset"
            raise Refusal(f"{self.path}: {ROOT}/{name} should hold rows {start} to {start + count}, it has {held}")
        return np.asarray(node[start : start + count])
