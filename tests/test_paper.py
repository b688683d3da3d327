"""The paper's experiment: two cases, its tables and figures from their runs, and what differs from the paper."""

import json
import re
import shutil
from contextlib import contextmanager

import numpy as np
import pytest

import suffice.simulating
from sim import parse_scene, scene_text
from suffice.door import InterruptedRunError
from suffice.paper_trials import calibrated, consistency_of_rom, solver_seconds
from suffice.progress import Reporter
from suffice.report import render
from suffice.results import gather
from suffice.run import Run
from suffice.selecting import select_run
from suffice.study import built_in_studies, load_study, run_study

STUDY = """[cases]
scenes = ["violent.toml", "mild.toml"]
intervals = [0.010, 0.006, 0.005, 0.003, 0.002]
[cases.changes]
"time.duration" = 0.12
"particles.0.count" = 24
"""
STAGES = [f"{verb} Case {k}" for verb in ("simulate", "select", "measure") for k in (1, 2)] + ["tables", "report"]


@pytest.fixture(scope="module")
def study(beads, tmp_path_factory):
    """Run the study once: beads in a box that shakes violently, and mildly."""
    home = tmp_path_factory.mktemp("paper")
    (home / "violent.toml").write_text(beads)
    (home / "mild.toml").write_text(
        beads.replace("frequency = 40.0", "frequency = 10.0").replace("0.3, 0.2", "0.1, 0.1")
    )
    (home / "my.toml").write_text(STUDY)
    said = []
    run_study(str(home / "my.toml"), home / "out", Reporter(as_json=True), said.append)
    return home, said


def paper(study):
    return json.loads((study[0] / "out" / "results.json").read_text())["paper"]


def test_both_cases_are_simulated_judged_and_measured_and_a_second_run_does_nothing(study):
    home, said = study
    assert [line.split(":")[0] for line in said] == STAGES
    again = []
    run_study(str(home / "my.toml"), home / "out", Reporter(as_json=True), again.append)
    assert all("nothing changed" in line for line in again)
    names = {path.name for path in (home / "out").iterdir()}
    assert {f"case_{k}.{end}" for k in (1, 2) for end in ("h5", "cost.json", "select.json", "measured.json")} <= names


def test_the_indices_of_table_5_are_those_that_select_finds_in_the_run(study):
    with Run(study[0] / "out" / "case_1.h5") as run:
        found = select_run(run, ["position.x", "velocity.z"], [0.010, 0.006, 0.005, 0.003, 0.002])
    for row, own, other in zip(
        paper(study)["tables"]["5"]["rows"], found["position.x"].candidates, found["velocity.z"].candidates, strict=True
    ):
        assert (row["interval"], row["n_lr"], row["n_c"], row["K_f"]) == (own.interval, own.n_lr, own.n_c, own.K_f)
        assert row["K_f_of_others"]["velocity.z"] == other.K_f


def test_the_decision_of_table_6_stops_at_the_first_interval_from_coarse_to_fine_with_an_index_of_two(study):
    with Run(study[0] / "out" / "case_2.h5") as run:
        all_rows = select_run(run, ["position.x"], [0.010, 0.006, 0.005, 0.003, 0.002])["position.x"].candidates
    rows = paper(study)["tables"]["6"]["rows"]
    assert [row["interval"] for row in rows] == [c.interval for c in all_rows[: len(rows)]]
    assert all(row["K_f"] < 2.0 for row in rows[:-1])
    assert rows[-1]["K_f"] >= 2.0 or len(rows) == len(all_rows)


def test_training_data_are_counted_in_bytes_of_three_single_precision_positions_a_particle(study):
    for row in paper(study)["tables"]["4"]["rows"]:
        assert row["n_snapshots"] == int(0.12 / row["interval"] + 1e-9) + 1
        assert row["bytes"] == row["n_snapshots"] * 24 * 3 * 4
        assert row["density"] == pytest.approx(1.0 / row["interval"])
        assert row["single_ratio"] == pytest.approx(row["solver_seconds"] / row["single_seconds"])


def test_the_solver_takes_for_an_interval_what_the_run_took_over_its_intervals(study):
    cost = json.loads((study[0] / "out" / "case_1.cost.json").read_text())
    row = paper(study)["tables"]["7"]["rows"][0]
    assert row["solver_seconds"] == pytest.approx(cost["seconds"] / 120, rel=1e-3)
    # of a run that was resumed half way the last session counts: twice the steps of it were done
    resumed = {"cost": cost | {"seconds": cost["seconds"] / 2}, "select": {"dense_interval": 0.001}}
    assert solver_seconds(resumed) == pytest.approx(row["solver_seconds"], rel=1e-3)


def test_errors_of_figure_7_are_those_of_snapshots_projected_one_by_one(study):
    with Run(study[0] / "out" / "case_1.h5") as run:
        values, times = run.variable("position.x")[:].astype(float), run.times
    for one in paper(study)["figures"]["7"]["Case 1"]:
        training = np.array(one["training"])
        mean = values[:, training].mean(axis=1, keepdims=True)
        modes, size, _ = np.linalg.svd(values[:, training] - mean, full_matrices=False)
        modes = modes[:, size > 1e-9 * size[0]]
        moved = values[:, : training[-1] + 1] - mean
        errors = np.sqrt(np.square(moved - modes @ (modes.T @ moved)).mean(axis=0))
        assert one["times"] == pytest.approx(times[: training[-1] + 1])
        assert one["error"] == pytest.approx(errors, abs=1e-7 * np.abs(moved).max())


def test_the_simulated_coefficient_of_figure_6_is_that_of_the_first_singular_vector_of_all_snapshots(study):
    first = paper(study)["figures"]["6"]["Case 1"][0]
    with Run(study[0] / "out" / "case_1.h5") as run:
        values = run.variable("position.x")[:].astype(float)
    _, size, right = np.linalg.svd(
        values[:, : len(first["times"])] - values[:, : len(first["times"])].mean(axis=1, keepdims=True)
    )
    assert first["mode"] == 1
    assert np.abs(first["truth"]) == pytest.approx(np.abs(size[0] * right[0]), rel=1e-6, abs=1e-9)
    # what the ROM was trained on it gives back
    for one in first["predicted"]:
        stride = round(one["interval"] / 0.001)
        assert len(one["values"]) == stride * ((len(first["times"]) - 1) // stride) + 1


def test_a_rom_that_hits_every_projection_is_as_consistent_as_the_projections(study):
    with Run(study[0] / "out" / "case_1.h5") as run:
        sweep = select_run(run, ["position.x"], [0.003])["position.x"]
    (candidate,) = sweep.candidates
    n, E = candidate.n_lr, candidate.curves
    row = {
        "variable": "position.x", "interval": 0.003, "surrogate": "rbf", "basis": "plain", "modes": n,
        "n_snapshots": candidate.n_snapshots, "rmse": float(E.E_gap[n]),
    }  # fmt: skip
    found = {
        "rom": "rbf", "compare": {"rows": [row]}, "select": {"dense_interval": 0.001},
        "curves": {"position.x": {"0.003": candidate.curves_as_dict()}},
    }  # fmt: skip
    assert consistency_of_rom(found, "position.x", 0.003, n) == pytest.approx(float(E.R_c[n]), rel=1e-9)


def test_where_no_interval_suffices_it_is_said_and_the_finest_is_measured_instead(study, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(study[0] / "out", out)
    (study[0] / "fast.toml").write_text(STUDY.replace("[cases.changes]", 'variable = "velocity.z"\n[cases.changes]'))
    said = []
    run_study(str(study[0] / "fast.toml"), out, Reporter(as_json=True), said.append)
    assert [line.split(":")[0] for line in said if "nothing changed" in line] == STAGES[:2]
    results = json.loads((out / "results.json").read_text())
    for verdict in results["paper"]["verdicts"]:
        assert (verdict["sufficient"], verdict["interval"]) == (False, 0.002)
        assert "no Δτ considered suffices for velocity.z; K_f is" in verdict["sentence"]
    assert len(results["paper"]["tables"]["6"]["rows"]) == 5
    assert [row["sufficient"] for row in results["paper"]["tables"]["7"]["rows"]] == [False, False]
    shown = {row["statement"]: row["here"] for row in results["paper"]["differences"]}
    assert shown["Δτ decided for Case 2, velocity.z"] == "none down to 2 ms"
    page = (out / "report.html").read_text()
    assert page.count("no Δτ considered suffices for velocity.z") >= 2


def test_a_study_that_dies_while_it_measures_goes_on_from_there(study, tmp_path, monkeypatch):
    out = tmp_path / "out"
    shutil.copytree(study[0] / "out", out)
    for name in ("case_2.measured.json", "paper.json", "report.html"):
        (out / name).unlink()

    def dies(*_):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr("suffice.paper_cases.measure_case", dies)
        with pytest.raises(MemoryError):
            run_study(str(study[0] / "my.toml"), out, Reporter(as_json=True), lambda _: None)
    said = []
    run_study(str(study[0] / "my.toml"), out, Reporter(as_json=True), said.append)
    assert [line.split(":")[0] for line in said if "nothing changed" not in line] == [
        "measure Case 2",
        "tables",
        "report",
    ]


@pytest.mark.physics
def test_a_case_that_was_stopped_while_it_was_simulated_goes_on_bitwise(study, tmp_path, monkeypatch):
    out = tmp_path / "out"

    class Stopped(list):
        def __init__(self, most):
            self.most = most

        def __bool__(self):
            self.most -= 1
            return self.most < 0

    real = suffice.simulating.asked_to_stop

    @contextmanager
    def after_some():
        yield Stopped(60)

    monkeypatch.setattr(suffice.simulating, "asked_to_stop", after_some)
    with pytest.raises(InterruptedRunError):
        run_study(str(study[0] / "my.toml"), out, Reporter(as_json=True), lambda _: None)
    assert (out / "case_1.h5.checkpoint").exists()
    monkeypatch.setattr(suffice.simulating, "asked_to_stop", real)
    run_study(str(study[0] / "my.toml"), out, Reporter(as_json=True), lambda _: None)
    with Run(out / "case_1.h5") as again, Run(study[0] / "out" / "case_1.h5") as once:
        assert np.array_equal(again.variable("position")[:], once.variable("position")[:])


def trials(*pairs):
    return [{"variable": "x", "interval": 0.01, "K_f": K_f, "kept": kept} for K_f, kept in pairs]


def test_the_index_that_calibration_finds_is_the_least_above_which_all_roms_are_consistent():
    assert calibrated(trials((0.8, False), (1.1, True), (1.3, False), (2.2, True)))["K_f"] == 2.2
    found = calibrated(trials((2.2, True), (0.8, False), (1.3, True), (1.1, True)))
    assert (found["K_f"], found["bounded"]) == (1.1, True)
    found = calibrated(trials((0.8, True), (1.1, True)))
    assert (found["K_f"], found["bounded"]) == (0.8, False)
    assert calibrated(trials((1.1, True), (2.2, False))) is None
    assert calibrated(trials((1.1, True), (1.1, False), (1.3, True)))["K_f"] == 1.3
    assert calibrated(trials((None, True), (1.3, None))) is None


def test_the_built_in_study_judges_two_speeds_of_one_mill_from_10_down_to_2_ms():
    assert "bead_mill" in built_in_studies()
    cases = load_study("bead_mill")[1].cases
    assert cases.scenes == ["bead_mill_1", "bead_mill_2"]
    assert cases.intervals == pytest.approx(np.arange(10, 1, -1) / 1000)
    violent, mild = (parse_scene(scene_text(name)) for name in cases.scenes)
    assert violent.model_dump(exclude={"walls"}) == mild.model_dump(exclude={"walls"})
    assert [scene.walls[1].motion.rpm for scene in (violent, mild)] == [1000.0, 500.0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("[cases]", 'scene = "mild.toml"\n[cases]'), "[cases] names its own scenes"),
        (('["violent.toml", "mild.toml"]', '["violent.toml"]'), "cases.scenes"),
        (("[cases.changes]", 'surrogates = ["raw-hermite"]\n[cases.changes]'), "raw-hermite is no reduced order model"),
        (("[cases.changes]", 'surrogates = ["rbg"]\n[cases.changes]'), "surrogate 'rbg' is not known"),
        (("[cases.changes]", 'trained = ["position.y"]\n[cases.changes]'), "position.x is missing"),
        (('"time.duration"', '"time.durration"'), "time.durration"),
    ],
)
def test_a_study_of_cases_that_cannot_be_is_refused_before_anything_runs(study, suffice, tmp_path, change, says):
    (study[0] / "bad.toml").write_text(STUDY.replace(*change))
    answer = suffice("study", study[0] / "bad.toml", "-o", tmp_path / "out")
    assert answer.code == 2
    assert says in answer.err
    assert not (tmp_path / "out").exists()


def test_a_variable_that_the_run_does_not_hold_is_refused_with_those_it_holds(study, suffice, tmp_path):
    shutil.copytree(study[0] / "out", tmp_path / "out")
    (study[0] / "no.toml").write_text(STUDY.replace("[cases.changes]", 'variable = "fluid.pressure"\n[cases.changes]'))
    answer = suffice("study", study[0] / "no.toml", "-o", tmp_path / "out")
    assert answer.code == 2
    assert "cases.variable = 'fluid.pressure': Case 1 has no such variable; it has position.x" in answer.err


def test_the_page_shows_verdicts_first_then_every_table_and_the_figures_in_their_order(study):
    results = gather(study[0] / "out", "my")
    page = render(results)
    titles = re.findall(r"<h2>(.*?)</h2>", page)
    assert titles[0] == "Verdict"
    figures = [title for title in titles if title.startswith("Figure")]
    assert figures == sorted(figures, key=lambda title: int(title.split(":")[0].split()[1]))
    assert [number for number in "1234567" if f"<b>Table {number}.</b>" in page] == list("1234567")
    for verdict in results["paper"]["verdicts"]:
        assert verdict["case"] in page


def test_what_differs_from_the_paper_is_measured_and_not_written_down(study):
    found = paper(study)
    rows = {row["statement"]: row for row in found["differences"]}
    assert rows["particles in each case"]["here"] == "24"
    decided = found["verdicts"][-1]
    told = rows["Δτ decided for Case 2, position.x"]
    assert told["paper"] == "4 ms"
    assert told["here"] == (f"{1e3 * decided['interval']:g} ms" if decided["sufficient"] else "none down to 2 ms")
    assert rows["times faster, one step"]["paper"] == "over 1500"
