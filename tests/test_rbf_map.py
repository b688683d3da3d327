"""Radial state map: it replays what it has seen, and goes on sensibly."""

import numpy as np
import pytest

from surrogates import InputError, RbfMap
from surrogates.surrogate import Surrogate

INTERVAL = 0.002


def times(count):
    return INTERVAL * np.arange(count)


def limit_cycle(t):
    """Harmonics of one period: what an oscillating bed settles into."""
    k = np.arange(1, 5)
    return np.exp(-k / 2) * np.sin(2 * np.pi * k * t[:, None] / 0.0437 + k)


def lorenz(count, interval=0.02):
    """Chaotic motion, by Runge-Kutta at a fifth of the interval."""

    def rate(x):
        return np.array([10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]])

    x, path = np.array([1.0, 1.0, 20.0]), []
    h = interval / 5
    for k in range(5 * (count + 100)):
        if k >= 500 and k % 5 == 0:
            path.append(x)
        a = rate(x)
        b = rate(x + h / 2 * a)
        c = rate(x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c))
    return np.array(path)


@pytest.mark.parametrize("signal", [limit_cycle(times(150)), lorenz(120)], ids=["limit cycle", "chaos"])
def test_a_rollout_replays_the_training_series(signal):
    model = RbfMap().fit(times(len(signal)), signal)
    miss = np.abs(model.predict(times(len(signal))) - signal).max() / np.abs(signal).max()
    assert miss < 1e-10  # the gate of the verification table
    assert model.replay_miss_ == pytest.approx(miss, abs=1e-12)


def test_a_limit_cycle_is_continued():
    model = RbfMap().fit(times(150), limit_cycle(times(150)))
    later = times(300)[150:]
    # between centres a hundredth of a turn apart on the cycle the kernel errs by 1e-6 a step
    np.testing.assert_allclose(model.predict(later, beyond=True), limit_cycle(later), rtol=0, atol=1e-3)


def test_one_step_of_chaos_is_foreseen_better_than_by_persistence():
    path = lorenz(500)
    model = RbfMap().fit(times(300), path[:300])
    m = model.memory_
    starts = range(320, 490, 10)
    end = model.window_[1] + INTERVAL
    miss = [model.predict([end], path[s - m + 1 : s + 1], beyond=True)[0] - path[s + 1] for s in starts]
    stayed = [path[s] - path[s + 1] for s in starts]
    assert np.linalg.norm(miss) < 0.02 * np.linalg.norm(stayed)


def test_states_that_coincide_and_go_on_differently_take_their_mean_step_and_say_so():
    swing = np.sin(2 * np.pi * np.arange(81) / 20)[:, None]
    blind = RbfMap(memory=1).fit(times(81), swing)
    assert blind.replay_miss_ > 0.1
    seeing = RbfMap(memory=2).fit(times(81), swing)
    assert seeing.replay_miss_ < 1e-10


def test_the_choice_is_the_least_error_of_those_that_replay():
    model = RbfMap().fit(times(120), lorenz(120))
    better = [radial for radial, error in model.left_out_.items() if error < model.left_out_[model.radial_]]
    for radial in better:
        assert not RbfMap()._replays(lorenz(120), radial)


def test_a_loaded_model_of_an_unknown_kernel_is_refused():
    model = RbfMap().fit(times(30), limit_cycle(times(30)))
    state = model.state()
    with pytest.raises(InputError, match="kernel 'magic' is unknown"):
        RbfMap.from_state({**state, "kernel": np.frombuffer(b"magic", np.uint8)})
    with pytest.raises(InputError, match="'radial' of the model names no kernel"):
        RbfMap.from_state({**state, "radial": np.array([2.0, -1.0, 0.0])})
    assert isinstance(RbfMap.from_state(state), Surrogate)


def test_a_memory_of_nothing_is_refused():
    with pytest.raises(InputError, match="memory is 0 snapshots; a step reads at least 1"):
        RbfMap(memory=0)
