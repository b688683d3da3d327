"""Broken and hostile files, made from good ones by a seeded generator: scenes, studies, dumps, runs, bases, models."""

import gzip
import json
import lzma
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

Rng = np.random.Generator

WORDS = (
    "nan", "inf", "-inf", "0", "-1", "1e300", "-1e300", "1e-300", "1000000000", "9" * 30, "9" * 5000, "1e9", "0.5",
    "2", "true", "[]", "{}", '""', '"../../outside"', '"/etc/passwd"', "[1.0, 2.0]", "[" * 3000,
    "[" * 3000 + "]" * 3000,
    "'''", "\\u0000", "\x00", "\x1b[2J", "\ud800", "é" * 200, "=", "#", "[[walls]]", "1979-05-27T07:32:00Z",
)  # fmt: skip
NUMBERS = (
    "nan", "inf", "-inf", "0", "-1", "1e300", "-1e300", "1e-300", "1000000000", "99999999999999999999", "1e9", "1e-9",
    "0.5", "2", "1e-3", "1e3", "100", "true", "[]", '""', "0.0", "1.0", "1e20", "9223372036854775807",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1, 2**62, 10**30, 1e300, -1e300, 1e-300, float("nan"), float("inf"), "", "../../outside",
    "/etc/passwd", "nan", "x" * 10000, [], [[]], {}, {"a": 1}, [1, 2, 3, 4], [[1], [2]], "\x00", "\ud800",
)  # fmt: skip


def one_of(rng: Rng, choices: Any) -> Any:
    """Choose one of a sequence, which numpy must not turn into an array."""
    return choices[int(rng.integers(len(choices)))]


def mutated_text(rng: Rng, text: bytes) -> bytes:
    """Change a text once: a word, a line, some bytes, or its end."""
    lines = text.split(b"\n")
    k, other = int(rng.integers(len(lines))), int(rng.integers(len(lines)))
    what = rng.integers(8)
    if what <= 2 and lines[k].split():
        words = lines[k].split(b" ")
        words[int(rng.integers(len(words)))] = one_of(rng, WORDS).encode("utf-8", "surrogatepass")
        lines[k] = b" ".join(words)
    elif what == 3:
        del lines[k]
    elif what == 4:
        lines.insert(k, lines[other])
    elif what == 5:
        lines[k], lines[other] = lines[other], lines[k]
    elif what == 6:
        return text[: int(rng.integers(len(text)))]
    else:
        return mutated_bytes(rng, text)
    return b"\n".join(lines)


def mutated_bytes(rng: Rng, content: bytes, most: int | None = None) -> bytes:
    """Change, insert or remove some bytes, among the first `most`."""
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(min(len(out), most or len(out)) or 1))
        what, noise = rng.integers(4), rng.bytes(int(rng.integers(1, 9)))
        if what == 0:
            out[at : at + len(noise)] = noise
        elif what == 1:
            out[at : at + 8] = one_of(rng, (b"\xff" * 8, b"\0" * 8, struct.pack("<Q", 10**12), b"\x7f" + b"\xff" * 7))
        elif what == 2:
            out[at:at] = noise
        else:
            del out[at : at + len(noise)]
    return bytes(out)


def mutate_file(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Replace the content of a file."""
    path.write_bytes(change(path.read_bytes()))


def _other_number(rng: Rng, text: bytes) -> bytes:
    """Replace one number of a TOML text by another, so that it stays TOML."""
    found = one_of(rng, list(re.finditer(rb"(?<![\w.])-?\d[\d.e-]*(?![\w.])", text)))
    return text[: found.start()] + one_of(rng, NUMBERS).encode() + text[found.end() :]


def mutate_toml(rng: Rng, path: Path) -> None:
    """Change a TOML file at one to three places, or one or two of its numbers."""
    if rng.integers(2):
        for _ in range(int(rng.integers(1, 3))):
            mutate_file(path, lambda text: _other_number(rng, text))
        return
    for _ in range(int(rng.integers(1, 4))):
        mutate_file(path, lambda text: mutated_text(rng, text) or b"\n")


def mutate_dump(rng: Rng, path: Path) -> None:
    """Change a dump at one place, or pack it and break the archive."""
    if rng.integers(4):
        mutate_file(path, lambda text: mutated_text(rng, text) or b"\n")
    else:
        pack = one_of(rng, (gzip.compress, lzma.compress))
        mutate_file(path, lambda text: mutated_bytes(rng, pack(text)))


def mutate_hdf5(rng: Rng, path: Path) -> None:
    """Change an HDF5 file: bytes, most of them of its structure, or one of its nodes by another that is none."""
    what = rng.integers(20)
    if what < 4:
        mutate_file(path, lambda content: mutated_bytes(rng, content))
    elif what < 8:
        mutate_file(path, lambda content: mutated_bytes(rng, content, 12000))
    elif what < 10:
        mutate_file(path, lambda content: content[: int(rng.integers(len(content)))])
    elif what < 11:
        mutate_file(path, lambda content: _with_circles(rng, content))
    else:
        with h5py.File(path, "r+") as file:
            _change_node(rng, file)


def _with_circles(rng: Rng, content: bytes) -> bytes:
    """Let the first free place of a group's heap be followed by itself; of every second heap."""
    changed = bytearray(content)
    for found in re.finditer(b"HEAP.{28}", content, re.DOTALL):
        _, free, data = struct.unpack("<QQQ", found[0][8:])
        if rng.integers(2) and data + free + 8 <= len(content):  # 1, for no free place, leads to a broken list
            struct.pack_into("<Q", changed, data + free, free)
    return bytes(changed)


class Spot(NamedTuple):
    """Where a node stood in an HDF5 file, and what it held."""

    file: Any
    name: str
    old: Any
    shape: tuple[int, ...]


def _change_node(rng: Rng, file: Any) -> None:
    names: list[str] = []
    file.visit(names.append)
    name = one_of(rng, names)
    node = file[name]
    old = node[()] if isinstance(node, h5py.Dataset) else np.zeros(3)
    del file[name]
    one_of(rng, NODES)(rng, Spot(file, name, old, np.shape(old)))


def _of_other_numbers(rng: Rng, at: Spot) -> None:
    values = np.array(at.old)
    if values.dtype.kind in "fiu":
        flat = values.reshape(-1)
        with np.errstate(all="ignore"):
            odd = one_of(rng, (np.nan, np.inf, -1, 0, 1e300, 2**62, -(2**62), 99))
            flat[int(rng.integers(max(flat.size, 1))) % max(flat.size, 1) :][:1] = np.asarray(odd).astype(values.dtype)
    at.file[at.name] = values


def _huge(rng: Rng, at: Spot) -> None:
    more = tuple(10**12 if k == 0 else n for k, n in enumerate(at.shape or (1,)))
    chunks = (4096, *more[1:]) if rng.integers(2) else None
    at.file.create_dataset(at.name, more, np.asarray(at.old).dtype, chunks=chunks)


def _large(_rng: Rng, at: Spot) -> None:
    more = tuple(3 * 10**9 if k == 0 else n for k, n in enumerate(at.shape or (1,)))
    at.file.create_dataset(at.name, more, np.asarray(at.old).dtype, chunks=(2**20, *more[1:]), compression="gzip")


def _of_other_shape(rng: Rng, at: Spot) -> None:
    values = np.asarray(at.old)
    at.file[at.name] = one_of(
        rng, (values.reshape(-1), values.reshape(1, *at.shape), values.reshape(-1)[:0], values[..., None])
    )


def _of_other_type(rng: Rng, at: Spot) -> None:
    at.file[at.name] = one_of(
        rng,
        (np.zeros(at.shape, np.complex64), np.zeros(at.shape, bool), np.zeros(at.shape, np.uint8), "text", ["a"], 1.5,
         np.zeros(at.shape, [("a", "i4"), ("b", "f8")]), h5py.Empty("f8"), np.zeros(at.shape, np.float16)),
    )  # fmt: skip


def _text(rng: Rng, at: Spot) -> None:
    texts = (b"{", b"\xff\xfe", b"[" * 100000, b"[]", b"null", b'{"a": NaN}', b"1e999", b'{"n_snapshots": "x"}', b"{}")
    at.file[at.name] = np.bytes_(one_of(rng, texts))


def _link(rng: Rng, at: Spot) -> None:
    at.file[at.name] = one_of(
        rng,
        (h5py.SoftLink("/nothing"), h5py.SoftLink(f"/{at.name}"), h5py.SoftLink("/"),
         h5py.ExternalLink("/etc/passwd", "x"), h5py.ExternalLink("secret.h5", at.name)),
    )  # fmt: skip


def _virtual(_rng: Rng, at: Spot) -> None:
    layout = h5py.VirtualLayout(at.shape or (1,), np.float64)
    layout[...] = h5py.VirtualSource("secret.h5", at.name, at.shape or (1,))
    at.file.create_virtual_dataset(at.name, layout)


def _outside(_rng: Rng, at: Spot) -> None:
    at.file.create_dataset(at.name, at.shape or (1,), np.float32, external=[("secret.h5", 0, h5py.h5f.UNLIMITED)])


def _group(_rng: Rng, at: Spot) -> None:
    at.file.create_group(at.name)["x"] = 1.0


def _gone(_rng: Rng, _at: Spot) -> None:
    """Leave it out."""


NODES = (
    _of_other_numbers, _of_other_numbers, _huge, _large, _of_other_shape, _of_other_type, _text, _link, _virtual,
    _outside, _group, _gone,
)  # fmt: skip


def mutate_model(rng: Rng, folder: Path) -> None:
    """Change the card or the arrays of a model: bytes, values, headers, or a link in their place."""
    card, arrays = folder / "model.json", folder / "model.safetensors"
    what = rng.integers(7)
    if what == 0:
        mutate_file(card, lambda text: mutated_text(rng, text))
    elif what <= 3:
        mutate_file(card, lambda text: mutated_json(rng, text))
    elif what == 4:
        mutate_file(arrays, lambda content: mutated_bytes(rng, content, 2000 if rng.integers(2) else None))
    elif what == 5:
        mutate_file(arrays, lambda content: mutated_header(rng, content))
    else:
        place = one_of(rng, (card, arrays))
        place.unlink()
        place.symlink_to(one_of(rng, ("/dev/zero", "/etc/passwd", "/nothing", place.name, "..")))


def mutated_json(rng: Rng, text: bytes) -> bytes:
    """Change one value somewhere in JSON, or a key."""
    tree = json.loads(text)
    if rng.integers(12) == 0:
        return b'{"a":' * 50000
    node, way = tree, 0
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            break
        key = one_of(rng, keys)
        if isinstance(node[key], dict | list) and node[key] and rng.integers(3) and way < 8:
            node, way = node[key], way + 1
            continue
        if isinstance(node, dict) and rng.integers(6) == 0:
            node[f"{key}/../x"] = node.pop(key)
        elif isinstance(node, dict) and rng.integers(6) == 0:
            del node[key]
        else:
            node[key] = one_of(rng, VALUES)
        break
    return json.dumps(tree).encode()


def mutated_header(rng: Rng, content: bytes, change: Callable[[Rng, bytes], bytes] = mutated_json) -> bytes:
    """Change the header of safetensors, which says where each array lies."""
    size = struct.unpack("<Q", content[:8])[0]
    header, body = content[8 : 8 + size], content[8 + size :]
    if rng.integers(4) == 0:
        return struct.pack("<Q", int(one_of(rng, (0, 1, size - 1, size + 1, 10**8, 10**12, 2**63)))) + header + body
    header = change(rng, header)
    return struct.pack("<Q", len(header)) + header + body
