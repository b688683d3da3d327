"""A run whose snapshots are datasets of VTK: particles, cells of a uniform grid, or both side by side."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from typing import Any, NamedTuple, Protocol

import numpy as np

from suffice.quantities import Grid
from suffice.readers.clock import Stamps
from suffice.readers.parts import is_empty
from suffice.readers.pieces import NO_PARTICLES, Chosen, choose, fields_of, notes_of, particles_of, variables_of
from suffice.readers.trajectory import Frame
from suffice.readers.uniform import Cells, cells_of
from suffice.readers.vtk_process import Piece
from suffice.refusal import Refusal

Read = Callable[[int, Sequence[str] | None], Piece]  # snapshot k with the arrays named


class PieceSource(Protocol):
    """Datasets of one kind, one for each snapshot."""

    @property
    def stamps(self) -> Stamps:
        """How many there are, and what is said of their time."""

    @property
    def head(self) -> Piece:
        """The first dataset without its arrays of values."""

    def where(self, k: int) -> str:
        """Return how to find snapshot k, for messages."""

    def opened(self) -> AbstractContextManager[Read]:
        """Return what reads snapshot k, for the time of a block."""


class Group(NamedTuple):
    """Particles, or cells, and which of their arrays are used."""

    source: PieceSource
    chosen: Chosen
    cells: Cells | None  # None for particles


class PieceRun:
    """A run of particles, of fields on a uniform grid, or of both, read snapshot by snapshot.

    Raises `Refusal` where no array is the id, it is not clear what is what, or particles and fields do not go together.
    """

    def __init__(self, sources: Sequence[PieceSource], mapped: Mapping[str, str], notes: Sequence[str] = ()) -> None:
        walls = [source for source in sources if source.head.facts["kind"] == "walls"]
        groups = [group for source in sources if source not in walls and (group := _group(source, mapped)) is not None]
        self._particles = _only("particles", [group for group in groups if group.cells is None])
        self._fluid = _only("fields", [group for group in groups if group.cells is not None])
        self._groups = [group for group in (self._particles, self._fluid) if group is not None]
        if not self._groups:
            held = "walls alone" if walls else "no particles, and the fluid is left out"
            raise Refusal(f"the sources hold {held}; give the files of the particles")
        self.stamps = self._groups[0].source.stamps
        self._check_together()
        self._notes = [*notes, *(f"{source.stamps.n} files of walls left out: {source.where(0)}" for source in walls)]

    @property
    def grid(self) -> Grid | None:
        """The cells of the fluid, where there is one."""
        return self._fluid.cells.grid if self._fluid is not None and self._fluid.cells is not None else None

    @property
    def variables(self) -> list[str]:
        """What is known in every snapshot."""
        position = [] if self._particles is None else ["position"]
        return position + [name for group in self._groups for name in variables_of(group.chosen)]

    @property
    def ignored(self) -> list[str]:
        """Arrays that are not read."""
        return [name for group in self._groups for name in group.chosen.ignored]

    @property
    def notes(self) -> list[str]:
        """How the sources were understood."""
        return ["SI units taken", *self._notes, *(note for group in self._groups for note in notes_of(group.chosen))]

    def frames(self) -> Generator[Frame, None, None]:
        """Read the snapshots in the order of time, holding one in memory."""
        with ExitStack() as stack:
            reads = [stack.enter_context(group.source.opened()) for group in self._groups]
            for k in range(self.stamps.n):
                yield self._frame(k, reads)

    def _frame(self, k: int, reads: Sequence[Read]) -> Frame:
        frame = Frame(self._groups[0].source.where(k), NO_PARTICLES, {}, None, None)
        fields: dict[str, Any] = {}
        for group, read in zip(self._groups, reads, strict=True):
            where = group.source.where(k)
            piece = read(k, group.chosen.names)
            if group.cells is not None:
                fields = _fields(piece, group.chosen, group.cells, where)
            elif piece.facts["kind"] != "particles":
                raise Refusal(f"{where} holds {piece.facts['kind']}, not particles as the first snapshot; leave it out")
            elif is_empty(piece):
                raise Refusal(f"{where} holds no particles; leave snapshots without particles out")
            else:
                frame = particles_of(piece, group.chosen, where)
        return frame._replace(values={**frame.values, **fields})

    def _check_together(self) -> None:
        if self._particles is None or self._fluid is None:
            return
        one, other = self._particles.source.stamps, self._fluid.source.stamps
        if one.n != other.n:
            raise Refusal(f"{one.n} snapshots of particles and {other.n} of fields; give the files of the same times")
        if one.times is not None and other.times is not None and not np.allclose(one.times, other.times, rtol=1e-6):
            k = int(np.argmax(np.abs(one.times - other.times)))
            raise Refusal(
                f"snapshot {k} is at {one.times[k]:g} s of the particles and at {other.times[k]:g} s of the fields; "
                "give the files of the same times"
            )


def _group(source: PieceSource, mapped: Mapping[str, str]) -> Group | None:
    """Decide what the first dataset of a source is; None for a fluid that is left out."""
    where, head = source.where(0), source.head
    if head.facts["kind"] == "particles":
        return Group(source, choose(head, mapped, where), None)
    if mapped.get("fluid") == "none":
        return None
    return Group(source, choose(head, mapped, where), cells_of(head, where))


def _fields(piece: Piece, chosen: Chosen, cells: Cells, where: str) -> dict[str, Any]:
    if piece.facts["kind"] == "particles":
        raise Refusal(f"{where} holds particles, not cells as the first snapshot; leave it out")
    found = cells_of(piece, where)
    if found.grid.shape != cells.grid.shape or not np.array_equal(found.place, cells.place):
        raise Refusal(f"{where} has other cells than the first snapshot; import snapshots on one grid")
    return fields_of(piece, chosen, cells, where)


def _only(what: str, groups: list[Group]) -> Group | None:
    if len(groups) > 1:
        names = " and ".join(group.source.where(0) for group in groups[:2])
        raise Refusal(
            f"the sources hold {what} of {len(groups)} kinds, such as {names}; give the files of one, or the .pvtu or "
            ".pvtp that name its parts"
        )
    return groups[0] if groups else None
