"""Predictions at a speed nobody showed: the right surrogate wins, by as much as it should, and ties are ties."""

import json
from contextlib import ExitStack

import numpy as np
import pytest

from suffice.refusal import Refusal
from suffice.run import Run
from suffice.unseen import compare_unseen
from suffice.unseen_tables import show_unseen
from suffice.unseen_verdicts import OVERALL, limit, sentences, tied

SPEEDS = (400.0, 600.0, 800.0, 1200.0, 1600.0)
PLAIN = ["nearest", "linear", "rbf"]


@pytest.fixture
def compared(tmp_path, write_stirred):
    """Compare made-up runs at five speeds, 800 rpm unseen."""

    def compare(held_out=(800.0,), speeds=SPEEDS, surrogates=PLAIN, **flow):
        with ExitStack() as opened:
            runs = [opened.enter_context(Run(write_stirred(tmp_path / f"{rpm:g}.h5", rpm, **flow))) for rpm in speeds]
            return compare_unseen(runs, held_out, surrogates=surrogates, start_up=0.5)

    return compare


def case_of(answer, average="phase", scaling="none"):
    return next(case for case in answer["cases"] if (case["average"], case["scaling"]) == (average, scaling))


def errors_of(case, field=OVERALL):
    return {row["surrogate"]: row["errors"][field] for row in case["rows"]}


def test_what_grows_with_the_speed_itself_is_no_task_for_more_than_straight_lines(compared):
    answer = compared()
    flux = errors_of(case_of(answer), "fluid_flux")
    assert flux["nearest"] > 0.3
    # (0.5 + 0.1 b z) a: void fraction and speed both grow, so the flux is slightly curved
    assert flux["linear"] < 0.03
    assert errors_of(case_of(answer), "solid_flux")["linear"] < 1e-9


def test_what_grows_with_the_square_of_the_speed_is_won_by_rbf_without_scaling(compared):
    answer = compared()
    case = case_of(answer)
    for field in ("pressure", "agitation"):
        errors = errors_of(case, field)
        assert errors["rbf"] < 0.5 * errors["linear"] < errors["nearest"]
        # a² at 0.8 between 0.6 and 1.2: straight lines give 0.72
        shown = np.array([0.16, 0.36, 1.44, 2.56])
        assert errors["linear"] == pytest.approx(0.08 / shown.std(), rel=1e-6)
        assert case["sentences"][field].startswith(f"{field}: rbf (")


def test_scaled_by_the_tip_speed_what_obeys_it_is_predicted_by_every_speed(compared):
    case = case_of(compared(b=lambda pace: pace**2), "phase", "tip speed")
    for name in PLAIN:
        assert errors_of(case, "solid_flux")[name] < 1e-9
        assert errors_of(case, "agitation")[name] < 1e-9
    assert errors_of(case, "void_fraction")["linear"] > 0.05


def test_the_error_of_the_nearest_speed_is_how_far_it_lies_over_the_spread(compared):
    flux = errors_of(case_of(compared()), "solid_flux")["nearest"]
    shown = np.array([0.4, 0.6, 1.2, 1.6])
    assert flux == pytest.approx(0.2 / shown.std(), rel=1e-9)


def test_noise_shows_as_the_statistical_floor_and_makes_ties_of_what_it_hides(compared):
    answer = compared(noise=0.5, a=lambda pace: 1.0 + 0.02 * pace, b=lambda pace: 1.0 + 0.02 * pace)
    case = case_of(answer)
    for field, least in case["statistical_floor"].items():
        assert least > 0.2, field
        assert all(error > 0.7 * least for error in errors_of(case, field).values())
    quiet = case_of(compared())
    assert all(error < 1e-9 for error in quiet["statistical_floor"].values())


def test_all_modes_hold_what_straight_lines_hold(compared):
    for case in compared(a=lambda pace: pace**2)["cases"]:
        assert case["modes"] <= case["samples"] - 1
        for row in case["rows"]:
            assert case["projection_floor"][OVERALL] <= row["errors"][OVERALL] + 1e-9


def test_the_answer_is_plain_and_says_what_was_compared(compared, capsys):
    answer = json.loads(json.dumps(compared()))
    assert answer["held_out"] == [800.0]
    assert [run["rpm"] for run in answer["runs"]] == list(SPEEDS)
    assert {(case["average"], case["scaling"]) for case in answer["cases"]} == {
        (average, scaling) for average in ("phase", "time") for scaling in ("none", "tip speed")
    }
    assert case_of(answer)["samples"] == 32
    assert case_of(answer, "time")["samples"] == 4
    show_unseen(answer)
    said = capsys.readouterr().out
    assert "nearest" in said
    assert "800 rpm" in said
    assert "statistical floor" in said


def test_runs_that_cannot_be_compared_are_refused(compared):
    for held_out, says in (
        ((500.0,), r"500 rpm is not run; there are 400, 600, 800"),
        ((400.0,), r"400 rpm is not between speeds that are shown"),
        ((), r"0 of 5 speeds; hold one out"),
        ((600.0, 800.0, 1200.0, 1600.0), r"4 of 5 speeds"),
    ):
        with pytest.raises(Refusal, match=says):
            compared(held_out)
    with pytest.raises(Refusal, match="surrogate 'oracle' is not known here; use nearest"):
        compared(surrogates=["oracle"])
    with pytest.raises(Refusal, match="void_fraction is the same at every speed shown"):
        compared(b=lambda _: 1.0)


def test_runs_that_differ_in_more_than_the_speed_are_refused_with_what_differs(tmp_path, write_stirred):
    with ExitStack() as opened:
        runs = [opened.enter_context(Run(write_stirred(tmp_path / f"{rpm:g}.h5", rpm))) for rpm in SPEEDS[:3]]
        scene = runs[1].provenance["scene"]
        longer = scene.replace("duration = 1.0", "duration = 2.0")
        assert longer != scene
        runs[1].provenance["scene"] = longer
        compare_unseen(runs, [600.0], surrogates=["linear"], start_up=0.5)
        runs[1].provenance["scene"] = scene.replace("stiffness = 1e3", "stiffness = 8e3")
        says = r"contact\.stiffness is 1000\.0 and 8000\.0; give runs of one scene"
        with pytest.raises(Refusal, match=says):
            compare_unseen(runs, [600.0], surrogates=["linear"], start_up=0.5)


def row(name, error, halves, scatter=0.0):
    return {
        "surrogate": name,
        "errors": {OVERALL: error},
        "half_errors": {OVERALL: halves},
        "seed_spread": {OVERALL: scatter},
    }


def said(*rows):
    return sentences(rows, {OVERALL: 0.03}, {OVERALL: 0.05})[OVERALL]


def test_a_winner_is_named_with_its_lead_and_with_what_limits_it():
    best, worse = row("rbf", 0.1, [0.1, 0.1]), row("linear", 0.2, [0.2, 0.2])
    text = said(worse, best)
    assert text.startswith("overall: rbf (0.1) wins, ahead of linear (0.2) by 50 %; floors 0.03 statistical, 0.05")
    assert "limited by the coefficients" in text
    assert "(75 % of its square)" in text


def test_a_lead_within_the_scatter_of_seeds_or_in_one_half_alone_is_a_tie():
    steady, shaky = row("rbf", 0.10, [0.1, 0.1]), row("mlp", 0.11, [0.11, 0.11], scatter=0.02)
    assert said(steady, shaky).startswith("overall: tie of rbf (0.1) and mlp (0.11 ± 0.02); floors")
    turned = row("linear", 0.11, [0.09, 0.13])
    assert tied(steady, turned, OVERALL)
    assert not tied(steady, row("linear", 0.11, [0.101, 0.12]), OVERALL)


def test_the_limit_is_the_largest_part_of_the_error():
    assert limit(0.11, 0.1, 0.1).startswith("the statistical error")
    assert limit(0.11, 0.01, 0.1).startswith("the modes")
    assert limit(0.5, 0.01, 0.1).startswith("the coefficients")
