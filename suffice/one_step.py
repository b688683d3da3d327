"""One step: seconds from a time to the snapshot of all positions, by a reduced order model and by the solver."""

from collections.abc import Callable
from statistics import quantiles
from time import perf_counter
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from suffice.rom import Rom

Array = NDArray[np.float64]
BUFFER = 2**30  # bytes of the snapshots that are reconstructed at once
SINGLES, BATCHES = 31, 7  # repetitions


class Timing(NamedTuple):
    """Seconds of one thing done again and again: median and quartiles."""

    seconds: float
    low: float
    high: float
    repeats: int


class OneStep(NamedTuple):
    """What one snapshot of all positions takes a reduced order model, from its time to the numbers in memory."""

    single: Timing  # s, one snapshot asked for alone
    batch: Timing  # s, of each of `batch_size` asked for at once
    batch_size: int
    regression: Timing  # s, the part of `single` in which coefficients are predicted
    fetch: Timing | None  # s, to copy one snapshot from a GPU to the host; None where it is there already
    n_modes: list[int]  # of each component
    beads: int
    precision: str
    threads: int
    device: str
    bytes_moved: int  # by one snapshot alone: all modes read, the snapshot written
    flops: float  # of one snapshot

    @property
    def seconds(self) -> float:
        """Seconds of one snapshot asked for alone, in the memory of the host."""
        return self.single.seconds + (self.fetch.seconds if self.fetch else 0.0)

    @property
    def batch_seconds(self) -> float:
        """Seconds of each of many, in the memory of the host."""
        return self.batch.seconds + (self.fetch.seconds if self.fetch else 0.0)

    @property
    def bytes_per_second(self) -> float:
        """Rate at which one snapshot alone moves memory: more than a machine can is a sign of a wrong measurement."""
        return self.bytes_moved / self.single.seconds

    @property
    def flops_per_second(self) -> float:
        """Rate of the product in a batch."""
        return self.flops / self.batch.seconds


def rom_speed(
    rom: Rom, *, buffer: int = BUFFER, singles: int = SINGLES, batches: int = BATCHES, seed: int = 0
) -> OneStep:
    """Measure one step of a model: prediction of the coefficients, and reconstruction into memory that is there.

    Single: one snapshot of all components at a time. Batch: as many at once as fit in `buffer` bytes, one product of
    matrices for each component. Every repetition asks for other times, drawn from the window, so that no answer can be
    remembered; one before them is not counted. A GPU is waited for before a clock is read.
    """
    chance, (first, last) = np.random.default_rng(seed), rom.window

    def times(count: int) -> Array:
        return chance.uniform(first, last, count)

    one = rom.empty(1)
    snapshot_bytes = one.numel() * one.element_size()
    size = max(buffer // snapshot_bytes, 1)
    single = timed(lambda: rom.fill_(one, times(1)), singles, rom.device)
    regression = timed(lambda: rom.coefficients(times(1)), singles, rom.device)
    fetch = None
    if rom.device.type != "cpu":
        here = torch.empty(one.shape, dtype=one.dtype, pin_memory=True)
        fetch = timed(lambda: here.copy_(one), singles, rom.device)
    many = rom.empty(size)
    batch = timed(lambda: rom.fill_(many, times(size)), batches, rom.device, size)
    return OneStep(
        single, batch, size, regression, fetch, list(rom.n_modes), rom.beads, "single", torch.get_num_threads(),
        device_name(rom.device), rom.bytes_read + snapshot_bytes,
        sum(2.0 * rom.beads * (1 + n) for n in rom.n_modes),
    )  # fmt: skip


def timed(call: Callable[[], object], repeats: int, device: torch.device, count: int = 1) -> Timing:
    """Time a call that yields `count` things, repeatedly and per thing, once before for nothing."""

    def seconds() -> float:
        _wait(device)
        begin = perf_counter()
        call()
        _wait(device)
        return (perf_counter() - begin) / count

    seconds()
    return timing_of([seconds() for _ in range(repeats)])


def timing_of(seconds: list[float]) -> Timing:
    """Median and quartiles of some seconds."""
    low, middle, high = quantiles(seconds, n=4, method="inclusive") if len(seconds) > 1 else 3 * seconds
    return Timing(middle, low, high, len(seconds))


def _wait(device: torch.device) -> None:
    if device.type == "cuda":
        torch.cuda.synchronize(device)


def device_name(device: torch.device) -> str:
    """Name of the processor: of a GPU that of the model, otherwise `CPU`."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else "CPU"
