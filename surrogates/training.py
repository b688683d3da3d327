"""Training of every network: what it is shown, how long, and which of its states is kept."""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import torch
from torch import Tensor, nn

from surrogates.errors import InputError


class Samples(NamedTuple):
    """What a network is asked and what it should answer, both scaled to the size of one."""

    inputs: tuple[Tensor, ...]  # (samples, …) each
    targets: Tensor  # (samples, …)

    def some(self, which: Tensor) -> "Samples":
        """Return those of these numbers."""
        return Samples(tuple(part[which] for part in self.inputs), self.targets[which])


class Training(NamedTuple):
    """How a network is trained."""

    steps: int = 2000  # of the optimiser (AdamW)
    learning_rate: float = 3e-3  # at first; it falls to nothing along a cosine
    weight_decay: float = 0.0
    batch: int | None = None  # samples of a step, default all
    checks: int = 40  # times that the validation error is measured on the way
    patience: int | None = 10  # checks without a better one after which it stops; None: it goes on
    max_seconds: float | None = None
    seed: int = 0
    folder: Path | None = None  # for the states and a log; None: nothing is written
    resume: bool = False  # go on from the last state in the folder
    report: Callable[[int, int], None] | None = None  # called with (steps done, all steps)


class Trained(NamedTuple):
    """How a training went; the network has its best weights."""

    steps: int  # done
    best_step: int  # after which the weights that are kept were measured
    error: float  # then, RMS over the validation samples
    seconds: float
    reason: str  # why it stopped
    early: bool  # before it was done: its time was over, or its error grew without bound


def check_training(settings: Training) -> None:
    """Raise InputError for a number of steps, a rate, a time or a seed that no training can have."""
    for name in ("steps", "checks", "batch", "patience"):
        count = getattr(settings, name)
        if count is not None and count < 1:
            raise InputError(f"{name} is {count}; give at least 1")
    for name, number in (("learning_rate", settings.learning_rate), ("max_seconds", settings.max_seconds)):
        if number is not None and not 0.0 < number < float("inf"):
            raise InputError(f"{name} is {number:g}; give a positive number")
    if not 0.0 <= settings.weight_decay < float("inf"):
        raise InputError(f"weight_decay is {settings.weight_decay:g}; give zero or a positive number")
    if not 0 <= settings.seed < 2**32:
        raise InputError(f"seed is {settings.seed}; give a number from 0 to 2³² - 1")
    if settings.resume and settings.folder is None:
        raise InputError("resume is asked for without a folder; name the folder that the training was written to")


def train(network: nn.Module, training: Samples, validation: Samples | None, settings: Training) -> Trained:
    """Minimise the mean square error over the training samples, and keep the weights of the least validation error.

    One AdamW optimiser, its rate on a cosine; without validation samples the training samples are measured. The same
    seed gives the same weights on a CPU, whether it was interrupted and resumed or not. A GPU is used if there is one;
    the network comes back to the CPU. Raises InputError for settings that cannot be, for a state to be resumed that is
    damaged or of another network or other samples, and where the error grows without bound before anything was learnt;
    later on a divergence ends the training, the best weights so far are kept and the reason says so.
    """
    from surrogates.regression import fit_network  # Lightning takes seconds to load

    check_training(settings)
    begin = perf_counter()
    threads, rounded = torch.get_num_threads(), torch.backends.cudnn.allow_tf32
    torch.set_num_threads(1)  # networks of this size are no faster on more, and their sums no longer depend on it
    torch.backends.cudnn.allow_tf32 = False  # recurrent networks would keep ten bits of a number on a GPU
    try:
        with torch.random.fork_rng(devices=range(torch.cuda.device_count())):
            torch.manual_seed(settings.seed)
            kept = fit_network(network, training, validation or training, settings)
    finally:
        torch.set_num_threads(threads)
        torch.backends.cudnn.allow_tf32 = rounded
    if kept.best_step == 0 and kept.diverged_at is not None:
        raise InputError(
            f"learning_rate is {settings.learning_rate:g}: the training error grew without bound by step "
            f"{kept.diverged_at}; give a tenth of it"
        )
    return Trained(
        kept.steps, kept.best_step, kept.best_error, perf_counter() - begin, kept.reason(settings), kept.early(settings)
    )
