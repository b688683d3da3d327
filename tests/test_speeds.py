"""A study over rotor speeds: a run per speed with whole periods, then the unseen one, each stage once."""

import json
import tomllib

import pytest

from sim import parse_scene, scene_text
from suffice.changes import toml_value
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.report import render
from suffice.rotor import rotor_of
from suffice.run import Run
from suffice.speeds import Speeds, scene_at
from suffice.study import built_in_studies, load_study, run_study

STUDY = """scene = "mini_mill"
seed = 2

[unseen]
rpm = [1500.0, 2000.0, 2500.0]
held_out = [2000.0]
start_up = 0
turns = 1
bins = 2
snapshots_per_bin = 2
surrogates = ["nearest", "linear", "rbf"]

[unseen.changes]
"particles.0.count" = 150
"contact.stiffness" = 2e4
"fluid.cells" = [9, 9, 5]
"""
STAGES = ["simulate 1500 rpm", "simulate 2000 rpm", "simulate 2500 rpm", "compare unseen", "report"]


def speeds(**changed):
    return Speeds(**{"rpm": [400.0, 800.0, 1200.0], "held_out": [800.0], **changed})


def test_the_built_in_study_holds_out_a_speed_between_others():
    assert "speeds" in built_in_studies()
    _, study, _ = load_study("speeds")
    assert study.unseen is not None
    assert len(study.unseen.rpm) == 5
    assert len(study.unseen.held_out) == 1


def test_every_speed_turns_equally_often_and_is_seen_at_the_same_phases():
    text = scene_text("mini_mill")
    for rpm in (400.0, 800.0, 1600.0):
        scene = parse_scene(scene_at(text, "mini_mill", rpm, speeds(start_up=1, turns=2)))
        rotor = rotor_of(scene)
        assert rotor.rpm == rpm
        assert scene.time.duration == pytest.approx(3 * 60.0 / rpm, rel=1e-12)
        assert rotor.period / scene.output.interval == pytest.approx(16, rel=1e-12)


def test_a_scene_at_a_speed_differs_in_nothing_else():
    text = scene_text("mini_mill")
    before, after = (
        parse_scene(text).model_dump(),
        parse_scene(scene_at(text, "mini_mill", 1000.0, speeds())).model_dump(),
    )
    for scene in (before, after):
        del scene["time"]["duration"], scene["output"]["interval"]
    assert after == before


def test_changes_reach_the_place_they_name_or_are_refused():
    text = scene_text("mini_mill")
    scene = parse_scene(scene_at(text, "mini_mill", 400.0, speeds(changes={"particles.0.count": 7})))
    assert scene.particles[0].count == 7
    for where in ("particles.1.count", "particles.first.count", "seed.what"):
        with pytest.raises(Refusal, match=rf"changes: {where} is no place in scene mini_mill"):
            scene_at(text, "mini_mill", 400.0, speeds(changes={where: 7}))


@pytest.mark.parametrize("value", [1e-7, 0.1 + 0.2, 3, True, 'a "b"\n\\ µ', [1.0, [2, "x"]], {"a b": {"c": [1e300]}}])
def test_a_value_reads_back_from_toml_as_it_was(value):
    assert tomllib.loads(f"x = {toml_value(value)}")["x"] == value


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"held_out": [400.0]}, "400 1/min is not among rpm, or at their end"),
        ({"held_out": [900.0]}, "900 1/min is not among rpm"),
        ({"rpm": [400.0, 800.0, 800.0]}, "give different speeds"),
    ],
)
def test_speeds_that_leave_nothing_between_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        speeds(**change)


@pytest.mark.parametrize(
    ("extra", "says"),
    [
        ('[compare]\nvariables = ["position.x"]\n', r"\[unseen\] runs a scene at several speeds"),
        ('[source]\nfiles = ["a"]\n', "give either a scene or a table"),
    ],
)
def test_a_study_of_speeds_has_a_scene_and_no_other_question(tmp_path, extra, says):
    (tmp_path / "my.toml").write_text(STUDY + extra)
    with pytest.raises(Refusal, match=says):
        load_study(str(tmp_path / "my.toml"))


def test_an_unknown_surrogate_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "my.toml").write_text(STUDY.replace('"rbf"', '"oracle"'))
    with pytest.raises(Refusal, match="surrogate 'oracle' is not known here; use nearest"):
        run_study(str(tmp_path / "my.toml"), tmp_path / "out", Reporter(as_json=True), print)
    assert not (tmp_path / "out").exists()


def ran(folder):
    said = []
    run_study(str(folder / "my.toml"), folder / "out", Reporter(as_json=True), said.append)
    assert [line.split(":")[0] for line in said] == STAGES
    return [line.split(":")[0] for line in said if "nothing changed" not in line]


@pytest.mark.physics
def test_a_study_of_speeds_runs_each_stage_once_and_its_report_tells_the_unseen_speed(tmp_path):
    (tmp_path / "my.toml").write_text(STUDY)
    assert ran(tmp_path) == STAGES
    out = tmp_path / "out"
    for rpm in (1500, 2000, 2500):
        with Run(out / f"{rpm}_rpm.h5") as run:
            assert run.n_snapshots == 17
            assert f"rpm = {rpm}.0" in run.provenance["scene"].replace('"', "")
    answer = json.loads((out / "unseen.json").read_text())
    assert answer["held_out"] == [2000.0]
    page = (out / "report.html").read_text()
    assert "Fields at an unseen speed" in page
    assert "Predicted: <b>2000 rpm</b>" in page
    # a faster rotor gives more momentum to solid and fluid than one as slow: the nearest speed is no answer to that
    case = next(c for c in answer["cases"] if (c["average"], c["scaling"]) == ("time", "none"))
    nearest, linear = (next(r for r in case["rows"] if r["surrogate"] == name) for name in ("nearest", "linear"))
    assert linear["errors"]["agitation"] < nearest["errors"]["agitation"]
    assert ran(tmp_path) == []
    (out / "2500_rpm.h5").unlink()
    assert ran(tmp_path)[0] == "simulate 2500 rpm"


def test_no_name_of_a_surrogate_acts_as_markup_in_the_section_of_unseen_speeds():
    evil = "<img src=x onerror=alert(1)>"
    errors = {"void_fraction": 0.1, "overall": 0.1}
    row = {"surrogate": evil, "errors": errors, "seed_spread": errors, "seeds": 2}
    case = {"average": "phase", "scaling": "none", "rows": [row], "statistical_floor": errors}
    case |= {"projection_floor": errors, "sentences": dict.fromkeys(errors, evil)}
    page = render({"unseen": {"cases": [case], "held_out": [800.0], "runs": [{"rpm": 400.0}], "fields": {}}})
    assert "Fields at an unseen speed" in page
    assert "<img" not in page
