"""Dumps of LAMMPS and LIGGGHTS: the text of `dump custom`, atoms in any order, columns in any order."""

from collections.abc import Generator, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.readers.box import Box, box_of
from suffice.readers.clock import Stamps
from suffice.readers.columns import read_columns
from suffice.readers.header import CUT_REMEDY, Header, read_header
from suffice.readers.restarts import Place, Restart, find_restarts, restarted
from suffice.readers.text import Text, open_text
from suffice.readers.trajectory import Frame
from suffice.refusal import Refusal

# unwrapped coordinates first: a particle that leaves through a periodic face must not jump
POSITIONS = (("xu", "yu", "zu"), ("x", "y", "z"), ("xsu", "ysu", "zsu"), ("xs", "ys", "zs"))
IMAGES = ("ix", "iy", "iz")
MOTIONS = {"velocity": ("vx", "vy", "vz"), "angular_velocity": ("omegax", "omegay", "omegaz")}
SIZES = {"radius": 1.0, "diameter": 0.5}  # times the column is the radius
SPECIES = "type"


class Survey(NamedTuple):
    """The headers of one file, in its order."""

    path: Path
    headers: list[Header]


def read_dump(sources: Sequence[Path], mapped: Mapping[str, str]) -> "Dump":
    """Return the run in dump files. Raises `Refusal` as `Dump` does, and for a mapping: columns have fixed names."""
    if mapped:
        raise Refusal(f"--map {next(iter(mapped))}: the columns of a dump have fixed names; leave --map out")
    return Dump(sources)


class Dump:
    """A run in one or more dump files, surveyed once and then read snapshot by snapshot.

    Files are put in the order of their first time step. Raises `Refusal` when a file is no dump, is cut in the middle
    of a snapshot, changes its columns, or does not say which particle is where.
    """

    def __init__(self, sources: Sequence[Path]) -> None:
        self.files = sorted((survey(path) for path in sources), key=lambda file: file.headers[0].step)
        self.columns = self.files[0].headers[0].columns
        self.restarts = find_restarts([file.headers for file in self.files], [file.path for file in self.files])
        again = {place for restart in self.restarts for place in restart.dropped}
        kept = [(place, header) for place, header in self._places() if place not in again]
        self.empty = next((k for k, (_, header) in enumerate(kept) if header.n), len(kept))
        self.kept = dict(kept[self.empty :])
        self.headers = list(self.kept.values())
        self._check_atoms()
        self._check_columns()
        self.position = self._choose_position()
        self.motions = {name: three for name, three in MOTIONS.items() if set(three) <= set(self.columns)}

    @cached_property
    def stamps(self) -> Stamps:
        """Time step numbers of the snapshots, and their times if each has its `ITEM: TIME`."""
        said = [header.time for header in self.headers if header.time is not None]
        times = np.array(said) if len(said) == len(self.headers) else None
        return Stamps(len(self.steps), self.steps, times, "ITEM: TIME of the source")

    @cached_property
    def steps(self) -> NDArray[np.int64]:
        """Time step number of every snapshot, (snapshots,)."""
        return np.array([header.step for header in self.headers], np.int64)

    @property
    def grid(self) -> None:
        """A dump holds no fluid."""

    @cached_property
    def used(self) -> tuple[str, ...]:
        """The columns that are read, each once."""
        single = [name for name in (*SIZES, SPECIES) if name in self.columns]
        motions = [name for three in self.motions.values() for name in three]
        return ("id", *self.position, *(IMAGES if self._unwraps else ()), *motions, *single)

    @property
    def variables(self) -> list[str]:
        """What is known of every particle in every snapshot."""
        return ["position", *self.motions]

    @property
    def ignored(self) -> list[str]:
        """Columns that are not read."""
        return [name for name in dict.fromkeys(self.columns) if name not in self.used]

    @property
    def notes(self) -> list[str]:
        """How the dump was understood: its units, and particles that cross periodic faces."""
        units = self.headers[0].units
        notes = [f"units {units} taken as SI" if units else "a dump does not say its units; SI taken"]
        if self._unwraps:
            notes.append("positions unwrapped at periodic faces with ix iy iz")
        elif self._wrapped:
            notes.append("particles jump where they cross a periodic face; dump xu yu zu to avoid it")
        if self.empty:
            notes.append(f"{self.empty} snapshots without atoms before step {self.headers[0].step} left out")
        return notes + [self._told(restart) for restart in self.restarts]

    def _told(self, restart: Restart) -> str:
        first, file = restart.dropped[0], self.files[restart.at.file]
        step = self.files[first.file].headers[first.number].step
        n = len(restart.dropped)
        return f"{n} snapshots from step {step} on left out: after a restart {file.path} goes on from there"

    def frames(self) -> Generator[Frame, None, None]:
        """Read the snapshots in the order of time, holding one in memory.

        Raises `Refusal` naming particle, column and step of a number that is none, or not finite.
        """
        for place, frame in restarted(self._all_frames(), self.restarts):
            if place in self.kept:
                yield frame

    def _places(self) -> Iterator[tuple[Place, Header]]:
        for number, file in enumerate(self.files):
            yield from ((Place(number, k), header) for k, header in enumerate(file.headers))

    def _all_frames(self) -> Iterator[tuple[Place, Frame]]:
        for number, file in enumerate(self.files):
            with open_text(file.path) as text:
                for k, expected in enumerate(file.headers):
                    if (header := read_header(text)) is None or header.step != expected.step:
                        raise Refusal(f"{file.path} changed while it was read; import it when it is complete")
                    if header.n:
                        yield Place(number, k), self._frame(header, text)

    def _frame(self, header: Header, text: Text) -> Frame:
        where = f"{text.path} step {header.step}"
        lines = text.block(header.n)
        if lines.count(b"\n") < header.n:
            raise Refusal(f"{text.path} changed while it was read; import it when it is complete")
        table = read_columns(lines, header.columns, self.used, where)
        of = dict(zip(self.used, table.T, strict=True))
        position = table[:, 1:4]
        if self._scaled:
            position = self._box(header).at(position)
        if self._unwraps:
            position = position + self._box(header).shift(np.column_stack([of[name] for name in IMAGES]))
        motions = {name: np.column_stack([of[column] for column in three]) for name, three in self.motions.items()}
        size = next((name for name in SIZES if name in of), None)
        radius = None if size is None else SIZES[size] * of[size]
        species = of[SPECIES].astype(np.int64) if SPECIES in of else None
        return Frame(where, of["id"].astype(np.int64), {"position": position, **motions}, radius, species)

    def _box(self, header: Header) -> Box:
        if (box := box_of(header)) is None:
            raise Refusal(
                f"{self.files[0].path} step {header.step}: BOX BOUNDS has {header.box.shape[1]} columns, not 2 to "
                f"4; columns {' '.join(self.position)} need them: dump xu yu zu"
            )
        return box

    @property
    def _scaled(self) -> bool:
        return self.position[0] in ("xs", "xsu")

    @cached_property
    def _wrapped(self) -> bool:
        return "u" not in self.position[0] and "pp" in self.headers[0].faces

    @cached_property
    def _unwraps(self) -> bool:
        return self._wrapped and set(IMAGES) <= set(self.columns)

    def _choose_position(self) -> tuple[str, str, str]:
        found = next((three for three in POSITIONS if set(three) <= set(self.columns)), None)
        if found is None or "id" not in self.columns:
            raise Refusal(
                f"{self.files[0].path}: its columns are {' '.join(self.columns) or 'not named'}; particles need id "
                "and x y z (or xu yu zu, xs ys zs): dump them"
            )
        return found

    def _check_atoms(self) -> None:
        if not self.headers:
            raise Refusal(f"{self.files[0].path} holds no atoms at any step; name a dump that holds some")
        if not all(header.n for header in self.headers):
            step = next(header.step for header in self.headers if not header.n)
            raise Refusal(f"step {step} has 0 atoms; leave snapshots without atoms out")

    def _check_columns(self) -> None:
        for file in self.files:
            for header in file.headers:
                if header.columns != self.columns:
                    raise Refusal(
                        f"{file.path} step {header.step}: the columns change from {' '.join(self.columns)} to "
                        f"{' '.join(header.columns)}; import snapshots of the same columns"
                    )


def survey(path: Path) -> Survey:
    """Return the headers of one file. Raises `Refusal` when it is empty, no dump, or cut."""
    headers = []
    with open_text(path) as text:
        while (header := read_header(text)) is not None:
            _check_atoms(text, header)
            headers.append(header)
    if not headers:
        raise Refusal(f"{path} is empty; name a dump that holds snapshots")
    return Survey(path, headers)


def _check_atoms(text: Text, header: Header) -> None:
    """Read past the atoms. Raises `Refusal` when the file ends or another snapshot begins before the last of them."""
    n = 0
    for piece in text.pieces(header.n):
        whole, another, _ = piece.partition(b"ITEM:")
        n += whole.count(b"\n")
        if another:
            break
    if n < header.n:
        raise Refusal(
            f"{text.path}: the snapshot of step {header.step} at line {header.line} is cut: it has {n} whole lines of "
            f"{header.n} atoms; {CUT_REMEDY}"
        )
