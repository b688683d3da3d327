"""Gaussian process in time against the dense formulas it replaces, and its deviation against chance."""

import numpy as np
import pytest

from surrogates import Gp, InputError
from surrogates.kalman import kalman_filter
from surrogates.matern import Matern


def covariance(apart, length):
    x = np.sqrt(5) * np.abs(apart) / length
    return (1 + x + x**2 / 3) * np.exp(-x)


def dense(times, values, asked, length, noise):
    """Mean and variance of the process by the matrix of all covariances."""
    among = covariance(times[:, None] - times, length) + noise * np.eye(len(times))
    across = covariance(asked[:, None] - times, length)
    mean = values.mean(axis=0)
    solved = np.linalg.solve(among, values - mean)
    variance = 1 - np.einsum("ij,ij->i", across, np.linalg.solve(among, across.T).T)
    scale = np.sqrt(np.mean((values - mean) * solved, axis=0))
    return mean + across @ solved, np.sqrt(np.maximum(variance, 0.0))[:, None] * scale


@pytest.mark.parametrize("noise", [0.0, 1e-2])
def test_filter_and_smoother_give_what_the_dense_formulas_give(noise):
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.5, 1.5, 40))
    values = rng.standard_normal((40, 3))
    model = Gp(2.5, noise).fit(times, values)
    asked = np.linspace(times[0] - 8, times[-1] + 8, 211)
    mean, deviation = dense(times, values, asked, 2.5 * model.interval_, noise)
    np.testing.assert_allclose(model.predict(asked, beyond=True), mean, rtol=0, atol=1e-11)
    # the dense variance is a difference of numbers near 1, and so is ours where it vanishes: roots of 1e-15
    np.testing.assert_allclose(model.deviation(asked, beyond=True), deviation, rtol=0, atol=3e-7)


def test_the_noise_added_over_a_short_gap_keeps_its_digits():
    kernel, gap = Matern(100.0), 1e-3
    q = 16 / 3 * kernel.rate**5
    # white noise integrated three times over a short time, to first order in λh = 2e-5
    expected = q * np.array(
        [[gap**5 / 20, gap**4 / 8, gap**3 / 6], [gap**4 / 8, gap**3 / 3, gap**2 / 2], [gap**3 / 6, gap**2 / 2, gap]]
    )
    np.testing.assert_allclose(kernel.added(np.array([gap]))[0], expected, rtol=1e-3)


def test_motion_over_a_gap_keeps_the_stationary_covariance():
    kernel, gaps = Matern(3.0), np.array([1e-3, 0.1, 1.0, 7.0])
    moved = kernel.transition(gaps) @ kernel.stationary() @ kernel.transition(gaps).transpose(0, 2, 1)
    np.testing.assert_allclose(moved + kernel.added(gaps), np.tile(kernel.stationary(), (4, 1, 1)), atol=1e-14)


def test_without_noise_snapshots_are_met_to_rounding_and_with_it_they_are_smoothed():
    rng = np.random.default_rng(1)
    times = 0.01 * np.arange(200)
    smooth = np.sin(7 * times)[:, None]
    rough = smooth + 0.1 * rng.standard_normal((200, 1))
    exact = Gp().fit(times, rough)
    assert np.abs(exact.predict(times) - rough).max() < 1e-12
    assert exact.deviation(times).max() < 1e-7
    smoothed = Gp(noise=None).fit(times, rough)
    assert smoothed.noise_ > 0
    # thirty snapshots a radian: of the noise of 0.1 the fifth remains
    assert np.sqrt(np.mean((smoothed.predict(times) - smooth) ** 2)) < 0.03


def test_outside_the_window_it_falls_back_to_the_mean_with_growing_deviation():
    times = 0.01 * np.arange(100)
    values = 2 + np.sin(30 * times)[:, None] * [1.0, 3.0]
    model = Gp(5.0).fit(times, values)
    ell = 5.0 * model.interval_
    for asked in (times[-1] + ell * np.array([0.1, 0.5, 1, 2, 20]), times[0] - ell * np.array([0.1, 0.5, 1, 2, 20])):
        deviation = model.deviation(asked, beyond=True)
        assert (np.diff(deviation, axis=0) > 0).all()
        np.testing.assert_allclose(model.predict(asked, beyond=True)[-1], values.mean(axis=0), rtol=1e-6)
        np.testing.assert_allclose(deviation[-1], model.scale_, rtol=1e-6)


@pytest.mark.parametrize("reach", ["between", "beyond"])
def test_the_deviation_is_that_of_draws_from_its_own_prior(reach):
    rng = np.random.default_rng(4)
    times = np.cumsum(rng.uniform(0.4, 1.6, 60))
    asked = times[:-1] + 0.5 * np.diff(times) if reach == "between" else times[-1] + np.linspace(0.3, 3, 12)
    everywhere = np.concatenate([times, asked])
    root = np.linalg.cholesky(covariance(everywhere[:, None] - everywhere, 4.0) + 1e-12 * np.eye(len(everywhere)))
    draws = root @ rng.standard_normal((len(everywhere), 400)) * np.geomspace(1e-3, 1e3, 400)
    model = Gp().fit(times, draws[:60])
    score = (model.predict(asked, beyond=True) - draws[60:]) / model.deviation(asked, beyond=True)
    # of 400 draws the root mean square is known to 1/sqrt(800) = 4 % at each time; σ from 60 snapshots to 9 % each
    assert np.sqrt(np.mean(score**2)) == pytest.approx(1, abs=0.12)
    assert np.mean(np.abs(score) < 1) == pytest.approx(0.68, abs=0.05)


def test_the_most_likely_length_is_the_one_drawn_from():
    rng = np.random.default_rng(5)
    times = np.arange(300.0)
    for length in (3.0, 12.0):
        root = np.linalg.cholesky(covariance(times[:, None] - times, length) + 1e-10 * np.eye(300))
        model = Gp().fit(times, root @ rng.standard_normal((300, 6)))
        # the scale tried has factors of √2
        assert np.sqrt(0.5) <= model.length_ / length <= np.sqrt(2)


def test_its_likelihood_is_the_dense_one():
    rng = np.random.default_rng(6)
    times, values = np.cumsum(rng.uniform(0.5, 1.5, 30)), rng.standard_normal((30, 2))
    filtered = kalman_filter(Matern(2.0), times, values, 0.01)
    among = covariance(times[:, None] - times, 2.0) + 0.01 * np.eye(30)
    assert np.log(filtered.variances).sum() == pytest.approx(np.linalg.slogdet(among)[1], abs=1e-10)
    squares = (filtered.surprises**2 / filtered.variances[:, None]).sum()
    assert squares == pytest.approx(float((values * np.linalg.solve(among, values)).sum()), rel=1e-10)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"length": 0.0}, "length is 0 intervals"), ({"noise": -1.0}, "noise is -1 of a mode's variance")],
)
def test_settings_that_make_no_sense_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        Gp(**settings)


def test_a_deviation_is_refused_as_a_prediction_is():
    with pytest.raises(InputError, match="gp has not been fitted"):
        Gp().deviation([0.0])
    model = Gp().fit([0.0, 0.1, 0.2], [[1.0], [2.0], [0.0]])
    with pytest.raises(InputError, match=r"time 0\.3 s lies outside the fitted window"):
        model.deviation([0.3])
