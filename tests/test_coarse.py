"""A run without a denser one beside it: what half of its own snapshots tell of it."""

import numpy as np
import pytest

from selection import ArraySnapshots, InputError, Thresholds, intervals_without_truth, sweep, without_truth


def milliseconds(n, step=1):
    return np.arange(n) * 1e-3 * step


def judged(W, limits=None, step=1, groups=None):
    times = milliseconds(W.shape[1], step)
    table = sweep(W, times, intervals_without_truth(times), limits, groups)
    return without_truth(table, ArraySnapshots(W).gram())


def travelling_waves(unseen, m=60):
    """Four travelling waves of amplitude 1, 0.1, 0.01, 0.001, and a motion that every second snapshot misses."""
    x = 2 * np.pi * np.arange(500) / 500
    k = np.arange(2 * m - 1)
    waves = sum(10.0**-j * np.cos((j + 1) * x[:, None] - np.pi * (2 * j + 1) * k / m) for j in range(4))
    return waves + unseen * np.sin(9 * x)[:, None] * np.sin(np.pi * k / 2) ** 2


def smooth_motion(seed, n=481, particles=450, slope=1.5):
    """Motion of 400 frequencies f with amplitudes f^-slope, resolved ever less when snapshots are thinned."""
    rng = np.random.default_rng(seed)
    f, t = np.arange(1.0, 401.0)[:, None], np.linspace(0, 1, n)
    signals = np.cos(np.pi * f * t + rng.uniform(0, 2 * np.pi, f.shape))
    return rng.standard_normal((particles, 400)) @ (f**-slope * signals)


def test_the_two_ratios_bracket_the_modes_of_travelling_waves():
    # rest after four modes 1.01e-4, after five 5.1e-5, against 2.5e-3 unseen: the ratio at the gaps is
    # sqrt(1 + 6.25e-6/1.01e-4) = 1.030 and sqrt(1 + 6.25e-6/5.1e-5) = 1.059; over all times half of that: 1.029
    found = judged(travelling_waves(unseen=2.5e-3))
    assert found.doubled.n_snapshots == 60
    assert found.doubled.n_lr == 4
    assert found.doubled.n_c_range == (4, 5)
    assert found.doubled.K_f_range == (1.0, 1.25)
    assert found.doubled.verdict == "insufficient"
    assert found.recorded.n_snapshots == 119
    assert found.recorded.n_lr == 4
    assert found.recorded.n_c_range[1] == 117
    assert found.recorded.verdict == "undecidable"


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("every", [3, 4, 6])
def test_the_dense_answer_lies_between_the_bounds_of_the_coarse_run(seed, every):
    W = smooth_motion(seed)
    dense = {
        round(c.interval * 1e3): c
        for c in sweep(W, milliseconds(481), [every * 1e-3, 2 * every * 1e-3], groups=None).candidates
    }
    found = judged(W[:, ::every], step=every)
    for coarse, true in ((found.doubled, dense[2 * every]), (found.recorded, dense[every])):
        assert coarse.n_lr == true.n_lr
        assert coarse.n_c_range[0] <= true.n_c <= coarse.n_c_range[1]
        assert coarse.n_c_range[0] < coarse.n_c_range[1]


def test_what_the_papers_ratio_accepts_on_a_coarse_run_is_not_accepted_where_the_truth_is_less():
    W = smooth_motion(1)
    (dense,) = sweep(W, milliseconds(481), [0.008], groups=None).candidates
    (paper,) = sweep(W[:, ::4], milliseconds(121, 4), [0.008], groups=None).candidates
    assert paper.n_c > dense.n_c  # half of its testing times are training times
    limits = Thresholds(feasibility=paper.n_c / paper.n_lr)
    assert sweep(W[:, ::4], milliseconds(121, 4), [0.008], limits, None).chosen_interval == 0.008
    assert judged(W[:, ::4], limits, step=4).doubled.verdict == "undecidable"


def test_a_dense_run_is_told_sufficient_and_a_thinned_one_is_not():
    W = smooth_motion(1)
    dense, thin = judged(W[:, ::2], step=2), judged(W[:, ::8], step=8)
    assert dense.recorded.verdict == "sufficient"
    assert judged(W).doubled.verdict == "sufficient"
    assert thin.recorded.verdict != "sufficient"
    assert thin.doubled.verdict == "insufficient"


def test_snapshots_that_have_nothing_in_common_are_too_few_for_two_modes_each():
    W = np.random.default_rng(0).standard_normal((400, 121))
    recorded = judged(W).recorded
    assert recorded.verdict == "insufficient"
    assert recorded.reasons == ["121 snapshots have at most 119 consistent modes, 2 n_lr = 240 are needed"]


def test_n_c_is_never_said_to_grow_by_more_than_half_nor_to_shrink():
    for seed in range(3):
        found = judged(smooth_motion(seed)[:, ::2])
        assert found.doubled.n_c_range[0] <= found.recorded.n_c_range[0] <= 1.5 * found.doubled.n_c_range[0]


@pytest.mark.physics
def test_coefficients_without_a_time_axis_are_not_sufficient_however_consistent():
    # the subspace is right at unseen times, but nothing can be interpolated
    rng = np.random.default_rng(2)
    shapes = np.linalg.qr(rng.standard_normal((1500, 12)))[0]
    W = (shapes * [1.0, 0.5, *(0.01 * 0.9 ** np.arange(10))]) @ rng.standard_normal((12, 801))
    found = judged(W + 2e-6 * rng.standard_normal(W.shape))
    for bounded in (found.recorded, found.doubled):
        assert bounded.K_f_range[0] >= 2
        assert bounded.R_a > 10
        assert bounded.verdict != "sufficient"


@pytest.mark.physics
def test_a_floor_of_noise_misleads_seldom_and_by_a_few_modes():
    # modes sink into the noise however dense the snapshots are, and n_c stops growing: the known limit of the bound
    beyond = []
    for slope in (2.5, 3.0, 4.0):
        for noise in (1e-5, 1e-4):
            W = smooth_motion(3, slope=slope)
            W += noise * np.random.default_rng(1).standard_normal(W.shape)
            dense = sweep(W, milliseconds(481), [8e-3, 4e-3, 3e-3], groups=None).candidates
            for true, every in zip(dense, (8, 4, 3), strict=True):
                beyond.append(judged(W[:, ::every], step=every).recorded.n_c_range[0] - true.n_c)
    assert sum(excess > 0 for excess in beyond) <= 3  # of 18
    assert max(beyond) <= 5


def test_the_resolution_of_a_run_is_taken_at_more_modes_than_that_of_half_its_snapshots():
    found = judged(smooth_motion(0)[:, ::2])
    assert found.recorded.R_a > found.doubled.R_a > 1


def test_the_interval_of_the_index_widens_its_bounds():
    W = smooth_motion(0)[:, ::3]
    without, with_groups = judged(W), judged(W, groups=10)
    assert with_groups.doubled.K_f_range[0] < without.doubled.K_f_range[0]
    assert with_groups.doubled.K_f_range[1] > without.doubled.K_f_range[1]
    assert with_groups.recorded.K_f_range[0] < without.recorded.K_f_range[0]


def test_two_snapshots_are_refused_and_three_cannot_tell():
    with pytest.raises(InputError, match=r"2 snapshots; .* at least 3"):
        intervals_without_truth(milliseconds(2))
    found = judged(np.random.default_rng(0).standard_normal((50, 3)))
    for bounded in (found.recorded, found.doubled):
        assert bounded.verdict == "undecidable"
        assert "too few snapshots: 2, at least 10 needed" in bounded.reasons


def test_what_does_not_move_cannot_be_judged():
    found = judged(np.ones((50, 61)))
    for bounded in (found.recorded, found.doubled):
        assert bounded.verdict == "undecidable"
        assert bounded.K_f_range is None
        assert "nothing moves: the variable is the same in every snapshot" in bounded.reasons


def test_one_particle_cannot_tell():
    # one row is one mode: nothing is left to be consistent, and no particles can be left out
    found = judged(np.cos(np.linspace(0, 9, 61))[None], groups=10)
    assert found.recorded.verdict == found.doubled.verdict == "undecidable"


def test_a_band_limited_motion_is_exhausted_by_its_modes():
    rng = np.random.default_rng(1)
    t = np.arange(301) / 300
    shapes = np.linalg.qr(rng.standard_normal((400, 10)))[0]
    W = shapes @ np.concatenate([[np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)] for f in range(1, 6)])
    found = judged(W)
    assert found.doubled.n_c_range == (9, 9)
    assert found.recorded.verdict == found.doubled.verdict == "undecidable"
    assert any("before R_c exceeds 1.05" in reason for reason in found.recorded.reasons)


def test_a_sweep_of_other_intervals_is_refused():
    with pytest.raises(InputError, match="intervals_without_truth"):
        without_truth(sweep(smooth_motion(0), milliseconds(481), [0.004], groups=None), np.eye(481))


def test_the_answer_is_plain():
    found = judged(smooth_motion(0)[:, ::8]).as_dict()
    assert list(found) == ["recorded", "doubled"]
    for bounded in found.values():
        assert list(bounded) == [
            "interval", "n_snapshots", "n_lr", "n_c_range", "K_f_range", "R_a", "verdict", "reasons",
        ]  # fmt: skip
        assert isinstance(bounded["n_c_range"], list)
