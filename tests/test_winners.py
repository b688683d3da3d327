"""Who wins is said as the figures say it: ties are ties, and a baseline without a model may win."""

import json

import pytest

from suffice.winners import beats, error_of, spread_of, winners


def row(surrogate, modes, rmse, interval=0.003, variable="position.x", **more):
    return {
        "variable": variable,
        "interval": interval,
        "unit": "m",
        "surrogate": surrogate,
        "modes": modes,
        "rmse": rmse,
        "projection_rmse": 0.9,
        **more,
    }


def only(rows):
    (entry,) = winners(rows)
    return entry


def test_the_least_error_wins_and_by_what_the_next_errs_more():
    entry = only([row("spline", 60, 1.25), row("rbf", 60, 1.0), row("linear", 60, 1.5)])
    (level,) = entry["levels"]
    assert (level["winner"], level["next"], level["by"]) == ("rbf", "spline", 0.25)
    assert entry["sentence"] == "position.x, Δτ 3 ms: on 60 modes rbf wins, spline errs 25.0% more."


def test_what_differs_by_less_than_a_hundredth_is_a_tie():
    entry = only([row("spline", 60, 1.009), row("rbf", 60, 1.0), row("linear", 60, 1.02)])
    (level,) = entry["levels"]
    assert (level["tied"], level["next"]) == (["spline"], "linear")
    assert "rbf and spline tie, linear errs 2.0% more" in entry["sentence"]


def test_surrogates_are_compared_on_the_same_number_of_modes_only():
    entry = only([row("rbf", 12, 3.0), row("spline", 12, 2.0), row("rbf", 60, 1.0), row("spline", 60, 1.2)])
    assert [(level["modes"], level["winner"]) for level in entry["levels"]] == [(12, "spline"), (60, "rbf")]


def test_a_difference_within_the_spread_over_seeds_is_a_tie():
    mlp = row("mlp", 60, 0.9, seeds=[0.9, 1.1, 1.0])
    assert error_of(mlp) == pytest.approx(1.0)
    assert spread_of(mlp) == pytest.approx(0.2)
    assert only([mlp, row("rbf", 60, 1.15)])["levels"][0]["tied"] == ["rbf"]
    assert only([mlp, row("rbf", 60, 1.25)])["levels"][0]["next"] == "rbf"
    assert not beats(row("rbf", 60, 0.9), row("lstm", 60, 1.0, rmse_spread=0.15))


def test_a_baseline_without_a_model_that_beats_them_all_is_said_to():
    entry = only([row("rbf", 60, 1.0), row("raw-hermite", None, 0.8), row("raw-linear", None, 2.0)])
    assert (entry["raw"], entry["raw_wins"]) == ("raw-hermite", True)
    assert entry["raw_by"] == pytest.approx(-0.2)
    assert (
        "no model wins here: raw-hermite, without any, errs 20% less than the best of them, rbf on 60 modes"
        in (entry["sentence"])
    )


def test_a_baseline_that_ties_with_the_best_model_does_not_win():
    entry = only([row("rbf", 60, 1.0), row("raw-hermite", None, 0.995)])
    assert not entry["raw_wins"]
    assert "no model wins" not in entry["sentence"]


def test_a_network_behind_straight_lines_or_hermite_is_named_with_its_modes():
    rows = [row("linear", 12, 1.0), row("linear", 60, 0.5), row("raw-hermite", None, 1.2)]
    rows += [row("mlp", 12, 2.0), row("mlp", 60, 1.0), row("lstm", 12, 0.8), row("lstm", 60, 0.4)]
    entry = only(rows)
    assert entry["behind"] == [
        {"surrogate": "mlp", "modes": 12, "rivals": ["linear", "raw-hermite"]},
        {"surrogate": "mlp", "modes": 60, "rivals": ["linear"]},
    ]
    assert "mlp on 60 modes stands behind linear" in entry["sentence"]
    assert "lstm" not in entry["sentence"].partition("stands behind")[2]


def test_the_same_rivals_at_both_numbers_of_modes_are_named_once():
    rows = [row("linear", 12, 1.0), row("linear", 60, 0.5), row("mlp", 12, 2.0), row("mlp", 60, 1.0)]
    assert "mlp on 12 and 60 modes stands behind linear." in only(rows)["sentence"]


def test_a_network_within_its_own_spread_of_straight_lines_is_not_behind_them():
    assert only([row("linear", 12, 1.0), row("mlp", 12, 1.1, seeds=[1.0, 1.2])])["behind"] == []


def test_only_networks_are_named_as_behind():
    assert only([row("linear", 12, 1.0), row("dmd", 12, 1.1)])["behind"] == []
    assert winners([row("linear", 12, 1.0), row("dmd", 12, 1.1)], networks=("dmd",))[0]["behind"]


def test_every_variable_and_interval_has_its_own_sentence_and_all_is_plain_json():
    rows = [row("rbf", 60, 1.0, interval, variable) for interval in (0.01, 0.003) for variable in ("a", "b")]
    answer = winners(rows)
    assert [(e["variable"], e["interval"]) for e in answer] == [("a", 0.01), ("b", 0.01), ("a", 0.003), ("b", 0.003)]
    assert "rbf stands alone" in answer[0]["sentence"]
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer


def test_an_error_of_zero_wins_over_any_other():
    entry = only([row("hermite", 60, 0.0), row("rbf", 60, 0.0), row("linear", 60, 1e-9)])
    assert entry["levels"][0]["tied"] == ["rbf"]
    assert "hermite and rbf tie without error, linear errs" in entry["sentence"]


def test_raw_baselines_alone_are_no_model_that_could_win():
    entry = only([row("raw-linear", None, 1.0)])
    assert (entry["levels"], entry["raw_wins"]) == ([], False)
    assert entry["sentence"] == "position.x, Δτ 3 ms: nothing could be compared."
    assert winners([]) == []


def test_only_what_is_kept_in_the_precision_of_the_run_takes_part():
    rows = [row("rbf", 60, 1.0, precision="single"), row("spline", 60, 1.2, precision="single")]
    rows += [row("spline", 60, 0.9, precision="int8")]
    (level,) = only(rows)["levels"]
    assert (level["winner"], level["next"]) == ("rbf", "spline")


def test_modes_of_positions_and_velocities_are_compared_among_themselves():
    rows = [row("rbf", 60, 1.0, basis="plain"), row("spline", 60, 1.3, basis="plain")]
    rows += [row("hermite", 60, 0.8, basis="enriched"), row("rbf", 60, 0.9, basis="enriched")]
    entry = only(rows)
    assert [level["winner"] for level in entry["levels"]] == ["rbf"]
    assert [(level["winner"], level["next"]) for level in entry["enriched"]] == [("hermite", "rbf")]
    assert "on 60 modes of positions and velocities hermite wins, rbf errs 12.5% more" in entry["sentence"]


def test_a_baseline_that_a_basis_with_velocities_equals_beats_positions_alone_and_no_more():
    rows = [row("rbf", 60, 1.0, basis="plain"), row("hermite", 120, 0.8, basis="enriched")]
    entry = only([*rows, row("raw-hermite", None, 0.8, basis=None)])
    assert (entry["raw_wins"], entry["raw_by"]) == (True, pytest.approx(-0.2))
    assert (
        "no model of positions alone wins here: raw-hermite, without any, errs 20% less than the best of them, rbf "
        "on 60 modes, and not less than hermite on 120 modes of positions and velocities" in entry["sentence"]
    )
    ahead = only([*rows, row("raw-hermite", None, 0.7, basis=None)])
    assert "no model wins here: raw-hermite, without any, errs 30% less" in ahead["sentence"]
