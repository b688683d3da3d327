"""Dynamic mode decomposition: the linear map that best steps from one snapshot to the next."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surrogates.companion import companion, drawn_back
from surrogates.errors import InputError
from surrogates.past import Array, Past
from surrogates.series import Series
from surrogates.state_map import LOST, StateMap
from surrogates.surrogate import saved_table

RIDGES = (np.inf, *(10.0**k for k in range(1, -16, -1)), 0.0)  # of the largest singular value squared, stiffest first
LEVERAGE = 1e-10  # least of 1 - leverage of a part left out: below it the error left out is a quotient of roundings
EARLIER = 0.7  # of the steps, to which a map is fitted that the others judge
EQUAL = 1e-9  # errors below this fraction of the largest value: the shortest past wins
ROUNDING = 1e-13  # errors below this one: the stiffest ridge wins
GROWING = 1e-4  # per step: growth that the eigenvalues of an exact parabola show by rounding alone


class Trial(NamedTuple):
    """One choice of memory and ridge, and its error on the end of the series."""

    memory: int
    ridge: float
    error: float  # RMS of the last steps' errors, the norm over modes, unit of the values
    scatter: float  # standard error of it, from one step to the next


class Dmd(StateMap):
    """c_{i+1} = c_i + B z_i with z_i the last states and their differences, B by ridge regression.

    min Σ_i |c_{i+1} - c_i - B z_i|² + ρ s₁² |B|², s₁ the largest singular value of the points z, a 1 for the drift
    among them: well posed with more modes than snapshots, and at ρ = ∞ persistence. ρ is that with the least error on
    the last three tenths of the series, by the fit to what comes before; the past is the shortest, of at most `memory`
    states, that comes within one standard error of the best. Leaving out one snapshot would not do: it stands between
    two that nearly equal it, and of a shaken bed the map so chosen was worse than persistence. Nor would leaving out
    parts of the series in turn: a flow that is still settling leaves the states that it has been in.

    With `stable`, eigenvalues of the map outside the unit circle are drawn back onto it, phase kept; `growing_` of them
    were, the largest had the modulus `radius_`. A growing signal then stays near the amplitude it has reached; pass
    stable=False to let it grow.
    (Schmid 2010, doi 10.1017/S0022112010001217; delays: Arbabi and Mezić 2017, doi 10.1137/17M1125236.)
    """

    name: ClassVar[str] = "dmd"

    trials_: list[Trial]  # all that was tried; empty in a loaded model
    growing_: int  # eigenvalues that were drawn back onto the unit circle
    radius_: float  # largest modulus of an eigenvalue before that

    def __init__(self, memory: int = 3, *, stable: bool = True) -> None:
        if memory < 1:
            raise InputError(f"memory is {memory} snapshots; a step reads at least 1, 2 know a velocity")
        self.memory, self.stable = memory, stable

    def _learn(self, series: Series) -> None:
        values = np.asarray(series.values, dtype=np.float64)
        scale = float(np.abs(values - values.mean(axis=0)).max()) or 1.0
        deepest = min(self.memory_, max(1, (len(values) - 1) // 2))
        trials = [trial for memory in range(1, deepest + 1) for trial in _tried(values / scale, memory, deepest)]
        best = _chosen(trials)
        self.trials_ = [trial._replace(error=trial.error * scale, scatter=trial.scatter * scale) for trial in trials]
        self.memory_, past = best.memory, Past.of(values, best.memory)
        self.centre_, self.growing_ = past.centre, 0
        linear, self.drift_ = _fitted(past, values, best.ridge)
        self.matrix_ = companion(past, linear)
        self.radius_ = float(np.abs(np.linalg.eigvals(self.matrix_)).max())
        if self.stable and self.radius_ > 1 + GROWING:
            self.matrix_, self.growing_ = drawn_back(self.matrix_, 1 + GROWING)

    def _step(self, history: Array) -> Array:
        return self.matrix_[: len(self.centre_)] @ self._delayed(history) + self.drift_ + self.centre_

    def _delayed(self, history: Array) -> Array:
        return np.asarray((history - self.centre_)[::-1].ravel())

    def _rollout(self, history: Array, count: int) -> Array:
        """Carry the delayed state along: drawn back, the map is no longer that of a state and its own past alone."""
        path, modes, state = [*history], len(self.centre_), self._delayed(history)
        with np.errstate(all="ignore"):
            while len(path) < count:
                state = self.matrix_ @ state
                state[:modes] += self.drift_
                if not np.abs(state).max() < LOST:
                    break
                path.append(state[:modes] + self.centre_)
        return np.array(path)

    def _learnt(self) -> dict[str, NDArray[Any]]:
        growth = np.array([[self.radius_, self.growing_]])
        return {"offsets": np.array([self.centre_, self.drift_]), "matrix": self.matrix_, "growth": growth}

    def _recall(self, state: Mapping[str, NDArray[Any]]) -> None:
        memory, modes = self.first_.shape
        self.centre_, self.drift_ = saved_table(state, "offsets", (2, modes))
        self.matrix_ = saved_table(state, "matrix", (memory * modes, memory * modes))
        self.radius_, growing = saved_table(state, "growth", (1, 2))[0].tolist()
        self.growing_, self.trials_ = int(growing), []


def _chosen(trials: Sequence[Trial]) -> Trial:
    """Shortest past with which some ridge errs no more than the best by its standard error; of its ridges the best.

    A longer past than needed fits the next step as well and goes astray sooner: of a shaken bed five steps ahead by a
    half.
    """
    best = min(trials, key=lambda trial: trial.error)
    memory = min(trial.memory for trial in trials if trial.error <= max(best.error + best.scatter, EQUAL))
    same = [trial for trial in trials if trial.memory == memory]
    return min(same, key=lambda trial: max(trial.error, ROUNDING))


def _tried(values: Array, memory: int, deepest: int) -> Iterator[Trial]:
    """Every ridge with this memory, on the same steps whatever the memory: those with `deepest` states before them."""
    points = _points(Past.of(values, memory), values)[deepest - memory :]
    steps = np.diff(values, axis=0)[deepest - 1 :]
    left, singular, _ = np.linalg.svd(points, full_matrices=False)
    for ridge in RIDGES:
        yield Trial(memory, ridge, *_error_left_out(left * np.sqrt(_kept(singular, ridge)), steps))


def _fitted(past: Past, values: Array, ridge: float) -> tuple[Array, Array]:
    """B (memory · modes, modes) and the drift b (modes,) from all steps."""
    left, singular, right = np.linalg.svd(_points(past, values), full_matrices=False)
    weights = _kept(singular, ridge) / np.where(singular > 0, singular, 1.0)
    fitted = right.T @ (weights[:, None] * (left.T @ np.diff(values, axis=0)[past.memory - 1 :]))
    return fitted[:-1], fitted[-1]


def _points(past: Past, values: Array) -> Array:
    """Points that steps start from, each with a 1 for the drift, (steps, memory · modes + 1)."""
    points = past.points(values)[:-1]
    return np.column_stack([points, np.ones(len(points))])


def _kept(singular: Array, ridge: float) -> Array:
    """Share of each singular direction that the ridge leaves, s²/(s² + ρ s₁²); without one all above rounding."""
    if ridge == np.inf or singular[0] == 0:
        return np.zeros_like(singular)
    if ridge == 0:
        return np.where(singular > len(singular) * np.finfo(np.float64).eps * singular[0], 1.0, 0.0)
    square = (singular / singular[0]) ** 2
    return np.asarray(square / (square + ridge))


def _error_left_out(root: Array, steps: Array) -> tuple[float, float]:
    """RMS error of the last steps by the fit to those before, and its standard error.

    e_B = (1 - H_BB)⁻¹ (y - H y)_B with H = R Rᵀ and B the last three tenths. Infinite where the others do not determine
    the fit.
    """
    part = slice(int(EARLIER * len(steps)), len(steps))
    rest, half = (steps - root @ (root.T @ steps))[part], root[part]
    wide = half.shape[0] <= half.shape[1]
    small = half @ half.T if wide else half.T @ half
    if np.linalg.eigvalsh(small)[-1] > 1 - LEVERAGE:
        return np.inf, np.inf
    solved = np.linalg.solve(np.eye(len(small)) - small, rest if wide else half.T @ rest)
    squares = np.square(solved if wide else rest + half @ solved).sum(axis=1)
    error = float(np.sqrt(squares.mean()))
    # of the mean of the squares, carried over to its root
    scatter = float(squares.std()) / np.sqrt(len(squares))
    return error, scatter / (2 * error) if error > 0 else 0.0
