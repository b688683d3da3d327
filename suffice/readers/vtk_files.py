"""VTK files, one or several for each snapshot: LIGGGHTS, Yade, MFiX and ParaView write particles and fields so."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from suffice.readers.clock import Stamps
from suffice.readers.parts import GHOSTS, is_empty, join
from suffice.readers.piece_run import PieceRun, PieceSource, Read
from suffice.readers.series import NUMBER, Entry, entries_of
from suffice.readers.vtk_process import Piece, VtkProcess
from suffice.readers.vtkhdf import VtkHdf, is_vtkhdf
from suffice.refusal import Refusal

TIME_NAMES = ("TimeValue", "TIME", "Time")  # in the field data, by ParaView and by VisIt


def read_vtk(sources: Sequence[Path], mapped: Mapping[str, str]) -> PieceRun:
    """Return the run that files of VTK hold: legacy, XML, lists of them, or VTKHDF.

    Raises `Refusal` where VTK is missing or cannot read a file, no array is the id, or it is not clear what is what.
    """
    boxes = [path for path in sources if "boundingBox" in path.name]  # LIGGGHTS writes one beside each dump
    found: list[PieceSource] = [VtkHdf(path) for path in sources if is_vtkhdf(path)]
    others = [path for path in sources if path not in boxes and not is_vtkhdf(path)]
    series = list(_series(list(_grouped(others))))
    notes = [f"{len(boxes)} files of bounding boxes left out"] if boxes else []
    notes += [f"{each.empty} without particles before {each.where(0)} left out" for each in series if each.empty]
    return PieceRun([*found, *series], mapped, notes)


def _series(grouped: Sequence[Sequence[Entry]]) -> Iterator["FileSeries"]:
    """Look at all files with one program of VTK, and with none where there are none."""
    if grouped:
        with VtkProcess() as vtk:
            yield from (FileSeries(entries, vtk) for entries in grouped)


class FileSeries:
    """Files that belong together, in the order of time, from the first on that holds something."""

    def __init__(self, entries: Sequence[Entry], vtk: VtkProcess) -> None:
        self.entries = list(entries)
        read = self._reads(vtk)
        self.empty, self.head = self._begin(read)
        self.entries = self.entries[self.empty :]
        self.stamps = self._read_stamps(read)

    def where(self, k: int) -> str:
        """Return the file of snapshot k."""
        return str(self.entries[k].path)

    @contextmanager
    def opened(self) -> Iterator[Read]:
        """Start VTK, and return what reads snapshot k with it."""
        with VtkProcess() as vtk:
            yield self._reads(vtk)

    def _reads(self, vtk: VtkProcess) -> Read:
        def read(k: int, names: Sequence[str] | None) -> Piece:
            wanted = None if names is None else [*names, GHOSTS]
            return join([vtk.read(part.path, part.type, wanted) for part in self.entries[k].parts], self.where(k))

        return read

    def _begin(self, read: Read) -> tuple[int, Piece]:
        """Return how many files hold nothing before the first one that does, and that one."""
        for k in range(len(self.entries)):
            if not is_empty(head := read(k, ())):
                return k, head
        raise Refusal(f"{self.where(0)} holds no particles, nor does any file after it")

    def _read_stamps(self, read: Read) -> Stamps:
        """Return times from a list of files, or from inside the files; and step numbers from their names otherwise."""
        n = len(self.entries)
        if self.entries[0].time is not None:
            return Stamps(n, None, np.array([entry.time for entry in self.entries], float), "the list of files")
        steps = [entry.step for entry in self.entries]
        numbered = None if None in steps else np.array(steps, np.int64)
        if n > 1 and numbered is None and _time_in(self.head) is None:
            where = self.where(steps.index(None))
            raise Refusal(f"{where} has no number in its name, nor a time in it; give a .pvd that says the times")
        if _time_in(self.head) is None:
            return Stamps(n, numbered)
        said = [_time_in(read(k, ())) for k in range(n)]
        if None in said:
            raise Refusal(f"{self.where(said.index(None))} does not say its time, as {self.where(0)} does; add it")
        times = np.array(said, float)
        if numbered is None:  # the folder tells them apart, not the name
            order = np.argsort(times, kind="stable")
            self.entries, times = [self.entries[i] for i in order], times[order]
        return Stamps(n, numbered, times, "the files themselves")


def _grouped(sources: Sequence[Path]) -> Iterator[list[Entry]]:
    """Yield the files that belong together: those of one list, or those whose names differ by their number alone."""
    alone: dict[str, list[Entry]] = {}
    for source in sources:
        entries = entries_of(source)
        if entries[0].time is not None:
            yield sorted(entries, key=lambda entry: entry.time or 0.0)
        else:
            alone.setdefault(NUMBER.sub("", source.stem) + source.suffix, []).extend(entries)
    for entries in alone.values():
        yield sorted(entries, key=lambda entry: entry.step or 0)


def _time_in(piece: Piece) -> float | None:
    for name in TIME_NAMES:
        if (found := piece.arrays.get(f"field:{name}")) is not None and found.size == 1:
            return float(found.reshape(-1)[0])
    return None
