"""`suffice select --coarse` and `--forecast`: what they write, say and refuse."""

import json

import numpy as np
import pytest

from selection import sweep
from suffice.partial import Asked, select_partial
from suffice.run import Run
from suffice.selecting import select_json, select_run

REFUSED = 2
BOUNDED = ["interval", "n_snapshots", "n_lr", "n_c_range", "K_f_range", "R_a", "verdict", "reasons"]
FORESEEN = ["interval", "n_snapshots", "n_lr", "n_lr_range", "n_c", "K_f", "K_f_range", "verdict", "reasons"]


@pytest.fixture
def path(write_run, tmp_path):
    return write_run(tmp_path / "run.h5", n=60)


def answer_of(suffice, *arguments):
    given = suffice("select", *arguments, "--json", "-")
    assert given.code == 0, given.err
    return json.loads(given.out)


def test_the_blocks_stand_beside_what_select_says_anyway(suffice, path):
    plain = answer_of(suffice, path)
    asked = answer_of(suffice, path, "--forecast", "0.2")
    assert list(asked) == list(plain)
    for name, found in asked["variables"].items():
        assert list(found) == [*plain["variables"][name], "forecast"]
        assert {k: v for k, v in found.items() if k != "forecast"} == plain["variables"][name]


def test_a_coarse_run_gets_bounds_of_its_own_interval_and_of_twice_that(suffice, path):
    answer = answer_of(suffice, path, "--coarse", "--variable", "position.x", "--variable", "velocity.y")
    assert list(answer["variables"]) == ["position.x", "velocity.y"]
    for found in answer["variables"].values():
        assert [c["interval"] for c in found["candidates"]] == pytest.approx(np.arange(10, 0, -1) * 1e-3)
        assert list(found["coarse"]) == ["recorded", "doubled"]
        recorded, doubled = found["coarse"].values()
        assert (recorded["interval"], doubled["interval"]) == (0.001, 0.002)
        assert (recorded["n_snapshots"], doubled["n_snapshots"]) == (41, 21)
        for bounded in (recorded, doubled):
            assert list(bounded) == BOUNDED
            low, high = bounded["K_f_range"]
            assert low <= high
            assert bounded["verdict"] in ("sufficient", "insufficient", "undecidable")


def test_intervals_asked_for_are_judged_beside_those_a_coarse_run_needs(suffice, path):
    answer = answer_of(suffice, path, "--coarse", "--intervals", "0.005", "--variable", "position.x")
    candidates = answer["variables"]["position.x"]["candidates"]
    assert [c["interval"] for c in candidates] == [0.005, 0.004, 0.002, 0.001]


def test_a_forecast_names_the_interval_and_how_many_snapshots_it_takes(suffice, path):
    answer = answer_of(suffice, path, "--forecast", "0.4", "--variable", "position.x", "--feasibility", "0.5")
    told = answer["variables"]["position.x"]["forecast"]
    assert list(told) == [
        "pilot", "duration", "growth", "expected_interval", "safe_interval", "candidates", "remarks",
    ]  # fmt: skip
    assert (told["pilot"], told["duration"]) == (pytest.approx(0.04), 0.4)
    assert [c["interval"] for c in told["candidates"]] == [0.004, 0.003, 0.002]
    assert [c["n_snapshots"] for c in told["candidates"]] == [101, 134, 201]
    for candidate in told["candidates"]:
        assert list(candidate) == FORESEEN
    enough = [c["interval"] for c in told["candidates"] if c["K_f"] >= 0.5]
    assert told["expected_interval"] == max(enough, default=None)


def test_rows_are_read_once(path, monkeypatch):
    from suffice.rows import Variable

    read = []
    monkeypatch.setattr(
        Variable, "__getitem__", lambda self, rows, get=Variable.__getitem__: read.append(rows) or get(self, rows)
    )
    with Run(path) as run:
        select_run(run, ["position.x"])
        once = len(read)
        select_partial(run, Asked(True, 0.4), ["position.x"])
    assert len(read) == 2 * once


def test_a_partial_verdict_is_that_of_the_library(path):
    with Run(path) as run:
        rows = run.variable("velocity.z")
        direct = sweep(np.asarray(rows[0 : rows.shape[0]], float), run.times)
        answer = select_partial(run, Asked(duration=0.2), ["velocity.z"])
        plain = select_json(run, select_run(run, ["velocity.z"]))
    found = answer["variables"]["velocity.z"]
    assert found.pop("forecast")["candidates"]
    assert found == plain["variables"]["velocity.z"]
    assert [c["n_c"] for c in found["candidates"]] == [c.n_c for c in direct.candidates]


def test_the_terminal_is_told_what_is_expected_and_what_is_safe(suffice, path):
    said = suffice("select", path, "--coarse", "--forecast", "0.4", "--variable", "position.x")
    assert said.code == 0, said.err
    assert "without dense truth" in said.out
    assert "position.x at 1 ms: " in said.out
    assert "position.x at 2 ms: " in said.out
    assert "400 ms foreseen from 40 ms" in said.out


@pytest.mark.parametrize(
    ("duration", "says"),
    [
        ("0.04", "duration: 0.04 s, the run has 0.04 s already; judge it as it is, or plan longer"),
        ("0.01", "duration: 0.01 s, the run has 0.04 s already"),
        ("nan", "duration: nan s"),
    ],
)
def test_a_plan_no_longer_than_the_run_is_refused_and_nothing_is_written(suffice, path, tmp_path, duration, says):
    told = suffice("select", path, "--forecast", duration, "--json", tmp_path / "out.json")
    assert told.code == REFUSED
    assert says in told.err.replace("\n", " ")
    assert not (tmp_path / "out.json").exists()


def test_two_snapshots_have_nothing_to_leave_out(suffice, write_run, tmp_path):
    told = suffice("select", write_run(tmp_path / "two.h5", n_snapshots=2), "--coarse")
    assert told.code == REFUSED
    assert "2 snapshots; a verdict without dense truth leaves out every second of at least 3" in told.err.replace(
        "\n", " "
    )


def test_three_snapshots_are_answered_with_what_is_missing(suffice, write_run, tmp_path):
    answer = answer_of(suffice, write_run(tmp_path / "three.h5", n_snapshots=3), "--coarse", "--forecast", "1")
    for found in answer["variables"].values():
        assert found["coarse"]["recorded"]["verdict"] == "undecidable"
        assert found["forecast"]["remarks"] == ["too short a pilot: 3 snapshots, at least 20 needed"]
