"""A network of time: features whose frequencies and sizes are those of the series, and hidden layers on them."""

from collections.abc import Mapping
from math import pi, sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from torch import Tensor, nn

from surrogates.errors import InputError
from surrogates.network import Network, asked, restore_weights_, seeded, single, weights_of, zeroed
from surrogates.series import Array, Series
from surrogates.surrogate import Kind, saved_table
from surrogates.training import Samples, train

FAINT = 1e-7  # of the largest power: frequencies below it at the end of the spectrum are left out
UNSEEN = 1e-6  # amplitude in units of the series' RMS below which single precision learns nothing
MOST_FREQUENCIES = 512
LEADING = 0.9  # of the power: frequencies that hold it are what the hidden layers see
BATCH = 1024  # samples of a step, and times that are predicted at once
CHECKS = 10  # of the training error, which decides what is kept


class Spectrum(NamedTuple):
    """Frequencies of a series, and how much of it each one is."""

    cycles: NDArray[np.float64]  # (k,) in the window, by halves
    size: NDArray[np.float64]  # (k,) of rms 1


class TimeNetwork(nn.Module):
    """c(x) = A φ(x) + g(φ_lead(x)), φ = (x - 1/2, a_k cos 2πf_k x, a_k sin 2πf_k x), x the share of the window passed.

    g has two hidden layers and sees the leading frequencies alone: steep features would let it oscillate between the
    snapshots. Both begin at zero.
    """

    cycles: Tensor
    size: Tensor

    def __init__(self, frequencies: int, leading: int, modes: int, width: int) -> None:
        super().__init__()
        self.leading = leading
        self.register_buffer("cycles", torch.ones(frequencies, dtype=torch.float64))
        self.register_buffer("size", torch.ones(frequencies))
        self.straight = zeroed(nn.Linear(1 + 2 * frequencies, modes))
        hidden = (nn.Linear(1 + 2 * leading, width), nn.GELU(), nn.Linear(width, width), nn.GELU())
        self.bent = nn.Sequential(*hidden, zeroed(nn.Linear(width, modes)))

    def forward(self, x: Tensor) -> Tensor:
        """Values (b, modes) at x (b, 1) in double precision."""
        phase = 2.0 * torch.pi * x * self.cycles
        features = self.size * torch.cos(phase).float(), self.size * torch.sin(phase).float()
        straight: Tensor = self.straight(self.all_of((x - 0.5).float(), *features))
        bent: Tensor = self.bent(self.leading_of((x - 0.5).float(), *features))
        return straight + bent

    def all_of(self, line: Tensor, cosine: Tensor, sine: Tensor) -> Tensor:
        """Every feature, (b, 1 + 2k)."""
        return torch.cat([line, cosine, sine], dim=1)

    def leading_of(self, line: Tensor, cosine: Tensor, sine: Tensor) -> Tensor:
        """Features of the leading frequencies alone."""
        return torch.cat([line, cosine[:, : self.leading], sine[:, : self.leading]], dim=1)


class WithRates(nn.Module):
    """Values of a network of time beside their change over one interval, (b, 2 modes)."""

    def __init__(self, network: TimeNetwork, interval: float) -> None:
        super().__init__()
        self.network, self.interval = network, interval

    def forward(self, x: Tensor) -> Tensor:
        """Values and d/dx times the interval, carried through the layers side by side."""
        net, pace = self.network, 2.0 * torch.pi * self.interval * self.network.cycles.float()
        phase = 2.0 * torch.pi * x * net.cycles
        cosine, sine = net.size * torch.cos(phase).float(), net.size * torch.sin(phase).float()
        features = (x - 0.5).float(), cosine, sine
        moving = torch.full_like(features[0], self.interval), -pace * sine, pace * cosine
        values = net.straight(net.all_of(*features))
        change = net.all_of(*moving) @ net.straight.weight.T
        h, dh = net.leading_of(*features), net.leading_of(*moving)
        for layer in net.bent:
            if isinstance(layer, nn.Linear):
                h, dh = layer(h), dh @ layer.weight.T
            else:
                h, dh = layer(h), dh * gelu_slope(h)
        return torch.cat([values + h, change + dh], dim=1)


def gelu_slope(h: Tensor) -> Tensor:
    """Return the derivative of GELU, Φ(h) + h Φ'(h) with Φ the normal distribution function."""
    return 0.5 * (1.0 + torch.erf(h / sqrt(2.0))) + h * torch.exp(-0.5 * h * h) / sqrt(2.0 * pi)


class Mlp(Network):
    """Multilayer perceptron of time (the f of paper eq. (30)), trained on the snapshots and, where given, their rates.

    Frequencies and sizes of its features are those of the spectrum of the series, taken over twice the window so that
    its ends need not meet. With rates the loss holds values and Δτ ċ alike, and frequencies reach twice as far. It
    passes near its snapshots, not through them. Outside the window, where its features have learnt nothing, it goes on
    along its tangent.
    """

    name: ClassVar[str] = "mlp"
    kind: ClassVar[Kind] = "time"
    uses_rates: ClassVar[bool] = True

    def __init__(
        self,
        seed: int = 0,
        width: int = 64,
        steps: int = 1000,
        learning_rate: float = 1e-2,
        max_seconds: float | None = None,
    ) -> None:
        super().__init__(seed, width, steps, learning_rate, max_seconds)

    def _fit(self, series: Series) -> None:
        tau, values = np.asarray(series.scaled(series.times)), np.asarray(series.values, dtype=np.float64)
        self.span_ = np.array([series.times[0], series.times[-1]])
        self.mean_ = values.mean(axis=0)
        self.scale_ = float(np.sqrt(np.square(values - self.mean_).mean())) or 1.0
        changes = None if series.rates is None else np.asarray(series.rates) * (series.interval / self.scale_)
        scaled = (values - self.mean_) / self.scale_
        spectrum = spectrum_of(tau, scaled, changes)
        self.network_ = self._made(len(spectrum.cycles), leading(spectrum), values.shape[1])
        self.network_.cycles.copy_(torch.from_numpy(spectrum.cycles))
        self.network_.size.copy_(torch.from_numpy(spectrum.size))
        share = torch.from_numpy(tau / tau[-1])[:, None]
        targets = single(scaled if changes is None else np.hstack([scaled, changes]))
        learner = self.network_ if changes is None else WithRates(self.network_, 1.0 / tau[-1])
        self.trainings_ = [
            train(learner, Samples((share,), targets), None, self._training(batch=BATCH, checks=CHECKS, patience=None))
        ]

    def _made(self, frequencies: int, leads: int, modes: int) -> TimeNetwork:
        network = seeded(lambda: TimeNetwork(frequencies, leads, modes, self.width), self.seed)
        assert isinstance(network, TimeNetwork)
        return network

    def _predict(
        self, times: NDArray[np.float64], _start: Array | None, _parameters: Array | None
    ) -> NDArray[np.float64]:
        share = (times - self.span_[0]) / (self.span_[1] - self.span_[0])
        inside = np.clip(share, 0.0, 1.0)
        predicted = np.empty((len(times), len(self.mean_)))
        with asked():
            for low in range(0, len(times), BATCH):
                some = slice(low, low + BATCH)
                predicted[some] = self.network_(torch.from_numpy(inside[some])[:, None]).numpy()
                if (outside := share[some] - inside[some]).any():
                    both = WithRates(self.network_, 1.0)(torch.from_numpy(inside[some])[:, None]).numpy()
                    predicted[some] += outside[:, None] * both[:, len(self.mean_) :]
        return np.asarray(self.mean_ + self.scale_ * predicted)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        scalers = {"span": self.span_, "mean": self.mean_, "scale": np.array([self.scale_])}
        return {**scalers, "leading": np.array([self.network_.leading]), **weights_of(self.network_)}

    def _restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        self.span_ = saved_table(state, "span", (2,))
        self.mean_ = saved_table(state, "mean", (np.size(state["mean"]),))
        self.scale_ = float(saved_table(state, "scale", (1,))[0])
        frequencies = saved_table(state, "weight.cycles", (np.size(state["weight.cycles"]),))
        leads = int(saved_table(state, "leading", (1,))[0])
        if not 1 <= leads <= len(frequencies) or not self.span_[1] > self.span_[0]:
            raise InputError(
                "arrays 'leading' or 'span' of the model make no sense; the file is damaged, save it again"
            )
        self.network_ = self._made(len(frequencies), leads, len(self.mean_))
        restore_weights_(self.network_, state)
        self.trainings_ = []


def spectrum_of(tau: NDArray[np.float64], values: NDArray[np.float64], changes: Array | None = None) -> Spectrum:
    """Frequencies that a series (snapshots, modes) holds, from the cosine transform of what departs from a line.

    tau: (snapshots,) times in Δτ; changes: rates in the same unit, which let twice as many frequencies be told apart.
    """
    finer = 1 if changes is None else 2
    count = min(finer * (len(tau) - 1), MOST_FREQUENCIES) + 1
    if len(tau) < 4 and changes is None:
        return Spectrum(np.array([0.5]), np.ones(1))
    curve = CubicSpline(tau, values) if changes is None else CubicHermiteSpline(tau, values, changes)
    even = curve(np.linspace(tau[0], tau[-1], finer * (len(tau) - 1) + 1))
    line = even[0] + np.linspace(0.0, 1.0, len(even))[:, None] * (even[-1] - even[0])
    power = np.square(dct(even - line, axis=0, type=1)).sum(axis=1)[1:count]
    smooth = np.convolve(np.pad(power, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    unseen = (UNSEEN * (len(even) - 1)) ** 2 * np.square(values - values.mean(axis=0)).mean()
    if not smooth.max() > unseen:  # a line: what departs from it is rounding, whose frequencies would fill the spectrum
        return Spectrum(np.array([0.5]), np.ones(1))
    last = int(np.flatnonzero(smooth > max(FAINT * smooth.max(), unseen))[-1]) + 1
    size = np.sqrt(smooth[:last] / smooth[:last].mean())
    return Spectrum(np.arange(1, last + 1) / 2.0, size)


def leading(spectrum: Spectrum) -> int:
    """How many of the first frequencies hold nine tenths of the power."""
    held = np.cumsum(np.square(spectrum.size))
    return int(np.searchsorted(held, LEADING * held[-1])) + 1
