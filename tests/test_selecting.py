"""The verdict as `suffice select --json` writes it: stable names, plain numbers."""

import json
from math import isfinite
from pathlib import Path

import numpy as np
import pytest

from selection import sweep
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import default_variables, parse_intervals, select_json, select_run, thresholds_of

CANDIDATE = {
    "interval": float,
    "n_snapshots": int,
    "n_lr": int,
    "n_lr_paper": int,
    "n_c": int,
    "K_f": (float, type(None)),
    "K_f_interval": (list, type(None)),
    "n_c_gap": (int, type(None)),
    "K_f_gap": (float, type(None)),
    "R_a": (float, type(None)),
    "sufficient": bool,
    "verdict": str,
    "reasons": list,
    "error_n_lr": float,
    "error_n_c": float,
    "K_f_groups": (int, type(None)),
    "R_lr": (float, type(None)),
    "error_n_lr_diameters": (float, type(None)),
    "error_n_c_diameters": (float, type(None)),
}


@pytest.fixture
def run(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5")) as opened:
        yield opened


def test_the_answer_has_the_names_of_the_design_and_no_others(run):
    answer = select_json(run, select_run(run))
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    assert list(answer) == ["run", "dense_interval", "variables"]
    assert answer["dense_interval"] == pytest.approx(0.001, rel=1e-12)
    assert list(answer["variables"]) == [f"{v}.{axis}" for v in ("position", "velocity") for axis in "xyz"]
    for found in answer["variables"].values():
        assert list(found) == ["chosen_interval", "thresholds", "candidates", "unit"]
        assert found["thresholds"] == {"energy": 0.999, "consistency": 1.05, "feasibility": 2.0, "resolution": 1.25}
        assert [c["interval"] for c in found["candidates"]] == pytest.approx(np.arange(10, 1, -1) * 1e-3)
        for candidate in found["candidates"]:
            assert list(candidate) == list(CANDIDATE)
            for name, kind in CANDIDATE.items():
                assert isinstance(candidate[name], kind), name


def test_numbers_and_verdicts_agree_with_each_other(run):
    for found in select_json(run, select_run(run))["variables"].values():
        candidates = found["candidates"]
        for c in candidates:
            assert c["K_f"] == pytest.approx(c["n_c"] / c["n_lr"])
            assert c["sufficient"] == (c["K_f"] >= 2.0)
            assert c["verdict"] in ("sufficient", "insufficient", "undecidable")
            assert c["reasons"]
            assert c["n_snapshots"] == int(0.04 / c["interval"] + 1e-9) + 1
            if c["K_f_interval"] is not None:
                low, high = c["K_f_interval"]
                assert low <= c["K_f"] <= high
                assert isfinite(high)
        enough = [c["interval"] for c in candidates if c["sufficient"]]
        assert found["chosen_interval"] == max(enough, default=None)


def test_a_run_is_judged_as_its_snapshot_matrix_is(run):
    rows = run.variable("velocity.y")
    direct = sweep(np.asarray(rows[0 : rows.shape[0]], float), run.times, [0.004, 0.002])
    through = select_run(run, ["velocity.y"], [0.004, 0.002])["velocity.y"]
    for one, other in zip(direct.candidates, through.candidates, strict=True):
        assert (one.n_lr, one.n_c, one.n_c_gap, one.K_f) == (other.n_lr, other.n_c, other.n_c_gap, other.K_f)


def test_variables_are_judged_once_each_in_the_order_asked(run):
    done = []
    table = select_run(
        run, ["velocity.z", "position.x", "velocity.z"], [0.004], progress=lambda *step: done.append(step)
    )
    assert list(table) == ["velocity.z", "position.x"]
    assert done == [(0, 2), (1, 2), (2, 2)]
    assert "angular_velocity.x" not in default_variables(run)


def test_a_threshold_changed_is_the_one_that_decides(run):
    strict = select_run(run, ["position.x"], [0.002], {"feasibility": 1e3})["position.x"]
    mild = select_run(run, ["position.x"], [0.002], {"feasibility": 1e-3})["position.x"]
    assert (strict.chosen_interval, mild.chosen_interval) == (None, 0.002)
    assert strict.thresholds.feasibility == 1e3


def test_fluid_needs_less_energy_than_particles():
    assert thresholds_of("fluid.velocity.x").energy == 0.99
    assert thresholds_of("position.x").energy == 0.999
    assert thresholds_of("fluid.velocity.x", {"energy": 0.9}).energy == 0.9


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"energy": 0.0}, "energy is 0; it must be above 0 and at most 1"),
        ({"energy": float("nan")}, "energy is nan"),
        ({"consistency": 1.0}, "consistency is 1; it must be above 1 and finite"),
        ({"feasibility": float("inf")}, "feasibility is inf; it must be above 0 and finite"),
        ({"enrgy": 0.9}, "threshold 'enrgy' is not known; there are energy, consistency, feasibility"),
    ],
)
def test_thresholds_that_decide_nothing_are_refused(changed, says):
    with pytest.raises(Refusal, match=says):
        thresholds_of("position.x", changed)


@pytest.mark.parametrize(
    ("text", "intervals"),
    [
        ("0.010:0.002:0.001", [0.01, 0.009, 0.008, 0.007, 0.006, 0.005, 0.004, 0.003, 0.002]),
        ("0.002:0.004:0.001", [0.002, 0.003, 0.004]),
        ("0.004", [0.004]),
        ("0.004,2e-3", [0.004, 0.002]),
    ],
)
def test_intervals_are_written_as_a_range_or_a_list(text, intervals):
    assert parse_intervals(text) == intervals


@pytest.mark.parametrize("text", ["", "a", "1:2", "1:2:3:4", "0.01:0.002:0", "0.01:0.002:-1", "inf:1:1", "nan:1:1"])
def test_text_that_is_no_intervals_is_refused(text):
    with pytest.raises(Refusal, match=r"not intervals in s; give coarse:fine:step"):
        parse_intervals(text)


def test_a_run_that_is_not_even_in_time_is_refused(write_run, tmp_path):
    import h5py

    path = write_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file["suffice/time"][20:] += 0.0005
    with Run(path) as run, pytest.raises(Refusal, match=r"run\.h5: times: not uniform, snapshot \d+ .* resample"):
        select_run(run)
    assert Path(path).exists()
