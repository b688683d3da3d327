"""Radial basis functions in the space of the coefficients: a state map that replays what it has seen."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.spatial.distance import pdist, squareform

from surrogates.errors import InputError
from surrogates.kernel import FAMILIES, KernelName, family_name
from surrogates.past import Array, Past, parts
from surrogates.series import Series
from surrogates.state_map import StateMap
from surrogates.surrogate import saved_numbers, saved_table

EXACT = 1e-10  # largest miss of a replay over the largest value
CHOSEN_ON = 400  # last steps that a choice is tested on, for it costs their cube
LOCAL = 1000  # centres above which only the nearest ones answer
NEAREST = 100
COINCIDENT = 1e-9  # of the median distance: centres closer than this are one
ROUNDING = (
    1e-9  # errors below this fraction of the largest value are equal, for rollouts multiply rounding: the first wins
)


class Radial(NamedTuple):
    """One choice: the states read, and φ(ε|z - z_i|/r) plus a polynomial of this degree, r the median distance."""

    memory: int
    kernel: KernelName
    shape: float  # ε per median distance between centres
    degree: int  # -1: no polynomial


# without a polynomial a map far from all centres is persistence; with one of degree 1 a linear map is exact
FORMS: tuple[tuple[KernelName, tuple[float, ...], tuple[int, ...]], ...] = (
    ("linear", (1.0,), (0, 1)),
    ("cubic", (1.0,), (1,)),
    ("multiquadric", (0.3, 1.0, 3.0, 10.0), (0, 1)),
    ("inverse_multiquadric", (0.3, 1.0, 3.0, 10.0), (-1,)),
    ("gaussian", (0.5, 1.0, 2.0, 4.0, 8.0), (-1,)),
)


class RbfMap(StateMap):
    """c_{i+1} = c_i + Σ_j w_j φ(ε|z_i - z_j|/r) + polynomial, z the last states and their differences (see `Past`).

    Interpolation, not a fit: rolled out from its first snapshots it replays the training series, to 1e-10 of the
    largest value. Memory, kernel and shape are those with the least error on five parts of the series left out in
    turn, e_B = (M⁻¹)_BB⁻¹ (M⁻¹ y)_B with M the saddle matrix (Rippa 1999 for single centres), among those that replay
    it. Where states coincide but go on differently no map replays them: their mean step is taken, the least error
    wins, and `replay_miss_` says by how much the replay misses.

    Of a long series only the last 400 steps enter the choice, and beyond 1000 centres the nearest 100 answer.
    """

    name: ClassVar[str] = "rbf-map"

    radial_: Radial
    left_out_: dict[Radial, float]  # RMS error of a step in the parts left out; empty in a loaded model
    replay_miss_: float  # largest miss of the replay, at most `CHOSEN_ON` steps, over the largest value

    def __init__(self, memory: int = 3) -> None:
        if memory < 1:
            raise InputError(f"memory is {memory} snapshots; a step reads at least 1, 2 know a velocity")
        self.memory = memory

    def _learn(self, series: Series) -> None:
        values = np.ascontiguousarray(series.values, dtype=np.float64)
        scale = float(np.abs(values - values.mean(axis=0)).max()) or 1.0
        deepest = min(self.memory_, max(1, (len(values) - 1) // 2))
        errors: dict[Radial, float] = {}
        for memory in range(1, deepest + 1):
            errors |= _errors_left_out((values / scale)[-CHOSEN_ON - deepest :], memory, deepest)
        self.left_out_ = {radial: error * scale for radial, error in errors.items()}
        ranked = sorted(errors, key=lambda radial: max(errors[radial], ROUNDING))
        chosen = next((radial for radial in ranked if self._replays(values, radial)), ranked[0])
        self._build(values, chosen)

    def _replays(self, values: Array, radial: Radial) -> bool:
        """Fit one choice; false if it misses its own series, or cannot be solved."""
        try:
            self._build(values, radial)
        except np.linalg.LinAlgError:
            return False
        return self.replay_miss_ <= EXACT

    def _build(self, values: Array, radial: Radial) -> None:
        self.values_, self.radial_, self.memory_ = values, radial, radial.memory
        self.past_ = Past.of(values, radial.memory)
        steps = np.diff(values, axis=0)[radial.memory - 1 :]
        centres, means = _distinct(self.past_.points(values)[:-1], steps)
        self.unit_ = float(np.abs(steps).max()) or 1.0
        terms = (0, 1, 1 + centres.shape[1])[radial.degree + 1]
        self.curve_ = RBFInterpolator(
            centres,
            means / self.unit_,
            neighbors=None if len(centres) <= LOCAL else max(NEAREST, 2 * terms),
            kernel=radial.kernel,
            epsilon=radial.shape / _median_distance(centres),
            degree=radial.degree,
        )
        seen = values[: CHOSEN_ON + radial.memory]
        replay = self._rollout(seen[: radial.memory], len(seen))
        miss = np.abs(replay - seen).max() if len(replay) == len(seen) else np.inf
        self.replay_miss_ = float(miss / (np.abs(values).max() or 1.0))

    def _step(self, history: Array) -> Array:
        return np.asarray(history[-1] + self.unit_ * self.curve_(self.past_.points(history))[0])

    def _learnt(self) -> dict[str, NDArray[Any]]:
        memory, kernel, shape, degree = self.radial_
        chosen = {"kernel": np.frombuffer(kernel.encode(), np.uint8), "radial": np.array([memory, shape, degree])}
        return {"values": self.values_, **chosen}

    def _recall(self, state: Mapping[str, NDArray[Any]]) -> None:
        values, kernel = saved_table(state, "values"), family_name(state["kernel"].tobytes().decode(errors="replace"))
        memory, shape, degree = saved_numbers(state, "radial", 3)
        if not (0 < memory < len(values) and shape > 0 and degree in (-1, 0, 1)):
            raise InputError("array 'radial' of the model names no kernel; the file is damaged, save it again")
        self.left_out_ = {}
        self._build(values, Radial(int(memory), kernel, shape, int(degree)))


def _distinct(points: Array, steps: Array) -> tuple[Array, Array]:
    """Centres that differ, in the order of time, and the mean step from each."""
    grid = np.round(points / (COINCIDENT * _median_distance(points)))
    _, first, group, count = np.unique(grid, axis=0, return_index=True, return_inverse=True, return_counts=True)
    sums = np.zeros((len(first), steps.shape[1]))
    np.add.at(sums, group, steps)
    in_time = np.argsort(first)
    return points[first[in_time]], (sums / count[:, None])[in_time]


def _median_distance(points: Array) -> float:
    apart = pdist(points[-CHOSEN_ON:])
    return float(np.median(apart)) or 1.0 if len(apart) else 1.0


def _errors_left_out(values: Array, memory: int, deepest: int) -> dict[Radial, float]:
    """Error of every form with this memory, on the steps that have `deepest` states before them."""
    points = Past.of(values, memory).points(values)[deepest - memory : -1]
    centres, steps = _distinct(points, np.diff(values, axis=0)[deepest - 1 :])
    apart = squareform(pdist(centres)) / _median_distance(centres)
    errors = {}
    for kernel, shapes, degrees in FORMS:
        for degree in degrees:
            polynomial = np.hstack([np.ones((len(centres), 1)), centres])[:, : (0, 1, None)[degree + 1]]
            if polynomial.shape[1] <= len(centres) // 2:
                for shape in shapes:
                    radial = FAMILIES[kernel].profile(shape * apart)
                    errors[Radial(memory, kernel, shape, degree)] = _error_left_out(radial, polynomial, steps)
    return errors


def _error_left_out(radial: Array, polynomial: Array, steps: Array) -> float:
    """RMS error of the steps in each part by the interpolant of the others; infinite where it is singular."""
    count, terms = polynomial.shape
    saddle = np.block([[radial, polynomial], [polynomial.T, np.zeros((terms, terms))]])
    try:
        inverse = np.linalg.inv(saddle)[:count, :count]
        weights = inverse @ steps
        total = sum(float((np.linalg.solve(inverse[p, p], weights[p]) ** 2).sum()) for p in parts(count))
    except np.linalg.LinAlgError:
        return np.inf
    return float(np.sqrt(total / count)) if np.isfinite(total) else np.inf
