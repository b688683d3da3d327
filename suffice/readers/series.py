"""Which VTK files a run is made of, in the order of time: named one by one, or by a .pvd, .series, .pvtu or .pvtp."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from suffice.refusal import Refusal

HEAD = 1 << 16  # bytes in which the first element of an XML file must stand
LARGEST_LIST = 64 << 20  # bytes of a list of files
ROOT = re.compile(rb"<VTKFile\b[^>]*?\btype\s*=\s*[\"'](\w+)[\"']")
ASIDE = re.compile(rb"<!--.*?-->|<\?.*?\?>", re.DOTALL)  # comments and instructions
LEGACY = b"# vtk DataFile"
NUMBER = re.compile(r"(\d+)\D*$")
IN_PARTS = {"PPolyData", "PUnstructuredGrid"}  # .pvtp and .pvtu: lists of what each process wrote


class Part(NamedTuple):
    """One file."""

    path: Path
    type: str  # of vtk_program.READERS


class Entry(NamedTuple):
    """One snapshot: a file, or the parts of it that processes wrote."""

    path: Path  # of the file, or of the list of its parts
    parts: tuple[Part, ...]
    time: float | None  # s
    step: int | None  # the number in its name


def type_of(path: Path) -> str | None:
    """Return `legacy`, the type an XML file of VTK declares, or None for anything else.

    Raises `Refusal` for an XML file that declares entities: nothing a program writes needs them.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(LEGACY):
        return "legacy"
    text = ASIDE.sub(b"", head)
    root = ROOT.search(text)
    if root is None:
        return None
    if text[: root.start()].strip(b"\xef\xbb\xbf \t\r\n"):
        raise Refusal(f"{path} declares a document type, which may hold entities; write it again without")
    return root.group(1).decode()


def entries_of(source: Path) -> list[Entry]:
    """Return the snapshots that one source stands for: those a list names, or itself.

    Files that a list names at one time are the parts of one snapshot. Raises `Refusal` where a file is missing, lies
    outside the folder of its list, or is no file of VTK.
    """
    if not source.is_file():
        raise Refusal(f"source {source} is missing or not a file; check its name")
    kind = type_of(source)
    if kind == "Collection":
        return _named(source, _read_pvd(source))
    if kind is None and source.suffix == ".series":
        return _named(source, _read_series(source))
    return [_entry(source, _parts(source), None)]


def _entry(path: Path, parts: Sequence[Part], time: float | None) -> Entry:
    number = NUMBER.search(path.stem)
    return Entry(path, tuple(parts), time, int(number.group(1)[-18:]) if number else None)


def _parts(path: Path, listed: bool = False) -> list[Part]:
    """Return the files that one file stands for; a list of parts may not be `listed` as a part itself.

    A list without parts is what LIGGGHTS writes of no particles.
    """
    if not path.is_file():
        raise Refusal(f"source {path} is missing or not a file; check its name")
    kind = type_of(path)
    if kind in IN_PARTS and not listed:
        return [part for file in _read_parts(path) for part in _parts(_beside(path, file), True)]
    if kind not in ("legacy", "PolyData", "UnstructuredGrid", "ImageData"):
        what = f"a VTK file of type {kind}" if kind else "no file of VTK"
        raise Refusal(
            f"source {path} is {what}; give .vtk, .vtu, .vtp, .pvtu, .pvtp or .vti files, or a .pvd or .series that "
            "lists them"
        )
    return [Part(path, kind)]


def _named(source: Path, named: Sequence[tuple[str, float]]) -> list[Entry]:
    if not named:
        raise Refusal(f"source {source} lists no files; write it again")
    files: dict[float, list[Path]] = {}
    for file, time in named:
        files.setdefault(time, []).append(_beside(source, file))
    return [_entry(paths[0], [part for path in paths for part in _parts(path)], time) for time, paths in files.items()]


def _beside(source: Path, file: str) -> Path:
    if Path(file).is_absolute() or ".." in Path(file).parts:
        raise Refusal(f"source {source} lists {file[:80]!r}, outside its folder; move the files beside it")
    return source.parent / file


def _text(source: Path) -> bytes:
    if source.stat().st_size > LARGEST_LIST:
        raise Refusal(f"source {source} has {source.stat().st_size} bytes, too many for a list of files")
    return source.read_bytes()


def _attributes(source: Path, tag: str) -> list[dict[str, str]]:
    try:
        return [element.attrib for element in ElementTree.fromstring(_text(source)).iter(tag)]
    except ElementTree.ParseError as error:
        raise Refusal(f"source {source} is no whole list of files ({error}); write it again") from None


def _read_pvd(source: Path) -> list[tuple[str, float]]:
    try:
        return [(each["file"], float(each["timestep"])) for each in _attributes(source, "DataSet")]
    except (KeyError, ValueError) as error:
        raise Refusal(f"source {source} is no whole list of files with their times ({error}); write it again") from None


def _read_parts(source: Path) -> list[str]:
    try:
        return [each["Source"] for each in _attributes(source, "Piece")]
    except KeyError as error:
        raise Refusal(f"source {source} has a piece without its {error}; write it again") from None


def _read_series(source: Path) -> list[tuple[str, float]]:
    try:
        return [(str(file["name"]), float(file["time"])) for file in json.loads(_text(source))["files"]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise Refusal(f"source {source} is no whole list of files with their times ({error}); write it again") from None
