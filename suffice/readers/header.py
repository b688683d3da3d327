"""What stands above the atoms of each snapshot in a LAMMPS or LIGGGHTS dump."""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from suffice.readers.text import Text
from suffice.refusal import Refusal

CUT_REMEDY = "remove that snapshot from the file, or write the dump again"

_LINES = {"UNITS": 1, "TIME": 1, "TIMESTEP": 1, "NUMBER OF ATOMS": 1, "BOX BOUNDS": 3, "ATOMS": 0}
LARGEST = 2**62  # of whole numbers, whose differences still have 64 bits
_SI = ("si", "lj")  # numbers in lj units have no dimension and are taken as they are

T = TypeVar("T")


class Header(NamedTuple):
    """One snapshot's header."""

    line: int  # where the snapshot begins
    step: int
    time: float | None  # s
    n: int  # atoms
    box: NDArray[np.float64]  # (3, 2) lower and upper corner, m; three or four columns when the box is tilted
    faces: tuple[str, ...]  # of the box, as written: pp pp ff
    units: str | None
    columns: tuple[str, ...]


class _Item(NamedTuple):
    words: list[str]  # after its name
    lines: list[str]  # below it


def read_header(text: Text) -> Header | None:
    """Read on to the first atom of the next snapshot; None at the end of the file.

    Raises `Refusal` naming file and line where something else stands there.
    """
    items: dict[str, _Item] = {}
    start = text.number + 1
    while (line := text.line()) is not None:
        if not line and not items:
            start = text.number + 1
            continue
        name = next((name for name in _LINES if f"{line} ".startswith(f"ITEM: {name} ")), None)
        if name is None:
            raise Refusal(
                f"{text.path} line {text.number}: {line[:40]!r} stands where a dump of atoms has its next 'ITEM: ...'; "
                "the snapshot before it is damaged, or this is not a dump of `dump custom`"
            )
        words = line.removeprefix(f"ITEM: {name}").split()
        items[name] = _Item(words, [text.line() or "" for _ in range(_LINES[name])])
        if name == "ATOMS":
            return _header(text, start, items)
    if items:
        raise Refusal(f"{text.path} ends inside the header of the snapshot at line {start}; {CUT_REMEDY}")
    return None


def _header(text: Text, start: int, items: dict[str, _Item]) -> Header:
    def value(name: str, read: Callable[[str], T]) -> T:
        written = items[name].lines[0] if name in items else "nothing"
        try:
            return read(written)
        except ValueError:
            raise Refusal(
                f"{text.path} line {start}: ITEM: {name} is {written!r}, not a number; {CUT_REMEDY}"
            ) from None

    units = items["UNITS"].lines[0] if "UNITS" in items else None
    if units not in (None, *_SI):
        raise Refusal(f"{text.path}: ITEM: UNITS is {units}; suffice reads SI: convert to m and s, or use `units si`")
    bounds = items.get("BOX BOUNDS", _Item([], []))
    header = Header(
        start,
        value("TIMESTEP", int),
        value("TIME", float) if "TIME" in items else None,
        value("NUMBER OF ATOMS", int),
        _box(text, start, bounds.lines),
        tuple(bounds.words),
        units,
        tuple(items["ATOMS"].words),
    )
    if not 0 <= header.n <= LARGEST:
        raise Refusal(f"{text.path} line {start}: step {header.step} has {header.n} atoms; {CUT_REMEDY}")
    if abs(header.step) > LARGEST:
        raise Refusal(f"{text.path} line {start}: step {header.step} is beyond any run; {CUT_REMEDY}")
    if header.time is not None and not np.isfinite(header.time):
        raise Refusal(f"{text.path} line {start}: ITEM: TIME of step {header.step} is {header.time} s; correct it")
    return header


def _box(text: Text, start: int, lines: list[str]) -> NDArray[np.float64]:
    try:
        box = np.array([[float(word) for word in line.split()] for line in lines]).reshape(len(lines), -1)
        if np.isfinite(box).all():
            return box
    except ValueError:
        pass
    raise Refusal(f"{text.path} line {start}: ITEM: BOX BOUNDS is {lines}, not numbers; {CUT_REMEDY}")
