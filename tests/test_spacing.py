"""Which snapshots are kept: interpolation between them holds its tolerance, and the run is looked at often enough."""

from itertools import pairwise

import numpy as np
import pytest

from selection.spacing import CALM, LONGEST, Moment, Spacing, hermite_errors, hermite_weights, kept_of


def flight(times, n=30):
    """Positions and velocities of particles that nothing touches, (N_t, n, 3) m and m/s."""
    rng = np.random.default_rng(0)
    x, v, g = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), np.array([0.0, 0.0, -9.81])
    t = np.asarray(times)[:, None, None]
    return x + v * t + 0.5 * g * t**2, v + g * t


def bounced(times, at):
    """The same, but all velocities along z are turned round at a time (s)."""
    x, v = flight(times)
    late = np.asarray(times) >= at
    there, speed = flight([at])
    x[late, :, 2] = 2.0 * there[0, :, 2] - x[late, :, 2]
    v[late, :, 2] *= -1.0
    assert np.isfinite(speed).all()
    return x, v


def moments(times, x, v):
    return [Moment(float(t), *rows) for t, *rows in zip(times, x, v, strict=True)]


def test_the_interpolant_is_exact_for_a_cubic_and_of_fourth_order():
    times = np.linspace(0.2, 0.5, 7)
    path = np.poly1d([3.0, -2.0, 1.0, 0.5])
    ends = np.array([path(0.1), path.deriv()(0.1), path(0.6), path.deriv()(0.6)])
    np.testing.assert_allclose(hermite_weights(0.1, 0.6, times) @ ends, path(times), atol=1e-14)
    found = []
    for h in (0.2, 0.1):
        ends = np.array([np.sin(1.0), np.cos(1.0), np.sin(1.0 + h), np.cos(1.0 + h)])
        found.append(abs(hermite_weights(1.0, 1.0 + h, np.array([1.0 + h / 2])) @ ends - np.sin(1.0 + h / 2))[0])
    assert np.log2(found[0] / found[1]) == pytest.approx(4.0, abs=0.1)


def test_free_flight_is_kept_as_rarely_as_moments_can_be_held():
    times = 1e-3 * np.arange(101)
    kept = kept_of(times, *flight(times), 1e-9)
    assert (np.diff(kept)[:-1] == LONGEST).all()
    assert (kept[0], kept[-1]) == (0, 100)


def test_snapshots_crowd_where_particles_bounce_and_nowhere_else():
    times = 1e-3 * np.arange(61)
    x, v = bounced(times, 0.0305)
    kept = kept_of(times, x, v, 1e-7)
    assert {30, 31} <= set(kept)
    assert len(kept) <= 5


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2, 0.1])
def test_interpolation_between_kept_snapshots_stays_within_the_tolerance(tolerance):
    rng = np.random.default_rng(1)
    times = 1e-3 * np.arange(200)
    push = rng.normal(size=(200, 20, 3)) * (rng.random((200, 20, 1)) < 0.05)
    v = 5.0 * np.cumsum(push, axis=0)
    x = 1e-3 * np.cumsum(v, axis=0)
    kept = kept_of(times, x, v, tolerance)
    steps = moments(times, x, v)
    for a, b in pairwise(kept):
        if b > a + 1:
            assert hermite_errors(steps[a], steps[b], times[a + 1 : b], x[a + 1 : b]).max() <= tolerance
    # each is as far from the one before as can be: one more step would not do, or too many moments would be held
    for a, b in pairwise(kept[:-1]):
        too_far = hermite_errors(steps[a], steps[b + 1], times[a + 1 : b + 1], x[a + 1 : b + 1]).max() > tolerance
        assert too_far or b - a == LONGEST
    assert len(kept) < 200


def test_a_run_is_looked_at_more_often_where_its_interval_is_too_coarse_and_less_where_it_is_calm():
    rng = np.random.default_rng(3)
    spacing, levels = Spacing(1e-6, 2), []
    for k in range(6):
        spacing.see(Moment(1e-3 * k, rng.normal(size=(5, 3)), rng.normal(size=(5, 3))))
        levels.append(spacing.level)
    assert levels == [0, 0, 1, 2, 2, 2]
    assert spacing.unchecked == 4
    assert [spacing.next_stop(now) for now in range(4)] == [1, 2, 3, 4]
    still = np.zeros((5, 3))
    for k in range(6, 6 + 3 * CALM):
        spacing.see(Moment(1e-3 * k, still, still))
        levels.append(spacing.level)
    assert levels[-1] == 0
    assert [spacing.next_stop(now) for now in (0, 1, 3)] == [4, 4, 4]


@pytest.mark.parametrize("at", [1, 2, 5, 40])
def test_a_spacing_that_goes_on_from_its_state_decides_as_before(at):
    times = 1e-3 * np.arange(61)
    steps = moments(times, *bounced(times, 0.0305))
    whole, first, second = Spacing(1e-6, 2), Spacing(1e-6, 2), Spacing(1e-6, 2)
    decided = [whole.see(step) for step in steps]
    begun = [first.see(step) for step in steps[:at]]
    second.restore_({name: rows.copy() for name, rows in first.state().items()})
    assert begun + [second.see(step) for step in steps[at:]] == decided
    assert second.level == whole.level
