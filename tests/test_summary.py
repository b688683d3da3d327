"""What a run tells about itself at its end is what its kernels, its diagnostics and its warnings say."""

import json
import warnings
from shutil import copyfile
from time import perf_counter

import h5py
import numpy as np
import pytest
from numba import config, njit

from sim import LimitError, Simulation, parse_scene, scene_text, simulation_of
from suffice import layout
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.report import render
from suffice.run import Run
from suffice.simulating import simulate_to
from suffice.summary import Summary, read_summary
from suffice.summary_text import percent, summary_text

EVIL = "</script><img src=x onerror=alert(1)>"


def summed_up(text, folder, reporter=None, until=None):
    """Run a scene, and return what it told as its answer and as its file have it."""
    answer = simulate_to(text, "scene.toml", folder / "run.h5", reporter or Reporter(), until=until, threads=1)
    with Run(folder / "run.h5") as run:
        return answer["summary"], read_summary(run), run.series


@pytest.fixture(scope="module")
def whole(beads, tmp_path_factory):
    """One run of the beads: its file, and what it told."""
    folder = tmp_path_factory.mktemp("whole")
    return folder / "run.h5", summed_up(beads, folder)


def test_the_largest_overlap_is_that_of_every_step_and_not_of_the_snapshots_alone(beads, whole):
    told, _, series = whole[1]
    alone = Simulation(parse_scene(beads))
    alone.advance_to(told["steps"])
    assert told["guards"]["overlap"]["largest"] == alone.tally[:, 1].max() > 1.1 * series["max_overlap"].max()
    assert told["guards"]["overlap"]["share"] == told["guards"]["overlap"]["largest"] / 0.1


def test_what_was_put_in_is_what_moves_is_sprung_was_lifted_or_lost(whole):
    told, _, series = whole[1]
    energy = {name.removeprefix("energy."): values for name, values in series.items() if name.startswith("energy.")}
    missing = energy["balance"] - energy["balance"][0]
    assert energy["wall_work"].min() >= 0.0
    lifted = np.maximum(energy["potential"] - energy["potential"][0], 0.0)
    found = energy["kinetic"] + energy["rotational"] + energy["elastic"] + energy["dissipated"] + lifted - missing
    assert told["energy"]["put_in"] == pytest.approx(found.max(), rel=1e-12)
    assert told["energy"]["residual"] == missing[-1]
    assert abs(told["energy"]["largest_residual"]) == np.abs(missing).max()
    assert abs(told["energy"]["largest_residual"]) < 1e-3 * told["energy"]["put_in"]


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_what_is_compiled_before_the_first_step_is_counted_as_compiling(beads, tmp_path, monkeypatch):
    spent = []

    def compiled_first(scene, start):
        began = perf_counter()
        njit(lambda x: x + 1.5)(1.0)
        spent.append(perf_counter() - began)
        return simulation_of(scene, start)

    monkeypatch.setattr("suffice.simulating.simulation_of", compiled_first)
    told, _, _ = summed_up(beads, tmp_path, until=0.001)
    assert told["pace"]["compiling_seconds"] > 0.5 * spent[0]


def test_every_list_made_after_the_first_is_counted(beads, tmp_path, monkeypatch):
    made, rebuild = [], Simulation.rebuild
    monkeypatch.setattr(Simulation, "rebuild", lambda run: made.append(run.step) or rebuild(run))
    told, _, _ = summed_up(beads, tmp_path)
    assert told["neighbours"]["rebuilds"] == len(made) - 1
    assert told["neighbours"]["mean_steps"] == pytest.approx(np.diff(made).mean(), rel=1e-12)


def test_a_guard_that_stopped_a_run_stands_at_its_limit_or_above(beads, tmp_path, capsys):
    with pytest.raises(LimitError, match="overlaps"):
        summed_up(beads.replace("amplitude = [0.0, 0.0, 0.001]", "amplitude = [0.0, 0.0, 0.05]"), tmp_path)
    with Run(tmp_path / "run.h5") as run:
        told = read_summary(run)
    assert told.outcome == "limit"
    assert told.guards["overlap"].share > 1.0 > told.guards["speed"].share
    assert (told.guards["overlap"].unit, told.guards["overlap"].limit) == ("radii", 0.1)
    assert told.time > run.times[-1]
    assert "run.h5: stopped by a limit at t = " in capsys.readouterr().err


def test_a_dry_run_has_no_void_fraction_and_its_file_tells_what_its_answer_does(beads, tmp_path, capsys):
    told, stored, _ = summed_up(beads, tmp_path)
    assert stored.as_dict() == told == json.loads(json.dumps(told))
    assert set(told["guards"]) == {"overlap", "speed"}
    assert (told["clamps"], told["fluid_steps"], told["pace"]["cell_steps_per_second"]) == ({}, None, None)
    pace = told["pace"]
    assert pace["particle_steps_per_second"] == pytest.approx(12 * told["steps"] / pace["seconds"])
    assert pace["simulated_ms_per_minute"] == pytest.approx(20.0 / pace["seconds"] * 60.0)
    said = capsys.readouterr().err
    assert said.rstrip().endswith(summary_text(str(tmp_path / "run.h5"), stored))
    assert "warnings        none" in said


@pytest.mark.physics
def test_void_fractions_held_at_their_bound_are_counted_and_warned_of(tmp_path):
    text = scene_text("mini_mill").replace('coupling = "two-way"', 'coupling = "two-way"\nleast_void_fraction = 0.6')
    told, stored, series = summed_up(text, tmp_path, until=0.002)
    clamp = told["clamps"]["void fraction"]
    assert clamp["count"] == series["fluid.clamped"][-1] > 0
    assert clamp["of"] == 2 * 18 * 18 * 10 * series["fluid.steps"][-1]
    assert stored.warnings["void fraction at its bound"].count == clamp["count"]
    assert 0.2 < told["guards"]["courant"]["share"] < 1.0
    assert all(told["guards"][guard]["share"] <= 1.0 for guard in ("momentum", "continuity"))


def test_a_limit_that_was_nearly_reached_is_warned_of(beads, whole, tmp_path):
    _, before, _ = whole[1]
    limit = before.guards["overlap"].largest / 0.95
    _, after, _ = summed_up(f"{beads}\n[limits]\nmax_overlap = {limit}\n", tmp_path)
    assert before.warnings == {}
    assert list(after.warnings) == ["near a limit"]
    assert "overlap" in after.warnings["near a limit"].first
    assert "95 % of the limit" in after.warnings["near a limit"].first


def test_a_run_that_gains_energy_from_nowhere_warns_of_it(beads, tmp_path, monkeypatch):
    series = Simulation.series

    def leaking(run):
        found = series(run)
        return found | {"energy.balance": found["energy.balance"] + 1e-3 * run.time}

    monkeypatch.setattr(Simulation, "series", leaking)
    told, stored, _ = summed_up(beads, tmp_path)
    assert told["energy"]["residual"] == pytest.approx(2e-5, rel=1e-2)
    assert "energy does not balance" in stored.warnings


def test_warnings_of_libraries_are_said_once_and_counted(capsys):
    reporter = Reporter()
    with warnings.catch_warnings():
        warnings.resetwarnings()
        warnings.simplefilter("ignore", DeprecationWarning)
        with reporter.hearing():
            for _ in range(3):
                np.float64(1.0) / np.float64(0.0)
                warnings.warn("old", DeprecationWarning, stacklevel=1)
            reporter.warn("odd", "just once")
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("warning: RuntimeWarning: divide by zero encountered")
    assert said[1:] == ["warning: odd: just once", "warning: RuntimeWarning: 3 in all"]


def test_warnings_of_a_run_are_in_its_file_and_no_longer_with_the_reporter(beads, tmp_path):
    reporter = Reporter(as_json=True)
    for _ in range(2):
        reporter.warn("odd", "twice")
    _, stored, _ = summed_up(beads, tmp_path, reporter)
    assert stored.warnings["odd"].model_dump() == {"count": 2, "first": "twice"}
    assert not reporter.warned


def test_the_report_shows_every_warning_with_its_count_and_nothing_in_it_is_markup(beads, tmp_path):
    reporter = Reporter()
    reporter.warn(EVIL, EVIL, 1234)
    told, _, _ = summed_up(beads, tmp_path, reporter)
    stages = [{"name": "select", "seconds": 1.0, "detail": "", "warnings": {"undecidable": {"count": 7, "first": "x"}}}]
    page = render({"told": {EVIL: told}, "stages": stages})
    section = page.partition("What the runs tell about themselves")[2].partition("</section>")[0]
    assert "1,234" in section
    assert "<td>select</td><td>undecidable</td><td>7</td><td>x</td>" in section
    assert EVIL not in page
    several = render({"told": {"a.h5": told, "b.h5": told}})
    assert several.count(f"<td>{percent(told['guards']['overlap']['share'], 1.0)}</td>") == 2
    quiet = render({"stages": [{**stages[0], "warnings": {}}]})
    assert "No stage has warned of anything." in quiet
    assert "What the runs tell" not in render({"stages": [{"name": "select", "seconds": 1.0, "detail": ""}]})


@pytest.mark.parametrize("text", [b"no", b"[]", b'{"outcome": "done"}', b"\xff\xfe"])
def test_a_damaged_summary_is_refused(whole, tmp_path, text):
    copyfile(whole[0], tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        file[layout.SUMMARY][()] = np.bytes_(text)
    with Run(tmp_path / "run.h5") as run, pytest.raises(Refusal, match="is damaged"):
        read_summary(run)


def test_a_value_that_is_not_a_number_is_told_as_such():
    guard = {"largest": None, "at": 0.1, "limit": 1.0, "unit": "cells per step"}
    told = Summary(outcome="limit", time=0.1, steps=3, guards={"courant": guard}, clamps={}, warnings={})
    assert "Courant number  not a number at 100 ms, – of the limit of 1 cells per step" in summary_text("run.h5", told)
