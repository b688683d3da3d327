"""A trained surrogate on disk: weights and modes as safetensors, and a card that says what they are."""

import json
import os
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file, save_file

from suffice.door import disk_words
from suffice.quantities import QUANTITIES, Grid, velocity_of, whole_of
from suffice.refusal import Refusal
from surrogates import SURROGATES, InputError, Surrogate

KIND, VERSION = "model", 1
ARRAYS, CARD = "model.safetensors", "model.json"
BEGUN = "training.begun"  # stands from before a training writes anything until its model is whole
FITTED = "surrogate/"  # before the names of a surrogate's own arrays
PARTICLES = ("ids", "radius", "species")


class Model(NamedTuple):
    """A surrogate of one variable, the modes it answers for, and the particles or cells that the rows are."""

    surrogate: Surrogate
    mean: NDArray[np.float64]  # (rows,) unit of the variable
    modes: NDArray[np.float64]  # (rows, n)
    particles: Mapping[str, NDArray[Any]]  # ids, radius (m) and species, (particles,) each
    card: Mapping[str, Any]
    moving: bool = False  # it predicts the velocity of the positions it was trained on

    @property
    def variable(self) -> str:
        """Name of what it predicts, such as `position` or `position.x`."""
        trained = str(self.card["variable"])
        return velocity_of(trained) if self.moving else trained

    @property
    def grid(self) -> Grid | None:
        """Cells of a field of the fluid, None for particles."""
        found = self.card["grid"]
        return None if found is None else Grid(*(tuple(part) for part in found))

    def snapshots(self, times: NDArray[np.float64], *, beyond: bool = False) -> NDArray[np.float64]:
        """Values (times, rows) at times in s. Raises surrogates.InputError outside the window, unless `beyond`."""
        if self.moving:  # the mean position stands still
            return np.asarray(self.surrogate.derivative(times, beyond=beyond) @ self.modes.T)
        coefficients = self.surrogate.predict(times, beyond=beyond)
        return np.asarray(self.mean + coefficients @ self.modes.T)


def check_model_place(folder: Path) -> None:
    """Refuse an output that is a file, or a folder that holds other things than a model."""
    if folder.exists() and not folder.is_dir():
        raise Refusal(f"output {folder} is a file; name a folder for the model")
    ours = any((folder / name).exists() for name in (CARD, BEGUN)) or training_stands(folder)
    half = {ARRAYS, f"{ARRAYS}.part", f"{CARD}.part", ".lock"}  # what a kill before the card comes leaves
    if not ours and folder.is_dir() and any(path.name not in half for path in folder.iterdir()):
        raise Refusal(f"output {folder} holds other things than a model; choose another name or empty it")
    if not folder.parent.is_dir():
        raise Refusal(f"output {folder}: there is no folder {folder.parent}; make it first")


def begin_training(folder: Path) -> None:
    """Mark a folder as one of ours before logs and states come into it: a kill may leave them without a model."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / BEGUN).touch()
    except OSError as error:
        raise _unwritable(folder, error) from None


def training_stands(folder: Path) -> bool:
    """Tell whether a training, perhaps an interrupted one, has left its state in the folder."""
    return any(folder.glob("**/training.safetensors"))


def save_model(folder: Path, model: Model) -> None:
    """Write arrays and card beside and rename them, the card last: without it there is no model.

    A model that stood there goes only when the new one is whole beside it: a disk that is full does not cost it.
    Mean and modes are kept in the precision of the snapshots that they were made of.
    """
    arrays = {"mean": model.mean, "modes": model.modes, **model.particles}
    arrays |= {FITTED + name: array for name, array in model.surrogate.state().items()}
    card = {**model.card, "kind": KIND, "version": VERSION, "versions": _versions()}
    parts = {name: folder / f"{name}.part" for name in (ARRAYS, CARD)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        save_file({name: np.ascontiguousarray(array) for name, array in arrays.items()}, parts[ARRAYS])
        parts[CARD].write_text(json.dumps(card, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        (folder / CARD).unlink(missing_ok=True)  # it does not belong to the new arrays
        for name, part in parts.items():
            os.replace(part, folder / name)
        (folder / BEGUN).unlink(missing_ok=True)
    except (OSError, SafetensorError) as error:  # the latter is its name for a disk that is full
        for part in parts.values():
            part.unlink(missing_ok=True)
        raise _unwritable(folder, error) from None


def _unwritable(folder: Path, error: Exception) -> Refusal:
    return Refusal(f"output {folder} cannot be written ({disk_words(error)}); name a folder you may write to")


def read_model_card(folder: Path) -> dict[str, Any] | None:
    """Return the card of a model, None where the folder holds none or another kind of card."""
    card = read_card(folder / CARD)
    return card if card is not None and card.get("kind") == KIND else None


def read_card(path: Path) -> dict[str, Any] | None:
    """Return an object of JSON, None where the file holds none, or is none: a device has no end."""
    try:
        card: Any = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
        # half a character could not be shown, and a number that is none not be written again
        json.dumps(card, ensure_ascii=False, allow_nan=False).encode()
    except (OSError, ValueError, RecursionError):
        return None
    return card if isinstance(card, dict) else None


def load_model(folder: Path) -> Model:
    """Read a model back; nothing in it is executed. Raises Refusal where anything is missing or does not fit."""
    card = read_model_card(folder)
    if card is None:
        raise Refusal(f"{folder} holds no model; name the folder that `suffice train -o` wrote")
    if card.get("version") != VERSION:
        raise Refusal(f"{folder}: model of version {card.get('version')}, this program reads {VERSION}; train it again")
    member = SURROGATES.get(str(card.get("surrogate")))
    if member is None:
        raise Refusal(f"{folder}: surrogate {card.get('surrogate')!r} is not known here; use a newer suffice")
    if not (folder / ARRAYS).is_file():  # a pipe or a device has no end, and is not left by Ctrl-C
        raise Refusal(f"{folder / ARRAYS} is missing or no file: the model is damaged; train it again")
    try:
        arrays = load_file(folder / ARRAYS)
        fitted = {name.removeprefix(FITTED): array for name, array in arrays.items() if name.startswith(FITTED)}
        surrogate = member.from_state(fitted, card["settings"])
        mean, modes = (np.asarray(arrays[name], dtype=np.float64) for name in ("mean", "modes"))
        model = Model(surrogate, mean, modes, {name: arrays[name] for name in PARTICLES}, card)
        _check_shapes(folder, model)
    except (SafetensorError, OSError, KeyError, ValueError, TypeError, InputError) as error:
        if isinstance(error, Refusal):
            raise
        raise Refusal(f"{folder}: the model is damaged ({error}); train it again") from None
    return model


def _check_shapes(folder: Path, model: Model) -> None:
    """Refuse modes that do not fit the rows, the surrogate or the particles."""
    whole = whole_of(model.variable)
    if whole not in QUANTITIES:
        raise Refusal(f"{folder}: variable {model.variable!r} is not known; train the model again")
    size = 1 if whole != model.variable else QUANTITIES[whole].components
    grid, count = model.grid, len(model.particles["ids"])
    rows = size * (int(np.prod(grid.shape)) if grid is not None else count)
    modes = model.surrogate.predict([model.surrogate.window_[0]]).shape[1]
    if model.mean.shape != (rows,) or model.modes.shape != (rows, modes):
        raise Refusal(
            f"{folder}: modes of shape {model.modes.shape} and mean of {model.mean.shape} for {rows} rows and {modes} "
            "coefficients; the model is damaged, train it again"
        )
    if any(len(model.particles[name]) != count for name in PARTICLES):
        raise Refusal(f"{folder}: ids, radii and species differ in number; the model is damaged, train it again")
    if not all(np.isfinite(part).all() for part in (model.mean, model.modes)):
        raise Refusal(f"{folder}: modes hold a value that is not finite; the model is damaged, train it again")


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("suffice", "torch", "numpy", "scipy")}
