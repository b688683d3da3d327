"""The Pareto front and the cheapest choice within limits."""

import numpy as np
import pytest

from selection.errors import InputError
from selection.tradeoff import choose, pareto_front


def beaten_by_comparing_all_pairs(errors, costs):
    """Independent oracle: the definition, pair by pair."""
    return [
        any(
            errors[j] <= errors[i] and costs[j] <= costs[i] and (errors[j] < errors[i] or costs[j] < costs[i])
            for j in range(len(errors))
        )
        for i in range(len(errors))
    ]


@pytest.mark.parametrize("seed", range(5))
def test_the_front_is_what_no_other_alternative_beats(seed):
    rng = np.random.default_rng(seed)
    errors, costs = rng.integers(0, 12, (2, 60)).astype(float)  # whole numbers, so that ties occur
    assert list(pareto_front(errors, costs)) == [not b for b in beaten_by_comparing_all_pairs(errors, costs)]


def test_equal_alternatives_stand_on_the_front_together():
    assert list(pareto_front([1.0, 1.0, 1.0], [2.0, 2.0, 3.0])) == [True, True, False]


def test_the_front_of_nothing_is_empty():
    assert pareto_front([], []).shape == (0,)


def test_the_front_does_not_depend_on_the_units():
    errors, costs = np.random.default_rng(1).random((2, 40))
    np.testing.assert_array_equal(pareto_front(errors, costs), pareto_front(errors * 1e-6, costs * 1e9))


def test_the_cheapest_within_the_limit_is_chosen_and_the_limit_itself_is_within():
    errors, costs = np.array([[0.1], [0.2], [0.3], [0.4]]), [9.0, 5.0, 3.0, 1.0]
    assert choose(costs, errors, [0.3]) == (2, True)


def test_without_limits_the_cheapest_of_all_is_chosen():
    assert choose([3.0, 1.0, 2.0], np.empty((3, 0)), []) == (1, True)


def test_where_none_keeps_the_limit_the_closest_is_named_and_said_not_to_keep_it():
    assert choose([1.0, 2.0, 3.0], [[0.9], [0.4], [0.5]], [0.1]) == (1, False)


def test_both_limits_must_be_kept_together():
    error_and_seconds = [[0.1, 10.0], [1.0, 1.0], [0.4, 2.0]]
    assert choose([1.0, 2.0, 3.0], error_and_seconds, [0.5, 5.0]) == (2, True)
    # 0.05 and 0.5: exceeded by factors 20, 20 and 8
    assert choose([1.0, 2.0, 3.0], error_and_seconds, [0.05, 0.5]) == (2, False)


@pytest.mark.parametrize(
    ("costs", "bounded", "limits", "says"),
    [
        ([], np.empty((0, 1)), [1.0], "no alternative"),
        ([1.0], [[1.0]], [0.0], "limits: 0; a limit must be positive"),
        ([1.0], [[1.0]], [float("nan")], "limits: nan"),
        ([1.0], [[float("nan")]], [1.0], "finite"),
        ([1.0, 2.0], [[1.0]], [1.0], "2 alternatives"),
    ],
)
def test_a_choice_between_nothing_or_without_a_sensible_limit_is_refused(costs, bounded, limits, says):
    with pytest.raises(InputError, match=says):
        choose(costs, bounded, limits)


@pytest.mark.parametrize(("errors", "costs"), [([1.0], [1.0, 2.0]), ([float("nan")], [1.0]), ([[1.0]], [1.0])])
def test_a_front_of_unequal_or_unknown_numbers_is_refused(errors, costs):
    with pytest.raises(InputError):
        pareto_front(errors, costs)
