"""Allocation of one alternative to each variable: against every possible allocation."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selection.allocation import allocate, allocate_alike
from selection.errors import InputError


def brute(costs, burdens, limits):
    """Return the least cost among all allocations that keep the limits, None where none does."""
    found = []
    for picks in product(*(range(len(c)) for c in costs)):
        total = sum(np.atleast_1d(b[i]) for b, i in zip(burdens, picks, strict=True))
        if (total <= np.atleast_1d(limits) * (1 + 1e-12)).all():
            found.append(sum(c[i] for c, i in zip(costs, picks, strict=True)))
    return min(found, default=None)


@st.composite
def problems(draw, quantities=1):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    sizes = draw(st.lists(st.integers(1, 6), min_size=1, max_size=4))
    if draw(st.booleans()):  # many ties
        costs = [rng.integers(0, 5, k).astype(float) for k in sizes]
        burdens = [rng.integers(0, 5, (k, quantities)).astype(float) for k in sizes]
    else:
        costs = [rng.lognormal(0, 2, k) for k in sizes]
        burdens = [rng.lognormal(0, 2, (k, quantities)) for k in sizes]
    return costs, burdens, rng.lognormal(1, 1, quantities)


@settings(max_examples=150, deadline=None)
@given(problems() | problems(quantities=2) | problems(quantities=3))
def test_no_allocation_that_keeps_the_limits_is_cheaper(problem):
    costs, burdens, limits = problem
    found, least = allocate(costs, burdens, limits), brute(costs, burdens, limits)
    assert found.kept == (least is not None)
    assert found.cost == pytest.approx(sum(c[i] for c, i in zip(costs, found.chosen, strict=True)))
    np.testing.assert_allclose(found.totals, sum(b[i] for b, i in zip(burdens, found.chosen, strict=True)))
    if least is not None:
        assert found.cost == pytest.approx(least, rel=1e-12)
        assert (found.totals <= limits * (1 + 1e-11)).all()
    elif (np.concatenate(burdens) > 0).all():  # no variable is independent of another
        shares = [min((b / limits).sum(axis=1)) for b in burdens]
        assert (found.totals / limits).sum() == pytest.approx(sum(shares))


@settings(max_examples=60, deadline=None)
@given(problems(), st.integers(1, 3))
def test_one_label_for_all_is_the_best_of_every_label_alone(problem, kinds):
    costs, burdens, limits = problem
    labels = [np.arange(len(c)) % kinds for c in costs]
    common = set.intersection(*(set(label.tolist()) for label in labels))
    found = allocate_alike(costs, burdens, limits, labels)
    parts = []
    for mark in common:
        which = [label == mark for label in labels]
        parts.append(brute(*([x[w] for x, w in zip(xs, which, strict=True)] for xs in (costs, burdens)), limits))
    kept = [one for one in parts if one is not None]
    assert found.kept == bool(kept)
    assert len({int(label[i]) for label, i in zip(labels, found.chosen, strict=True)}) == 1
    if kept:
        assert found.cost == pytest.approx(min(kept), rel=1e-12)
        assert allocate(costs, burdens, limits).cost <= found.cost * (1 + 1e-12)


def test_a_slow_variable_takes_few_bytes_so_that_a_fast_one_may_take_many():
    # e² of a slow variable falls with the first byte, of a fast one with the last
    slow, fast = np.array([1e-4, 5e-5, 1e-5]), np.array([1.0, 0.5, 9e-4])
    bytes_of = np.array([1.0, 5.0, 20.0])
    found = allocate([bytes_of, bytes_of], [slow, fast], 1e-3)
    assert (found.chosen, found.cost) == ((0, 2), 21.0)
    alike = allocate_alike([bytes_of, bytes_of], [slow, fast], 1e-3, [[0, 1, 2], [0, 1, 2]])
    assert (alike.chosen, alike.cost) == ((2, 2), 40.0)


def test_a_limit_that_is_the_sum_of_the_burdens_themselves_is_kept():
    burdens = [np.array([x]) for x in (0.1, 0.7, 0.3, 1e-17)]
    for order in ([0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]):
        assert allocate([[1.0]] * 4, burdens, sum(float(burdens[i][0]) for i in order)).kept


@settings(max_examples=60, deadline=None)
@given(problems(), problems())
def test_variables_that_share_no_limit_are_allocated_as_if_alone(one, other):
    costs = [*one[0], *other[0]]
    burdens = [np.hstack([b, 0 * b]) for b in one[1]] + [np.hstack([0 * b, b]) for b in other[1]]
    both = allocate(costs, burdens, np.concatenate([one[2], other[2]]))
    alone = [allocate(*problem) for problem in (one, other)]
    assert both.chosen == (*alone[0].chosen, *alone[1].chosen)
    assert both.kept == all(found.kept for found in alone)


def test_twelve_variables_of_sixty_alternatives_are_allocated_exactly():
    rng = np.random.default_rng(1)
    n = np.arange(1, 61)
    costs = [1000.0 * n + rng.integers(0, 500) for _ in range(12)]
    burdens = [rng.lognormal() * n ** -rng.uniform(0.5, 3.0) for _ in range(12)]
    limit = 0.2 * sum(float(b[0]) for b in burdens)
    found = allocate(costs, burdens, limit)
    assert found.kept
    other = allocate(burdens, costs, found.cost)  # the twin: the least burden that this cost buys
    assert other.cost <= found.totals[0] * (1 + 1e-12)
    assert allocate(burdens, costs, found.cost - 1.0).cost > limit  # a byte less cannot keep the limit


@pytest.mark.parametrize(
    ("costs", "burdens", "limits", "says"),
    [
        ([], [], 1.0, "give both for at least one"),
        ([[1.0]], [[1.0]], 0.0, "positive finite"),
        ([[1.0]], [[1.0]], [np.nan], "positive finite"),
        ([[1.0], []], [[1.0], []], 1.0, "variable 1: .* at least one alternative"),
        ([[1.0]], [[-1.0]], 1.0, "negative or not finite"),
        ([[np.inf]], [[1.0]], 1.0, "negative or not finite"),
        ([[1.0]], [[[1.0, 2.0]]], 1.0, "for 1 limits"),
    ],
)
def test_what_cannot_be_allocated_is_refused(costs, burdens, limits, says):
    with pytest.raises(InputError, match=says):
        allocate(costs, burdens, limits)


def test_variables_without_a_common_label_have_no_alternative_alike():
    with pytest.raises(InputError, match="none is common"):
        allocate_alike([[1.0], [1.0]], [[1.0], [1.0]], 1.0, [[1], [2]])
