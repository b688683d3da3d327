"""Contract of every regressor over operating conditions, and what each of them owes to its data."""

import numpy as np
import pytest

from surrogates import CONDITION_SURROGATES, InputError

EVERY = list(CONDITION_SURROGATES)
QUICK = {"mlp": {"steps": 40}}  # what the contract asks of a network needs no training to the end
SPEEDS = np.array([400.0, 600.0, 1200.0, 1600.0])


def quick(name, **settings):
    return CONDITION_SURROGATES[name](**settings, **QUICK.get(name, {}))


def circle(phases):
    turned = 2 * np.pi * np.asarray(phases)
    return np.column_stack([np.cos(turned), np.sin(turned)])


def sampled(speeds, phases):
    """Conditions (samples, 3) of every speed at every phase."""
    return np.column_stack([np.repeat(speeds, len(phases)), np.tile(circle(phases), (len(speeds), 1))])


def waves(conditions, power=1.0):
    """Two modes whose amplitude grows with a power of the speed, turning with the phase."""
    amplitude = (conditions[:, :1] / 1000.0) ** power
    return amplitude * conditions[:, 1:]


def test_the_table_knows_each_regressor_by_its_own_name():
    assert all(member.name == name for name, member in CONDITION_SURROGATES.items())


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("phase", [False, True])
def test_predictions_have_a_row_per_condition_and_a_column_per_mode(name, phase):
    shown = sampled(SPEEDS, np.arange(8) / 8) if phase else SPEEDS[:, None]
    values = np.random.default_rng(0).normal(size=(len(shown), 5))
    asked = sampled([800.0, 1000.0], [0.1]) if phase else np.array([[800.0], [1000.0], [400.0]])
    found = quick(name, phase=phase).fit(shown, values).predict(asked)
    assert found.shape == (len(asked), 5)
    assert np.isfinite(found).all()


@pytest.mark.parametrize("name", EVERY)
def test_neither_the_unit_of_speed_nor_that_of_the_values_matters(name):
    values = np.column_stack([SPEEDS / 1e3, (SPEEDS / 1e3) ** 2])
    one = quick(name).fit(SPEEDS[:, None], values).predict([[800.0]])
    other = quick(name).fit(SPEEDS[:, None] / 60.0, 1e12 * values).predict([[800.0 / 60.0]])
    np.testing.assert_allclose(other, 1e12 * one, rtol=1e-5)


@pytest.mark.parametrize("name", EVERY)
def test_a_speed_outside_those_shown_is_refused_unless_asked_for(name):
    fitted = quick(name).fit(SPEEDS[:, None], SPEEDS[:, None])
    for rpm in (399.0, 1601.0):
        with pytest.raises(InputError, match=rf"= {rpm:g} lies outside the fitted range 400 to 1600; .*beyond"):
            fitted.predict([[rpm]])
        assert np.isfinite(fitted.predict([[rpm]], beyond=True)).all()


@pytest.mark.parametrize("name", EVERY)
def test_a_phase_has_no_outside(name):
    shown = sampled(SPEEDS, (np.arange(4) + 0.3) / 4)
    fitted = quick(name, phase=True).fit(shown, waves(shown))
    assert np.isfinite(fitted.predict(sampled([800.0], [0.0, 0.99]))).all()


@pytest.mark.parametrize("name", EVERY)
def test_the_same_seed_gives_the_same_predictions_bitwise(name):
    first, second = (quick(name, seed=3).fit(SPEEDS[:, None], SPEEDS[:, None] ** 2).predict([[800.0]]) for _ in "ab")
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize(
    ("conditions", "values", "says"),
    [
        ([1.0, 2.0], [[1.0], [2.0]], r"conditions has shape \(2,\)"),
        ([[1.0], [2.0]], [[1.0]], "values has 1 rows, conditions 2"),
        ([[1.0], [np.nan]], [[1.0], [2.0]], r"conditions\[1, 0\] is nan; remove or repair sample 1"),
        ([[1.0], [2.0]], [[1.0], [np.inf]], r"values\[1, 0\] is inf"),
        ([[1.0], [1.0]], [[1.0], [2.0]], "a sample stands there twice"),
        ([[1.0, 3.0], [1.0, 4.0]], [[1.0], [2.0]], r"conditions\[:, 0\] is 1 everywhere"),
    ],
)
def test_data_that_say_nothing_over_conditions_are_refused(name, conditions, values, says):
    with pytest.raises(InputError, match=says):
        quick(name).fit(conditions, values)


@pytest.mark.parametrize("name", EVERY)
def test_a_phase_that_is_no_cosine_and_sine_is_refused(name):
    with pytest.raises(InputError, match="no cosine and sine"):
        quick(name, phase=True).fit([[1.0, 1.0, 1.0], [2.0, 0.0, 1.0]], [[1.0], [2.0]])
    with pytest.raises(InputError, match="give an operating condition before the cosine"):
        quick(name, phase=True).fit([[0.0, 1.0], [1.0, 0.0]], [[1.0], [2.0]])


@pytest.mark.parametrize("name", EVERY)
def test_what_was_not_fitted_predicts_nothing(name):
    with pytest.raises(InputError, match="has not been fitted"):
        quick(name).predict([[1.0]])
    fitted = quick(name).fit(SPEEDS[:, None], SPEEDS[:, None])
    with pytest.raises(InputError, match="conditions has 2 columns, 1 were fitted"):
        fitted.predict([[800.0, 1.0]])


@pytest.mark.parametrize("name", ["nearest", "linear", "rbf"])
def test_straight_lines_are_exact_between_speeds_except_for_the_nearest(name):
    fitted = quick(name).fit(SPEEDS[:, None], 2.0 + SPEEDS[:, None])
    expected = 602.0 if name == "nearest" else 802.0
    assert fitted.predict([[800.0]])[0, 0] == pytest.approx(expected, rel=1e-9)


def test_nearest_and_linear_answer_with_the_phase_that_was_asked_for():
    shown = sampled(SPEEDS, np.arange(8) / 8)
    asked = sampled([800.0], np.arange(8) / 8)
    for name, amplitude in (("nearest", 0.6), ("linear", 0.8)):
        found = quick(name, phase=True).fit(shown, waves(shown)).predict(asked)
        np.testing.assert_allclose(found, amplitude * asked[:, 1:], atol=1e-12)


@pytest.mark.physics
@pytest.mark.parametrize("name", [name for name in EVERY if name not in ("nearest", "linear")])
@pytest.mark.parametrize("phase", [False, True])
def test_what_grows_with_the_square_of_the_speed_is_learnt_better_than_by_straight_lines(name, phase):
    phases = np.arange(8) / 8 if phase else [0.0]
    shown, asked = sampled(SPEEDS, phases), sampled([800.0], phases)
    truth = waves(asked, 2.0)
    columns = slice(None) if phase else slice(0, 1)
    errors = {}
    for other in ("nearest", "linear", name):
        fitted = CONDITION_SURROGATES[other](phase=phase).fit(shown[:, columns], waves(shown, 2.0)[:, : 1 + phase])
        errors[other] = np.linalg.norm(fitted.predict(asked[:, columns]) - truth[:, : 1 + phase])
    assert errors[name] < 0.6 * errors["linear"] < errors["nearest"]


def test_rbf_is_chosen_by_a_speed_left_out_and_smooths_what_is_noise():
    shown = sampled(np.linspace(400.0, 1600.0, 6), np.arange(8) / 8)
    noise = 0.3 * np.random.default_rng(1).normal(size=(len(shown), 2))
    fitted = CONDITION_SURROGATES["rbf"](phase=True).fit(shown, waves(shown) + noise)
    assert fitted.radial_.smoothing > 0.0
    assert fitted.left_out_[fitted.radial_] == min(fitted.left_out_.values())
    asked = sampled([700.0, 1300.0], np.arange(8) / 8)
    # 48 samples for a plane in three dimensions: better than any single one of them
    assert np.sqrt(((fitted.predict(asked) - waves(asked)) ** 2).mean()) < 0.3


def test_powers_of_the_speed_are_straight_lines_over_its_logarithm():
    values = np.log(SPEEDS)[:, None]
    for name in ("linear", "rbf"):
        fitted = CONDITION_SURROGATES[name](logarithmic=True).fit(SPEEDS[:, None], values)
        assert fitted.predict([[800.0]])[0, 0] == pytest.approx(np.log(800.0), rel=1e-9)
        with pytest.raises(InputError, match="lies outside the fitted range 400 to 1600"):
            fitted.predict([[1700.0]])
        with pytest.raises(InputError, match="not positive and have no logarithm"):
            fitted.fit(SPEEDS[:, None] - 400.0, values)


def test_two_speeds_are_enough_for_every_regressor():
    for name in EVERY:
        found = quick(name).fit([[1.0], [3.0]], [[10.0], [30.0]]).predict([[1.9]])
        assert 9.9 <= found[0, 0] <= 30.1
