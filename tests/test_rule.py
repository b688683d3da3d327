import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from selection import Thresholds, interpolated, project_from_gram, resolution_ratio, spline_errors
from sim import parse_scene
from suffice.store import Run, RunWriter

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

from rule_cases import correlation_time, gram_cases
from rule_flows import FLOWS, crop, scene_of
from rule_truth import (
    Confusion,
    across_flows,
    area,
    best_threshold,
    breach,
    confusion,
    crossing,
    holds_energy,
    keeps_promise,
    keeps_promise_up_to_n_c,
    largest,
    recut,
    spline_keeps_promise,
    unseen_energy,
    within_diameters,
)

ROWS, SNAPSHOTS = 400, 201
TIMES = np.arange(SNAPSHOTS) * 1e-3
LIMITS = Thresholds()


def falling_waves(rng, fastest=24.0, count=40):
    """Motion of waves of ever shorter period and smaller amplitude, and a little noise."""
    k = np.arange(1, count + 1)
    frequency = fastest * k / count / TIMES[-1]
    signals = np.cos(2 * np.pi * frequency[:, None] * TIMES + rng.uniform(0, 6, (count, 1)))
    W = rng.standard_normal((ROWS, count)) @ (10.0 ** (-4 * k / count)[:, None] * signals)
    return W + 1e-6 * rng.standard_normal(W.shape)


def fast_vibration(rng):
    """Two vibrations of 0.37 and 0.43 turns a snapshot, too fast for every second snapshot, and a little noise."""
    phase = 2 * np.pi * np.array([0.37, 0.43])[:, None] * np.arange(SNAPSHOTS)
    W = rng.standard_normal((ROWS, 4)) @ np.concatenate([np.cos(phase), np.sin(phase)])
    return W + 1e-2 * rng.standard_normal(W.shape)


@pytest.fixture(scope="module")
def waves():
    cases = gram_cases(falling_waves(np.random.default_rng(0)), TIMES, LIMITS)
    return [{**case, "variable": "position.x", "diameter": 1.0} for case in cases]


def projection_of(W, stride):
    training = np.arange(0, W.shape[1], stride)
    motion = W - W[:, :1]
    last = training[-1] + 1
    return project_from_gram((motion.T @ motion)[:last, :last], training), training, last


@pytest.mark.parametrize("n", [0, 3, 11])
def test_the_error_of_a_spline_from_inner_products_is_that_of_the_reconstructed_snapshots(n):
    W = falling_waves(np.random.default_rng(1))
    projection, training, last = projection_of(W, 6)
    mean = W[:, training].mean(axis=1, keepdims=True)
    U = np.linalg.svd(W[:, training] - mean, full_matrices=False)[0][:, :n]
    unseen = np.setdiff1d(np.arange(last), training)
    coefficients = (U.T @ (W[:, training] - mean)).T
    rebuilt = mean + U @ CubicSpline(training, coefficients)(unseen).T
    direct = np.sqrt(np.square(rebuilt - W[:, unseen]).mean(axis=0)).mean()
    assert spline_errors(projection, ROWS)[n] == pytest.approx(direct, rel=1e-6)


def test_the_error_of_a_spline_is_the_projection_error_times_the_resolution_ratio():
    W = falling_waves(np.random.default_rng(2))
    case = next(c for c in gram_cases(W, TIMES, LIMITS) if c["stride"] == 5)
    projection, _, _ = projection_of(W, 5)
    n = case["n_c"]
    assert case["curves"]["spline"][n] / case["curves"]["E_gap"][n] == pytest.approx(case["R_a"], rel=1e-5)
    assert resolution_ratio(interpolated(projection, n), n) == pytest.approx(case["R_a"], rel=1e-6)


def test_without_unseen_snapshots_a_spline_has_no_error_to_tell():
    W = falling_waves(np.random.default_rng(3))
    projection, _, _ = projection_of(W, 1)
    assert np.isnan(spline_errors(projection, ROWS)).all()


def test_the_paper_s_rule_accepts_a_vibration_faster_than_the_snapshots_and_the_spline_does_not():
    rng = np.random.default_rng(4)
    cases = [{**c, "variable": "position.x"} for c in gram_cases(fast_vibration(rng), TIMES, LIMITS)]
    fine = cases[-1]
    assert fine["K_f"] >= 2
    assert fine["R_a"] > 10
    assert fine["verdict"] != "sufficient"
    assert not spline_keeps_promise(fine)


def test_a_motion_resolved_in_space_and_time_keeps_its_promise_only_at_fine_intervals(waves):
    kept = [spline_keeps_promise(case) for case in waves]
    assert kept == sorted(kept)  # coarse to fine: once good, good at every finer interval
    assert kept[-1]
    assert not kept[0]


def test_twice_the_consistent_modes_are_asked_at_a_finer_interval_than_one_time_as_many(waves):
    at = {limit: largest(waves, lambda case, limit=limit: case["K_f"] >= limit) for limit in (1.0, 2.0)}
    assert at[2.0] < at[1.0]


def test_thresholds_as_they_were_give_the_numbers_as_they_were(waves):
    for case in waves:
        again = recut(case)
        assert (again["n_lr"], again["n_c"], again["K_f"]) == (case["n_lr"], case["n_c"], case["K_f"])
        assert again["R_a"] == pytest.approx(case["R_a"], rel=1e-5)


def test_more_energy_needs_more_modes_and_a_laxer_consistency_allows_more(waves):
    case = waves[4]
    assert recut(case, energy=0.9999)["n_lr"] > case["n_lr"]
    assert recut(case, consistency=1.2)["n_c"] > case["n_c"]


def made(errors, n_c=6):
    """A case whose modes promise 1, 0.5 … and whose only surrogate makes these errors."""
    curves = {"E_train": [4.0, 2.0, 1.0, 0.5, 0.4, 0.3, 0.2, 0.1], "E_gap": [4.0, 2.0, 1.1, 0.6, 0.5, 0.4, 0.3, 0.3]}
    return {
        "n_lr": 2,
        "n_c": n_c,
        "curves": curves,
        "errors": {"spline": errors},
        "deviation": 40.0,
        "diameter": 6.0,
    } | {"variable": "position.x"}


def test_each_truth_asks_what_it_says():
    good = made({"n_lr": 1.09, "n_c": 0.24, "all": 0.2})
    bad = made({"n_lr": 1.11, "n_c": 0.26, "all": 0.26 * 40})
    assert keeps_promise(good)
    assert not keeps_promise(bad)
    assert breach(bad) == pytest.approx(1.11)
    assert keeps_promise_up_to_n_c(good)
    assert not keeps_promise_up_to_n_c(bad)
    assert not keeps_promise_up_to_n_c({**good, "n_c": 1})
    assert holds_energy(good)
    assert not holds_energy({**good, "deviation": 6.0})  # 0.2² of 6² is more than a thousandth
    assert within_diameters(good)
    assert not within_diameters({**good, "diameter": 3.9})
    assert unseen_energy(good) == pytest.approx(1 - (1.1 / 40) ** 2)


def test_all_modes_promise_no_error_and_no_surrogate_keeps_that():
    full = {**made({"n_lr": 0.1, "n_c": 0.1, "all": 0.1}), "n_lr": 8}
    assert breach(full) == np.inf
    assert not keeps_promise(full)


def test_confusion_counts_each_kind_once():
    found = confusion([True, True, False, False, False], [True, False, True, False, False])
    assert found == Confusion(accepted=1, rejected=2, strict=1, lenient=1)
    assert found.balanced == pytest.approx((1 / 2 + 2 / 3) / 2)
    assert np.isnan(confusion([True], [True]).balanced)


def test_roc_area_is_the_chance_that_good_scores_above_bad():
    assert area([1, 2, 3, 4], [False, False, True, True]) == 1.0
    assert area([4, 3, 2, 1], [False, False, True, True]) == 0.0
    assert area([1, 1], [False, True]) == 0.5
    assert np.isnan(area([1, 2], [True, True]))


def test_the_best_threshold_parts_good_from_bad_half_way():
    threshold, accuracy = best_threshold([0.5, 0.7, 1.1, 2.0], [False, False, True, True])
    assert threshold == pytest.approx(0.9)
    assert accuracy == 1.0


def test_a_threshold_is_tried_on_flows_that_it_was_not_fitted_to():
    cases = [
        {"flow": flow, "score": s, "good": s > at} for flow, at in (("a", 1.0), ("b", 3.0)) for s in (0.5, 2.0, 4.0)
    ]
    found = across_flows(cases, lambda c: c["score"], lambda c: c["good"])
    assert (found.strict, found.lenient) == (1, 1)  # a's 2 is rejected by b's threshold, b's 2 accepted by a's


def test_an_error_crosses_its_limit_where_a_power_law_says():
    intervals = np.array([10.0, 8.0, 6.0, 4.0, 2.0])
    assert crossing(intervals, (intervals / 5) ** 2, 1.0) == pytest.approx(5.0)
    assert crossing(intervals, intervals, 20.0) == np.inf
    assert crossing(intervals, intervals, 1.0) == 0.0


def test_correlation_time_is_that_of_an_exponential_memory():
    rng, memory = np.random.default_rng(5), 8.0
    v = np.zeros((200, 2100))
    for k in range(1, v.shape[1]):
        v[:, k] = np.exp(-1 / memory) * v[:, k - 1] + rng.standard_normal(len(v))
    assert correlation_time(v[:, 100:]) == pytest.approx(memory, rel=0.05)


def test_correlation_time_of_a_vibration_is_the_phase_at_which_a_cosine_is_one_over_e():
    vibration = np.cos(0.1 * np.arange(2000))[None]
    assert correlation_time(vibration) == pytest.approx(np.arccos(1 / np.e) / 0.1, rel=0.01)


def test_violence_changes_the_clock_but_not_the_snapshots_in_a_turn():
    for names in (("dry_mild", "dry_violent"), ("wet_mild", "wet_violent"), ("drum_mild", "drum_violent")):
        mild, violent = (FLOWS[name]() for name in names)
        assert mild.interval / violent.interval == pytest.approx(4)
        assert mild.interval * mild.units_per_second == pytest.approx(violent.interval * violent.units_per_second)


@pytest.mark.parametrize("name", FLOWS)
def test_every_flow_is_a_scene_that_ends_with_its_last_snapshot(name):
    flow = FLOWS[name]()
    scene = parse_scene(scene_of(flow), name)
    assert scene.time.duration / flow.interval == pytest.approx(flow.start_up + flow.snapshots - 1)
    assert scene.output.interval == flow.interval
    assert ("fluid" in scene.model_fields_set) == (flow.flow in ("wet mill", "fluidised bed"))


def test_a_run_without_its_start_up_keeps_its_clock(tmp_path):
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    place = np.arange(6.0).reshape(2, 3)
    with RunWriter(
        whole, ids=[1, 2], radius=[1e-3, 1e-3], species=[0, 0], n_snapshots=5, provenance={"scene": "made up"},
        variables=["position"], series=["energy"],
    ) as writer:  # fmt: skip
        for k in range(5):
            writer.append(0.1 * k, {"position": place + k}, {"energy": float(k)})
    with Run(whole) as run:
        crop(run, 2, cut)
    with Run(cut) as run:
        assert run.times == pytest.approx([0.2, 0.3, 0.4])
        assert run.snapshot(0).values["position"] == pytest.approx(place + 2)
        assert run.series["energy"] == pytest.approx([2, 3, 4])
        assert run.provenance["scene"] == "made up"
