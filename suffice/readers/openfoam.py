"""A case of OpenFOAM: its Lagrangian cloud, and fields of the fluid on a uniform box."""

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path

import numpy as np

from suffice.quantities import Grid
from suffice.readers.clock import Stamps
from suffice.readers.pieces import NO_PARTICLES, Chosen, choose, fields_of, notes_of, particles_of, variables_of
from suffice.readers.trajectory import Frame
from suffice.readers.uniform import Cells, cells_of
from suffice.readers.vtk_process import Piece, VtkProcess
from suffice.refusal import Refusal

CLOUDS, MESH = "/lagrangian/", "/internalMesh"
PROCESSOR_BITS = 32  # id = processor · 2³² + number: where a parcel was born never changes


def read_openfoam(sources: Sequence[Path], mapped: Mapping[str, str]) -> "OpenFoamCase":
    """Return the run that a case holds. Raises `Refusal` as `OpenFoamCase` does."""
    return OpenFoamCase(sources, mapped)


class OpenFoamCase:
    """A reconstructed case, at the times that hold all that the last one holds; the first ones may hold less.

    Raises `Refusal` where there is no such case, several clouds, cells that are no uniform box, or a gap in between.
    """

    def __init__(self, sources: Sequence[Path], mapped: Mapping[str, str]) -> None:
        self.case, self.mapped = _case_of(sources), mapped
        with VtkProcess() as vtk:
            times = vtk.times_of_case(self._control)
            if not times:
                raise Refusal(
                    f"case {self.case} has no times; run its solver, and reconstructPar if it ran in parallel"
                )
            pieces = self._read(vtk, times[-1])
            self.cloud, self.chosen = self._choose_cloud(pieces)
            self.cells, self.fields = self._choose_fields(pieces)
            if self.chosen is None and self.fields is None:
                raise Refusal(f"case {self.case} holds no particles and no fields at its last time{self._parallel}")
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
                if self.fields is not None and self.cells is not None:
                    self._check_same(self.fields, pieces[MESH], where)
                    fields = fields_of(pieces[MESH], self.fields, self.cells, where)
                yield frame._replace(values={**frame.values, **fields})

    @property
    def _control(self) -> Path:
        return self.case / "system" / "controlDict"

    @property
    def _parallel(self) -> str:
        return "; it ran in parallel: run reconstructPar first" if (self.case / "processor0").is_dir() else ""

    @property
    def _cloud_name(self) -> str:
        return self.cloud.removeprefix(CLOUDS)

    @property
    def _both(self) -> list[Chosen]:
        return [chosen for chosen in (self.chosen, self.fields) if chosen is not None]

    def _read(self, vtk: VtkProcess, time: float) -> dict[str, Piece]:
        """Return the datasets of one time by name; particles with one id made of their two labels."""
        found = {
            piece.facts["name"]: piece for piece in vtk.read_case(self._control, time, size_of_case(self.case, time))
        }
        for name, piece in found.items():
            if name.startswith(CLOUDS) and "point:origId" in piece.arrays:
                number = piece.arrays["point:origId"].astype(np.int64)
                processor = piece.arrays.get("point:origProcId", np.zeros_like(number)).astype(np.int64)
                piece.arrays["point:origId"] = (processor << PROCESSOR_BITS) + number
        return found

    def _choose_cloud(self, pieces: Mapping[str, Piece]) -> tuple[str, Chosen | None]:
        clouds = [name for name in pieces if name.startswith(CLOUDS)]
        if "cloud" in self.mapped:
            clouds = [name for name in clouds if name == CLOUDS + self.mapped["cloud"]]
            if not clouds:
                raise Refusal(
                    f"--map cloud={self.mapped['cloud']}: case {self.case} has no such cloud at its last time"
                )
        if len(clouds) > 1:
            names = ", ".join(name.removeprefix(CLOUDS) for name in clouds)
            raise Refusal(f"case {self.case} has the clouds {names}; say which one with --map cloud=NAME")
        return (clouds[0], choose(pieces[clouds[0]], self.mapped, str(self.case))) if clouds else ("", None)

    def _choose_fields(self, pieces: Mapping[str, Piece]) -> tuple[Cells | None, Chosen | None]:
        if MESH not in pieces or self.mapped.get("fluid") == "none":
            return None, None
        return cells_of(pieces[MESH], str(self.case)), choose(pieces[MESH], self.mapped, str(self.case))

    def _check_same(self, chosen: Chosen, piece: Piece, where: str) -> None:
        """Refuse a time that holds more than the last one, by which it was decided what is read."""
        if more := set(choose(piece, self.mapped, where).used) - set(chosen.used):
            raise Refusal(
                f"{where} holds {', '.join(sorted(more))}, which the last time, {self.times[-1]:g} s, does not or has "
                "damaged; write that again, or remove it"
            )

    def _holds_all(self, pieces: Mapping[str, Piece]) -> bool:
        cells = pieces[MESH].facts["known"]["cell"] if MESH in pieces else []
        parcels = pieces[self.cloud].facts["known"]["point"] if self.cloud in pieces else []
        return (self.chosen is None or set(self.chosen.names) <= set(parcels)) and (
            self.fields is None or set(self.fields.names) <= set(cells)
        )


def is_case(path: Path) -> bool:
    """Tell whether a path is the folder of a case, or a file in it that ParaView opens."""
    return (path / "system" / "controlDict").is_file() or path.suffix in (".foam", ".OpenFOAM")


def _case_of(sources: Sequence[Path]) -> Path:
    if len(sources) > 1:
        raise Refusal(f"{len(sources)} sources are named; give one case of OpenFOAM at a time")
    case = sources[0] if sources[0].is_dir() else sources[0].parent
    if not (case / "system" / "controlDict").is_file():
        raise Refusal(f"case {case} has no system/controlDict; name the folder of a case")
    return case


def size_of_case(case: Path, time: float) -> int:
    """Return the bytes of the files that hold the mesh and one time. Raises `Refusal` for a device or a pipe."""
    folders = [case / "constant" / "polyMesh"]
    folders += [path for path in case.iterdir() if path.is_dir() and _is_time(path.name, time)]
    files = [file for folder in folders for file in folder.rglob("*") if not file.is_dir()]
    if odd := next((file for file in files if not file.is_file()), None):
        raise Refusal(f"{odd} is no file, and may have no end; put a file there, or remove it")
    return sum(file.stat().st_size for file in files)


def _is_time(name: str, time: float) -> bool:
    try:
        return abs(float(name) - time) <= 1e-9 * max(abs(time), 1.0)
    except ValueError:
        return False
