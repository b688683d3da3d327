"""Runs at the edge of what can be decided: the right verdict, or a refusal that says why."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from selection import ArraySnapshots, InputError, Thresholds, is_sufficient, sweep
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import select_run
from suffice.store import RunWriter

AROUND_ONE = np.random.default_rng(0).uniform(0.0, 60.0, (2, 40, 3))


def milliseconds(n):
    return np.arange(n) * 1e-3


def motion(n_snapshots, interval=0.02):
    """Positions of 40 beads on sines, (snapshots, 40, 3): of full rank."""
    pace, phase = AROUND_ONE
    return np.sin(pace * interval * np.arange(n_snapshots)[:, None, None] + phase)


@pytest.fixture
def judge_positions(tmp_path):
    """Write positions (snapshots, n, 3) as a run, and judge it."""

    def judged(position, variables=("position.x",), intervals=None, precision="double", times=None):
        n = position.shape[1]
        about = {"ids": np.arange(n), "radius": np.full(n, 5e-4), "species": np.ones(n, int), "provenance": {}}
        path = tmp_path / "run.h5"
        with RunWriter(path, **about, n_snapshots=len(position), variables=("position",), precision=precision) as run:
            for k, snapshot in enumerate(position):
                run.append(k * 1e-3 if times is None else times[k], {"position": snapshot})
        with Run(path) as run:
            return select_run(run, variables, intervals)

    return judged


def test_two_snapshots_have_no_interval_between_them_and_only_their_own_cannot_be_judged(judge_positions):
    with pytest.raises(Refusal, match=r"run\.h5: times: 2 snapshots, the run is too short; .* at least 3"):
        judge_positions(motion(2))
    (candidate,) = judge_positions(motion(2), intervals=[0.001])["position.x"].candidates
    assert (candidate.n_snapshots, candidate.n_lr, candidate.K_f, candidate.error_n_c) == (2, 1, None, None)
    assert candidate.verdict == "undecidable"
    assert "Δτ equals the dense interval: no unseen snapshot to test on" in candidate.reasons


def test_one_snapshot_is_refused(judge_positions):
    with pytest.raises(Refusal, match=r"1 snapshot\(s\); a choice of Δτ needs at least 2"):
        judge_positions(motion(1))


def test_one_particle_moves_in_three_directions_and_is_too_few_to_tell(judge_positions):
    found = judge_positions(motion(61)[:, :1], ("position.x", "position"))
    for name, rank in (("position.x", 1), ("position", 3)):
        for candidate in found[name].candidates:
            assert len(candidate.eigenvalues) == rank
            assert candidate.n_lr <= rank
            assert candidate.verdict == "undecidable"
            assert "too few particles to resample" in candidate.reasons


def test_identical_snapshots_have_nothing_to_decide(judge_positions):
    still = np.repeat(motion(1), 61, axis=0)
    for candidate in judge_positions(still)["position.x"].candidates:
        assert (candidate.n_lr, candidate.n_c, candidate.K_f, candidate.error_n_c) == (0, 0, None, 0.0)
        assert candidate.verdict == "undecidable"
        assert "nothing moves: the variable is the same in every snapshot" in candidate.reasons


def test_training_snapshots_alike_and_the_unseen_not_are_never_sufficient(judge_positions):
    # at every second snapshot all beads are back where they were: training at 2 ms sees no motion at all
    back = np.repeat(motion(1), 61, axis=0)
    back[1::2] += 1e-3 * np.random.default_rng(1).standard_normal(back[1::2].shape)
    (candidate,) = judge_positions(back, intervals=[0.002])["position.x"].candidates
    assert candidate.n_lr == 0
    assert not candidate.sufficient
    assert candidate.error_n_c == pytest.approx(1e-3, rel=0.1)  # and the reader sees what is missed
    assert candidate.verdict == "undecidable"


def test_one_mode_represents_every_snapshot_of_rank_one():
    t = milliseconds(121)
    W = np.random.default_rng(2).standard_normal((300, 1)) * np.cos(40.0 * t) + 5.0
    for candidate in sweep(W, t).candidates:
        assert candidate.n_lr == 1
        assert candidate.error_n_lr == pytest.approx(0.0, abs=1e-7)
        assert candidate.verdict == "undecidable"  # E_train is at round-off before anything is exceeded
        assert any("E_train at round-off" in reason for reason in candidate.reasons)


def test_an_interval_that_does_not_divide_the_range_trims_the_testing_set(judge_positions):
    (candidate,) = judge_positions(motion(65), intervals=[0.007])["position.x"].candidates
    (cut,) = judge_positions(motion(64), intervals=[0.007])["position.x"].candidates
    assert candidate.n_snapshots == cut.n_snapshots == 10
    assert_allclose(candidate.curves.R_c, cut.curves.R_c, rtol=1e-9)


def travelling_waves(m, unseen=1e-3):
    """Four travelling waves of amplitude 1, 0.1, … over whole periods, and a fifth motion at odd snapshots alone."""
    x, k = 2 * np.pi * np.arange(100) / 100, np.arange(2 * m - 1)
    waves = sum(10.0**-j * np.cos((j + 1) * x[:, None] - np.pi * (2 * j + 1) * k / m) for j in range(4))
    return waves + unseen * np.sin(9 * x)[:, None] * np.sin(np.pi * k / 2) ** 2


@pytest.mark.physics
def test_five_thousand_snapshots_are_judged_to_the_integer():
    # as in test_sweep: n_lr = 4 and, wherever Δτ is an even number of ms, the fifth motion is not seen: n_c = 5
    W = travelling_waves(2500)
    found = sweep(W, milliseconds(W.shape[1]), groups=2).candidates
    even = [c for c in found if round(c.interval * 1e3) % 2 == 0]
    assert [(c.n_lr, c.n_c, c.sufficient) for c in even] == [(4, 5, False)] * 5
    assert even[-1].n_snapshots == 2500
    assert even[-1].curves.R_gap[6] == pytest.approx(2**0.5, rel=1e-6)
    # where Δτ is odd it is seen as well, as a mode of its own: nothing is unseen
    odd = [c for c in found if round(c.interval * 1e3) % 2 == 1]
    assert [(c.n_lr, c.n_c, c.verdict) for c in odd] == [(4, 8, "undecidable")] * 4


@pytest.mark.physics
def test_many_snapshots_of_few_motions_are_judged_as_singular_values_do():
    # rank 30 of 401 training snapshots takes the way through few rows; the oracle is an SVD with formed residuals
    rng, t = np.random.default_rng(3), np.arange(1201)
    shapes = np.linalg.qr(rng.standard_normal((500, 30)))[0] * 10.0 ** (-3 * np.arange(30) / 30)
    W = shapes @ rng.standard_normal((30, 40)) @ np.cos(np.pi * np.arange(1, 41)[:, None] * t / 1200 * 9)
    (candidate,) = sweep(W, t * 1e-3, [0.003]).candidates
    training = np.arange(0, 1201, 3)
    D = W - W[:, training].mean(axis=1, keepdims=True)
    U = np.linalg.svd(D[:, training], full_matrices=False)[0]
    n = len(candidate.curves.R_c)
    assert n == 30
    error = np.array([np.sqrt(np.square(D - U[:, :k] @ (U[:, :k].T @ D)).mean(axis=0)) for k in range(n)])
    ratio = error.mean(axis=1) / error[:, training].mean(axis=1)
    known = error[:, training].mean(axis=1) > 5e-4 * np.sqrt(np.square(D[:, training]).mean())
    assert np.abs(candidate.curves.R_c - ratio)[known].max() <= 1e-8


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("variables", [("position.y",), ("position.x", "position.y", "position")])
def test_a_value_that_is_not_finite_is_named_by_its_place(judge_positions, value, variables):
    bad = motion(31)
    bad[17, 5, 1] = value
    where = (
        "position.y: snapshots: row 5" if len(variables) == 1 else r"position: .* \(component 1 of particle or cell 5\)"
    )
    with pytest.raises(Refusal, match=rf"run\.h5: {where} of snapshot 17 is {value}"):
        judge_positions(bad, variables)


def test_a_component_that_is_fine_is_judged_beside_one_that_is_not(judge_positions):
    bad = motion(31)
    bad[17, 5, 1] = np.nan
    assert judge_positions(bad, ("position.x",))["position.x"].candidates


@pytest.mark.parametrize("scale", [1e150, 1e-150, 1e-170])
@pytest.mark.parametrize("wrap", [np.asarray, ArraySnapshots])
def test_motion_whose_square_no_double_holds_is_refused(judge_positions, scale, wrap):
    W = motion(61)
    message = "whose square a double cannot hold; choose a unit in which"
    with pytest.raises(InputError, match=message):
        sweep(wrap(scale * W[:, :, 0].T), milliseconds(61))
    with pytest.raises(Refusal, match=message):
        judge_positions(scale * W)


@pytest.mark.parametrize("scale", [1e130, 1e-130])
def test_the_verdict_does_not_depend_on_the_unit(judge_positions, scale):
    one, other = (judge_positions(factor * motion(61))["position.x"] for factor in (1.0, scale))
    for mine, theirs in zip(one.candidates, other.candidates, strict=True):
        assert (mine.n_lr, mine.n_c, mine.verdict) == (theirs.n_lr, theirs.n_c, theirs.verdict)
        assert theirs.error_n_c == pytest.approx(scale * mine.error_n_c, rel=1e-9)


def test_times_that_are_not_uniform_are_refused_before_a_row_is_read(judge_positions):
    bad = motion(31)
    bad[3] = np.nan
    times = milliseconds(31) + 0.0004 * (np.arange(31) > 20)
    with pytest.raises(Refusal, match=r"times: not uniform, snapshot \d+ .* resample the run"):
        judge_positions(bad, times=times)


@pytest.mark.parametrize(
    ("limit", "says"),
    [
        ({"energy": 2.0}, "energy is 2; it is a share"),
        ({"energy": np.nan}, "energy is nan; give a finite one above 0"),
        ({"consistency": 1.0}, "consistency is 1; give a finite one above 1"),
        ({"feasibility": np.inf}, "feasibility is inf"),
        ({"resolution": 0.5}, "resolution is 0.5; give a finite one above 1"),
    ],
)
def test_thresholds_that_no_ratio_can_meet_are_refused(limit, says):
    W, times = np.sin(np.outer(np.arange(1, 9), np.arange(40) * 0.1)), 0.1 * np.arange(40)
    for judge in (partial(sweep, W, times, [0.2]), partial(is_sufficient, W, times, 0.2)):
        with pytest.raises(InputError, match=says):
            judge(thresholds=Thresholds(**limit))
