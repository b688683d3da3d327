"""Numbers kept in fewer bits are read back within the step of their kind, and take the bytes that are counted."""

import numpy as np
import pytest

from suffice.precision import PRECISIONS, bytes_kept, extent_of, narrowed, precisions_from, read_back
from suffice.refusal import Refusal
from surrogates import SURROGATES

NARROW = ["single", "half", "int16", "int8"]


def table(rows=500, columns=6, seed=0):
    """Columns of very different size and origin."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((rows, columns)) * 10.0 ** np.arange(-6, columns - 6) + np.arange(columns)


def lost(values, precision):
    return read_back(values, precision, extent_of([values])) - values


def test_double_keeps_every_digit():
    assert not lost(table(), "double").any()


@pytest.mark.parametrize(("precision", "steps"), [("int16", 32767), ("int8", 127)])
def test_an_integer_is_within_half_a_step_of_its_column_and_as_wrong_as_even_chances_say(precision, steps):
    values = table(rows=20_000)
    step = (values.max(axis=0) - values.min(axis=0)) / 2 / steps
    error = lost(values, precision)
    assert (np.abs(error).max(axis=0) <= 0.5 * step * (1 + 1e-9)).all()
    assert np.sqrt((error**2).mean(axis=0)) == pytest.approx(step / np.sqrt(12.0), rel=0.03)


def test_half_precision_errs_by_its_eleven_bits_of_what_departs_from_the_mean():
    values = table(rows=20_000)
    apart = values - values.mean(axis=0)
    relative = np.sqrt((lost(values, "half") ** 2).mean(axis=0)) / np.sqrt((apart**2).mean(axis=0))
    # evenly between 2^-12 and 0 of each number's own power of two: 2^-11 of it at most, some 0.4 of that in the mean
    assert (relative < 2.0**-11).all()
    assert (relative > 0.1 * 2.0**-11).all()


def test_half_precision_loses_nothing_to_a_large_unit_or_a_far_origin():
    values = np.random.default_rng(1).standard_normal((1000, 1))
    near = np.abs(lost(values, "half")).max()
    assert np.abs(lost(1e9 * values, "half")).max() == pytest.approx(1e9 * near, rel=1e-6)
    assert np.abs(lost(values + 1e3, "half")).max() == pytest.approx(near, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_fewer_bits_never_err_less(seed):
    values = table(seed=seed)
    errors = [float(np.square(lost(values, name)).sum()) for name in ("double", "single", "half", "int8")]
    assert errors == sorted(errors)
    assert lost(values, "int16").std() < lost(values, "half").std()


@pytest.mark.parametrize("precision", NARROW)
def test_a_column_in_which_nothing_differs_is_kept(precision):
    values = np.full((7, 2), 0.3)
    assert np.abs(lost(values, precision)).max() <= 0.3 * 2.0**-24


def test_an_extent_is_the_same_for_any_blocks():
    values = table()
    whole, parts = extent_of([values]), extent_of(np.array_split(values, 7))
    assert (whole.low == parts.low).all()
    assert (whole.high == parts.high).all()
    np.testing.assert_allclose(whole.mean, parts.mean, rtol=1e-12)


def test_a_packed_column_also_keeps_its_shift_and_scale():
    assert [bytes_kept(100, 3, name) for name in PRECISIONS] == [2400, 1200, 648, 648, 348]


def test_a_run_is_kept_in_its_own_precision_first_and_in_integers():
    assert precisions_from(8) == ["double", "int16", "int8"]
    assert precisions_from(4) == ["single", "int16", "int8"]
    assert precisions_from(8, ["half", "single"]) == ["double", "single", "half"]
    assert precisions_from(4, []) == ["single"]


@pytest.mark.parametrize("asked", ["double", "quarter"])
def test_a_precision_that_is_wider_than_the_run_or_unknown_is_refused(asked):
    with pytest.raises(Refusal, match="use single, half, int16, int8"):
        precisions_from(4, [asked])


@pytest.mark.parametrize("name", ["spline", "hermite", "rbf", "gp", "linear"])
def test_a_surrogate_read_back_from_fewer_bits_errs_as_its_coefficients_do(name):
    t = 0.01 * np.arange(40)
    c, rates = np.sin(t[:, None] * [20.0, 35.0, 50.0]), [20.0, 35.0, 50.0] * np.cos(t[:, None] * [20.0, 35.0, 50.0])
    fitted = SURROGATES[name]().fit(t, c, rates)
    asked = np.linspace(0.0, t[-1], 77)
    error = {}
    for precision in NARROW:
        other, size = narrowed(fitted, precision)
        error[precision] = np.abs(other.predict(asked) - fitted.predict(asked)).max()
        tables = [array for array in fitted.state().values() if array.ndim == 2]
        saved = sum(array.nbytes - bytes_kept(*array.shape, precision) for array in tables)
        assert size == sum(array.nbytes for array in fitted.state().values()) - saved
    # coefficients of size 1, and interpolation that enlarges what it interpolates at most twofold
    assert error["int8"] <= 2.0 * 0.5 / 127
    assert error["int16"] <= 2.0 * 0.5 / 32767
    assert error["single"] <= 1e-6


def test_a_surrogate_in_double_is_bitwise_the_same():
    t = 0.01 * np.arange(9)
    fitted = SURROGATES["spline"]().fit(t, np.sin(t)[:, None])
    other, size = narrowed(fitted, "double")
    assert (other.predict([0.033]) == fitted.predict([0.033])).all()
    assert size == sum(array.nbytes for array in fitted.state().values())
