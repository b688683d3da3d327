"""What the first part of a run tells of the whole, on motions whose growth is known."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from selection import ArraySnapshots, InputError, Thresholds, forecast, growth_of_modes, sweep

ENERGY = 0.999


def milliseconds(n):
    return np.arange(n) * 1e-3


def gram_of(W):
    return ArraySnapshots(W).gram()


def foreseen(W, duration, limits=None, intervals=None):
    table = sweep(W, milliseconds(W.shape[1]), intervals, limits, groups=None)
    return forecast(table, gram_of(W), duration)


def irregular_motion(seed, n, particles=600):
    """Stationary motion without end: a Gaussian spectrum of 40 Hz, of which more is seen the longer it lasts."""
    rng = np.random.default_rng(seed)
    t = milliseconds(n)
    f = np.arange(0.5, 200.0, 0.25)[:, None]
    size = np.exp(-0.5 * (f / 40.0) ** 2)
    signals = np.concatenate([size * np.cos(2 * np.pi * f * t), size * np.sin(2 * np.pi * f * t)])
    return rng.standard_normal((particles, len(signals))) @ signals


def periodic_motion(n, period=50, decay=2.0):
    """Harmonics up to the 20th of one period, of falling amplitude, each a pair of modes."""
    rng = np.random.default_rng(3)
    t = np.arange(n) / period
    k = np.arange(1, 21)[:, None]
    signals = np.concatenate([k**-decay * np.cos(2 * np.pi * k * t), k**-decay * np.sin(2 * np.pi * k * t)])
    return rng.standard_normal((300, 40)) @ signals


def test_a_motion_that_repeats_itself_needs_no_more_modes():
    growth = growth_of_modes(gram_of(periodic_motion(201)), ENERGY)
    assert growth.exponent < 0.02
    assert growth.least_exponent < 0.02
    assert_allclose(growth.energy_growth, 1.0, rtol=1e-12)


def test_halves_that_have_nothing_in_common_need_the_modes_of_both():
    # the particles of one group move in the first half, those of the other in the second, all alike
    W = np.zeros((400, 201))
    moves = np.random.default_rng(0).standard_normal((200, 100))
    W[:200, :100], W[200:, 101:] = moves, moves[:, ::-1]
    growth = growth_of_modes(gram_of(W), ENERGY)
    assert growth.exponent == pytest.approx(1.0, abs=0.02)
    assert growth.least_exponent == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_an_irregular_motion_needs_modes_in_proportion_to_its_duration(seed):
    # Shannon: 2 f T modes of a band f; what a quarter foresees the whole confirms
    W = irregular_motion(seed, 801)
    growth = growth_of_modes(gram_of(W[:, :201]), ENERGY)
    whole = growth_of_modes(gram_of(W), ENERGY)
    assert growth.exponent > 0.85
    assert_allclose(growth.n_lr * 4.0**growth.exponent, whole.n_lr, rtol=0.1)
    assert growth.n_lr * 4.0**growth.least_exponent <= whole.n_lr <= 1.02 * growth.n_lr * 4.0


@pytest.mark.physics
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("limit", [0.6, 1.0])
def test_the_interval_foreseen_for_an_irregular_motion_is_that_of_the_whole(seed, limit):
    limits = Thresholds(feasibility=limit)
    W = irregular_motion(seed, 801)
    true = sweep(W, milliseconds(801), None, limits, groups=None)
    told = foreseen(W[:, :201], 0.8, limits)
    assert true.chosen_interval is not None
    assert told.expected_interval == pytest.approx(true.chosen_interval, abs=1.001e-3)
    assert told.safe_interval <= told.expected_interval
    for c in told.candidates:
        whole = next(t for t in true.candidates if t.interval == c.interval)
        assert c.n_snapshots == whole.n_snapshots
        assert_allclose(c.n_c, whole.n_c, rtol=0.15, atol=2)


def test_at_proportional_growth_the_index_stays_what_it_is_in_the_pilot():
    W = irregular_motion(4, 201)
    pilot = {c.interval: c for c in sweep(W, milliseconds(201), groups=None).candidates}
    for c in foreseen(W, 2.0).candidates:
        # whole modes: one of n_lr and one of n_c, of tens
        assert_allclose(c.K_f_range[0], pilot[c.interval].K_f, rtol=0.12)


def test_the_longer_the_plan_the_more_a_repeated_motion_is_over_resolved():
    W = periodic_motion(201)
    W += 1e-4 * np.random.default_rng(5).standard_normal(W.shape)
    short, long = foreseen(W, 0.4), foreseen(W, 1.6)
    assert long.expected_interval >= short.expected_interval
    for few, many in zip(short.candidates, long.candidates, strict=True):
        assert many.n_lr <= few.n_lr + 1
        assert many.n_c > 3 * few.n_c


def test_ranges_are_ordered_and_verdicts_follow_from_them():
    for c in foreseen(irregular_motion(1, 401), 1.0, Thresholds(feasibility=0.8)).candidates:
        assert c.n_lr_range[0] <= c.n_lr <= c.n_lr_range[1] < c.n_snapshots
        assert c.K_f_range[0] <= c.K_f <= c.K_f_range[1]
        assert c.n_snapshots == math.floor(1.0 / c.interval + 1e-9) + 1
        either = c.K_f_range[0] < 0.8 <= c.K_f_range[1]
        told = "undecidable" if either else "sufficient" if c.K_f >= 0.8 else "insufficient"
        assert c.verdict == told


def test_a_flow_that_is_still_gaining_energy_is_no_sample_of_what_comes():
    W = irregular_motion(2, 201) * np.exp(np.linspace(0, 3, 201))
    told = foreseen(W, 1.0)
    assert any(remark.startswith("transient: the second half of the pilot has") for remark in told.remarks)
    assert not any("transient" in remark for remark in foreseen(irregular_motion(2, 201), 1.0).remarks)


def test_a_motion_exhausted_by_its_modes_stays_undecidable():
    rng = np.random.default_rng(1)
    t = np.arange(201) / 200
    shapes = np.linalg.qr(rng.standard_normal((400, 10)))[0]
    W = shapes @ np.concatenate([[np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)] for f in range(2, 12, 2)])
    # 10 to 50 Hz: five milliseconds see all of it, ten would not
    for c in foreseen(W, 1.0, intervals=[0.005, 0.004, 0.003, 0.002]).candidates:
        assert c.n_c == 9
        assert c.verdict == "undecidable"
        assert "R_c never exceeds 1.05 in the pilot" in c.reasons


def test_a_plan_no_longer_than_the_pilot_is_refused():
    W = irregular_motion(0, 101)
    for duration in (0.1, 0.05, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match=r"the run has 0\.1 s already"):
            foreseen(W, duration)


@pytest.mark.parametrize("n", [3, 19])
def test_too_short_a_pilot_says_so(n):
    told = foreseen(irregular_motion(0, n), 1.0)
    assert told.growth is told.expected_interval is told.safe_interval is None
    assert told.candidates == []
    assert told.remarks == [f"too short a pilot: {n} snapshots, at least 20 needed"]


def test_what_does_not_move_in_a_half_of_the_pilot_foretells_nothing():
    W = irregular_motion(0, 101)
    for still in (np.ones((50, 101)), np.where(np.arange(101) < 60, 0.25, W)):
        told = foreseen(still, 1.0)
        assert told.growth is None
        assert told.remarks == ["nothing moves in a half of the pilot"]


def test_one_particle_is_one_mode_however_long_it_is_watched():
    told = foreseen(np.cos(np.linspace(0, 40, 101))[None], 1.0)
    assert told.growth.n_lr == 1.0
    assert told.expected_interval is None
    assert all(c.verdict != "sufficient" for c in told.candidates)


def test_intervals_with_few_snapshots_in_the_pilot_are_left_out():
    told = foreseen(irregular_motion(0, 41), 1.0)
    assert [c.interval for c in told.candidates] == [0.004, 0.003, 0.002]


def test_the_answer_is_plain():
    told = foreseen(irregular_motion(0, 101), 1.0).as_dict()
    assert list(told) == [
        "pilot", "duration", "growth", "expected_interval", "safe_interval", "candidates", "remarks",
    ]  # fmt: skip
    assert list(told["growth"]) == ["n_lr", "exponent", "least_exponent", "energy_growth"]
    assert list(told["candidates"][0]) == [
        "interval", "n_snapshots", "n_lr", "n_lr_range", "n_c", "K_f", "K_f_range", "verdict", "reasons",
    ]  # fmt: skip
    assert told["pilot"] == pytest.approx(0.1)
