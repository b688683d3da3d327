"""A basis on disk: mean, modes and what is known about them."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from pod import Basis
from suffice.refusal import Refusal

KIND = "basis"
ARRAYS = ("mean", "modes", "values", "residuals", "ratio")


def card_of(basis: Basis, made_from: Mapping[str, Any]) -> dict[str, Any]:
    """Return all of a basis but its arrays, in plain types."""
    return {
        **made_from,
        "n_modes": basis.modes.shape[1],
        "n_rows": basis.modes.shape[0],
        "n_lr": basis.n_lr,
        "n_lr_paper": basis.n_lr_paper,
        "total_energy": basis.total_energy,
        "energy_held": float(basis.ratio[-1]) if len(basis.ratio) else 0.0,
        "largest_residual": float(np.max(basis.residuals, initial=0.0)),
        "lanczos_steps": basis.steps,
        "route": basis.route,
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


def write_basis(path: Path, basis: Basis, card: Mapping[str, Any]) -> None:
    """Write a basis beside and rename it.

    Raises Refusal when the file cannot be made.
    """
    part = path.with_name(path.name + ".part")
    try:
        with h5py.File(part, "w") as file:
            file["suffice/kind"] = np.bytes_(KIND.encode())
            file["suffice/card"] = np.bytes_(json.dumps(dict(card)).encode())
            for name in ARRAYS:
                file[name] = getattr(basis, name)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise Refusal(f"output {path} cannot be written ({error}); name a file in a folder that exists") from None


def read_card(path: Path) -> dict[str, Any] | None:
    """Return the card of a basis, or None where the file is no basis."""
    try:
        with h5py.File(path, "r") as file:
            if "suffice/card" not in file:
                return None
            card: dict[str, Any] = json.loads(bytes(file["suffice/card"][()]))
            return card
    except (OSError, ValueError, TypeError):
        return None
