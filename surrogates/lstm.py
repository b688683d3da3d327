"""A recurrent network that reads a window of coefficients: the next step, and any time between two snapshots."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from torch import Tensor, nn

from surrogates.autoregression import autoregression
from surrogates.network import Network, asked, restore_weights_, seeded, single, weights_of, zeroed
from surrogates.series import Array, Series, checked_series
from surrogates.state_map import StateMap
from surrogates.surrogate import EDGE, saved_table
from surrogates.training import Samples, train

MEMORY = 8  # snapshots of a window
FEWEST = 20  # samples that a network is trained on; with fewer the simple answer stands
STRIDES = (3, 4)  # intervals of the series skipped to, so that what lies between is known
FINER = 2  # the stride by which weights are chosen: what was learnt has to hold at the next finer interval too
HELD_OUT = 0.2  # the last part of the series, by which the weights are chosen
BATCH, CHECK_STEPS, CHECKS = 64, 10, 15  # samples of a step, steps between two checks, checks without a better one
AT_ONCE = 1024  # times that are predicted at once: each reads a whole window
SHAPE = 3  # numbers that say where in the window's interval the answer is wanted

Values = NDArray[np.float64]
Mask = NDArray[np.bool_]


class WindowNetwork(nn.Module):
    """Correction (b, modes) in units of `size` (b, 1), from a window (b, snapshots, modes) and a place (b, 3) in it."""

    def __init__(self, modes: int, width: int) -> None:
        super().__init__()
        self.lstm = nn.LSTM(modes, width, batch_first=True)
        self.head = nn.Sequential(nn.Linear(width + SHAPE, width), nn.GELU(), zeroed(nn.Linear(width, modes)))

    def forward(self, window: Tensor, place: Tensor, size: Tensor) -> Tensor:
        """Read the window and answer with its last state."""
        read, _ = self.lstm(window)
        answer: Tensor = self.head(torch.cat([read[:, -1], place], dim=1))
        return answer * size


class Questions(NamedTuple):
    """Windows of a series, and where in them an answer is wanted."""

    window: Values  # (b, k, modes) of rms one
    place: Values  # (b, 3)
    size: Values  # (b, 1) that the window was divided by


class Lstm(Network, StateMap):
    """Long short-term memory on windows of eight coefficients (the f of paper eq. (30)).

    Next step: an autoregression shared by all modes, its roots kept inside the unit circle, and what the network adds,
    trained on its misses. Between two snapshots: the cubic Hermite interpolant where rates are given, else the cubic
    spline, and what a second network adds; it reads fourth differences, to which both are blind, and learns from the
    snapshots that a series of three or four times the interval skips. Weights are those of the least error on the last
    fifth of the series, untrained ones among them: `trainings_` says where nothing was learnt. Between snapshots that
    is the error at twice the interval: what was learnt from coarse intervals is kept if it holds at a finer one.
    """

    name: ClassVar[str] = "lstm"
    bridges: ClassVar[bool] = True
    uses_rates: ClassVar[bool] = True
    memory = MEMORY

    def __init__(
        self,
        seed: int = 0,
        width: int = 32,
        steps: int = 600,
        learning_rate: float = 3e-3,
        max_seconds: float | None = None,
    ) -> None:
        super().__init__(seed, width, steps, learning_rate, max_seconds)

    def _fit(self, series: Series) -> None:
        self.series_ = series
        super()._fit(series)

    def _learn(self, series: Series) -> None:
        values = np.asarray(series.values, dtype=np.float64)
        self.mean_ = values.mean(axis=0)
        self.scale_ = float(np.sqrt(np.square(values - self.mean_).mean())) or 1.0
        scaled = (values - self.mean_) / self.scale_
        self.autoregression_ = autoregression(scaled, self.memory_)
        self.ahead_, self.between_ = (self._made(part, values.shape[1]) for part in ("ahead", "between"))
        self.trainings_ = []
        self._train_ahead(scaled)
        self._train_between(series, scaled)
        self._set_curve()

    def _train_ahead(self, scaled: Values) -> None:
        windows = np.stack([scaled[k : len(scaled) - self.memory_ + k] for k in range(self.memory_)], axis=1)
        targets = scaled[self.memory_ :] - np.einsum("j,bjm->bm", self.autoregression_, windows)
        miss = float(np.sqrt(np.square(targets).mean())) if len(targets) else 0.0
        asked = Questions(windows, np.zeros((len(windows), SHAPE)), np.full((len(windows), 1), miss))
        self.miss_ = miss
        held = np.arange(self.memory_, len(scaled)) >= (1.0 - HELD_OUT) * len(scaled)
        self._train("ahead", self.ahead_, asked, targets, (~held, held))

    def _train_between(self, series: Series, scaled: Values) -> None:
        rates = series.rates
        changes = None if rates is None else np.asarray(rates * (series.interval / self.scale_), dtype=np.float64)
        found = [(q, skipped(scaled, changes, q, offset)) for q in (FINER, *STRIDES) for offset in range(q)]
        known = [(q, part) for q, part in found if part is not None]
        if known:
            asked = Questions(*(np.concatenate(parts) for parts in zip(*(part[0] for _, part in known), strict=True)))
            targets, rows = (np.concatenate([part[k] for _, part in known]) for k in (1, 2))
            late = rows >= (1.0 - HELD_OUT) * len(scaled)
            finer = np.repeat([q == FINER for q, _ in known], [len(part[2]) for _, part in known])
            self._train("between", self.between_, asked, targets, (~late & ~finer, late & finer))

    def _train(
        self, part: str, network: WindowNetwork, asked: Questions, targets: Values, which: tuple[Mask, Mask]
    ) -> None:
        """Train one network on targets (b, modes), if they are enough: which are shown, and which decide."""
        shown, held = (torch.from_numpy(mask) for mask in which)
        scale = float(np.sqrt(np.square(targets).mean())) if len(targets) else 0.0
        if int(shown.sum()) < FEWEST or not held.any() or scale < 1e-12:  # nothing to learn
            return
        window, place, size = asked
        samples = Samples((single(window), single(place), single(size / scale)), single(targets / scale))
        checks = max(self.steps // CHECK_STEPS, 1)
        settings = self._training(part, batch=BATCH, checks=checks, patience=CHECKS)
        self.trainings_.append(train(network, samples.some(shown), samples.some(held), settings))

    def _made(self, part: str, modes: int) -> WindowNetwork:
        network = seeded(lambda: WindowNetwork(modes, self.width), self.seed + (part == "between"))
        assert isinstance(network, WindowNetwork)
        return network

    def _step(self, history: Values) -> Values:
        scaled = (history - self.mean_) / self.scale_
        window = single(scaled[None])
        with asked():
            added = self.ahead_(window, torch.zeros((1, SHAPE)), torch.full((1, 1), self.miss_)).numpy()[0]
        return np.asarray(self.mean_ + self.scale_ * (self.autoregression_ @ scaled + added))

    def _set_curve(self) -> None:
        tau = self.series_.scaled(self.series_.times)
        values, rates = np.asarray(self.series_.values, dtype=np.float64), self.series_.rates
        interval = self.series_.interval
        self.curve_ = CubicSpline(tau, values) if rates is None else CubicHermiteSpline(tau, values, rates * interval)

    def _predict(self, times: Values, start: Array | None, parameters: Array | None) -> Values:
        first, last = self.window_
        inside = (times >= first - EDGE * self.interval_) & (times <= last + EDGE * self.interval_)
        if start is not None or not inside.any():
            return super()._predict(times, start, parameters)
        predicted = np.empty((len(times), len(self.mean_)))
        predicted[inside] = self._bridged(times[inside])
        predicted[~inside] = super()._predict(times[~inside], None, None)
        return predicted

    def _bridged(self, times: Values) -> Values:
        tau = np.clip(self.series_.scaled(times), 0.0, len(self.series_.times) - 1.0)
        answer: Values = self.curve_(tau)
        if len(self.series_.times) < MEMORY:
            return answer
        scaled = (np.asarray(self.series_.values, dtype=np.float64) - self.mean_) / self.scale_
        with asked():
            for low in range(0, len(tau), AT_ONCE):
                some = slice(low, low + AT_ONCE)
                window, place, size = around(scaled, tau[some])
                answer[some] += self.scale_ * self.between_(single(window), single(place), single(size)).numpy()
        return answer

    def _learnt(self) -> dict[str, NDArray[Any]]:
        times, values, rates, _ = self.series_
        none = np.empty((0, values.shape[1]))
        series = {"times": times, "values": values, "rates": none if rates is None else rates}
        scalers = {"mean": self.mean_, "scale": np.array([self.scale_]), "miss": np.array([self.miss_])}
        networks = weights_of(self.ahead_, "ahead.") | weights_of(self.between_, "between.")
        return {**series, **scalers, "autoregression": self.autoregression_, **networks}

    def _recall(self, state: Mapping[str, NDArray[Any]]) -> None:
        rates = state["rates"]
        self.series_ = checked_series(state["times"], state["values"], rates if np.size(rates) else None)
        modes = self.series_.values.shape[1]
        self.mean_ = saved_table(state, "mean", (modes,))
        self.scale_, self.miss_ = (float(saved_table(state, name, (1,))[0]) for name in ("scale", "miss"))
        self.autoregression_ = saved_table(state, "autoregression", (self.memory_,))
        self.ahead_, self.between_ = (self._made(part, modes) for part in ("ahead", "between"))
        restore_weights_(self.ahead_, state, "ahead.")
        restore_weights_(self.between_, state, "between.")
        self.trainings_ = []
        self._set_curve()


def around(values: Values, places: Values) -> Questions:
    """Fourth differences of the eight snapshots around each place (b,), counted in rows of `values` (rows, modes)."""
    k = np.clip(places.astype(np.intp), 0, len(values) - 2)
    first = np.clip(k + 1 - MEMORY // 2, 0, len(values) - MEMORY)
    differences = np.diff(values[first[:, None] + np.arange(MEMORY)], 4, axis=1)
    size = np.sqrt(np.square(differences).mean(axis=(1, 2)))[:, None]
    s = places - k
    # zero at both ends of the interval, where the snapshots themselves are known
    place = np.stack([s, s * (1.0 - s), k - first - (MEMORY // 2 - 1.0)], axis=1)
    return Questions(differences / np.maximum(size, 1e-300)[:, :, None], place, size * 16.0 * place[:, 1:2] ** 2)


def skipped(values: Values, changes: Values | None, q: int, offset: int) -> tuple[Questions, Values, Values] | None:
    """Ask for what every q-th snapshot leaves out: questions, misses of the cubic there, rows of `values`."""
    own = values[offset::q]
    if len(own) < MEMORY:
        return None
    rows = np.arange(offset, offset + (len(own) - 1) * q)
    rows = rows[(rows - offset) % q != 0]
    places, knots = (rows - offset) / q, np.arange(len(own))
    curve = CubicSpline(knots, own) if changes is None else CubicHermiteSpline(knots, own, q * changes[offset::q])
    return around(own, places), values[rows] - curve(places), rows.astype(np.float64)
