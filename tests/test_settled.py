"""Growing inner products are those of the whole, and a verdict settles when it has held for long enough."""

import numpy as np
import pytest

from selection import ArraySnapshots, InputError, Thresholds, is_sufficient, sweep
from selection.growing import GrowingSnapshots
from selection.settled import Settling, checks


def wave(rows=60, n=80, slower=1.0):
    """Particles on smooth paths of many pitches: K_f is defined at every Δτ."""
    rng = np.random.default_rng(2)
    pace, phase = rng.uniform(5.0, 80.0, rows) / slower, rng.uniform(0.0, 6.0, rows)
    return np.sin(np.outer(pace, np.arange(n) * 0.01) + phase[:, None]) + 40.0


def grown(W, known_at=(), **options):
    rows = GrowingSnapshots(len(W), W.shape[1], **options)
    for k, column in enumerate(W.T):
        rows.append(column)
        if k + 1 in known_at:
            rows.gram()
    return rows


@pytest.mark.parametrize(("known_at", "per"), [((), 1), ((1, 2, 30, 31, 79), 1), ((20, 22, 25), 3)])
def test_inner_products_do_not_depend_on_when_they_were_formed(known_at, per):
    W = wave()
    whole = ArraySnapshots(W, rows_per_particle=per)
    rows = grown(W, known_at, rows_per_particle=per)
    scale = np.abs(whole.gram()).max()
    np.testing.assert_allclose(rows.gram_groups(10), whole.gram_groups(10), rtol=0.0, atol=1e-14 * scale)
    np.testing.assert_allclose(rows.gram(), whole.gram(), rtol=0.0, atol=1e-14 * scale)
    assert (rows.gram() == rows.gram().T).all()


def test_rows_come_back_as_they_are_stored_and_none_is_lost():
    W = wave().astype(np.float32)
    blocks = np.concatenate(list(grown(W, dtype=np.float32, rows_per_particle=3).row_blocks()))
    assert blocks.dtype == np.float64
    assert sorted(map(tuple, blocks)) == sorted(map(tuple, W.astype(np.float64)))


def test_a_sweep_of_growing_snapshots_is_the_sweep_of_the_matrix():
    W, times = wave(), 0.01 * np.arange(80)
    growing, whole = sweep(grown(W, (20, 40)), times), sweep(W, times)
    for one, other in zip(growing.candidates, whole.candidates, strict=True):
        assert (one.n_lr, one.n_lr_paper, one.n_c, one.n_c_gap, one.verdict) == (
            other.n_lr, other.n_lr_paper, other.n_c, other.n_c_gap, other.verdict
        )  # fmt: skip
        assert (one.K_f_interval is None) == (other.K_f_interval is None) == (one.n_snapshots < 10)
        if one.K_f_interval is not None:
            assert one.K_f_interval == pytest.approx(other.K_f_interval, rel=1e-8)


def test_the_short_way_to_a_verdict_on_the_first_snapshots_is_the_long_one_on_their_matrix():
    W, times, limits, found = wave(slower=5.0), 0.01 * np.arange(80), Thresholds(feasibility=1.0), set()
    rows = grown(W)
    for n in (30, 48, 80):
        for c in sweep(W[:, :n], times[:n], thresholds=limits, groups=None).candidates:
            assert is_sufficient(rows.first(n), times[:n], c.interval, limits) == (c.verdict == "sufficient")
            found.add(c.verdict)
    assert found == {"sufficient", "insufficient", "undecidable"}
    assert rows.shape == (60, 80)


def test_a_value_that_is_not_finite_is_refused_where_it_arrives():
    rows = grown(wave(60, 3))
    with pytest.raises(InputError, match="room for 3 snapshots"):
        rows.append(np.zeros(60))
    rows = GrowingSnapshots(60, 3)
    with pytest.raises(InputError, match="row 7, snapshot 0 is nan"):
        rows.append(np.where(np.arange(60) == 7, np.nan, 1.0))


def test_checks_grow_by_a_tenth_and_end_with_the_run():
    counts = checks(1000)
    assert (counts[0], counts[-1], len(counts)) == (20, 1000, 41)
    steps = np.diff(counts[:-1]) / counts[:-2]
    assert steps.min() > 0.09
    assert steps.max() < 0.15
    assert checks(12) == [12]


def test_an_interval_settles_when_snapshots_have_doubled_without_a_break():
    sufficient = {20: [2], 22: [2], 24: [], 26: [2], 40: [3, 2], 51: [3, 2], 52: [3, 2], 80: [3]}
    settling = Settling(list(sufficient), lambda stride, n: stride in sufficient[n])
    settled = {n: [stride for stride in (4, 3, 2) if settling.settled(stride, n)] for n in sufficient}
    assert settled == {20: [], 22: [], 24: [], 26: [], 40: [], 51: [], 52: [2], 80: [3]}
    assert [n for n in sufficient if settling.any_settled(n)] == [52, 80]
    assert [settling.since(stride, 52) for stride in (4, 3, 2)] == [None, 40, 26]


def test_no_verdict_is_asked_for_that_cannot_end_the_run():
    counts, rng, asked = checks(800), np.random.default_rng(6), []
    good = {(stride, n): n > 9 * stride and rng.random() < 0.7 for stride in range(2, 11) for n in counts}
    settling = Settling(counts, lambda stride, n: asked.append((stride, n)) or good[stride, n])
    for n in counts:
        for stride in range(10, 1, -1):
            broken = [c for c in counts if c <= n and not good[stride, c]]
            unbroken = [c for c in counts if max(broken, default=0) < c <= n]
            assert settling.settled(stride, n) == (bool(unbroken) and n >= 2 * unbroken[0])
    assert len(asked) == len(set(asked)) < len(good) / 2
