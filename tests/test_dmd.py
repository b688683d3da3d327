"""Linear state map: exact where the dynamics are linear, cautious where they cannot be told from chance."""

import numpy as np
import pytest

from surrogates import Dmd, InputError
from surrogates.companion import companion, drawn_back
from surrogates.past import Past, parts

INTERVAL = 0.002


def times(count):
    return INTERVAL * np.arange(count)


def damped(t):
    """Two modes of one decaying oscillation and one of another: the normal modes of a damped linear system."""
    return np.stack(
        [
            np.exp(-3 * t) * np.sin(80 * t),
            2 * np.exp(-3 * t) * np.cos(80 * t),
            np.exp(-t) * np.sin(33 * t + 1),
        ],
        axis=1,
    )


def test_a_damped_oscillation_is_continued_exactly():
    model = Dmd().fit(times(60), damped(times(60)))
    later = times(200)[60:]
    # one step is exact to 1e-13 of the largest coefficient; 140 steps of a decaying map add no more than 1e-10
    np.testing.assert_allclose(model.predict(later, beyond=True), damped(later), rtol=0, atol=1e-10)


def test_its_eigenvalues_are_those_of_the_oscillations():
    model = Dmd(memory=2).fit(times(60), damped(times(60)))
    found = np.linalg.eigvals(model.matrix_)
    for rate, omega in ((-3, 80), (-1, 33)):
        assert np.abs(found - np.exp((rate + 1j * omega) * INTERVAL)).min() < 1e-9


def test_uniform_motion_and_free_fall_go_on():
    t, later = times(40), times(80)[40:]
    assert np.abs(Dmd().fit(t, 1 + 3 * t[:, None]).predict(later, beyond=True)[:, 0] - (1 + 3 * later)).max() < 1e-9
    fall = Dmd().fit(t, 1 - 4.905 * t[:, None] ** 2).predict(later, beyond=True)[:, 0]
    # three equal eigenvalues at 1: forty steps multiply the rounding of a second difference by 40³
    assert np.abs(fall - (1 - 4.905 * later**2)).max() < 1e-7


def test_more_modes_than_snapshots_are_well_posed():
    rng = np.random.default_rng(2)
    values = np.cumsum(rng.standard_normal((12, 60)), axis=0)
    predicted = Dmd().fit(times(12), values).predict(times(40), beyond=True)
    assert np.abs(predicted).max() < 5 * np.abs(values).max()


def test_of_a_random_walk_nothing_better_than_persistence_is_learnt():
    walk = np.cumsum(np.random.default_rng(3).standard_normal((200, 4)), axis=0)
    model = Dmd().fit(times(200), walk)
    start = walk[-model.memory_ :]
    one_ahead = model.predict([model.window_[1] + INTERVAL], start, beyond=True)[0]
    # the steps of a walk are of length 2 here and cannot be foreseen
    assert np.linalg.norm(one_ahead - walk[-1]) < 0.3


def test_what_grows_is_held_at_its_amplitude_unless_it_may_grow():
    growing = (np.exp(4 * times(60)) * np.sin(80 * times(60)))[:, None]
    held, free = Dmd().fit(times(60), growing), Dmd(stable=False).fit(times(60), growing)
    assert (held.growing_, free.growing_) == (2, 0)
    assert held.radius_ == pytest.approx(np.exp(4 * INTERVAL), abs=1e-6)
    later = times(400)[60:]
    assert np.abs(held.predict(later, beyond=True)).max() < 3 * np.abs(growing).max()
    truth = np.exp(4 * later) * np.sin(80 * later)
    np.testing.assert_allclose(free.predict(later, beyond=True)[:, 0], truth, rtol=0, atol=1e-6 * np.abs(truth).max())


def test_drawing_back_what_grows_leaves_the_rest_as_it_was():
    rng = np.random.default_rng(5)
    vectors = rng.standard_normal((5, 5))
    values = np.array([0.5, -0.8, 0.95, 1.3, -1.2])
    matrix = (vectors * values) @ np.linalg.inv(vectors)
    bounded, count = drawn_back(matrix, 1 + 1e-4)
    assert count == 2
    expected = (vectors * np.array([0.5, -0.8, 0.95, 1.0, -1.0])) @ np.linalg.inv(vectors)
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(bounded).real), [-1, -0.8, 0.5, 0.95, 1], atol=1e-12)
    np.testing.assert_allclose(bounded @ vectors[:, :3], expected @ vectors[:, :3], atol=1e-12)


def test_the_matrix_of_the_delayed_state_steps_as_the_points_do():
    rng = np.random.default_rng(6)
    values, linear = rng.standard_normal((9, 2)), rng.standard_normal((6, 2))
    past = Past.of(values, 3)
    state = (values[-3:] - past.centre)[::-1].ravel()
    step = past.points(values)[-1] @ linear
    stepped = companion(past, linear) @ state
    np.testing.assert_allclose(stepped[:2], values[-1] + step - past.centre, atol=1e-12)
    np.testing.assert_array_equal(stepped[2:], state[:4])


def test_parts_left_out_are_contiguous_and_cover_the_series():
    assert [list(range(*part.indices(12))) for part in parts(12)] == [[0, 1], [2, 3], [4, 5, 6], [7, 8], [9, 10, 11]]
    assert len(parts(3)) == 3


def test_the_error_of_the_last_steps_is_that_of_fitting_to_those_before():
    rng = np.random.default_rng(7)
    values = np.cumsum(rng.standard_normal((31, 2)), axis=0)
    model = Dmd(memory=1).fit(times(31), values)
    trial = next(t for t in model.trials_ if t.ridge == 0.0)
    points, steps = np.column_stack([values[:-1], np.ones(30)]), np.diff(values, axis=0)
    fit = np.linalg.lstsq(points[:21], steps[:21], rcond=None)[0]
    squares = np.square(points[21:] @ fit - steps[21:]).sum(axis=1)
    assert trial.error == pytest.approx(np.sqrt(squares.mean()), rel=1e-10)


def test_a_memory_of_nothing_is_refused():
    with pytest.raises(InputError, match="memory is 0 snapshots; a step reads at least 1"):
        Dmd(memory=0)
