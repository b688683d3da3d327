"""Contract of every surrogate: what a regressor in time owes to its data."""

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file

from surrogates import SURROGATES, InputError, Network, Rbf, Surrogate, measure_cost
from surrogates.interpolant import Interpolant

Array = NDArray[np.floating]
EVERY = list(SURROGATES)
INTERPOLANTS = [name for name, member in SURROGATES.items() if issubclass(member, Interpolant)]
RAW = [name for name, member in SURROGATES.items() if member.raw]
STATE_MAPS = [name for name, member in SURROGATES.items() if member.kind == "state"]
# these know one snapshot and nothing of the next: they jump at every snapshot
FROM_THE_LAST = ["ballistic", "persistence"]
JOINED = [name for name in INTERPOLANTS if name not in FROM_THE_LAST]
# a network of time passes near its snapshots and not through them; tests/test_networks.py says how near
THROUGH = [name for name in EVERY if name != "mlp"]
# single precision and what training makes of a rounding: tests/test_networks.py asks the same with other gates
DETERMINED = [name for name in STATE_MAPS if not issubclass(SURROGATES[name], Network)]
# persistence knows no motion, and a Gaussian process falls back to the mean: a line is no draw from it
EXACT_FOR_LINES = [name for name in INTERPOLANTS if name not in ("persistence", "gp")]


class Signal(NamedTuple):
    times: Array  # (snapshots,) s
    values: Array  # (snapshots, modes)
    rates: Array  # (snapshots, modes) per second


def waves(times: Array, modes: int = 5, period: float = 0.2) -> Signal:
    """Sines of falling amplitude and rising frequency: what the coefficients of a smooth flow look like."""
    k = np.arange(modes)
    omega, amplitude = 2 * np.pi * (1 + k / 2) / period, np.exp(-k / 2.0)
    phase = omega * times[:, None] + k
    return Signal(times, amplitude * np.sin(phase), amplitude * omega * np.cos(phase))


def every(interval: float, snapshots: int, modes: int = 5) -> Signal:
    return waves(interval * np.arange(snapshots), modes)


def fitted(name: str, signal: Signal) -> Surrogate:
    """A few steps of training will do: what is asked here does not depend on how well a network has learnt."""
    few = {"steps": 20} if issubclass(SURROGATES[name], Network) else {}
    return SURROGATES[name](**few).fit(*signal)


def between(times: Array) -> Array:
    """Four times inside each interval, the middle among them."""
    return (times[:-1, None] + np.diff(times)[:, None] * np.array([0.1, 0.4, 0.5, 0.9])).ravel()


def test_the_table_knows_each_surrogate_by_its_own_name() -> None:
    assert all(member.name == name for name, member in SURROGATES.items())


@pytest.mark.parametrize("name", INTERPOLANTS)
@pytest.mark.parametrize("snapshots", [2, 3, 4, 5, 18, 150])
def test_an_interpolant_passes_through_its_snapshots(name: str, snapshots: int) -> None:
    signal = every(0.002, snapshots)
    # 1e-10 of the largest coefficient: the gate of the verification table
    np.testing.assert_allclose(fitted(name, signal).predict(signal.times), signal.values, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", JOINED)
def test_unevenly_spaced_snapshots_are_interpolated_too(name: str) -> None:
    rng = np.random.default_rng(3)
    signal = waves(np.cumsum(0.002 * rng.uniform(0.05, 1.95, 120)))
    surrogate = fitted(name, signal)
    np.testing.assert_allclose(surrogate.predict(signal.times), signal.values, rtol=0, atol=1e-10)
    truth = waves(between(signal.times))
    # a straight line between snapshots errs by h² c''/8, h up to 3.9 ms, each mode: 0.01 for the five together
    assert np.abs(surrogate.predict(truth.times) - truth.values).max() < 0.01


@pytest.mark.parametrize("name", EXACT_FOR_LINES)
def test_uniform_motion_is_predicted_exactly(name: str) -> None:
    times = 0.5 + 0.003 * np.arange(40)
    velocity = np.array([0.3, -2.0, 0.0])
    surrogate = fitted(name, Signal(times, 0.1 + times[:, None] * velocity, np.tile(velocity, (40, 1))))
    asked = between(times)
    # solving a window loses a few digits of sixteen
    np.testing.assert_allclose(surrogate.predict(asked), 0.1 + asked[:, None] * velocity, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", EXACT_FOR_LINES)
def test_two_snapshots_of_one_mode_give_the_line_between_them(name: str) -> None:
    surrogate = fitted(name, Signal(np.array([1.0, 3.0]), np.array([[2.0], [6.0]]), np.array([[2.0], [2.0]])))
    np.testing.assert_allclose(surrogate.predict([1.5, 2.0]), [[3.0], [4.0]], rtol=1e-12)


@pytest.mark.parametrize("name", ["spline", "hermite", "raw-hermite"])
def test_free_fall_is_a_parabola_and_predicted_exactly(name: str) -> None:
    times = 0.01 * np.arange(10)
    surrogate = fitted(name, Signal(times, 1 - 4.905 * times[:, None] ** 2, -9.81 * times[:, None]))
    asked = between(times)
    np.testing.assert_allclose(surrogate.predict(asked), 1 - 4.905 * asked[:, None] ** 2, rtol=1e-13)


@pytest.mark.parametrize(
    ("surrogate", "order"),
    [
        (SURROGATES["linear"](), 2),
        (SURROGATES["raw-linear"](), 2),
        (SURROGATES["spline"](), 4),
        (SURROGATES["hermite"](), 4),
        (SURROGATES["raw-hermite"](), 4),
        (SURROGATES["ballistic"](), 2),
        (SURROGATES["persistence"](), 1),
        (Rbf("linear"), 2),
        (Rbf("cubic"), 4),
        (Rbf("quintic"), 6),
    ],
    ids=lambda given: given.name if isinstance(given, Surrogate) else f"order {given}",
)
def test_the_error_between_snapshots_falls_with_the_order_of_the_regressor(surrogate: Surrogate, order: int) -> None:
    errors = []
    for snapshots in (201, 401):
        signal = every(0.2 / (snapshots - 1), snapshots, modes=2)
        truth = waves(between(signal.times), modes=2)
        errors.append(np.abs(surrogate.fit(*signal).predict(truth.times) - truth.values).max())
    # the largest error stands at an end, where the next term is smaller by a few hω ~ 0.05 only: log2 off by 0.1
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("name", INTERPOLANTS)
def test_modes_superpose(name: str) -> None:
    _, a, a_rate = every(0.002, 80, modes=1)
    times, b, b_rate = waves(0.002 * np.arange(80), modes=1, period=0.07)
    joined = np.hstack([a, b, 2 * a - 3 * b]), np.hstack([a_rate, b_rate, 2 * a_rate - 3 * b_rate])
    first, second, both = fitted(name, Signal(times, *joined)).predict(between(times)).T
    np.testing.assert_allclose(both, 2 * first - 3 * second, rtol=0, atol=1e-11)  # rounding of one window


@pytest.mark.parametrize("name", INTERPOLANTS)
@pytest.mark.parametrize("factor", [1e-12, 1e3, 1e12])
def test_the_unit_of_the_values_does_not_matter(name: str, factor: float) -> None:
    signal = every(0.002, 80)
    asked = between(signal.times)
    scaled = fitted(name, Signal(signal.times, factor * signal.values, factor * signal.rates))
    expected = factor * fitted(name, signal).predict(asked)
    np.testing.assert_allclose(scaled.predict(asked), expected, rtol=0, atol=1e-11 * factor)  # rounding of one window


@pytest.mark.parametrize("name", DETERMINED)
@pytest.mark.parametrize("factor", [1e-12, 1e3, 1e12])
def test_the_unit_of_the_values_does_not_matter_to_a_rollout(name: str, factor: float) -> None:
    times, values, rates = every(0.002, 110)
    later = 0.002 * np.arange(150)
    scaled = fitted(name, Signal(times, factor * values, factor * rates)).predict(later, beyond=True)
    expected = fitted(name, Signal(times, values, rates)).predict(later, beyond=True)
    # factor times the values rounds their last digit, which least squares and forty steps multiply
    np.testing.assert_allclose(scaled / factor, expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", DETERMINED)
@pytest.mark.parametrize(("unit", "shift"), [(1e3, 0.0), (1e-9, 0.0), (1.0, 10.0), (1e6, -3e5)])
def test_neither_origin_nor_unit_of_time_matters_to_a_rollout(name: str, unit: float, shift: float) -> None:
    times, values, rates = every(0.002, 110)
    later = between(0.002 * np.arange(150))
    moved = fitted(name, Signal(unit * times + shift, values, rates / unit))
    expected = fitted(name, Signal(times, values, rates)).predict(later, beyond=True)
    # the map is the same to the last digit; a time shifted by 10 s is rounded by 1e-12 Δτ
    np.testing.assert_allclose(moved.predict(unit * later + shift, beyond=True), expected, rtol=0, atol=2e-11)


@pytest.mark.parametrize("name", EVERY)
def test_what_stands_still_is_predicted_to_stand_still(name: str) -> None:
    times = 0.002 * np.arange(30)
    still = Signal(times, np.tile([0.1, -3e5, 0.0], (30, 1)), np.zeros((30, 3)))
    predicted = fitted(name, still).predict(np.linspace(0, 0.07, 50), beyond=True)
    # the mean of thirty equal numbers is that number but for rounding
    np.testing.assert_allclose(predicted, np.tile([0.1, -3e5, 0.0], (50, 1)), rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize("name", EVERY)
def test_one_mode_that_stands_still_among_moving_ones_stays_still(name: str) -> None:
    times, values, rates = every(0.002, 40)
    values[:, 2], rates[:, 2] = 0.25, 0.0
    predicted = fitted(name, Signal(times, values, rates)).predict(between(times))
    np.testing.assert_allclose(predicted[:, 2], 0.25, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", THROUGH)
def test_two_snapshots_are_enough_to_answer_at_both(name: str) -> None:
    surrogate = fitted(name, every(0.01, 2))
    assert np.isfinite(surrogate.predict([0.0, 0.004, 0.01])).all()
    np.testing.assert_allclose(surrogate.predict([0.0]), every(0.01, 2).values[:1], rtol=0, atol=1e-12)


@pytest.mark.physics
@pytest.mark.parametrize("name", THROUGH)
@pytest.mark.parametrize(("snapshots", "modes"), [(520, 500), (10_000, 5)])
def test_hundreds_of_modes_and_thousands_of_times_are_answered(name: str, snapshots: int, modes: int) -> None:
    times = 0.002 * np.arange(snapshots)
    signal = waves(times, modes=modes)
    predicted = fitted(name, signal).predict(times[::50])
    assert predicted.shape == (len(times[::50]), modes)
    np.testing.assert_allclose(predicted, signal.values[::50], rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", INTERPOLANTS)
@pytest.mark.parametrize(("unit", "shift"), [(1e3, 0.0), (1e-9, 0.0), (1.0, 10.0), (1e6, -3e5)])
def test_neither_origin_nor_unit_of_time_matters(name: str, unit: float, shift: float) -> None:
    times, values, rates = every(0.002, 80)
    asked = between(times)
    moved = fitted(name, Signal(unit * times + shift, values, rates / unit))
    # shifting by 10 s rounds times by 2e-15 s, that is 1e-12 Δτ; a snapshot changes by less than 1 in one Δτ
    np.testing.assert_allclose(
        moved.predict(unit * asked + shift), fitted(name, Signal(times, values, rates)).predict(asked), atol=2e-11
    )


@pytest.mark.parametrize("name", EVERY)
def test_fitting_and_predicting_leave_the_arguments_alone(name: str) -> None:
    given = every(0.002, 30)
    kept = Signal(*(array.copy() for array in given))
    asked = between(given.times)
    for array in (*given, asked):
        array.flags.writeable = False
    fitted(name, given).predict(asked)
    assert all(np.array_equal(a, b) for a, b in zip(given, kept, strict=True))


@pytest.mark.parametrize("name", [name for name in EVERY if name not in RAW])
def test_a_model_of_coefficients_does_not_follow_later_changes_of_its_data(name: str) -> None:
    signal = every(0.002, 30)
    surrogate = fitted(name, signal)
    before = surrogate.predict(between(signal.times))
    signal.values[:] = 0
    signal.rates[:] = 0
    assert np.array_equal(surrogate.predict(between(signal.times)), before)


@pytest.mark.parametrize("name", EVERY)
def test_the_same_data_give_the_same_model(name: str) -> None:
    signal = every(0.002, 50)
    first, second = fitted(name, signal), fitted(name, signal)
    assert first.state().keys() == second.state().keys()
    assert all(np.array_equal(first.state()[key], second.state()[key]) for key in first.state())
    assert np.array_equal(first.predict(between(signal.times)), second.predict(between(signal.times)))


@pytest.mark.parametrize("name", EVERY)
def test_a_model_can_be_fitted_again(name: str) -> None:
    again = fitted(name, every(0.005, 12, modes=3)).fit(*every(0.002, 50))
    asked = between(0.002 * np.arange(50))
    assert np.array_equal(again.predict(asked), fitted(name, every(0.002, 50)).predict(asked))


@pytest.mark.parametrize("name", EVERY)
def test_a_saved_model_predicts_bitwise_the_same(name: str, tmp_path: Path) -> None:
    signal = every(0.002, 50)
    surrogate = fitted(name, Signal(signal.times, np.asfortranarray(signal.values), signal.rates))
    save_file(surrogate.state(), tmp_path / "model.safetensors")
    loaded = SURROGATES[name].from_state(load_file(tmp_path / "model.safetensors"), surrogate.settings())
    asked = np.linspace(0.0 if surrogate.kind == "state" else -0.001, 0.1, 333)
    assert np.array_equal(loaded.predict(asked, beyond=True), surrogate.predict(asked, beyond=True))
    assert loaded.window_ == surrogate.window_


def test_a_model_loaded_in_another_process_predicts_bitwise_the_same(tmp_path: Path) -> None:
    signal = every(0.002, 50)
    surrogate, asked = fitted("rbf", signal), between(signal.times)
    save_file(surrogate.state(), tmp_path / "model.safetensors")
    np.save(tmp_path / "asked.npy", asked)
    program = (
        "import numpy as np; from safetensors.numpy import load_file; from surrogates import Rbf; "
        "np.save('answer.npy', Rbf.from_state(load_file('model.safetensors')).predict(np.load('asked.npy')))"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=tmp_path)
    assert np.array_equal(np.load(tmp_path / "answer.npy"), surrogate.predict(asked))


@pytest.mark.parametrize("name", INTERPOLANTS)
def test_a_prediction_depends_neither_on_the_order_nor_on_the_number_of_times_asked(name: str) -> None:
    signal = every(0.002, 60)
    surrogate, asked = fitted(name, signal), between(signal.times)
    shuffled = np.random.default_rng(1).permutation(len(asked))
    whole = surrogate.predict(asked)
    # one product with a matrix or with a vector differ in rounding
    np.testing.assert_allclose(surrogate.predict(asked[shuffled]), whole[shuffled], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.vstack([surrogate.predict([t]) for t in asked]), whole, rtol=0, atol=1e-12)
    assert surrogate.predict([]).shape == (0, 5)


@pytest.mark.parametrize("name", INTERPOLANTS)
def test_times_outside_the_window_are_answered_only_when_asked_beyond(name: str) -> None:
    surrogate = fitted(name, every(0.1, 4))
    assert surrogate.window_ == pytest.approx((0.0, 0.3))
    with pytest.raises(InputError, match=r"time 0\.31 s lies outside the fitted window 0 to 0\.3 s"):
        surrogate.predict([0.1, 0.31])
    with pytest.raises(InputError, match=r"time -0\.01 s"):
        surrogate.predict([-0.01])
    assert np.isfinite(surrogate.predict([-0.01, 0.31], beyond=True)).all()
    assert np.isfinite(surrogate.predict([0.3, 0.30000000000000004])).all()  # 3 * 0.1


@pytest.mark.parametrize("name", RAW)
def test_raw_snapshots_are_kept_as_they_are_and_column_blocks_give_the_whole(name: str) -> None:
    signal = every(0.002, 20, modes=12)
    matrix = np.asarray(signal.values.T, dtype=np.float32, order="C")  # (rows, snapshots), as a run stores it
    rates = signal.rates.T.astype(np.float32)
    surrogate = SURROGATES[name]().fit(signal.times, matrix.T, rates.T)
    assert any(np.shares_memory(kept, matrix) for kept in surrogate.arrays().values())
    asked = between(signal.times)
    whole = surrogate.predict(asked)
    assert whole.dtype == np.float64
    blocks = [SURROGATES[name]().fit(signal.times, matrix[i : i + 5].T, rates[i : i + 5].T) for i in (0, 5, 10)]
    assert np.array_equal(np.hstack([block.predict(asked) for block in blocks]), whole)


@pytest.mark.parametrize("name", EVERY)
def test_the_cost_of_a_model_is_measured(name: str) -> None:
    signal = every(0.002, 50)
    surrogate = fitted(name, signal)
    cost = measure_cost(surrogate, between(signal.times))
    assert min(cost.fit_seconds, cost.single_seconds, cost.batch_seconds) > 0
    assert cost.model_bytes == sum(array.nbytes for array in surrogate.state().values())
    if issubclass(SURROGATES[name], Interpolant):
        assert cost.model_bytes >= signal.values.nbytes


TIMES, VALUES = [0.0, 0.1, 0.2], [[1.0], [2.0], [3.0]]


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0], [[1.0]], "times has 1 snapshots; .* at least 2"),
        ([0.0, 0.2, 0.1], VALUES, r"times\[2\] = 0.1 s does not come after times\[1\] = 0.2 s"),
        ([0.0, 0.1, 0.1], VALUES, r"times\[2\] = 0.1 s does not come after"),
        ([0.0, 0.1, 0.1 + 1e-12], VALUES, r"times\[1\] and times\[2\] are 1e-12 s apart"),
        ([0.0, np.nan, 0.2], VALUES, r"times\[1\] is not a finite number of seconds"),
        ([TIMES], VALUES, r"times has shape \(1, 3\)"),
        (TIMES, [[1.0], [np.nan], [3.0]], r"values\[1, 0\] is nan; remove or repair snapshot 1"),
        (TIMES, [[1.0], [np.inf], [3.0]], r"values\[1, 0\] is inf"),
        (TIMES, [[1.0], [2.0]], r"values has shape \(2, 1\), times has 3 snapshots"),
        (TIMES, [1.0, 2.0, 3.0], r"values has shape \(3,\)"),
        (TIMES, [[1.0], [2.0 + 1.0j], [3.0]], "values holds complex or masked values"),
        (TIMES, [[], [], []], r"values has shape \(3, 0\)"),
    ],
)
def test_a_series_that_cannot_be_learnt_is_refused(name: str, times: object, values: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SURROGATES[name]().fit(np.array(times), np.array(values), rates=np.array(values))


def test_what_is_masked_is_not_learnt() -> None:
    with pytest.raises(InputError, match="values holds complex or masked values"):
        SURROGATES["spline"]().fit(TIMES, np.ma.masked_greater([[1.0], [2.0], [3.0]], 2.5))


@pytest.mark.parametrize("name", [name for name in EVERY if SURROGATES[name].needs_rates])
def test_rates_that_are_missing_or_do_not_fit_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"rates is missing; {name} needs"):
        SURROGATES[name]().fit(TIMES, VALUES)
    with pytest.raises(InputError, match=r"rates has shape \(3, 2\), values \(3, 1\)"):
        SURROGATES[name]().fit(TIMES, VALUES, rates=np.zeros((3, 2)))
    with pytest.raises(InputError, match=r"rates\[2, 0\] is nan"):
        SURROGATES[name]().fit(TIMES, VALUES, rates=[[0.0], [0.0], [np.nan]])


@pytest.mark.parametrize("name", EVERY)
def test_a_question_that_makes_no_sense_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="has not been fitted; call fit"):
        SURROGATES[name]().predict([0.1])
    surrogate = fitted(name, every(0.1, 4))
    with pytest.raises(InputError, match=r"times\[1\] is not a finite number"):
        surrogate.predict([0.1, np.nan])
    if surrogate.kind == "time":
        with pytest.raises(InputError, match="start given, but"):
            surrogate.predict([0.1], start=[1.0] * 5)
    if not surrogate.takes_parameters:
        with pytest.raises(InputError, match="parameters given, but"):
            surrogate.predict([0.1], parameters=[[1.0]])
        with pytest.raises(InputError, match="parameters given, but"):
            surrogate.fit(TIMES, VALUES, VALUES, parameters=[[1.0]] * 3)


@pytest.mark.parametrize("name", EVERY)
def test_a_damaged_model_is_refused(name: str) -> None:
    state = fitted(name, every(0.1, 4)).state()
    for missing in state:
        with pytest.raises(InputError, match=f"lacks array '{missing}'"):
            SURROGATES[name].from_state({key: array for key, array in state.items() if key != missing})
    with pytest.raises(InputError, match="'window' of the model has to be 2 finite numbers"):
        SURROGATES[name].from_state({**state, "window": np.array([0.0, np.nan])})
