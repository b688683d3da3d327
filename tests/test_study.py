"""A study: every stage once, again only where something it depends on has changed, and on from where it stopped."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sim import InputError
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.store import Run
from suffice.study import built_in_studies, load_study, run_study

STAGES = ("simulate", "select", "compare", "report")
STUDY = """scene = "scene.toml"

[select]
intervals = [0.004, 0.002]

[compare]
variables = ["position.z"]
intervals = [0.002]
surrogates = ["spline", "rbf"]
"""


@pytest.fixture
def folder(tmp_path, beads):
    (tmp_path / "scene.toml").write_text(beads)
    (tmp_path / "my.toml").write_text(STUDY)
    return tmp_path


def ran(folder, study="my.toml", output="out"):
    """Run a study and return which of its stages did something."""
    said = []
    report = run_study(str(folder / study), folder / output, Reporter(as_json=True), said.append)
    assert report == folder / output / "report.html"
    stages = [line.split(":")[0] for line in said]
    assert stages[1:] == list(STAGES[1:])
    return [stage for stage, line in zip(stages, said, strict=True) if "nothing changed" not in line]


def replace(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_every_stage_runs_once_and_leaves_its_file(folder):
    assert ran(folder) == list(STAGES)
    out = folder / "out"
    made = ["compare.json", "report.html", "results.json", "run.h5", "run.particles.vtkhdf", "select.json"]
    assert sorted(path.name for path in out.iterdir()) == [*made, "stages.json"]
    results = json.loads((out / "results.json").read_text())
    assert results["study"] == "my"
    assert [stage["name"] for stage in results["stages"]] == list(STAGES[:3])
    assert list(results["select"]["variables"])[:3] == ["position.x", "position.y", "position.z"]
    assert {row["surrogate"] for row in results["compare"]["rows"]} == {"spline", "rbf"}
    undecided = [c["verdict"] for found in results["select"]["variables"].values() for c in found["candidates"]]
    warned = {stage["name"]: stage["warnings"] for stage in results["stages"]}
    assert warned["select"]["undecidable verdict"]["count"] == undecided.count("undecidable") > 0
    assert warned["simulate"] == {}  # its own are the run's
    assert results["told"]["run.h5"]["guards"]["overlap"]["share"] > 0.0
    assert "<html" in (out / "report.html").read_text()
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert ran(folder) == []
    assert before == {path.name: path.read_bytes() for path in out.iterdir()}


def test_a_change_reruns_what_depends_on_it_and_nothing_before(folder):
    ran(folder)
    # each stage's digest holds that of the one before it
    replace(folder / "my.toml", '["spline", "rbf"]', '["spline"]')
    assert ran(folder) == ["compare", "report"]
    replace(folder / "my.toml", "[0.004, 0.002]", "[0.004, 0.003, 0.002]")
    assert ran(folder) == ["select", "compare", "report"]
    replace(folder / "scene.toml", "seed = 1", "seed = 2")
    assert ran(folder) == list(STAGES)
    replace(folder / "scene.toml", "# Twelve beads", "# A dozen beads")
    assert ran(folder) == []  # words, not physics
    replace(folder / "my.toml", "scene =", "seed = 3\nscene =")
    assert ran(folder) == list(STAGES)
    (folder / "out" / "compare.json").unlink()
    assert ran(folder) == ["compare"]


def test_a_stage_that_failed_runs_again(folder):
    replace(folder / "my.toml", '["position.z"]', '["position.w"]')
    with pytest.raises(Refusal, match=r"no variable 'position\.w'; it has position\.x"):
        ran(folder)
    replace(folder / "my.toml", "position.w", "position.z")
    assert ran(folder) == ["compare", "report"]


def stopped_in_the_middle(folder):
    """Start a study in another process with a checkpoint after each snapshot, and interrupt it while it simulates."""
    command = (
        "import suffice.simulating as s; s.SECONDS_BETWEEN_CHECKPOINTS = 0.0; import suffice.__main__ as m; m.main()"
    )
    arguments = [sys.executable, "-c", command, "study", "my.toml", "-o", "out"]
    process = subprocess.Popen(arguments, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while not (folder / "out" / "run.h5.checkpoint").exists():
        assert process.poll() is None
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    with Run(folder / "out" / "run.h5") as run:
        return run.n_snapshots


def test_an_interrupted_study_goes_on_where_it_stopped_and_not_where_its_scene_has_changed(folder, monkeypatch):
    replace(folder / "scene.toml", "interval = 0.001", "interval = 0.0001")
    assert stopped_in_the_middle(folder) < 201
    resumed = []
    import suffice.stages as stages

    simulate_to = stages.simulate_to

    def noting(*arguments, **options):
        resumed.append(options["resume"])
        return simulate_to(*arguments, **options)

    monkeypatch.setattr(stages, "simulate_to", noting)
    assert ran(folder) == list(STAGES)
    assert resumed == [True]
    replace(folder / "my.toml", "scene =", "seed = 5\nscene =")
    stopped_in_the_middle(folder)
    replace(folder / "my.toml", "seed = 5", "seed = 6")
    assert ran(folder) == list(STAGES)
    assert resumed == [True, False]
    with Run(folder / "out" / "run.h5") as run:
        assert run.n_snapshots == 201
        assert json.loads(run.provenance["settings"])["seed"] == 6


def write_dump(path, shift=0.0):
    lines = []
    for k in range(41):
        lines += ["ITEM: TIMESTEP", str(100 * k), "ITEM: NUMBER OF ATOMS", "20", "ITEM: BOX BOUNDS ff ff ff"]
        lines += [*["-2 2"] * 3, "ITEM: ATOMS id x y z vx vy vz"]
        for i in range(1, 21):
            angle = 0.01 * i * k + shift
            speed = 0.01 * i / 0.001
            x, y = np.sin(angle), np.cos(angle)
            lines.append(f"{i} {x:.6g} {y:.6g} {i} {speed * y:.6g} {-speed * x:.6g} 0")
    path.write_text("\n".join(lines) + "\n")


SOURCE = """[source]
files = ["other.dump"]
timestep = 1e-5
diameter = 0.01

[compare]
variables = ["position.x"]
intervals = [0.004]
"""


def test_a_study_of_somebody_elses_run_reads_it_once_and_again_when_it_changes(tmp_path):
    write_dump(tmp_path / "other.dump")
    (tmp_path / "their.toml").write_text(SOURCE)
    stages = ["import", "select", "compare", "report"]
    assert ran(tmp_path, "their.toml") == stages
    assert ran(tmp_path, "their.toml") == []
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["run"]["diameter"] == pytest.approx(0.01)
    assert results["run"]["interval"] == pytest.approx(0.001)
    assert "series" not in results  # nobody told its energies
    write_dump(tmp_path / "other.dump", shift=0.3)
    assert ran(tmp_path, "their.toml") == stages


def test_what_the_study_decides_is_what_select_and_compare_decide(folder, suffice):
    ran(folder)
    run = folder / "out" / "run.h5"
    chosen = json.loads(suffice("select", run, "--intervals", "0.004,0.002", "--json", "-").out)
    assert json.loads((folder / "out" / "select.json").read_text())["select"] == chosen


def test_n_lr_and_n_c_of_a_comparison_are_those_of_the_verdict_whatever_the_study_asks_of_them(folder):
    text = STUDY.replace("[0.004, 0.002]", "[0.002]").replace("position.z", "position.x")
    (folder / "my.toml").write_text(text + "[select.thresholds]\nenergy = 0.9\nconsistency = 1.5\n")
    ran(folder)
    found = {name: json.loads((folder / "out" / f"{name}.json").read_text()) for name in ("select", "compare")}
    (judged,) = found["select"]["select"]["variables"]["position.x"]["candidates"]
    counts = {row["modes"] for row in found["compare"]["rows"] if row["basis"] == "plain"}
    assert {judged["n_lr"], judged["n_c"]} <= counts
    assert (found["compare"]["energy"], found["compare"]["consistency"]) == (0.9, 1.5)


def test_a_study_may_limit_an_error_in_the_unit_of_its_variables(folder):
    replace(folder / "my.toml", "intervals = [0.002]\n", 'intervals = [0.002]\nmax_error = "0.1m/s"\n')
    replace(folder / "my.toml", '["position.z"]', '["velocity.z"]')
    ran(folder)
    choice = json.loads((folder / "out" / "compare.json").read_text())["choice"]["velocity.z"]
    assert "at most 0.1 m/s" in choice["sentence"]


def test_files_of_a_source_may_be_named_by_a_pattern_from_the_root(tmp_path):
    write_dump(tmp_path / "other.dump")
    (tmp_path / "their.toml").write_text(SOURCE.replace("other.dump", str(tmp_path / "oth*.dump")))
    assert ran(tmp_path, "their.toml")[0] == "import"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("scene = ", "not valid TOML"),
        ("", "give either a scene or a table"),
        ('scene = "scene.toml"\n[source]\nfiles = ["a"]\n', "give either a scene or a table"),
        ("scene = 3", "scene = 3: Input should be a valid string"),
        ('scene = "scene.toml"\ncolour = "red"\n', "colour = 'red': unknown key; there are scene, source, seed"),
        ('scene = "scene.toml"\nseed = -1\n', "seed = -1: Input should be greater than or equal to 0"),
        ('scene = "scene.toml"\n[compare]\nmax_error = -1.0\n', "compare.max_error = -1.0: Input should be greater"),
        ('scene = "scene.toml"\n[compare]\nmax_error = inf\n', "compare.max_error = inf: Input should be a finite"),
        ('scene = "scene.toml"\n[select]\nintervals = [nan]\n', "select.intervals.0 = nan: Input should be a finite"),
        (
            'scene = "scene.toml"\n[select]\nintervals = [-1.0]\nvariable = ["position.x"]\n',
            r"select.intervals.0 = -1.0: Input should be greater than 0 \(Δτ, s.*\); select.variable: unknown key; .* "
            "variables, intervals, thresholds",
        ),
        (
            'scene = "scene.toml"\n[compare]\nmax_error = "small"\n',
            "max-error 'small': not an error; give diameters such as 0.05d",
        ),
        (
            'scene = "scene.toml"\n[compare]\nmax_seconds = -1\n[compare.networks]\nvariables = ["position.x"]\n',
            r"compare.max_seconds = -1: .* \(per snapshot, s\); compare.networks.intervals: it is missing \(Δτ, s\)$",
        ),
        ('[source]\nfiles = ["no/*.dump"]\n', r"source.files: no file matches .*no/\*.dump; a path that"),
        ("[source]\nfiles = []\n", r"source.files: List should have at least 1 item"),
        ('[source]\nfiles = ["no.dump"]\n', "source.files: there is no file or folder .*no.dump; a path that"),
        ('scene = "no_scene.toml"\n', "no such file or not a text .* built-in scenes: .*drum, .*mini_mill"),
        ('scene = "bad.toml"\n', "scene bad.toml: time: Field required"),
        (
            'scene = "scene.toml"\n[select.thresholds]\nenrgy = 0.9\n',
            "threshold 'enrgy' is not known; there are energy",
        ),
        ('scene = "scene.toml"\n[select.thresholds]\nenergy = 2.0\n', "energy is 2; it must be above 0 and at most 1"),
        ('scene = "scene.toml"\n[compare]\nsurrogates = ["oracle"]\n', "surrogate 'oracle' is not known here; use"),
    ],
)
def test_a_study_that_is_none_is_refused_before_anything_is_written(folder, text, says):
    (folder / "bad.toml").write_text("x = 1")
    (folder / "my.toml").write_text(text)
    with pytest.raises((Refusal, InputError), match=says) as caught:
        ran(folder)
    assert "\n" not in str(caught.value)
    assert not (folder / "out").exists()


def test_a_study_that_is_missing_or_a_folder_is_refused_with_the_built_in_ones(folder):
    for name in ("no.toml", "."):
        with pytest.raises(Refusal, match=r"no such file or not a text .* built-in studies: bead_mill, mini"):
            load_study(str(folder / name))


def test_an_output_that_is_a_file_is_refused(folder):
    with pytest.raises(Refusal, match=r"--output .*scene\.toml cannot be made .* name a folder you may write to"):
        ran(folder, output="scene.toml")


def test_a_damaged_record_of_stages_is_refused_with_the_remedy(folder):
    ran(folder)
    (folder / "out" / "stages.json").write_text("{")
    with pytest.raises(Refusal, match=r"stages\.json cannot be read .* again"):
        ran(folder)


def test_every_built_in_study_is_valid():
    assert "mini" in built_in_studies()
    for name in built_in_studies():
        found, study, home = load_study(name)
        assert (found, home) == (name, Path())
        assert study.scene or study.cases


def test_the_command_prints_the_report_and_keeps_its_words_to_standard_error(folder, suffice, monkeypatch):
    monkeypatch.chdir(folder)
    answer = suffice("--log-json", "study", "my.toml")
    assert (answer.code, answer.out.strip()) == (0, os.path.join("my", "report.html"))
    assert "simulate: 12 particles" in answer.err
    again = suffice("study", "my.toml")
    assert again.err.count("nothing changed, kept from") == 4
    (folder / "my" / "report.html").unlink()
    assert suffice("report", "my").code == 0
    assert (folder / "my" / "report.html").exists()
