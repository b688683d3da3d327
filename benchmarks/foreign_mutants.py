"""Broken and hostile files of other programs, made from good ones by a seeded generator: VTK, OpenFOAM, npz."""

import io
import os
import re
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
from mutants import NUMBERS, Rng, mutate_dump, mutate_file, mutate_hdf5, mutated_bytes, mutated_text, one_of

DOCTYPES = (
    b'<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>',
    b'<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]>',
    b'<!DOCTYPE a SYSTEM "http://127.0.0.1:9/a.dtd">',
)
PLACES = (b"/etc/passwd", b"../secret.h5", b"../../../outside", b"secret.h5", b"", b".", b"a\x00b", b"-", b"x" * 5000)
TARGETS = ("/dev/zero", "/etc/passwd", "/nothing", "..", "../secret.h5")
DIRECTIVES = (
    b'#include "/etc/passwd"\n', b'#include "../../secret.h5"\n', b"#calc \"1\";\n", b'#includeEtc "x"\n',
    b'#codeStream { code #{ system("touch outside"); #}; };\n', b"$a; a $a;\n", b'libs ("outside.so");\n', b"{" * 5000,
    b"((((((((", b"9999999999(", b"2147483647 ( 1 2 )", b"4294967296{0}",
)  # fmt: skip


def some_file(rng: Rng, place: Path) -> Path:
    """Choose a file below a folder, or the one that is named."""
    return place if place.is_file() else one_of(rng, sorted(path for path in place.rglob("*") if path.is_file()))


def put_in_place(rng: Rng, path: Path) -> None:
    """Put a link, a pipe that nobody writes to, a folder or nothing in the place of a file."""
    path.unlink()
    what = rng.integers(6)
    if what == 0:
        os.mkfifo(path)
    elif what == 1:
        path.mkdir()
    elif what > 2:
        path.symlink_to(one_of(rng, (*TARGETS, path.name)))


def other_word(rng: Rng, content: bytes) -> bytes:
    """Replace a number of the text in a file by another, or a name, wherever it stands."""
    words = list(re.finditer(rb"(?<![\w.])-?\d[\d.e-]*(?![\w.])|[A-Za-z_]\w{2,}", content[:200000]))
    if not words:
        return content
    found = one_of(rng, words)
    is_number = found[0][:1] in b"-0123456789"
    new = one_of(rng, NUMBERS).encode() if is_number or rng.integers(4) == 0 else one_of(rng, words)[0]
    return content[: found.start()] + new + content[found.end() :]


def mutate_vtk(rng: Rng, place: Path) -> None:
    """Change one VTK file, legacy or XML, or a list of them: its words, its bytes, or what it leads to."""
    path = some_file(rng, place)
    what = rng.integers(9)
    if what <= 2:
        mutate_file(path, lambda content: other_word(rng, content))
    elif what <= 4:
        mutate_file(path, lambda content: mutated_text(rng, content) or b"\n")
    elif what <= 6:
        mutate_file(path, lambda content: mutated_bytes(rng, content, one_of(rng, (None, 2000))))
    elif what == 7 and path.suffix in (".vtu", ".vtp", ".vti", ".pvd"):
        mutate_file(path, lambda content: _hostile_xml(rng, content))
    else:
        put_in_place(rng, path)


def _hostile_xml(rng: Rng, content: bytes) -> bytes:
    """Declare entities, nest without end, or name another file."""
    head, root = content.find(b"<VTKFile"), rng.integers(4)
    if root == 0:
        return content[:head] + one_of(rng, DOCTYPES) + content[head:].replace(b'"0', b'"&c;', 1)
    if root == 1:
        return content[:head] + b"<!--" + b"-" * 70000 + b"-->" + content[head:]
    if root == 2:
        return content.replace(b"<Piece", b"<Piece>" * 100000 + b"<Piece", 1)
    return re.sub(rb'(file|Name|format|encoding|type)="[^"]*"', lambda m: m[1] + b'="' + one_of(rng, PLACES) + b'"',
                  content, count=int(rng.integers(1, 4)))  # fmt: skip


def mutate_vtkhdf(rng: Rng, place: Path) -> None:
    """Change one VTKHDF file."""
    mutate_hdf5(rng, some_file(rng, place))


def mutate_foam(rng: Rng, place: Path) -> None:
    """Change one file of a case of OpenFOAM: its words, its text, directives that lead elsewhere, or what it is."""
    path = some_file(rng, place)
    what = rng.integers(8)
    if what <= 2:
        mutate_file(path, lambda content: other_word(rng, content))
    elif what <= 5:
        mutate_file(path, lambda content: mutated_text(rng, content) or b"\n")
    elif what == 6:
        mutate_file(path, lambda content: _directed(rng, content))
    else:
        put_in_place(rng, path)


def _directed(rng: Rng, content: bytes) -> bytes:
    ends = [match.end() for match in re.finditer(rb"\n", content)] or [0]
    at = one_of(rng, ends)
    return content[:at] + one_of(rng, DIRECTIVES) + content[at:]


def mutate_one_dump(rng: Rng, place: Path) -> None:
    """Change one dump of LIGGGHTS, or put something else in its place."""
    if rng.integers(12):
        mutate_dump(rng, some_file(rng, place))
    else:
        put_in_place(rng, some_file(rng, place))


@cache
def _bomb() -> bytes:
    """Make an .npz that grows a thousandfold: one snapshot of 40 million particles that are all at zero."""
    out = io.BytesIO()
    np.save(out, np.zeros((1, 4 * 10**7, 3), np.float32))
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("position.npy", out.getvalue())
        time = io.BytesIO()
        np.save(time, np.zeros(1))
        archive.writestr("time.npy", time.getvalue())
    return packed.getvalue()


def mutate_npz(rng: Rng, path: Path) -> None:
    """Change the archive, a member of it, the header of an array, or what the members are called."""
    what = rng.integers(12)
    if what <= 2:
        mutate_file(path, lambda content: mutated_bytes(rng, content, one_of(rng, (None, 300))))
    elif what == 3:
        mutate_file(path, lambda content: content[: int(rng.integers(len(content)))])
    elif what == 4 and rng.integers(8) == 0:
        path.write_bytes(_bomb())
    else:
        _repacked(rng, path)


def _repacked(rng: Rng, path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, what = one_of(rng, list(members)), rng.integers(8)
    if what == 0:
        members[one_of(rng, ("../outside.npy", "/outside.npy", "x.txt", ".npy", "é.npy"))] = members.pop(name)
    elif what == 1:
        members[name] = _pickled(rng)
    elif what == 2:
        members[name] = _other_array(rng, members[name])
    elif what == 3:
        del members[name]
    elif what <= 5:
        end = members[name].index(b"\n")
        members[name] = other_word(rng, members[name][:end]) + members[name][end:]
    else:
        members[name] = mutated_bytes(rng, members[name], one_of(rng, (None, 128)))
    with zipfile.ZipFile(path, "w", one_of(rng, (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for other, content in members.items():
            archive.writestr(other, content)


def _pickled(rng: Rng) -> bytes:
    """Return an array of objects, which numpy would unpickle if it were let."""
    out = io.BytesIO()
    np.save(out, np.array([one_of(rng, ({}, [1], "text"))], dtype=object))
    return out.getvalue()


def _other_array(rng: Rng, content: bytes) -> bytes:
    """Return the array in another shape, type or order, or with numbers that are none."""
    array = np.load(io.BytesIO(content))
    odd = array.astype(float).reshape(-1)
    odd[: max(1, odd.size // 7)] = one_of(rng, (np.nan, np.inf, -1.0, 1e300, 0.0))
    choices = (
        odd.reshape(array.shape), array[None], array.reshape(-1), array[:0], array.astype(np.complex64),
        np.asfortranarray(array), array.astype("S8"), array.astype(bool), array.astype(np.uint8), array.astype(">f8"),
    )  # fmt: skip
    out = io.BytesIO()
    np.save(out, one_of(rng, choices))
    return out.getvalue()
