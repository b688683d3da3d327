"""One pass decides every snapshot interval, on a foreign run and on motions whose answer is known."""

import json
import lzma

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pod import SnapshotMatrix
from selection import ArraySnapshots, InputError, Thresholds, default_intervals, sweep

COLUMNS = {
    f"{name}.{axis}": f"{prefix}{axis}" for name, prefix in (("position", ""), ("velocity", "v")) for axis in "xyz"
}


@pytest.fixture(scope="module")
def shake(reference):
    """Rows of the foreign run by column. For this one file only: the reader of dumps is `suffice.readers`."""
    with lzma.open(reference / "shake.dump.xz", "rt") as file:
        snapshots = [
            part.partition("ITEM: ATOMS ")[2].partition("\n") for part in file.read().split("ITEM: TIMESTEP")[1:]
        ]
    names = snapshots[0][0].split()
    tables = np.array([np.array(text.split(), dtype=float).reshape(-1, len(names)) for _, _, text in snapshots])
    order = np.argsort(tables[:, :, names.index("id")], axis=1)
    tables = np.take_along_axis(tables, order[:, :, None], axis=1)
    return {name: tables[:, :, names.index(column)].T for name, column in COLUMNS.items()}


@pytest.fixture(scope="module")
def expected(reference):
    return json.loads((reference / "shake.expected.json").read_text())


def milliseconds(n):
    return np.arange(n) * 1e-3


@pytest.mark.parametrize("variable", COLUMNS)
def test_every_integer_of_the_foreign_run_is_found(shake, expected, variable):
    table = sweep(SnapshotMatrix(shake[variable]), milliseconds(301))
    assert [round(c.interval * 1e3) for c in table.candidates] == [10, 9, 8, 7, 6, 5, 4, 3, 2]
    for candidate in table.candidates:
        for field, value in expected[variable][str(round(candidate.interval * 1e3))].items():
            assert getattr(candidate, field) == value, (candidate.interval, field)


def test_each_component_of_the_foreign_run_crosses_elsewhere(shake):
    chosen = {v: sweep(shake[v], milliseconds(301), groups=None).chosen_interval for v in COLUMNS}
    assert chosen == dict.fromkeys(COLUMNS) | {"position.z": 0.003}


def direct_ratio(W, training):
    """R_c(n) and E_train(n), n = 0, 1, …, by SVD, projection and residual vectors."""
    D = W[:, : training[-1] + 1] - W[:, training].mean(axis=1, keepdims=True)
    U, _, _ = np.linalg.svd(D[:, training], full_matrices=False)
    errors = [np.sqrt(np.square(D - U[:, :n] @ (U[:, :n].T @ D)).mean(axis=0)) for n in range(len(training))]
    mean = np.array([[e.mean(), e[training].mean()] for e in errors])
    return mean[:, 0] / mean[:, 1], mean[:, 1]


@pytest.mark.physics
@pytest.mark.parametrize("variable", ["position.x", "position.z", "velocity.x"])
def test_one_pass_equals_nine_svds_with_direct_projections(shake, variable):
    W = shake[variable]
    for candidate in sweep(W, milliseconds(301), groups=None).candidates:
        training = np.arange(0, 301, round(candidate.interval * 1e3))
        ratio, error = direct_ratio(W, training)
        n = len(candidate.curves.R_c)
        assert n == int((error > 1e-7 * error[0]).sum())
        difference = np.abs(candidate.curves.R_c - ratio[:n])
        still = error[:n] > 5e-4 * np.sqrt(np.square(W[:, training] - W[:, training].mean(1, keepdims=True)).mean())
        assert difference[still].max() <= 1e-8
        # before R_c is twice its limit nothing worse than 1e-6 is reported: there direct residuals take over
        assert candidate.curves.predicted_error[ratio[:n] < 2.1].max() <= 1e-6
        assert (difference <= 5 * np.maximum(candidate.curves.predicted_error, 1e-13) * ratio[:n]).all()


@pytest.mark.physics
def test_a_steep_spectrum_is_judged_by_direct_residuals():
    # amplitudes over fourteen decades, R_c near one until E_train is at 1e-7: inner products alone err by 1e-2 there
    rng = np.random.default_rng(6)
    t = np.linspace(0, 1, 241)
    W = (np.linalg.qr(rng.standard_normal((2000, 40)))[0] * 10.0 ** (-0.36 * np.arange(40))) @ np.array(
        [np.cos((j + 1) * np.pi * t / 4 + j) for j in range(40)]
    )
    (candidate,) = sweep(W, milliseconds(241), [0.002], groups=None).candidates
    ratio, error = direct_ratio(W, np.arange(0, 241, 2))
    n = len(candidate.curves.R_c)
    assert error[n - 1] < 1e-6 * error[0]
    assert candidate.curves.predicted_error.max() <= 1e-6
    assert np.abs(candidate.curves.R_c / ratio[:n] - 1).max() <= 1e-6


def travelling_waves(unseen=1e-3, m=60):
    """Four travelling waves of falling amplitude, and one that is zero at every other snapshot.

    Training every 2 ms sees m snapshots over whole periods: pairs of equal modes, amplitudes 1, 0.1, 0.01, 0.001. The
    fifth motion, sin²(π t/Δτ), is not in any of them and of the same size at every unseen time.
    """
    x = 2 * np.pi * np.arange(500) / 500
    k = np.arange(2 * m - 1)
    waves = sum(10.0**-j * np.cos((j + 1) * x[:, None] - np.pi * (2 * j + 1) * k / m) for j in range(4))
    return waves + unseen * np.sin(9 * x)[:, None] * np.sin(np.pi * k / 2) ** 2, milliseconds(2 * m - 1)


def test_travelling_waves_have_the_modes_they_should():
    # energies of the pairs: 1, 1e-2, 1e-4, 1e-6. I(3) = 1.005/1.010101 < 0.999 ≤ I(4) = 1.01/1.010101: n_lr = 4.
    # At n = 4 the rest is 0.01005 against 1e-3 unseen, 1 + (sqrt(1 + 0.0099) - 1)/2 = 1.002;
    # at n = 6 it is 0.001 against 0.001, 1 + (sqrt(2) - 1)/2 = 1.21 (m of 2m - 1 times are training times).
    W, times = travelling_waves()
    (candidate,) = sweep(W, times, [0.002], groups=None).candidates
    assert candidate.n_snapshots == 60
    assert candidate.n_lr == 4
    assert candidate.n_c == 5
    assert candidate.K_f == 1.25
    assert not candidate.sufficient
    gaps = 59 / 119
    for n, rest in [(2, 0.010100010**0.5), (4, 1.01e-4**0.5), (6, 1e-3)]:
        R_gap = np.sqrt(1 + 1e-6 / (rest**2 if n != 2 else 1.0101e-2))
        assert_allclose(candidate.curves.R_gap[n], R_gap, rtol=1e-9)
        assert_allclose(candidate.curves.R_c[n], 1 + gaps * (R_gap - 1), rtol=1e-9)
    assert_allclose(candidate.eigenvalues[:2], 500 / 4, rtol=1e-12)


def test_less_unseen_motion_is_consistent_further():
    W, times = travelling_waves(unseen=2e-5)
    (candidate,) = sweep(W, times, [0.002], groups=None).candidates
    # at n = 6 the rest is 1e-3 against 2e-5; after n = 8 nothing is left of the training snapshots
    assert candidate.n_c == 7
    assert candidate.verdict == "undecidable"
    assert "E_train at round-off beyond 7 modes, before R_c exceeds 1.05" in candidate.reasons


def test_a_band_limited_motion_is_exhausted_by_its_modes():
    # five frequencies, all resolved: ten modes represent every snapshot, seen or not, and R_c never exceeds
    rng = np.random.default_rng(1)
    t = np.arange(301) / 300
    shapes = np.linalg.qr(rng.standard_normal((400, 10)))[0]
    W = shapes @ np.concatenate([[np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)] for f in range(1, 6)])
    for candidate in sweep(W, milliseconds(301)).candidates:
        assert candidate.n_lr == 10
        assert candidate.n_c == 9
        assert candidate.verdict == "undecidable"


def test_coefficients_without_a_time_axis_are_consistent_and_yet_not_sufficient():
    # the subspace is right at unseen times, but nothing can be interpolated: R_c does not see it, R_a does
    rng = np.random.default_rng(2)
    shapes = np.linalg.qr(rng.standard_normal((3000, 12)))[0]
    W = (shapes * [1.0, 0.5, *(0.01 * 0.9 ** np.arange(10))]) @ rng.standard_normal((12, 801))
    W += 2e-6 * rng.standard_normal(W.shape)
    (candidate,) = sweep(W, milliseconds(801), [0.002], groups=None).candidates
    assert candidate.sufficient
    assert candidate.R_a is not None
    assert candidate.R_a > 10
    assert candidate.verdict == "insufficient"


def test_any_object_with_products_is_as_good_as_an_array(shake):
    W, times = shake["position.z"], milliseconds(301)
    results = [sweep(source, times).as_dict() for source in (W, ArraySnapshots(W), SnapshotMatrix(W, block_rows=100))]
    for other in results[1:]:
        for mine, theirs in zip(results[0]["candidates"], other["candidates"], strict=True):
            assert mine["n_c"] == theirs["n_c"]
            assert_allclose(mine["K_f_interval"], theirs["K_f_interval"], rtol=1e-6)


def test_the_interval_of_the_index_narrows_with_more_particles():
    rng = np.random.default_rng(4)
    t = np.linspace(0, 1, 201)
    modes = np.array([np.cos(np.pi * j * t + j) / j**2 for j in range(1, 61)])

    def width(particles):
        W = rng.standard_normal((particles, 60)) @ modes
        (candidate,) = sweep(W, milliseconds(201), [0.005]).candidates
        assert candidate.K_f_interval is not None
        low, high = candidate.K_f_interval
        assert low <= candidate.K_f <= high
        return high - low

    few, many = np.mean([width(300) for _ in range(5)]), np.mean([width(4800) for _ in range(5)])
    # sixteen times the particles, four times narrower; five draws of nine degrees of freedom each scatter by a tenth
    assert 2.5 < few / many < 6


def test_too_few_particles_to_resample_leave_no_interval():
    rng = np.random.default_rng(5)
    (candidate,) = sweep(rng.standard_normal((19, 60)), milliseconds(60), [0.003]).candidates
    assert candidate.K_f_interval is None
    assert "too few particles to resample" in candidate.reasons


def test_times_beyond_the_last_training_snapshot_are_trimmed(shake):
    W = shake["position.x"]
    (whole,) = sweep(W, milliseconds(301), [0.007], groups=None).candidates
    (cut,) = sweep(W[:, :295], milliseconds(295), [0.007], groups=None).candidates
    assert whole.n_snapshots == cut.n_snapshots == 43
    assert_allclose(whole.curves.R_c, cut.curves.R_c, rtol=1e-9)


def test_the_dense_interval_itself_cannot_be_judged(shake):
    (candidate,) = sweep(shake["position.x"], milliseconds(301), [0.001]).candidates
    assert candidate.K_f is candidate.n_c_gap is candidate.K_f_gap is None
    assert not candidate.sufficient
    assert candidate.verdict == "undecidable"


def test_a_variable_that_does_not_change_cannot_be_judged():
    table = sweep(np.ones((50, 61)), milliseconds(61))
    assert table.chosen_interval is None
    for candidate in table.candidates:
        assert (candidate.n_lr, candidate.n_c, candidate.K_f) == (0, 0, None)
        assert candidate.verdict == "undecidable"
    json.dumps([c.curves_as_dict() for c in table.candidates])


def test_looser_thresholds_choose_a_coarser_interval(shake):
    strict = sweep(shake["position.z"], milliseconds(301), groups=None)
    loose = sweep(shake["position.z"], milliseconds(301), thresholds=Thresholds(energy=0.99), groups=None)
    assert strict.chosen_interval == 0.003
    assert loose.chosen_interval is not None
    assert loose.chosen_interval > 0.003


def test_the_table_is_ready_for_json(shake):
    table = sweep(shake["position.z"], milliseconds(301), [0.003, 0.01])
    plain = json.loads(json.dumps(table.as_dict()))
    assert plain["chosen_interval"] == 0.003
    assert plain["thresholds"] == {"energy": 0.999, "consistency": 1.05, "feasibility": 2.0, "resolution": 1.25}
    assert list(plain["candidates"][0]) == [
        "interval", "n_snapshots", "n_lr", "n_lr_paper", "n_c", "K_f", "K_f_interval", "n_c_gap", "K_f_gap", "R_a",
        "sufficient", "verdict", "reasons", "error_n_lr", "error_n_c", "K_f_groups", "R_lr",
    ]  # fmt: skip
    assert [c["interval"] for c in plain["candidates"]] == [0.01, 0.003]
    curves = table.candidates[0].curves_as_dict()
    assert {"R_c", "R_gap", "E_train", "E_test", "eigenvalues", "energy_ratio", "predicted_error"} <= set(curves)
    json.dumps(curves)


def test_default_intervals_are_ten_to_two_dense_intervals():
    assert default_intervals(milliseconds(301)) == [0.01, 0.009, 0.008, 0.007, 0.006, 0.005, 0.004, 0.003, 0.002]
    assert default_intervals(milliseconds(5)) == [0.004, 0.003, 0.002]


@pytest.mark.parametrize(
    ("W", "times", "intervals", "message"),
    [
        (np.ones((9, 1)), [0.0], None, r"1 snapshot\(s\); a choice of Δτ needs at least 2"),
        (np.ones((9, 4)), [0.0, 1.0, 2.0, 4.0], None, "not uniform"),
        (np.ones((9, 3)), [2.0, 1.0, 0.0], None, "must increase"),
        (np.ones((9, 3)), [0.0, np.nan, 2.0], None, "snapshot 1 is at nan s"),
        (np.ones((9, 31)), milliseconds(31), [0.0025], r"0.0025 s is not a multiple .* nearest allowed is 0.002 s"),
        (np.ones((9, 31)), milliseconds(31), [0.0004], r"nearest allowed is 0.001 s"),
        (np.ones((9, 31)), milliseconds(31), [-0.001], "positive"),
        (np.ones((9, 31)), milliseconds(31), [0.04], r"longer than the run; the longest allowed is 0.03 s"),
        (np.ones((9, 31)), milliseconds(31), [], "none given"),
        (np.ones((9, 30)), milliseconds(31), None, "31 of them for 30 snapshots"),
        (np.full((9, 31), np.inf), milliseconds(31), None, "row 0, snapshot 0 is inf"),
        (np.ones(31), milliseconds(31), None, r"1 dimension\(s\)"),
        ("run.h5", milliseconds(31), None, "W: "),
        (np.ones((9, 31)) + 1j, milliseconds(31), None, "complex or masked"),
        (np.ma.masked_less(np.eye(9, 31), 1.0), milliseconds(31), None, "complex or masked"),
    ],
)
def test_what_cannot_be_decided_upon_is_refused(W, times, intervals, message):
    with pytest.raises(InputError, match=message):
        sweep(W, times, intervals)


def test_one_group_is_refused():
    with pytest.raises(InputError, match="groups: 1"):
        sweep(np.ones((9, 31)), milliseconds(31), groups=1)
