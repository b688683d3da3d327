"""Surrogates that are trained: what all networks have in common."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from surrogates.errors import InputError
from surrogates.surrogate import Surrogate
from surrogates.training import Trained, Training, check_training

WEIGHT = "weight."  # before the names of a network's arrays in a saved model


class Network(Surrogate):
    """A surrogate with a network in it: seed and training enter at birth, the same seed gives the same model.

    `width` units of a hidden layer, `steps` of the optimiser, its `learning_rate`; `max_seconds` ends each training
    earlier. `trainings_` says how each training went.
    """

    trainings_: list[Trained]

    def __init__(self, seed: int, width: int, steps: int, learning_rate: float, max_seconds: float | None) -> None:
        self.seed, self.width, self.steps = seed, width, steps
        self.learning_rate, self.max_seconds = learning_rate, max_seconds
        self._folder: Path | None = None
        self._resume = False
        self._report: Callable[[int, int], None] | None = None
        if width < 1:
            raise InputError(f"width is {width}; give at least 1 unit")
        check_training(self._training())

    def watched(
        self, folder: Path | None = None, resume: bool = False, report: Callable[[int, int], None] | None = None
    ) -> None:
        """Write states and a log of the next `fit` to a folder, resume what stands there, report its progress."""
        self._folder, self._resume, self._report = folder, resume, report

    def _training(self, part: str | None = None, **changed: Any) -> Training:
        """Return how to train, with a folder of its own for each part of the surrogate."""
        folder = self._folder if self._folder is None or part is None else self._folder / part
        given = Training(
            steps=self.steps,
            learning_rate=self.learning_rate,
            max_seconds=self.max_seconds,
            seed=self.seed,
            folder=folder,
            resume=self._resume,
            report=self._report,
        )
        return given._replace(**changed)


@contextmanager
def asked() -> Iterator[None]:
    """Answer without gradients and on one thread: waking another takes longer than a small network does."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.no_grad():
            yield
    finally:
        torch.set_num_threads(threads)


def seeded(make: Callable[[], nn.Module], seed: int) -> nn.Module:
    """Return a network whose first weights only the seed decides."""
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(seed)  # torch.manual_seed would also seed the GPUs, for good
        return make()


def zeroed(layer: nn.Linear) -> nn.Linear:
    """Return a layer that answers zero until it is trained."""
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


def single(values: ArrayLike) -> Tensor:
    """Return values as a tensor in single precision."""
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


def weights_of(network: nn.Module, part: str = "") -> dict[str, NDArray[Any]]:
    """Return the arrays of a network by name, ready to be saved."""
    return {f"{WEIGHT}{part}{name}": value.numpy() for name, value in network.state_dict().items()}


def restore_weights_(network: nn.Module, state: Mapping[str, NDArray[Any]], part: str = "") -> None:
    """Give a network what `weights_of` saved. Raises InputError where it does not fit, KeyError where it is missing."""
    for name, value in network.state_dict().items():
        saved = state[f"{WEIGHT}{part}{name}"]
        if saved.shape != tuple(value.shape) or saved.dtype != value.numpy().dtype or not np.isfinite(saved).all():
            raise InputError(
                f"array '{WEIGHT}{part}{name}' of the model does not fit its network or is not finite; the file is "
                "damaged, save it again"
            )
        value.copy_(torch.from_numpy(saved.copy()))
    network.eval()
