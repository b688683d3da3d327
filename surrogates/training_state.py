"""What a training has reached, on disk: weights, the best ones, and the optimiser's tensors; nothing is executed."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from surrogates.errors import InputError

FILE = "training.safetensors"
DECISIVE = ("steps", "learning_rate", "weight_decay", "batch", "checks", "patience", "seed")
MOMENTS = ("step", "exp_avg", "exp_avg_sq")  # of AdamW


class Facts(NamedTuple):
    """What a training knows about itself besides tensors: without it a resumed one would stop elsewhere."""

    steps: int  # done
    best_step: int
    best_error: float
    since_best: int  # checks without a better one
    first_loss: float  # by which a divergence is told; NaN before the first step


class State(NamedTuple):
    """Where a training stands."""

    facts: Facts
    settings: Mapping[str, float | None]  # by name, that decide every step: a resumed training must have the same
    last: Mapping[str, Tensor]  # weights
    best: Mapping[str, Tensor]
    moments: Mapping[str, Tensor]  # of the optimiser, by number of the parameter and name

    @classmethod
    def of(
        cls,
        facts: Facts,
        settings: Mapping[str, float | None],
        module: nn.Module,
        optimiser: torch.optim.Optimizer,
        best: Mapping[str, Tensor],
    ) -> "State":
        """State of a module in training."""
        held = optimiser.state_dict()["state"]
        moments = {f"{k}.{name}": entry[name].cpu() for k, entry in held.items() for name in MOMENTS if name in entry}
        last = {name: value.detach().cpu() for name, value in module.state_dict().items()}
        return cls(facts, settings, last, best, moments)

    def check_settings(self, wanted: Mapping[str, float | None]) -> None:
        """Raise InputError, naming the first that differs, unless the training was begun with these settings."""
        for name, value in wanted.items():
            if self.settings[name] != value:
                raise InputError(
                    f"{name} is {_told(value)}, the training to be resumed was begun with "
                    f"{_told(self.settings[name])}; give the same, or start it anew"
                )

    def check_fits(self, module: nn.Module) -> None:
        """Raise InputError unless every tensor is one of this module, or of an AdamW of its parameters."""
        weights = {name: value.shape for name, value in module.state_dict().items()}
        moments = {
            f"{k}.{name}": torch.Size() if name == "step" else parameter.shape
            for k, parameter in enumerate(module.parameters())
            for name in MOMENTS
        }
        for held, shapes in ((self.last, weights), (self.best, weights), (self.moments, moments)):
            if {name: value.shape for name, value in held.items()} != shapes:
                raise InputError("the training to be resumed is of another network; start it anew")
            if not all(bool(value.isfinite().all()) for value in held.values()):
                raise InputError("the training to be resumed holds numbers that are not finite; start it anew")

    def restore_(self, optimiser: torch.optim.Optimizer, module: nn.Module) -> None:
        """Give optimiser and module what they had."""
        whole = optimiser.state_dict()
        for key, value in self.moments.items():
            k, _, name = key.partition(".")
            whole["state"].setdefault(int(k), {})[name] = value
        module.load_state_dict(dict(self.last))
        optimiser.load_state_dict(whole)


def _told(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def _number(value: object) -> float | None:
    """Return a number or None. Raises TypeError for anything else."""
    if value is not None and not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return value


def _metadata(state: State) -> dict[str, str]:
    return {"facts": json.dumps(state.facts._asdict()), "settings": json.dumps(dict(state.settings))}


def write_state(folder: Path, state: State) -> None:
    """Write a state beside and rename it."""
    groups = {"last": state.last, "best": state.best, "moments": state.moments}
    tensors = {f"{group}/{name}": t.contiguous().clone() for group, held in groups.items() for name, t in held.items()}
    folder.mkdir(parents=True, exist_ok=True)
    part = folder / f"{FILE}.part"
    save_file(tensors, part, metadata=_metadata(state))
    os.replace(part, folder / FILE)


def read_state(folder: Path) -> State | None:
    """Return the state in a folder, None where there is none. Raises InputError for a damaged one."""
    if not (folder / FILE).exists():
        return None
    if not (folder / FILE).is_file():  # a device or a pipe has no end
        raise InputError(f"{folder / FILE} is no file; remove it and start the training anew")
    groups: dict[str, dict[str, Tensor]] = {"last": {}, "best": {}, "moments": {}}
    try:
        with safe_open(folder / FILE, framework="pt") as file:
            said, settings = (json.loads((file.metadata() or {})[key]) for key in ("facts", "settings"))
            for key in file.keys():  # noqa: SIM118 (not a dict)
                group, _, name = key.partition("/")
                groups[group][name] = file.get_tensor(key)
            facts = Facts(*(kind(said[name]) for name, kind in Facts.__annotations__.items()))
            if not (0 <= facts.best_step <= facts.steps and facts.since_best >= 0):
                raise ValueError(f"its best of {facts.steps} steps is {facts.best_step}")
            return State(facts, {name: _number(settings[name]) for name in DECISIVE}, **groups)
    except (SafetensorError, KeyError, ValueError, TypeError, OSError, OverflowError, RecursionError) as error:
        raise InputError(f"{folder / FILE} is damaged ({error}); remove it and start the training anew") from None
