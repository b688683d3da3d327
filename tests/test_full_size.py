"""A study of one step at full size: what is repeated is said, what is not measured is not claimed."""

import json

import numpy as np
import pytest

from sim import parse_scene
from suffice.developed import late_moment
from suffice.full_size import GOALS, chosen_interval, ratios
from suffice.one_step import OneStep, timing_of
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.report import render
from suffice.run import Run
from suffice.stretch import Stretch
from suffice.study import built_in_studies, load_study, run_study, stages_of

STUDY = """scene = "many.toml"

[one_step]
source = "few.toml"
interval = 0.002
surrogate = "spline"
steps = 60
"""


@pytest.fixture
def folder(tmp_path, beads):
    """Return a folder with a scene of 12 beads, one of 36, and a study of both."""
    (tmp_path / "few.toml").write_text(beads.replace("frequency = 40.0", "frequency = 50.0"))
    (tmp_path / "many.toml").write_text(beads.replace("count = 12", "count = 36"))
    (tmp_path / "my.toml").write_text(STUDY)
    return tmp_path


def ran(folder):
    said = []
    run_study(str(folder / "my.toml"), folder / "out", Reporter(as_json=True), said.append)
    return said


def stretch_of(steps, low, high):
    timing = timing_of([low, high])
    return Stretch(500_000, 0.0, 1e-3, steps, 2, timing, steps * timing.seconds, 2827, 1e-3, 0.0, 2, {})


def speed_of(single, batch):
    return OneStep(
        timing_of(single),
        timing_of(batch),
        100,
        timing_of([1e-6]),
        None,
        [3, 4, 5],
        500_000,
        "single",
        2,
        "CPU",
        1,
        1.0,
    )


def test_a_ratio_is_interval_over_snapshot_and_its_range_that_of_both_quartiles():
    found = ratios(stretch_of(1000, 0.09, 0.11), speed_of([0.04, 0.06], [0.002, 0.002]), None)
    assert found["single"] == pytest.approx(2827 * 0.1 / 0.05)
    assert found["batch"] == pytest.approx(2827 * 0.1 / 0.002)
    low, high = found["single_range"]
    assert low == pytest.approx(2827 * 0.095 / 0.055)
    assert high == pytest.approx(2827 * 0.105 / 0.045)
    assert found["single_reached"]
    assert found["single_developed"] is None
    slow = ratios(stretch_of(1000, 0.09, 0.11), speed_of([0.5, 0.5], [0.2, 0.2]), None)
    assert not slow["single_reached"]
    assert not slow["batch_reached"]


def test_the_built_in_study_is_of_the_paper_s_size_and_its_source_divides_it(tmp_path):
    assert "paper" in built_in_studies()
    name, study, home = load_study("paper")
    assert study.one_step is not None
    stages = stages_of(name, study, home, tmp_path, Reporter(as_json=True))  # refused where beads do not make it up
    assert [stage.name for stage in stages] == ["simulate source", "one step", "report"]
    assert (study.scene, study.one_step.surrogate) == ("paper_mill", "rbf")
    assert GOALS == {"single": 1500.0, "batch": 10_000.0}


@pytest.mark.physics
def test_a_study_at_full_size_times_solver_and_model_of_as_many_beads_and_tells_what_it_did(folder):
    said = ran(folder)
    assert [line.split(":")[0] for line in said] == ["simulate source", "one step", "report"]
    answer = json.loads((folder / "out" / "one_step.json").read_text())
    solver, rom, source = answer["solver"], answer["rom"], answer["source"]
    assert solver["beads"] == rom["beads"] == 36
    assert answer["scene"] == "many.toml"
    assert (source["beads"], source["copies"], source["interval_reason"]) == (12, 3, "asked for")
    assert solver["interval_seconds"] == pytest.approx(
        solver["steps_per_interval"] * solver["seconds"] / solver["steps"]
    )
    assert answer["ratio"]["single"] == pytest.approx(solver["interval_seconds"] / rom["seconds"])
    late = answer["developed"]
    assert late["start"]["beads"] == late["late"]["beads"] == 12
    assert answer["ratio"]["batch_developed"] == pytest.approx(late["factor"] * answer["ratio"]["batch"])
    results = json.loads((folder / "out" / "results.json").read_text())
    assert results["one_step"] == answer
    page = (folder / "out" / "report.html").read_text()
    assert "One step at full size" in page
    assert "repeated 3 times beside each other" in page
    assert all("nothing changed" in line for line in ran(folder))
    (folder / "my.toml").write_text(STUDY.replace("steps = 60", "steps = 80"))
    assert ["nothing changed" in line for line in ran(folder)] == [True, False, False]
    (folder / "again.toml").write_text(STUDY.replace("few.toml", "out/source.h5"))
    run_study(str(folder / "again.toml"), folder / "other", Reporter(as_json=True), lambda _: None)
    again = json.loads((folder / "other" / "one_step.json").read_text())
    assert again["source"] == source


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("few.toml", "none.h5"), r"none\.h5 is missing; name a file that holds a run"),
        (('"spline"', '"oracle"'), "surrogate 'oracle' is not one that is trained on modes"),
        (("[one_step]", "[select]\n[one_step]"), "times a scene; give it a scene, and no other question"),
    ],
)
def test_a_study_that_cannot_be_is_refused_before_anything_runs(folder, change, says):
    (folder / "my.toml").write_text(STUDY.replace(*change))
    with pytest.raises(Refusal, match=says):
        ran(folder)
    assert not (folder / "out").exists()


def test_beads_that_do_not_make_up_the_scene_are_refused_before_anything_runs(folder, beads):
    (folder / "many.toml").write_text(beads.replace("count = 12", "count = 30"))
    with pytest.raises(Refusal, match="12 beads do not make up the 30 of the scene"):
        ran(folder)
    assert not (folder / "out").exists()


def test_what_suffices_for_all_components_is_taken_before_what_suffices_for_x(tmp_path, write_run):
    with Run(write_run(tmp_path / "run.h5", n_snapshots=161)) as run:
        chosen = chosen_interval(run, None)
        assert chosen.interval in {0.01, 0.009, 0.008, 0.007, 0.006, 0.005, 0.004, 0.003, 0.002}
        assert "x" in chosen.reason
        assert chosen_interval(run, 0.004) == (0.004, "asked for")


def test_a_late_moment_shows_the_rotor_where_it_began(tmp_path, write_stirred):
    path = write_stirred(tmp_path / "run.h5", periods=3, per_period=8)  # two arms at 600 rpm stand alike every 50 ms
    with Run(path) as run:
        scene = parse_scene(run.provenance["scene"])
        assert late_moment(run, scene) == pytest.approx(0.15)
        run.times = np.arange(1, 6) * 0.007
        assert late_moment(run, scene) is None
        run.times = np.array([0.0, 0.05])
        assert late_moment(run, scene) == 0.05


def test_no_name_in_the_section_acts_as_markup():
    evil = "<img src=x onerror=alert(1)>"
    solver = stretch_of(1000, 0.09, 0.11)
    rom = speed_of([0.04, 0.06], [0.002, 0.002])
    timings = {name: getattr(rom, name)._asdict() for name in ("single", "batch", "regression")}
    own = {name: getattr(rom, name) for name in ("seconds", "batch_seconds", "bytes_per_second", "flops_per_second")}
    answer = {
        "scene": evil,
        "solver": solver._asdict() | {"step": solver.step._asdict(), "interval_seconds": 282.7, "share": 0.3},
        "developed": None,
        "rom": rom._asdict() | timings | own | {"device": evil},
        "source": {"run": evil, "beads": 2000, "copies": 250, "n_snapshots": 9, "interval": 0.003}
        | {"interval_reason": evil, "surrogate": evil}
        | {name: [1, 1, None] for name in ("n_lr", "n_c", "n_modes", "rmse_diameters")},
        "ratio": ratios(solver, rom, None),
        "gpu": None,
        "goals": GOALS,
        "paper": evil,
        "sentence": evil,
    }
    fetch = timing_of([1e-4])._asdict()
    answer["gpu"] = {"rom": answer["rom"] | {"fetch": fetch}, "ratio": ratios(solver, rom, None)}
    page = render({"one_step": answer})
    assert "One step at full size" in page
    assert "<img" not in page


def test_a_copy_from_a_gpu_counts_in_a_ratio():
    rom = speed_of([0.001, 0.001], [0.0005, 0.0005])
    solver = stretch_of(1000, 0.1, 0.1)
    fetched = ratios(solver, rom._replace(fetch=timing_of([0.001])), None)
    assert fetched["single"] == pytest.approx(0.5 * ratios(solver, rom, None)["single"])
    assert fetched["batch"] == pytest.approx(282.7 / 0.0015)
