"""A basis on disk: mean, modes and what is known about them."""

import json
import os
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pod import ALONE, Basis, Ranks
from suffice.door import disk_words
from suffice.hdf5_memory import open_hdf5
from suffice.layout import hard_node
from suffice.refusal import Refusal

KIND = "basis"
ARRAYS = ("mean", "modes", "values", "residuals", "ratio", "tridiagonal")
DAMAGE = (OSError, RuntimeError, LookupError, ValueError, TypeError)  # what HDF5 and JSON raise on broken content
ROOM = 1 << 14  # bytes, for what HDF5 keeps about its datasets: 5 kB in a basis
SHARED = ("mean", "modes", "weights")  # of which each process that shares the rows has its own


def card_of(basis: Basis, made_from: Mapping[str, Any]) -> dict[str, Any]:
    """Return all of a basis but its arrays, in plain types."""
    return {
        **made_from,
        "n_modes": basis.modes.shape[1],
        "n_lr": basis.n_lr,
        "n_lr_paper": basis.n_lr_paper,
        "n_lr_ritz": basis.n_lr_ritz,
        "total_energy": basis.total_energy,
        "energy_held": float(basis.ratio[-1]) if len(basis.ratio) else 0.0,
        "largest_residual": float(np.max(basis.residuals, initial=0.0)),
        "orthogonality": basis.orthogonality,
        "lanczos_steps": basis.steps,
        "route": basis.route,
        "route_reason": basis.route_reason,
        "reason": basis.reason,
    }


def check_place(path: Path) -> None:
    """Refuse an output that is a folder, or that another file than a basis stands at: it might be the run itself."""
    if path.is_dir():
        raise Refusal(f"output {path} is a folder; name a file, for example {path / 'basis.h5'}")
    if path.exists() and read_card(path) is None:
        raise Refusal(f"output {path} exists and is not a basis; choose another name or remove it")
    if not path.parent.is_dir():
        raise Refusal(f"output {path}: there is no folder {path.parent}; make it first")


def write_basis(
    path: Path, basis: Basis, card: Mapping[str, Any], ranks: Ranks = ALONE, gram: NDArray[np.float64] | None = None
) -> None:
    """Write a basis beside and rename it, and with it inner products (N_t, N_t) to which snapshots may be appended.

    Of several processes all call this, and the first one writes, also the rows of the others as they arrive. Raises
    Refusal when the file cannot be made.
    """
    if ranks.rank > 0:
        for name in SHARED:
            if getattr(basis, name) is not None:
                list(ranks.pieces(getattr(basis, name)))
        return
    part = path.with_name(path.name + ".part")
    try:
        _find_room(part, basis, card, gram)
        with h5py.File(part, "w") as file:
            file["suffice/kind"] = np.bytes_(KIND.encode())
            file["suffice/card"] = np.bytes_(json.dumps(dict(card)).encode())
            for name in ARRAYS:
                if name not in SHARED:
                    file[name] = getattr(basis, name)
            for name in SHARED:
                if getattr(basis, name) is not None:
                    _write_pieces(file, name, ranks.pieces(getattr(basis, name)), card["n_rows"])
            if gram is not None:
                file["gram"] = gram
        part.replace(path)
    except (OSError, RuntimeError) as error:  # HDF5's two names for a disk that is full
        part.unlink(missing_ok=True)
        raise Refusal(
            f"output {path} cannot be written ({disk_words(error)}); name a file in a folder that exists"
        ) from None


def _find_room(part: Path, basis: Basis, card: Mapping[str, Any], gram: NDArray[np.float64] | None) -> None:
    """Raise OSError where the disk has no room for a basis: HDF5 can crash when it closes a file it could not write."""
    shared = [array for name in SHARED if (array := getattr(basis, name)) is not None]
    rows = sum(array.itemsize * int(np.prod(array.shape[1:])) for array in shared)
    own = sum(getattr(basis, name).nbytes for name in ARRAYS if name not in SHARED)
    with part.open("wb") as file:
        size = card["n_rows"] * rows + own + (0 if gram is None else gram.nbytes) + len(json.dumps(dict(card)))
        os.posix_fallocate(file.fileno(), 0, size + ROOM)


def _write_pieces(file: h5py.File, name: str, pieces: Iterator[NDArray[np.float64]], rows: int) -> None:
    first = next(pieces)
    stored = file.create_dataset(name, (rows, *first.shape[1:]), first.dtype)
    begin = 0
    for piece in chain([first], pieces):
        stored[begin : begin + len(piece)] = piece
        begin += len(piece)


def read_gram(path: Path) -> NDArray[np.float64] | None:
    """Return the inner products (N_t, N_t) that stand in a basis, None where there is no file or none in it.

    Raises Refusal where they are no square of finite numbers, or lie outside the file.
    """
    if not path.exists():
        return None
    try:
        with open_hdf5(path) as file:
            node = hard_node(file, "gram")
            if node is None:
                return None
            gram = np.asarray(node[()], dtype=np.float64)
    except DAMAGE as error:
        raise _damaged(path, error) from None
    if gram.ndim != 2 or gram.shape[0] != gram.shape[1] or not np.isfinite(gram).all():
        raise _damaged(path, f"its inner products, {gram.shape}, are no square of finite numbers")
    return gram


def read_card(path: Path) -> dict[str, Any] | None:
    """Return the card of a basis, or None where the file is no basis.

    Raises Refusal where the card cannot be read, or lies outside the file.
    """
    if not path.is_file():  # a pipe has no end
        return None
    try:
        with open_hdf5(path) as file:
            node = hard_node(file, "suffice/card")
            if node is None:
                return None
            card: Any = json.loads(bytes(node[()]))
            json.dumps(card, ensure_ascii=False).encode()  # half a character could not be shown
    except OSError:  # no HDF5
        return None
    except DAMAGE as error:
        raise _damaged(path, error) from None
    if not isinstance(card, dict):
        raise _damaged(path, "its card is no object of JSON")
    return card


def _damaged(path: Path, why: object) -> Refusal:
    return why if isinstance(why, Refusal) else Refusal(f"{path}: the basis is damaged ({why}); make it again")
