"""How far, how fast, how long: as bars for people and as lines of JSON for programs."""

import json

import pytest

from suffice import progress
from suffice.progress import Reporter


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test moves."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])

    def wait(seconds):
        now[0] += seconds

    return wait


def lines(capsys):
    said = capsys.readouterr()
    assert said.out == ""
    return [json.loads(line) for line in said.err.splitlines()]


def test_lines_say_rate_and_seconds_left(clock, capsys):
    with Reporter(as_json=True).stage("simulate", "particle-steps", work=500.0) as advance:
        advance(0, 10)
        clock(2.0)
        advance(4, 10)
        clock(3.0)
        advance(10, 10)
    first, second, last = lines(capsys)
    assert first["rate"] is None
    assert first["seconds_left"] is None
    named = ("stage", "done", "all", "seconds", "unit")
    assert [second[n] for n in named] == ["simulate", 4, 10, 2.0, "particle-steps/s"]
    assert (second["rate"], second["seconds_left"]) == (2.0 * 500.0, 3.0)
    assert (last["done"], last["rate"], last["seconds_left"]) == (10, 2.0 * 500.0, 0.0)


def test_a_resumed_stage_counts_its_speed_from_where_it_began(clock, capsys):
    with Reporter(as_json=True).stage("simulate", "snapshots") as advance:
        advance(90, 100)
        clock(5.0)
        advance(95, 100)
    assert lines(capsys)[-1]["seconds_left"] == 5.0


def test_no_more_than_a_line_a_second_but_the_end_is_always_said(clock, capsys):
    with Reporter(as_json=True).stage("select", "variables") as advance:
        for done in range(101):
            advance(done, 100)
            clock(0.05)
    said = lines(capsys)
    assert len(said) <= 7
    assert said[-1]["done"] == 100


def test_a_bar_ends_with_its_count_on_standard_error(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with Reporter().stage("import", "snapshots") as advance:
        advance(7, 7)
    said = capsys.readouterr()
    assert said.out == ""
    assert "import" in said.err
    assert "7/7" in said.err


def test_every_line_of_a_run_is_json_and_its_answer_is_alone_on_standard_output(suffice, beads, tmp_path):
    (tmp_path / "scene.toml").write_text(beads)
    answer = suffice("--log-json", "simulate", tmp_path / "scene.toml", "-o", tmp_path / "run.h5", "--json", "-")
    said = [json.loads(line) for line in answer.err.splitlines()]
    *_, last, summary = said
    assert last["done"] == last["all"] == 21
    assert last["stage"] == "simulate"
    assert last["rate"] > 0.0
    assert json.loads(answer.out)["n_snapshots"] == 21
    assert summary == {"stage": "simulate", "summary": json.loads(answer.out)["summary"]}


def test_a_file_is_told_once_a_minute_and_a_short_stage_not_at_all(clock, capsys):
    with Reporter().stage("simulate", "particle-steps", work=500.0) as advance:
        for done in range(11):
            advance(done, 10)
            clock(31.0)
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "simulate: 2 of 10, 16.1 particle-steps/s, 4 min left"
    assert len(said) == 5
    with Reporter().stage("select", "variables") as advance:
        advance(1, 2)
        clock(5.0)
        advance(2, 2)
    assert capsys.readouterr().err == ""
