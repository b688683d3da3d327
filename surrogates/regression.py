"""A network as a regression that Lightning trains: the module, its data, and the state that is kept."""

import logging
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from math import cos, isfinite, isnan, nan, pi, sqrt
from typing import Any

import torch
from lightning.pytorch import Callback, LightningDataModule, LightningModule, Trainer
from lightning.pytorch.loggers import CSVLogger, TensorBoardLogger
from lightning.pytorch.loggers.logger import Logger
from torch import Tensor, nn

from surrogates.errors import InputError
from surrogates.training import Samples, Training
from surrogates.training_state import DECISIVE, Facts, State, read_state, write_state

DIVERGED = 1e4  # times the first training error
SAME = 0.01, 1e-5  # share and RMS by which the error of resumed weights may differ: rounding, no other samples


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
        settings, done = self.settings, self.state.facts.steps if self.state else 0
        optimiser = torch.optim.AdamW(
            self.network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
        )
        if self.state:
            self.state.restore_(optimiser, self)
        schedule = torch.optim.lr_scheduler.LambdaLR(
            optimiser, lambda k: 0.5 * (1.0 + cos(pi * min((k + done) / settings.steps, 1.0)))
        )
        return {"optimizer": optimiser, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}


class Batches:
    """Batches up to the next check, in an order that only seed and check decide; no copy where one is everything."""

    def __init__(self, samples: Samples, size: int | None, steps: int, per_check: int, seed: int) -> None:
        self._samples, self._steps, self.per_check, self._seed = samples, steps, per_check, seed
        self._size = min(size or len(samples.targets), len(samples.targets))
        self.done = 0  # steps before these batches; a training that was interrupted between two checks goes on there

    def __len__(self) -> int:
        return min(self.per_check - self.done % self.per_check, self._steps - self.done)

    def checks_left(self) -> int:
        """Count the checks still to come; the last one comes after fewer steps if they do not divide."""
        return -(-self._steps // self.per_check) - self.done // self.per_check if self.done < self._steps else 0

    def __iter__(self) -> Iterator[Samples]:
        total, skipped, count = len(self._samples.targets), self.done % self.per_check, len(self)
        if self._size == total:
            yield from (self._samples for _ in range(count))
            return
        chance = torch.Generator().manual_seed(self._seed * 100_003 + self.done // self.per_check)
        order = torch.empty(0, dtype=torch.int64)
        for k in range(skipped + count):
            if len(order) < self._size:
                order = torch.cat([order, torch.randperm(total, generator=chance)])
            if k >= skipped:
                yield self._samples.some(order[: self._size])
            order = order[self._size :]


class Snapshots(LightningDataModule):
    """Training and validation samples; the only LightningDataModule there is."""

    def __init__(self, training: Samples, validation: Samples, settings: Training, done: int) -> None:
        super().__init__()
        per_check = max(settings.steps // settings.checks, 1)
        self.batches = Batches(training, settings.batch, settings.steps, per_check, settings.seed)
        self.batches.done, self._validation = done, Batches(validation, None, 1, 1, settings.seed)

    def train_dataloader(self) -> Batches:
        """Batches up to the next check."""
        return self.batches

    def val_dataloader(self) -> Batches:
        """All validation samples at once."""
        return self._validation


class Keeper(Callback):
    """Keeps the weights of the least validation error, and stops what diverges or no longer improves."""

    def __init__(self, settings: Training, batches: Batches, state: State | None) -> None:
        self._settings, self._batches = settings, batches
        facts = state.facts if state else Facts(0, 0, float("inf"), 0, nan)
        self.steps, self.best_step, self.best_error, self._since_best, self._first_loss = facts
        self.best: dict[str, Tensor] = dict(state.best) if state else {}
        self.diverged_at: int | None = None

    def begin(self, module: Regression, validation: Samples) -> None:
        """Keep the weights as they are born: no training may leave worse ones."""
        error = _measured(module, validation)
        if isfinite(error):
            self.best_error = error
        self.best = {name: value.detach().clone() for name, value in module.state_dict().items()}

    def resume(self, module: Regression, validation: Samples) -> None:
        """Raise InputError unless the weights kept have the error here that they had where they were trained."""
        module.load_state_dict(self.best)
        error, (share, least) = _measured(module, validation), SAME
        if isfinite(self.best_error) and not abs(error - self.best_error) <= share * self.best_error + least:
            raise InputError(
                f"the training to be resumed is of other data: its best weights missed by {self.best_error:.3g} there "
                f"and miss by {error:.3g} here; start it anew"
            )

    @property
    def exhausted(self) -> bool:
        """Whether patience is over."""
        patience = self._settings.patience
        return patience is not None and self._since_best >= patience

    def on_train_batch_end(self, trainer: Trainer, _module: LightningModule, outputs: Any, *_: Any) -> None:
        """Look at the training error of every step."""
        loss = float(outputs["loss"])
        self._first_loss = loss if isnan(self._first_loss) else self._first_loss
        self.steps += 1
        if not isfinite(loss) or loss > DIVERGED**2 * max(self._first_loss, 1e-12):
            self.diverged_at, trainer.should_stop = self.steps, True

    def on_validation_end(self, trainer: Trainer, module: LightningModule) -> None:
        """Keep the weights if they are the best ones, write the state, and say how far it is."""
        if self.diverged_at is not None:
            return
        early = self.steps < self._settings.steps and self.steps % self._batches.per_check != 0
        if early:  # the time was over: what is resumed must not know of a check that no uninterrupted training makes
            self._write(module, trainer)
        error = float(trainer.callback_metrics["validation"]) ** 0.5
        if error < self.best_error:
            self.best_step, self.best_error, self._since_best = self.steps, error, 0
            self.best = {name: value.detach().cpu().clone() for name, value in module.state_dict().items()}
        elif not early:
            self._since_best += 1
        self._batches.done = self.steps
        trainer.should_stop = trainer.should_stop or self.exhausted
        if not early:
            self._write(module, trainer)
        if self._settings.report:
            self._settings.report(self.steps, self._settings.steps)

    def _write(self, module: LightningModule, trainer: Trainer) -> None:
        if self._settings.folder is not None:
            facts = Facts(self.steps, self.best_step, self.best_error, self._since_best, self._first_loss)
            given = _decisive(self._settings)
            write_state(self._settings.folder, State.of(facts, given, module, trainer.optimizers[0], self.best))

    def early(self, settings: Training) -> bool:
        """Tell whether the training stopped before it was done."""
        return self.diverged_at is not None or (self.steps < settings.steps and not self.exhausted)

    def reason(self, settings: Training) -> str:
        """Say in words why the training stopped."""
        if self.diverged_at is not None:
            return (
                f"the error grew without bound at step {self.diverged_at}, the weights of step {self.best_step} are "
                f"kept; a smaller learning_rate than {settings.learning_rate:g} helps"
            )
        if self.exhausted:
            since = f"since step {self.best_step}" if self.best_step else "on the untrained network"
            return f"no improvement {since}"
        if self.steps < settings.steps:
            return f"max_seconds of {settings.max_seconds:g} s were over"
        return "all steps done"


def fit_network(network: nn.Module, training: Samples, validation: Samples, settings: Training) -> Keeper:
    """Train a network by Lightning and load the best weights into it; returns what was kept."""
    state = read_state(settings.folder) if settings.resume and settings.folder else None
    if state is not None:
        state.check_settings(_decisive(settings))
    module = Regression(network, settings, state)
    data = Snapshots(training, validation, settings, state.facts.steps if state else 0)
    keeper = Keeper(settings, data.batches, state)
    if state is None:
        keeper.begin(module, validation)
    else:
        state.check_fits(module)
        keeper.resume(module, validation)
    left = data.batches.checks_left()
    if left > 0 and not keeper.exhausted:
        with _silent(), _interruptible():
            _trainer(settings, keeper, left).fit(module, datamodule=data)
    module.cpu()
    module.load_state_dict(keeper.best)
    network.eval()
    return keeper


def _decisive(settings: Training) -> dict[str, float | None]:
    """Return the settings that decide every step, and so what a resumed training has to have in common."""
    return {name: getattr(settings, name) for name in DECISIVE}


def _measured(module: Regression, samples: Samples) -> float:
    """Root of the loss, outside of any training."""
    module.eval()
    with torch.no_grad():
        loss = float(module.loss(samples))
    module.train()
    return sqrt(loss)


def _trainer(settings: Training, keeper: Keeper, epochs: int) -> Trainer:
    return Trainer(
        max_epochs=epochs,
        reload_dataloaders_every_n_epochs=1,  # the first and the last check may have fewer steps
        max_time=None if settings.max_seconds is None else timedelta(seconds=settings.max_seconds),
        callbacks=[keeper],
        logger=_loggers(settings, keeper.steps),
        accelerator="cuda" if torch.cuda.is_available() else "cpu",  # others lack the double precision of phases
        devices=1,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        log_every_n_steps=1,
        gradient_clip_val=1.0,
        default_root_dir=settings.folder,
    )


def _loggers(settings: Training, done: int) -> list[Logger]:
    """Return what writes a table of errors into the folder, and TensorBoard's files where that is installed."""
    if settings.folder is None:
        return []
    part = f"from_step_{done}" if done else ""  # Lightning would write over the table of what is resumed
    found: list[Logger] = [CSVLogger(str(settings.folder), name="log", version=part)]
    with suppress(ModuleNotFoundError):
        found.append(TensorBoardLogger(str(settings.folder), name="tensorboard", version=part))
    return found


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let Ctrl-C be Ctrl-C: Lightning makes an exit with code 1 of it and is deaf to a second one."""
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    except SystemExit as left:
        if not isinstance(left.__context__, KeyboardInterrupt):
            raise
        signal.signal(signal.SIGINT, handler)
        raise KeyboardInterrupt from None


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
