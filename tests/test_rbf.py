"""Radial basis functions in time: kernel choice, windows, conditioning."""

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from surrogates import InputError, Rbf
from surrogates.kernel import FAMILIES, Kernel, KernelName, candidates
from surrogates.leave_one_out import leave_one_out
from surrogates.windows import MARGIN, WindowedRbf, windows

Array = NDArray[np.floating]


def smooth(times: Array, modes: int = 3) -> Array:
    """Coefficients of a flow that ten snapshots per period resolve; times in Δτ."""
    k = np.arange(modes)
    return np.exp(-k / 2) * np.sin(2 * np.pi * times[:, None] * (1 + k) / (10 * modes) + k)


def refitted_without(i: int, kernel: Kernel, times: Array, values: Array) -> Array:
    rest = np.delete(np.arange(len(times)), i)
    curve = RBFInterpolator(
        times[rest, None], values[rest], kernel=kernel.name, epsilon=kernel.shape, degree=kernel.degree
    )
    return curve(times[i : i + 1, None])[0]


def test_the_kernels_offered_are_those_of_the_type() -> None:
    assert set(get_args(KernelName)) == set(FAMILIES)


@pytest.mark.parametrize("kernel", candidates(None, None, 20), ids=lambda kernel: f"{kernel.name} {kernel.shape}")
def test_leaving_one_out_in_closed_form_is_refitting_without_it(kernel: Kernel) -> None:
    times = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 20))
    values = smooth(times)
    errors = leave_one_out(kernel, times, values)
    direct = np.array([values[i] - refitted_without(i, kernel, times, values) for i in range(20)])
    # the ends extrapolate by the highest polynomial: compare with the size of their error
    np.testing.assert_allclose(errors, direct, rtol=1e-7, atol=1e-8)


def test_a_singular_matrix_has_an_infinite_leave_one_out_error() -> None:
    flat = Kernel("gaussian", 1e-9, 0)  # every entry is 1
    assert np.isinf(leave_one_out(flat, np.arange(5.0), np.ones((5, 1)))).all()


@pytest.mark.parametrize("snapshots", [2, 3, 17, 18, 33, 34, 100, 501])
def test_windows_answer_for_every_interval_once_and_see_enough_on_either_side(snapshots: int) -> None:
    parts = windows(snapshots)
    assert [i for w in parts for i in range(w.first, w.last)] == list(range(snapshots - 1))
    for w in parts:
        seen = range(snapshots)[w.seen]
        assert seen[0] == max(0, w.first - MARGIN)
        assert seen[-1] == min(snapshots - 1, w.last + MARGIN)


def test_the_curve_is_continuous_where_windows_meet() -> None:
    times = np.arange(100.0)
    curve = WindowedRbf.through(times, smooth(times), Kernel("multiquadric", 0.5, 3))
    seams = curve.begins[1:]
    assert len(seams) == 6
    # the curve's slope is below 1 per Δτ, so 2e-9 Δτ apart it differs by less than 2e-9, and rounding
    assert np.abs(curve(seams + 1e-9) - curve(seams - 1e-9)).max() < 3e-9


def test_snapshots_outside_the_window_hardly_matter() -> None:
    times = np.arange(200.0)
    values, kernel = smooth(times), Kernel("cubic", 1.0, 3)
    inside = np.linspace(60, 140, 777)
    whole = RBFInterpolator(times[:, None], values, kernel="cubic", epsilon=1.0, degree=3)(inside[:, None])
    windowed = WindowedRbf.through(times, values, kernel)(inside)
    error = np.abs(whole - smooth(inside)).max()
    # eight snapshots away a cubic weighs 0.27⁸, at the corner of a window raised by the polynomial of degree 3
    assert np.abs(windowed - whole).max() < 0.01 * error


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("snapshots", [5, 40, 500])
def test_every_kernel_passes_through_its_centres(name: KernelName, snapshots: int) -> None:
    times = 0.004 * np.arange(snapshots)
    values = smooth(times / 0.004, 10)
    surrogate = Rbf(name).fit(times, values)
    assert surrogate.kernel_.name == name
    np.testing.assert_allclose(surrogate.predict(times), values, rtol=0, atol=1e-10)  # gate of the verification table


def test_the_kernel_chosen_has_the_least_leave_one_out_error() -> None:
    times = np.arange(15.0)
    values = smooth(times)
    surrogate = Rbf().fit(times, values)
    assert surrogate.leave_one_out_.keys() == set(candidates(None, None, 15))
    for kernel, error in surrogate.leave_one_out_.items():
        misses = [values[i] - refitted_without(i, kernel, times, values) for i in range(1, 14)]
        assert error == pytest.approx(np.sqrt(np.mean(np.sum(np.square(misses), axis=1))), rel=1e-6)
    assert surrogate.leave_one_out_[surrogate.kernel_] == min(surrogate.leave_one_out_.values())


def test_a_smooth_series_gets_a_smooth_kernel_and_a_random_walk_straight_lines() -> None:
    times = np.arange(300.0)
    assert Rbf().fit(times, smooth(times / 4)).kernel_.name == "quintic"
    walk = np.cumsum(np.random.default_rng(0).standard_normal((300, 20)), axis=0)
    # given its ends, a Brownian path is on average the straight line between them: no kernel can do better
    assert Rbf().fit(times, walk).kernel_.name == "linear"


def test_the_chosen_kernel_errs_little_more_than_the_best_one_between_snapshots() -> None:
    times = np.arange(150.0)
    middles = times[:-1] + 0.5
    chosen = Rbf().fit(times, smooth(times))
    errors = {
        kernel: np.linalg.norm(
            Rbf(kernel.name, kernel.shape).fit(times, smooth(times)).predict(middles) - smooth(middles)
        )
        for kernel in chosen.leave_one_out_
    }
    # leaving one out measures gaps of 2 Δτ, so its choice may be the second best; it may not be a bad one
    assert errors[chosen.kernel_] <= 1.5 * min(errors.values())


def test_constant_and_zero_series_are_reproduced() -> None:
    times = np.arange(30.0)
    surrogate = Rbf().fit(times, np.tile([0.0, 3.0], (30, 1)))
    np.testing.assert_allclose(surrogate.predict([0.5, 7.3]), [[0, 3], [0, 3]], atol=1e-13)
    assert (Rbf().fit(times, np.zeros((30, 2))).predict([0.5]) == 0).all()


def test_beyond_the_window_the_last_curve_continues() -> None:
    times = np.arange(50.0)
    surrogate = Rbf("cubic").fit(times, smooth(times / 3))
    ahead = np.array([49.1])
    # a tenth of Δτ ahead the cubic's error is still of the order of that between snapshots
    np.testing.assert_allclose(surrogate.predict(ahead, beyond=True), smooth(ahead / 3), atol=1e-3)


@pytest.mark.parametrize(
    ("kernel", "shape", "message"),
    [
        ("sinc", None, "kernel 'sinc' is unknown; use one of linear, thin_plate_spline, cubic"),
        (None, 1.0, "shape 1 given without a kernel"),
        ("gaussian", 0.0, "shape is 0; use a positive number per snapshot interval"),
        ("gaussian", np.nan, "shape is nan"),
    ],
)
def test_a_kernel_that_does_not_exist_is_refused(kernel: str | None, shape: float | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Rbf(kernel, shape)


def test_a_kernel_too_flat_for_the_arithmetic_is_refused_rather_than_used() -> None:
    times = np.arange(40.0)
    with pytest.raises(InputError, match=r"kernel gaussian misses its own snapshots .* take a larger shape"):
        Rbf("gaussian", 0.02).fit(times, np.random.default_rng(0).standard_normal((40, 2)))


def test_the_quintic_kernel_needs_four_snapshots() -> None:
    with pytest.raises(InputError, match="kernel quintic needs at least 4 snapshots, 3 given"):
        Rbf("quintic").fit([0.0, 1.0, 2.0], np.ones((3, 1)))


def test_a_thousand_snapshots_of_sixty_modes_are_fitted_within_two_seconds() -> None:
    times = np.arange(1000.0)
    assert Rbf().fit(times, smooth(times, 60)).fit_seconds_ < 2  # about 0.1 s on two cores
