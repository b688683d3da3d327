"""The interval of K_f: what leaving out particles tells, and what rounding may not add to it."""

import numpy as np
import pytest

import selection.resampling
from pod import SnapshotMatrix
from selection import sweep


def smooth(interval, beads=101, snapshots=91):
    """Beads on sines of up to 10 Hz: in few snapshots a second their motion has fewer modes than snapshots."""
    pace, phase = np.random.default_rng(3).uniform(0.0, 60.0, (2, beads, 1))
    return np.sin(pace * interval * np.arange(snapshots) + phase)


def intervals_of(W):
    return [c.K_f_interval for c in sweep(W, np.arange(W.shape[1]) * 1e-3).candidates]


@pytest.mark.parametrize("interval", [1e-3, 5e-3])
def test_rounding_does_not_move_the_interval_where_modes_are_fewer_than_snapshots(interval):
    # before R_c near round-off was left out, these four differed by up to 2 % of the width
    W, rng = smooth(interval), np.random.default_rng(0)
    changed = [SnapshotMatrix(W, block_rows=37), *(W * (1 + 1e-15 * rng.standard_normal(W.shape)) for _ in range(3))]
    found = intervals_of(W)
    assert sum(known is not None for known in found) >= 4
    for other in map(intervals_of, changed):
        for mine, theirs in zip(found, other, strict=True):
            assert (mine is None) == (theirs is None)
            if mine is not None:
                assert theirs[1] - theirs[0] == pytest.approx(mine[1] - mine[0], rel=1e-3)


def test_the_modes_beyond_the_crossing_need_not_be_known(monkeypatch):
    rng, t = np.random.default_rng(4), np.linspace(0, 1, 201)
    W = rng.standard_normal((300, 60)) @ np.array([np.cos(np.pi * j * t + j) / j**2 for j in range(1, 61)])
    W += 1e-4 * rng.standard_normal(W.shape)
    few = intervals_of(W)
    monkeypatch.setattr(selection.resampling, "MORE", 1e6)
    every = intervals_of(W)
    assert None not in few
    # what lies beyond is a difference of squares: ε (‖W‖/E)² for E a thousandth of ‖W‖ at the crossing, and some more
    assert np.allclose(few, every, rtol=1e-7)


def half_width_by_deleting_rows(W, times, interval):
    """Half the interval of K_f from ten sweeps of what is left when the rows of a group are deleted."""
    group, found = np.arange(len(W)) % 10, []
    for g in range(10):
        (c,) = sweep(W[group != g], times, [interval], groups=None).candidates
        crossing = selection.consistent_mode(c.curves.R_c, 1.05)
        found.append(selection.resampling.smooth_index(c.eigenvalues, crossing, 0.999))
    return np.std(found) * 3.0 * 2.2621571628  # Student's t, nine degrees of freedom


@pytest.mark.parametrize("stack", [1, 20_000, 2**16])  # groups one by one, some at once, all at once
def test_leaving_out_groups_at_once_is_leaving_out_their_rows_one_group_after_another(monkeypatch, stack):
    monkeypatch.setattr(selection.resampling, "STACK", stack)
    rng, times = np.random.default_rng(8), np.arange(101) * 1e-3
    W = smooth(3e-3, beads=203, snapshots=101) + 2e-3 * rng.standard_normal((203, 101))
    table = sweep(W, times).candidates
    assert [c.n_snapshots for c in table][::4] == [11, 17, 51]
    for c in table:
        assert c.K_f_interval[1] - c.K_f == pytest.approx(half_width_by_deleting_rows(W, times, c.interval), rel=1e-8)


def test_leaving_out_particles_that_move_in_few_modes_is_leaving_out_their_rows():
    # rank 12 of 101 training snapshots takes the way through few rows; deleting rows is the oracle
    rng, t = np.random.default_rng(5), np.arange(301)
    shapes = rng.standard_normal((200, 12)) * 10.0 ** (-2 * np.arange(12) / 12)
    W = shapes @ np.cos(np.pi * np.linspace(0.5, 60, 12)[:, None] * t / 300 + np.arange(12)[:, None])
    W += 3e-3 * rng.standard_normal((200, 3)) @ rng.standard_normal((3, 301))
    (candidate,) = sweep(W, t * 1e-3, [0.003]).candidates
    low, high = candidate.K_f_interval
    assert high - low == pytest.approx(2 * half_width_by_deleting_rows(W, t * 1e-3, 0.003), rel=1e-6)
