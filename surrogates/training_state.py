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
MOMENTS = ("step", "exp_avg", "exp_avg_sq")  # of AdamW


class State(NamedTuple):
    """Where a training stands."""

    steps: int
    best_step: int
    best_error: float
    last: Mapping[str, Tensor]  # weights
    best: Mapping[str, Tensor]
    moments: Mapping[str, Tensor]  # of the optimiser, by number of the parameter and name

    @classmethod
    def of(
        cls,
        steps: int,
        best_step: int,
        best_error: float,
        module: nn.Module,
        optimiser: torch.optim.Optimizer,
        best: Mapping[str, Tensor],
    ) -> "State":
        """State of a module in training."""
        held = optimiser.state_dict()["state"]
        moments = {f"{k}.{name}": entry[name].cpu() for k, entry in held.items() for name in MOMENTS if name in entry}
        last = {name: value.detach().cpu() for name, value in module.state_dict().items()}
        return cls(steps, best_step, best_error, last, best, moments)

    def restore_(self, optimiser: torch.optim.Optimizer, network: nn.Module) -> None:
        """Give optimiser and network what they had."""
        whole = optimiser.state_dict()
        for key, value in self.moments.items():
            k, _, name = key.partition(".")
            whole["state"].setdefault(int(k), {})[name] = value
        try:
            network.load_state_dict({name.removeprefix("network."): value for name, value in self.last.items()})
            optimiser.load_state_dict(whole)
        except (RuntimeError, ValueError) as error:
            raise InputError(f"the training to be resumed is of another network ({error}); start it anew") from None


def write_state(folder: Path, state: State) -> None:
    """Write a state beside and rename it."""
    groups = {"last": state.last, "best": state.best, "moments": state.moments}
    tensors = {f"{group}/{name}": t.contiguous().clone() for group, held in groups.items() for name, t in held.items()}
    facts = {"steps": state.steps, "best_step": state.best_step, "best_error": state.best_error}
    folder.mkdir(parents=True, exist_ok=True)
    part = folder / f"{FILE}.part"
    save_file(tensors, part, metadata={"facts": json.dumps(facts)})
    os.replace(part, folder / FILE)


def read_state(folder: Path) -> State | None:
    """Return the state in a folder, None where there is none. Raises InputError for a damaged one."""
    if not (folder / FILE).exists():
        return None
    groups: dict[str, dict[str, Tensor]] = {"last": {}, "best": {}, "moments": {}}
    try:
        with safe_open(folder / FILE, framework="pt") as file:
            facts = json.loads((file.metadata() or {})["facts"])
            for key in file.keys():  # noqa: SIM118 (not a dict)
                group, _, name = key.partition("/")
                groups[group][name] = file.get_tensor(key)
            return State(int(facts["steps"]), int(facts["best_step"]), float(facts["best_error"]), **groups)
    except (SafetensorError, KeyError, ValueError, TypeError, OSError) as error:
        raise InputError(f"{folder / FILE} is damaged ({error}); remove it and start the training anew") from None
