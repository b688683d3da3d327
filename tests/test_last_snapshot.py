"""Persistence and ballistic motion: what the last snapshot alone foretells."""

import numpy as np
import pytest

from surrogates import Ballistic, Persistence

TIMES = 0.1 * np.arange(4)
PLACES = np.array([[0.0, 1.0], [2.0, 1.0], [3.0, 5.0], [7.0, 6.0]])
VELOCITIES = np.array([[1.0, 0.0], [2.0, -1.0], [0.0, 3.0], [5.0, 5.0]])


def test_persistence_holds_each_snapshot_until_the_next():
    held = Persistence().fit(TIMES, PLACES)
    np.testing.assert_array_equal(held.predict([0.0, 0.0999, 0.1, 0.25, 0.3]), PLACES[[0, 0, 1, 2, 3]])
    np.testing.assert_array_equal(held.predict([-1.0, 9.0], beyond=True), PLACES[[0, 3]])


def test_a_snapshot_that_rounding_puts_a_hair_later_counts_as_reached():
    np.testing.assert_array_equal(Persistence().fit(TIMES, PLACES).predict([0.3]), PLACES[3:])  # 3 * 0.1 > 0.3


def test_ballistic_motion_flies_on_from_the_last_snapshot():
    flown = Ballistic().fit(TIMES, PLACES, VELOCITIES)
    np.testing.assert_allclose(flown.predict([0.05, 0.15]), [[0.05, 1.0], [2.1, 0.95]], rtol=1e-14)
    np.testing.assert_allclose(flown.predict([2.3], beyond=True), [[17.0, 16.0]], rtol=1e-14)


def test_uniform_motion_is_ballistic_at_any_horizon_and_a_fall_misses_by_half_g_t_squared():
    t = 0.01 * np.arange(11)
    later = 0.1 + np.array([0.01, 0.1, 1.0])
    uniform = Ballistic().fit(t, 1 + 3 * t[:, None], np.full((11, 1), 3.0))
    np.testing.assert_allclose(uniform.predict(later, beyond=True)[:, 0], 1 + 3 * later, rtol=1e-14)
    fall = Ballistic().fit(t, 1 - 4.905 * t[:, None] ** 2, -9.81 * t[:, None])
    missed = fall.predict(later, beyond=True)[:, 0] - (1 - 4.905 * later**2)
    assert missed == pytest.approx(4.905 * (later - 0.1) ** 2, rel=1e-9)
