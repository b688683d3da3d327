"""A combined model on disk: ordinary models in a folder, one for each variable, and a card that lists them."""

import json
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from suffice.model import CARD, VERSION, Model, check_model_place, load_model, read_card
from suffice.quantities import QUANTITIES, component_names, velocity_of
from suffice.refusal import Refusal

KIND = "combined"
PLAN = "plan.json"  # what a training was asked for, until it is done
TOLD = (  # of each part
    "interval", "n_snapshots", "n_modes", "n_lr", "n_c", "unit", "rmse", "rmse_diameters", "projection_rmse",
    "storage_bytes", "window",
)  # fmt: skip
WORDS = {"unit", "of"}
VARIABLES = (*QUANTITIES, *component_names(QUANTITIES))


def read_combined_card(folder: Path) -> dict[str, Any] | None:
    """Return the card of a combined model, None where the folder holds none or another kind of card."""
    card = read_card(folder / CARD)
    return card if card is not None and card.get("kind") == KIND else None


def read_told_card(folder: Path) -> dict[str, Any] | None:
    """Return the card of a combined model to be shown, None where the folder holds none.

    Raises Refusal for a card that does not tell of every part what a training tells.
    """
    card = read_combined_card(folder)
    if card is None:
        return None
    for field, told in (("parts", TOLD), ("derived", ("of", "unit", "rmse"))):
        entries = card.get(field)
        if not isinstance(entries, dict) or not all(tells(entry, told) for entry in entries.values()):
            raise Refusal(f"{folder / CARD}: {field} does not tell what a training tells; train the model again")
    if not isinstance(card.get("limits"), dict):
        raise Refusal(f"{folder / CARD}: limits is no table; train the model again")
    return card


def tells(card: Any, names: Collection[str]) -> bool:
    """Tell whether a card, or a part of one, has all these names: words, a window of two numbers, else numbers."""
    if not isinstance(card, dict) or not set(names) <= set(card):
        return False
    window = card["window"] if "window" in names else [0.0, 0.0]
    return (
        all(isinstance(card[name], str) for name in WORDS & set(names))
        and all(_is_number(card[name], or_none=name != "storage_bytes") for name in set(names) - WORDS - {"window"})
        and isinstance(window, list)
        and [_is_number(time) for time in window] == [True, True]
    )


def _is_number(value: Any, *, or_none: bool = False) -> bool:
    return (isinstance(value, int | float) and not isinstance(value, bool)) or (or_none and value is None)


def load_models(folder: Path) -> list[Model]:
    """Read an ordinary model, or all that a combined model answers: parts, and velocities derived from them.

    Only folders inside it that bear the name of a variable are opened. Raises Refusal where one is missing or does not
    fit.
    """
    card = read_combined_card(folder)
    if card is None:
        return [load_model(folder)]
    if card.get("version") != VERSION:
        raise Refusal(f"{folder}: model of version {card.get('version')}, this program reads {VERSION}; train it again")
    names, derived = _listed(folder, card)
    parts = {name: _part(folder, name) for name in names}
    moving = []
    for velocity, position in derived.items():
        if position not in parts or velocity != velocity_of(position) or velocity in parts:
            raise Refusal(
                f"{folder}: {velocity!r} is not the derivative of a part; the card is damaged, train it again"
            )
        if not parts[position].surrogate.differentiable:
            raise Refusal(f"{folder}: {position} has no derivative in closed form; the card is damaged, train it again")
        moving.append(parts[position]._replace(moving=True))
    return [*parts.values(), *moving]


def _listed(folder: Path, card: Mapping[str, Any]) -> tuple[list[str], dict[str, str]]:
    """Names of the parts, and of the velocities derived from them, each that of a variable."""
    parts, derived = card.get("parts"), card.get("derived")
    if not isinstance(parts, dict) or not parts or not isinstance(derived, dict):
        raise Refusal(f"{folder}: the card lists no parts; it is damaged, train the model again")
    origins = {name: told.get("of") if isinstance(told, dict) else None for name, told in derived.items()}
    for name in (*parts, *origins, *origins.values()):
        if name not in VARIABLES:
            raise Refusal(f"{folder}: part {name!r} is not a variable; the card is damaged, train the model again")
    return list(parts), {name: str(origin) for name, origin in origins.items()}


def _part(folder: Path, name: str) -> Model:
    """Load one part, from the folder of its own name and no other."""
    place = folder / name
    if place.is_symlink() or not place.is_dir():
        raise Refusal(f"{folder}: part {name} is missing; train the model again, with --resume what is there is kept")
    model = load_model(place)
    if model.variable != name:
        raise Refusal(f"{place}: holds a model of {model.variable}, not of {name}; train the model again")
    return model


def check_combined_place(folder: Path) -> None:
    """Refuse an output that is a file, or a folder that holds other things than a model or a part of one."""
    if not any((folder / name).exists() for name in (PLAN, f"{PLAN}.part")):
        check_model_place(folder)


def check_plan(folder: Path, asked: Mapping[str, Any]) -> None:
    """Refuse to resume a training that was asked for something else, naming what differs."""
    begun = read_card(folder / PLAN) or (read_combined_card(folder) or {}).get("asked")
    if not isinstance(begun, dict):
        raise Refusal(f"--resume: no training stands in {folder}; leave it out")
    for field, value in asked.items():
        if begun.get(field) != value:
            raise Refusal(
                f"--resume: {field} is {_told(value)}, the training in {folder} was begun with "
                f"{_told(begun.get(field))}; give the same, or start it anew without --resume"
            )


def _told(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else "none" if value is None else str(value)


def begin(folder: Path, asked: Mapping[str, Any], parts: list[str]) -> None:
    """Write what is asked for, and forget what stood there under the same names.

    The plan stands beside before anything is forgotten, and under its name only then: a kill in between leaves a
    folder that is known as ours, and nothing to resume.
    """
    try:
        folder.mkdir(exist_ok=True)
        part = _beside(folder / PLAN, asked)
        for card in (folder / CARD, *(folder / name / CARD for name in parts)):
            card.unlink(missing_ok=True)
        os.replace(part, folder / PLAN)
    except OSError as error:
        raise Refusal(f"output {folder} cannot be written ({error}); name a folder you may write to") from None


def finish(folder: Path, card: Mapping[str, Any]) -> None:
    """Write the card, last of all: without it there is no model."""
    os.replace(_beside(folder / CARD, {**card, "kind": KIND, "version": VERSION}), folder / CARD)
    for plan in (folder / PLAN, folder / f"{PLAN}.part"):
        plan.unlink(missing_ok=True)


def _beside(path: Path, content: Mapping[str, Any]) -> Path:
    """Write JSON beside a file, ready to be renamed."""
    part = path.with_name(f"{path.name}.part")
    part.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return part
