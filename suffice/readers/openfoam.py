"""A case of OpenFOAM: its Lagrangian cloud, and fields of the fluid on a uniform box."""

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path

import numpy as np

from suffice.quantities import Grid
from suffice.readers.clock import Stamps
from suffice.readers.foam_folders import CONTROL, find_folders
from suffice.readers.pieces import NO_PARTICLES, Chosen, choose, fields_of, notes_of, particles_of, variables_of
from suffice.readers.trajectory import Frame
from suffice.readers.uniform import Cells, cells_of
from suffice.readers.vtk_process import Piece, VtkProcess
from suffice.refusal import Refusal

CLOUDS, MESH = "/lagrangian/", "/internalMesh"
BARYCENTRIC = (
    "barycentric positions, as the OpenFOAM Foundation writes them, need foamToVTK first: import its "
    "VTK/lagrangian/CLOUD/*"
)


def read_openfoam(sources: Sequence[Path], mapped: Mapping[str, str]) -> "OpenFoamCase":
    """Return the run that a case holds. Raises `Refusal` as `OpenFoamCase` does."""
    return OpenFoamCase(sources, mapped)


class OpenFoamCase:
    """A case, reconstructed or not, at the times that hold all that the last one holds; the first ones may hold less.

    Raises `Refusal` where there is no such case, several clouds, cells that are no uniform box, or a gap in between.
    """

    def __init__(self, sources: Sequence[Path], mapped: Mapping[str, str]) -> None:
        self.folders, self.mapped = find_folders(sources), mapped
        self.case = self.folders.case
        with VtkProcess() as vtk:
            times = vtk.times_of_case(self.folders.control, self.folders.decomposed)
            if not times:
                raise Refusal(f"case {self.case} has no times; run its solver")
            pieces = self._read(vtk, times[-1])
            self.cloud, self.chosen = self._choose_cloud(pieces, times[-1])
            self.cells, self.fields = self._choose_fields(pieces)
            if self.chosen is None and self.fields is None:
                raise Refusal(f"case {self.case} holds no particles and no fields at its last time")
            n = len(times)
            begins = next(k for k in range(n) if self._holds_all(self._read(vtk, times[k])))
        self.times, self.left_out = times[begins:], times[:begins]

    @property
    def stamps(self) -> Stamps:
        """The times of the case."""
        return Stamps(len(self.times), None, np.array(self.times), "the case")

    @property
    def grid(self) -> Grid | None:
        """The cells of the fluid, where it is read."""
        return None if self.cells is None else self.cells.grid

    @property
    def variables(self) -> list[str]:
        """What is known in every snapshot."""
        position = [] if self.chosen is None else ["position"]
        return position + [name for chosen in self._both for name in variables_of(chosen)]

    @property
    def ignored(self) -> list[str]:
        """Arrays that are not read."""
        return [name for chosen in self._both for name in chosen.ignored]

    @property
    def notes(self) -> list[str]:
        """How the case was understood."""
        found = [note for chosen in self._both for note in notes_of(chosen)]
        if self.folders.decomposed:
            first, last = self.folders.holders[0].name, self.folders.holders[-1].name
            found.append(f"put together from {first} to {last}, which hold more times than the case itself")
        if self.left_out:
            found.append(f"times before {self.times[0]:g} s left out: they do not hold all that the last one does")
        return [*found, "VTK reads OpenFOAM in single precision"]

    def frames(self) -> Generator[Frame, None, None]:
        """Read the snapshots in the order of time, holding one in memory."""
        with VtkProcess() as vtk:
            for time in self.times:
                where = f"{self.case} time {time:g}"
                pieces = self._read(vtk, time)
                frame = Frame(where, NO_PARTICLES, {}, None, None)
                if self.chosen is not None:
                    if self.cloud not in pieces:
                        raise Refusal(f"{where} has no cloud {self._cloud_name}; import a part of the run that has it")
                    self._check_same(self.chosen, pieces[self.cloud], where)
                    frame = particles_of(pieces[self.cloud], self.chosen, where)
                fields = {}
                self._check_without_fields(pieces, where)
                if self.fields is not None and self.cells is not None:
                    self._check_same(self.fields, pieces[MESH], where)
                    fields = fields_of(pieces[MESH], self.fields, self.cells, where)
                yield frame._replace(values={**frame.values, **fields})

    @property
    def _cloud_name(self) -> str:
        return self.cloud.removeprefix(CLOUDS)

    @property
    def _both(self) -> list[Chosen]:
        return [chosen for chosen in (self.chosen, self.fields) if chosen is not None]

    def _read(self, vtk: VtkProcess, time: float) -> dict[str, Piece]:
        """Return the datasets of one time by name. Raises `Refusal` where VTK cannot read them."""
        folders = self.folders
        try:
            pieces = vtk.read_case(folders.control, time, folders.size_of(time), folders.decomposed)
        except Refusal as refusal:
            hint = f"; {BARYCENTRIC}" if "/positions" in str(refusal) else ""
            raise Refusal(f"{refusal}{hint}") from None
        return {piece.facts["name"]: piece for piece in pieces}

    def _choose_cloud(self, pieces: Mapping[str, Piece], time: float) -> tuple[str, Chosen | None]:
        clouds = {name.removeprefix(CLOUDS): name for name in pieces if name.startswith(CLOUDS)}
        there = {*clouds, *self.folders.clouds_at(time)}
        wanted = self.mapped.get("cloud")
        if wanted == "none" or (not there and wanted is None):
            return "", None
        if wanted is not None and wanted not in there:
            raise Refusal(f"--map cloud={wanted}: case {self.case} has no such cloud at its last time")
        if wanted is None and len(there) > 1:
            names = ", ".join(sorted(there))
            raise Refusal(f"case {self.case} has the clouds {names}; say which one with --map cloud=NAME")
        name = wanted or there.pop()
        if name not in clouds:
            raise Refusal(
                f"case {self.case}: VTK finds no positions of its cloud {name}; {BARYCENTRIC}, or leave the cloud out "
                "with --map cloud=none"
            )
        return clouds[name], choose(pieces[clouds[name]], self.mapped, str(self.case))

    def _choose_fields(self, pieces: Mapping[str, Piece]) -> tuple[Cells | None, Chosen | None]:
        if self.mapped.get("fluid") == "none" or not _fields_in(pieces):
            return None, None
        return cells_of(pieces[MESH], str(self.case)), choose(pieces[MESH], self.mapped, str(self.case))

    def _check_same(self, chosen: Chosen, piece: Piece, where: str) -> None:
        """Refuse a time that holds more than the last one, by which it was decided what is read."""
        if more := set(choose(piece, self.mapped, where).used) - set(chosen.used):
            raise Refusal(
                f"{where} holds {', '.join(sorted(more))}, which the last time, {self.times[-1]:g} s, does not or has "
                "damaged; write that again, or remove it"
            )

    def _check_without_fields(self, pieces: Mapping[str, Piece], where: str) -> None:
        found = _fields_in(pieces) if self.fields is None and self.mapped.get("fluid") != "none" else []
        if found:
            raise Refusal(
                f"{where} holds {', '.join(found)}, the last time, {self.times[-1]:g} s, no fields at all; remove that "
                "time, or leave the fluid out with --map fluid=none"
            )

    def _holds_all(self, pieces: Mapping[str, Piece]) -> bool:
        cells = _fields_in(pieces)
        parcels = pieces[self.cloud].facts["known"]["point"] if self.cloud in pieces else []
        return (self.chosen is None or set(self.chosen.names) <= set(parcels)) and (
            self.fields is None or set(self.fields.names) <= set(cells)
        )


def _fields_in(pieces: Mapping[str, Piece]) -> list[str]:
    return list(pieces[MESH].facts["known"]["cell"]) if MESH in pieces else []


def is_case(path: Path) -> bool:
    """Tell whether a path is the folder of a case, or a file in it that ParaView opens."""
    return (path / CONTROL).is_file() or path.suffix in (".foam", ".OpenFOAM")
