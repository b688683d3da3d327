"""Rolling out a state map: where it starts, what it says between its steps, and what it refuses."""

import numpy as np
import pytest

from surrogates.errors import InputError
from surrogates.state_map import StateMap, cubic_between
from surrogates.surrogate import saved_table

INTERVAL, BEGIN = 0.01, 2.0


class Recurrence(StateMap):
    """c_{n+1} = a c_n + b c_{n-1}, with a and b known."""

    name = "recurrence"

    def __init__(self, a=1.0, b=0.0, memory=2):
        self.a, self.b, self.memory = a, b, memory

    def _learn(self, series):
        self.learnt_from_ = len(series.times)

    def _step(self, history):
        return self.a * history[-1] + (self.b * history[-2] if len(history) > 1 else 0)

    def _learnt(self):
        return {"count": np.array([[self.learnt_from_]])}

    def _recall(self, state):
        self.learnt_from_ = int(saved_table(state, "count")[0, 0])


def times(count):
    return BEGIN + INTERVAL * np.arange(count)


def wave(t, omega=40.0):
    return np.stack([np.sin(omega * t), 3 * np.cos(omega * t)], axis=-1)


def oscillator(count=30, omega=40.0):
    """A recurrence that is exact for waves: c_{n+1} = 2 cos(ωΔτ) c_n - c_{n-1}."""
    return Recurrence(2 * np.cos(omega * INTERVAL), -1.0).fit(times(count), wave(times(count), omega))


def test_inside_the_window_an_exact_map_replays_every_snapshot():
    np.testing.assert_allclose(oscillator().predict(times(30)), wave(times(30)), rtol=0, atol=1e-12)


def test_beyond_the_window_it_goes_on_from_the_last_snapshots():
    later = times(80)[30:]
    # a marginally stable recurrence adds up rounding: 50 steps of 1e-16, doubled by each
    np.testing.assert_allclose(oscillator().predict(later, beyond=True), wave(later), rtol=0, atol=1e-11)


def test_a_start_stands_at_the_end_of_the_window():
    model, origin = oscillator(), 0.123
    start = wave(origin + INTERVAL * np.array([-1, 0]))
    horizon = INTERVAL * np.arange(20)
    rolled = model.predict(model.window_[1] + horizon, start, beyond=True)
    np.testing.assert_allclose(rolled, wave(origin + horizon), rtol=0, atol=1e-12)


def test_a_start_of_one_state_may_be_a_row():
    model = Recurrence(0.5, memory=1).fit(times(5), wave(times(5)))
    asked = model.window_[1] + 2 * INTERVAL
    np.testing.assert_allclose(model.predict([asked], [4.0, 8.0], beyond=True), [[1.0, 2.0]], rtol=1e-9)
    np.testing.assert_allclose(model.predict([asked], [[4.0, 8.0]], beyond=True), [[1.0, 2.0]], rtol=1e-9)


def test_between_its_steps_the_error_falls_with_the_fourth_power_of_the_interval():
    errors = []
    for step in (0.2, 0.1):
        path = np.sin(step * np.arange(round(8 / step)))[:, None]
        place = np.linspace(0, 6 / step, 1001)
        errors.append(np.abs(cubic_between(path, place)[:, 0] - np.sin(step * place)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.1)


def test_between_its_steps_a_cubic_is_exact_from_the_first_interval_on():
    t = np.arange(6.0)
    place = np.linspace(0, 5, 37)
    np.testing.assert_allclose(cubic_between(t[:, None] ** 3, place)[:, 0], place**3, rtol=0, atol=1e-13)


def test_a_time_is_answered_the_same_whatever_else_is_asked():
    model = oscillator()
    asked = np.random.default_rng(0).uniform(BEGIN, BEGIN + 0.5, 40)
    whole = model.predict(asked, beyond=True)
    assert np.array_equal(np.vstack([model.predict([t], beyond=True) for t in asked]), whole)
    assert model.predict([]).shape == (0, 2)


def test_a_series_shorter_than_the_memory_shortens_it():
    model = Recurrence(1.0, memory=7).fit(times(3), wave(times(3)))
    assert model.memory_ == 2
    assert model.memory == 7


def test_a_rollout_that_grows_without_bound_is_answered_as_far_as_it_goes_and_refused_beyond():
    model = Recurrence(1e30, memory=1).fit(times(3), wave(times(3)))
    assert np.isfinite(model.predict(model.window_[1] + INTERVAL * np.array([1, 3, 4]), beyond=True)).all()
    with pytest.raises(InputError, match=r"time 2\.07 s: the rollout .* ends at 2\.06 s, 0\.04 s after its start"):
        model.predict([2.07], beyond=True)


def test_a_map_that_says_nothing_finite_at_once_still_knows_its_start():
    model = Recurrence(np.nan, memory=1).fit(times(3), wave(times(3)))
    np.testing.assert_array_equal(model.predict([BEGIN]), wave(times(1)))
    with pytest.raises(InputError, match="shorter horizon"):
        model.predict([BEGIN + INTERVAL])


def test_unevenly_spaced_snapshots_are_refused_and_rounded_times_are_not():
    uneven = times(10)
    uneven[4] += 0.002
    with pytest.raises(InputError, match=r"times\[4\] = 2\.042 s lies 0\.2 intervals of 0\.01 s off an even spacing"):
        Recurrence().fit(uneven, wave(uneven))
    rounded = times(10) + 4e-6 * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 0])
    assert Recurrence().fit(rounded, wave(rounded)).memory_ == 2


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ([1.0, 2.0], r"start has shape \(2,\); recurrence reads the last 2 snapshots of 2 modes"),
        ([[1.0, 2.0]] * 3, r"start has shape \(3, 2\)"),
        ([[1.0, np.nan]] * 2, "start holds a value that is not finite"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(start, message):
    model = oscillator()
    with pytest.raises(InputError, match=message):
        model.predict([model.window_[1]], start, beyond=True)


def test_a_state_map_does_not_run_backwards():
    model = oscillator()
    with pytest.raises(InputError, match=r"time 1\.9 s lies before 2 s, where the window begins"):
        model.predict([1.9], beyond=True)
    with pytest.raises(InputError, match=r"time 2\.1 s lies before 2\.29 s, where the start stands"):
        model.predict([2.1], wave(times(2)))


def test_a_loaded_map_rolls_out_bitwise_the_same():
    model = oscillator()
    loaded = Recurrence.from_state(model.state(), model.settings())
    asked = np.linspace(BEGIN, BEGIN + 0.6, 77)
    assert np.array_equal(loaded.predict(asked, beyond=True), model.predict(asked, beyond=True))
    with pytest.raises(InputError, match="'last' of the model has shape"):
        Recurrence.from_state({**model.state(), "last": np.zeros((2, 5))}, model.settings())
