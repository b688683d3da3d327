"""Derivatives of surrogates in closed form: the velocity that a model of positions already holds."""

import numpy as np
import pytest

from surrogates import SURROGATES, InputError

DIFFERENTIABLE = [name for name, member in SURROGATES.items() if member.differentiable]


def waves(times):
    """Return two modes and their rates."""
    angle = np.outer(times, [3.0, 7.0])
    return np.sin(angle), np.array([3.0, 7.0]) * np.cos(angle)


def fitted(name, interval=0.05, end=3.0):
    times = np.arange(0.0, end + interval / 2, interval)
    return SURROGATES[name]().fit(times, *waves(times))


def test_cubics_are_the_ones_that_can_be_differentiated():
    assert set(DIFFERENTIABLE) == {"spline", "hermite", "raw-hermite"}


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_the_derivative_is_the_slope_of_the_prediction(name):
    model, times, h = fitted(name), np.linspace(0.013, 2.987, 200), 1e-6
    slope = (model.predict(times + h) - model.predict(times - h)) / (2 * h)
    np.testing.assert_allclose(model.derivative(times), slope, atol=2e-8)


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_the_derivative_is_third_order_in_the_interval(name):
    times = np.linspace(1.0, 2.0, 400)
    coarse, fine = (np.abs(fitted(name, dt).derivative(times) - waves(times)[1]).max() for dt in (0.05, 0.025))
    assert 2.9 < np.log2(coarse / fine) < 3.3


@pytest.mark.parametrize("name", ["hermite", "raw-hermite"])
def test_a_hermite_cubic_has_the_stored_velocities_at_its_snapshots(name):
    model = fitted(name)
    np.testing.assert_allclose(model.derivative(model.series_.times), model.series_.rates, atol=1e-13)


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_a_parabola_has_a_straight_line_as_derivative_to_the_last_digit(name):
    times = np.linspace(0.0, 1.0, 9)
    model = SURROGATES[name]().fit(times, 0.5 * times[:, None] ** 2, times[:, None])
    asked = np.linspace(0.0, 1.0, 33)
    np.testing.assert_allclose(model.derivative(asked)[:, 0], asked, atol=1e-12)


def test_what_has_no_derivative_or_lies_outside_is_refused():
    times = np.linspace(0.0, 1.0, 9)
    linear = SURROGATES["linear"]().fit(times, times[:, None])
    with pytest.raises(InputError, match="linear has no derivative in closed form; use hermite or spline"):
        linear.derivative([0.5])
    with pytest.raises(InputError, match="outside the fitted window"):
        fitted("hermite").derivative([3.5])
    assert fitted("hermite").derivative([3.5], beyond=True).shape == (1, 2)
    with pytest.raises(InputError, match="has not been fitted"):
        SURROGATES["spline"]().derivative([0.5])


@pytest.mark.parametrize("name", [name for name, member in SURROGATES.items() if member.columnwise])
def test_fewer_modes_of_a_columnwise_surrogate_are_the_same_curves(name):
    times = np.linspace(0.0, 3.0, 61)
    values, rates = waves(times)
    asked = np.linspace(0.0, 3.0, 200)
    both, one = (SURROGATES[name]().fit(times, values[:, :n], rates[:, :n]).predict(asked) for n in (2, 1))
    np.testing.assert_allclose(both[:, :1], one, rtol=1e-13, atol=1e-15)
