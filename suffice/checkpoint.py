"""The state of an interrupted simulation on disk, beside its run."""

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from suffice.door import disk_words
from suffice.hdf5_memory import names_in, open_hdf5
from suffice.layout import hard_node
from suffice.refusal import Refusal


def checkpoint_path(run: Path) -> Path:
    """Return where the state of a run is kept while it is not finished."""
    return run.with_name(run.name + ".checkpoint")


def remove_checkpoint(run: Path) -> None:
    """Remove the state of a run that is finished or made anew, and what a killed program left of one."""
    path = checkpoint_path(run)
    for file in (path, _part(path)):
        file.unlink(missing_ok=True)


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def write_checkpoint(run: Path, state: dict[str, NDArray[Any]]) -> None:
    """Write the state beside and rename it, so that a complete one always stands.

    Raises OSError where it cannot be written.
    """
    path = checkpoint_path(run)
    part = _part(path)
    try:
        with h5py.File(part, "w", locking=False) as file:
            for name, values in state.items():
                file[name] = values
            file.flush()
            os.fsync(file.id.get_vfd_handle())
        part.replace(path)
    except (OSError, RuntimeError) as error:  # HDF5's two names for a disk that is full
        part.unlink(missing_ok=True)
        raise OSError(
            f"checkpoint {path} cannot be written ({disk_words(error)}); {run} keeps its snapshots: make room, "
            "then go on with --resume"
        ) from None


def read_checkpoint(run: Path) -> dict[str, NDArray[Any]] | None:
    """Return the state, or None where there is none.

    Raises Refusal when the file is damaged, leads elsewhere or declares more than it holds.
    """
    path = checkpoint_path(run)
    if not path.exists():
        return None
    if not path.is_file():
        raise Refusal(f"checkpoint {path} is no file; remove it and start the run anew")
    try:
        with open_hdf5(path, locking=False) as file:
            return {name: np.asarray(hard_node(file, name)[()]) for name in names_in(file)}
    except Refusal:
        raise
    except (OSError, RuntimeError, LookupError, TypeError, ValueError) as error:
        raise Refusal(f"checkpoint {path} cannot be read ({error}); remove it and start the run anew") from None
