"""A network as a regression that Lightning trains: the module, its data, and the state that is kept."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from math import cos, isfinite, pi
from typing import Any

import torch
from lightning.pytorch import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.loggers import CSVLogger, TensorBoardLogger
from lightning.pytorch.loggers.logger import Logger
from torch import Tensor, nn

from surrogates.training import Samples, Training
from surrogates.training_state import State, read_state, write_state

DIVERGED = 1e4  # times the first training error


class Regression(LightningModule):
    """Mean square error of a network's answers; the only LightningModule there is."""

    def __init__(self, network: nn.Module, settings: Training, state: State | None) -> None:
        super().__init__()
        self.network, self.settings, self.state = network, settings, state

    def loss(self, samples: Samples) -> Tensor:
        """Return the mean square of the misses."""
        inputs, targets = samples
        return nn.functional.mse_loss(self.network(*inputs), targets)

    def training_step(self, samples: Samples, _: int) -> Tensor:
        """One step of the optimiser."""
        loss = self.loss(samples)
        self.log("training", loss, on_step=False, on_epoch=True)
        return loss

    def validation_step(self, samples: Samples, _: int) -> None:
        """Measure the error that decides what is kept."""
        self.log("validation", self.loss(samples))

    def configure_optimizers(self) -> Any:
        """AdamW, its rate on a cosine that goes on where a resumed training stopped."""
        settings, done = self.settings, self.state.steps if self.state else 0
        optimiser = torch.optim.AdamW(
            self.network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
        )
        if self.state:
            self.state.restore_(optimiser, self.network)
        schedule = torch.optim.lr_scheduler.LambdaLR(
            optimiser, lambda k: 0.5 * (1.0 + cos(pi * min((k + done) / settings.steps, 1.0)))
        )
        return {"optimizer": optimiser, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}


class Batches:
    """Batches between two checks, in an order that only seed and check decide; no copy where a batch is everything."""

    def __init__(self, samples: Samples, size: int | None, count: int, seed: int) -> None:
        self._samples, self._count, self._seed = samples, count, seed
        self._size = min(size or len(samples.targets), len(samples.targets))
        self.check = 0

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Samples]:
        total = len(self._samples.targets)
        if self._size == total:
            yield from (self._samples for _ in range(self._count))
            return
        chance = torch.Generator().manual_seed(self._seed * 100_003 + self.check)
        order = torch.empty(0, dtype=torch.int64)
        for _ in range(self._count):
            if len(order) < self._size:
                order = torch.cat([order, torch.randperm(total, generator=chance)])
            yield self._samples.some(order[: self._size])
            order = order[self._size :]


class Snapshots(LightningDataModule):
    """Training and validation samples; the only LightningDataModule there is."""

    def __init__(self, training: Samples, validation: Samples, settings: Training, done: int) -> None:
        super().__init__()
        per_check = max(settings.steps // settings.checks, 1)
        self.batches = Batches(training, settings.batch, per_check, settings.seed)
        self.batches.check, self._validation = done // per_check, Batches(validation, None, 1, settings.seed)

    def train_dataloader(self) -> Batches:
        """Batches of one check."""
        return self.batches

    def val_dataloader(self) -> Batches:
        """All validation samples at once."""
        return self._validation


class Keeper(Callback):
    """Keeps the weights of the least validation error, and stops what diverges or no longer improves."""

    def __init__(self, settings: Training, batches: Batches, state: State | None) -> None:
        self._settings, self._batches, self._before = settings, batches, state.steps if state else 0
        self.steps = self._before
        self.best_step, self.best_error = (state.best_step, state.best_error) if state else (0, float("inf"))
        self.best: dict[str, Tensor] = dict(state.best) if state else {}
        self.diverged_at: int | None = None
        self._first: float | None = None
        self._since_best = 0

    def begin(self, module: Regression, validation: Samples) -> None:
        """Keep the weights as they are born: no training may leave worse ones."""
        module.eval()
        with torch.no_grad():
            error = float(module.loss(validation)) ** 0.5
        if isfinite(error):
            self.best_error = error
        self.best = {name: value.detach().clone() for name, value in module.state_dict().items()}
        module.train()

    def on_train_batch_end(self, trainer: Trainer, _module: LightningModule, outputs: Any, *_: Any) -> None:
        """Look at the training error of every step."""
        loss = float(outputs["loss"])
        self._first = loss if self._first is None and isfinite(loss) else self._first
        self.steps += 1
        if not isfinite(loss) or (self._first and loss > DIVERGED**2 * max(self._first, 1e-12)):
            self.diverged_at, trainer.should_stop = self.steps, True

    def on_validation_end(self, trainer: Trainer, module: LightningModule) -> None:
        """Keep the weights if they are the best ones, write the state, and say how far it is."""
        if trainer.sanity_checking or self.diverged_at is not None:
            return
        error = float(trainer.callback_metrics["validation"]) ** 0.5
        if error < self.best_error:
            self.best_step, self.best_error, self._since_best = self.steps, error, 0
            self.best = {name: value.detach().cpu().clone() for name, value in module.state_dict().items()}
        else:
            self._since_best += 1
        self._batches.check += 1
        patience = self._settings.patience
        if patience is not None and self._since_best >= patience:
            trainer.should_stop = True
        if self._settings.folder is not None:
            state = State.of(self.steps, self.best_step, self.best_error, module, trainer.optimizers[0], self.best)
            write_state(self._settings.folder, state)
        if self._settings.report:
            self._settings.report(min(self.steps, self._settings.steps), self._settings.steps)

    def reason(self, settings: Training) -> str:
        """Say in words why the training stopped."""
        if self.diverged_at is not None:
            return (
                f"the error grew without bound at step {self.diverged_at}, the weights of step {self.best_step} are "
                f"kept; a smaller learning_rate than {settings.learning_rate:g} helps"
            )
        if settings.patience is not None and self._since_best >= settings.patience:
            since = f"since step {self.best_step}" if self.best_step else "on the untrained network"
            return f"no improvement {since}"
        if self.steps < settings.steps - settings.steps % max(settings.steps // settings.checks, 1):
            return f"max_seconds of {settings.max_seconds:g} s were over" if settings.max_seconds else "interrupted"
        return "all steps done"


def fit_network(network: nn.Module, training: Samples, validation: Samples, settings: Training) -> Keeper:
    """Train a network by Lightning and load the best weights into it; returns what was kept."""
    state = read_state(settings.folder) if settings.resume and settings.folder else None
    module = Regression(network, settings, state)
    data = Snapshots(training, validation, settings, state.steps if state else 0)
    keeper = Keeper(settings, data.batches, state)
    if state is None:
        keeper.begin(module, validation)
    left = settings.steps // len(data.batches) - keeper.steps // len(data.batches)
    if left > 0:
        with _silent():
            _trainer(settings, keeper, left).fit(module, datamodule=data)
    module.cpu()
    if keeper.best:
        module.load_state_dict(keeper.best)
    network.eval()
    return keeper


def _trainer(settings: Training, keeper: Keeper, epochs: int) -> Trainer:
    return Trainer(
        max_epochs=epochs,
        max_time=None if settings.max_seconds is None else timedelta(seconds=settings.max_seconds),
        callbacks=[keeper],
        logger=_loggers(settings),
        accelerator="auto",
        devices=1,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        log_every_n_steps=1,
        gradient_clip_val=1.0,
        default_root_dir=settings.folder,
    )


def _loggers(settings: Training) -> list[Logger]:
    """Return what writes a table of errors into the folder, and TensorBoard's files where that is installed."""
    if settings.folder is None:
        return []
    found: list[Logger] = [CSVLogger(str(settings.folder), name="log", version="")]
    with suppress(ModuleNotFoundError):
        found.append(TensorBoardLogger(str(settings.folder), name="tensorboard", version=""))
    return found


@contextmanager
def _silent() -> Iterator[None]:
    """Keep Lightning from telling what hardware it has found: whoever trains ten small networks has heard it."""
    logger = logging.getLogger("lightning.pytorch")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # advice about workers and logging, which fits other data
            yield
    finally:
        logger.setLevel(level)
