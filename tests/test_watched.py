"""What the snapshots of surrogates are worth: whole snapshots between those kept, observed."""

import json
import re

import numpy as np
import pytest

from suffice.observables import meaning_of
from suffice.refusal import Refusal
from suffice.report import render
from suffice.run import Run
from suffice.show_observables import show_observables
from suffice.store import RunWriter
from suffice.watched import compare_observables

RADIUS, INTERVAL = 1e-3, 0.001

SCENE = """
[[particles]]
diameter = 2e-3
density = 2500.0
count = 30

[contact]
stiffness = 1e3
restitution = 0.8

[gravity]
acceleration = [0.0, 0.0, -9.81]

[time]
duration = 0.1

[output]
interval = 0.001
"""


def write(path, position, velocity=None, scene=SCENE):
    n = position.shape[1]
    with RunWriter(
        path,
        ids=np.arange(n),
        radius=np.full(n, RADIUS),
        species=np.zeros(n, int),
        n_snapshots=len(position),
        variables=("position",) if velocity is None else ("position", "velocity"),
        precision="double",
        provenance={"scene": scene} if scene else {},
    ) as run:
        for k in range(len(position)):
            values = (
                {"position": position[k]} if velocity is None else {"position": position[k], "velocity": velocity[k]}
            )
            run.append(k * INTERVAL, values)
    return path


def circling(snapshots=41, n=30, seed=0):
    """Beads on circles of their own, far from each other."""
    rng = np.random.default_rng(seed)
    t = np.arange(snapshots)[:, None] * INTERVAL
    pace, phase = rng.uniform(60, 160, n), rng.uniform(0, 6, n)
    angle = pace * t + phase
    home = np.stack([np.arange(n) * 8e-3, np.zeros(n), rng.uniform(0, 0.02, n)], axis=1)
    turn = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    along = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1) * pace[:, None]
    return home + 3e-3 * turn, 3e-3 * along


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with Run(write(tmp_path_factory.mktemp("watched") / "run.h5", *circling())) as opened:
        yield opened


def rows_of(answer, surrogate):
    return [row for row in answer["rows"] if row["surrogate"] == surrogate]


def crossing(snapshots=5):
    """Two beads that go round each other at a constant distance of 1.2 diameters, half a turn every 2 ms."""
    angle = np.pi * np.arange(snapshots)[:, None] / 2
    arm = 1.2 * RADIUS * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    rate = 1.2 * RADIUS * np.pi / (2 * INTERVAL) * np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    return np.concatenate([arm, -arm], axis=1), np.concatenate([rate, -rate], axis=1)


def test_a_surrogate_that_averages_two_beads_that_change_places_puts_one_into_the_other(tmp_path):
    with Run(write(tmp_path / "run.h5", *crossing())) as two:
        answer = compare_observables(two, 2 * INTERVAL, ["linear", "raw-linear"])
    assert answer["observables"]["overlap.largest"]["truth"] == 0.0
    for name in ("linear", "raw-linear"):
        for row in rows_of(answer, name):
            # half way both are at the same place
            assert row["bias"]["overlap.largest"] == pytest.approx(1.0)
            assert row["bias"]["overlap.pairs"] == pytest.approx(0.5)


def test_straight_lines_lose_the_kinetic_energy_of_the_arc_that_they_cut(tmp_path):
    with Run(write(tmp_path / "run.h5", *crossing())) as two:
        answer = compare_observables(two, 2 * INTERVAL, ["raw-linear"])
    # the chord of half a turn, 2r, against its arc, πr: speeds as 2 to π
    (row,) = rows_of(answer, "raw-linear")
    assert row["bias"]["kinetic_energy"] == pytest.approx(100 * ((2 / np.pi) ** 2 - 1), rel=1e-6)


def test_uniform_motion_is_observed_without_error_by_every_surrogate(tmp_path):
    rng = np.random.default_rng(3)
    speed = rng.uniform(-1, 1, (30, 3))
    start = np.stack([np.arange(30) * 8e-3, np.zeros(30), np.zeros(30)], axis=1)
    position = start + speed * (np.arange(21) * INTERVAL)[:, None, None]
    with Run(write(tmp_path / "run.h5", position, np.broadcast_to(speed, position.shape))) as steady:
        answer = compare_observables(steady, 0.004, ["spline", "linear", "hermite", "raw-linear", "raw-hermite"])
    assert {row["surrogate"] for row in answer["rows"]} >= {"spline", "linear", "hermite", "raw-linear", "raw-hermite"}
    for row in answer["rows"]:
        assert row["rmse"] < 1e-12
        assert row["errors"]["kinetic_energy"] < 1e-6  # %, of positions rounded at 1e-16 m over steps of 1e-5 s
        assert row["errors"]["bed_height"] < 1e-8
        assert row["errors"]["void_fraction.height"] < 1e-9


def test_the_floor_is_the_truth_on_the_modes_and_no_surrogate_of_them_is_nearer(run):
    answer = compare_observables(run, 0.005, energy=0.9)
    floor = {row["modes"]: row["rmse"] for row in rows_of(answer, "projection")}
    assert sorted(floor) == [answer["n_lr"], answer["modes"]]
    for row in answer["rows"]:
        if row["modes"] is not None:
            assert row["rmse"] >= floor[row["modes"]] * (1 - 1e-12)
    # velocities are not in these modes, so that even the floor loses energy, and what is on fewer modes more of it
    few, many = (row["bias"]["kinetic_energy"] for row in rows_of(answer, "projection"))
    assert few < many < 0


def test_errors_of_three_components_are_those_of_each_component_alone(run):
    from suffice.compare import compare

    answer = compare_observables(run, 0.002, ["raw-linear"])
    alone = compare(run, ["position.x", "position.y", "position.z"], [0.002], ["raw-linear"], precisions=[])
    errors = {row["variable"]: row for row in alone["rows"]}
    # z does not move and is left out there; all 20 unseen times are observed here
    squares = [errors[f"position.{axis}"]["rmse"] ** 2 for axis in "xy" if f"position.{axis}" in errors]
    assert rows_of(answer, "raw-linear")[0]["rmse"] == pytest.approx(np.sqrt(sum(squares) / 3), rel=0.01)


def test_the_answer_is_plain_json_with_a_row_per_surrogate_and_number_of_modes(run):
    told = []
    answer = compare_observables(run, 0.004, progress=lambda done, total: told.append((done, total)))
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    assert len(answer["times"]) == 20
    assert len(set(answer["times"])) == 20
    assert all(round(t / INTERVAL) % 4 for t in answer["times"])
    assert {row["modes"] for row in rows_of(answer, "raw-hermite")} == {None}
    assert {row["modes"] for row in rows_of(answer, "spline")} == {answer["n_lr"], answer["modes"]}
    assert told[0][0] == 0
    assert told[-1][0] == told[-1][1]
    for row in answer["rows"]:
        assert set(row["errors"]) == set(answer["observables"])
        assert all(row["errors"][name] >= abs(bias) * (1 - 1e-12) for name, bias in row["bias"].items())
    # every bead has a cell to itself, so that nothing can mix
    assert {left["observable"] for left in answer["left_out"]} >= {"rotor_side", "overlap.walls", "mixing"}
    assert all(what["text"] == meaning_of(name).text for name, what in answer["observables"].items())


def test_what_needs_velocities_is_left_out_of_a_run_without_them(tmp_path):
    with Run(write(tmp_path / "run.h5", circling()[0])) as still:
        answer = compare_observables(still, 0.004, ["spline", "hermite", "raw-hermite"])
    reasons = {left["observable"] or left["surrogate"]: left["reason"] for left in answer["left_out"]}
    assert "no velocities" in reasons["kinetic_energy"]
    assert "rates is missing" in reasons["hermite"]
    assert "rates is missing" in reasons["raw-hermite"]
    assert "kinetic_energy" not in answer["observables"]
    assert rows_of(answer, "spline")


def test_what_cannot_be_observed_is_refused_with_the_remedy(run):
    with pytest.raises(Refusal, match=r"leaves no snapshot to predict; take at least 0\.002 s"):
        compare_observables(run, 0.001)
    with pytest.raises(Refusal, match="surrogate 'nearest' is not known"):
        compare_observables(run, 0.004, ["nearest"])
    with pytest.raises(Refusal, match="it must be a share"):
        compare_observables(run, 0.004, energy=1.5)
    with pytest.raises(Refusal, match="not a multiple"):
        compare_observables(run, 0.0015)


def test_the_table_shows_the_truth_and_every_row(run, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    show_observables(compare_observables(run, 0.004, ["spline", "raw-linear"]))
    said = capsys.readouterr().out
    for word in ("truth", "projection", "spline", "raw-linear", "kinetic", "left out: rotor_side"):
        assert word in said
    (truth,) = re.findall("truth.*\n.*", said)
    assert "m²/s² per particle" in " ".join(truth.split()) or "J" in truth, "the truth is no percentage"
    assert "…" not in said


def test_the_report_shows_observables_per_interval_and_escapes_names(run):
    answer = compare_observables(run, 0.004, ["spline", "raw-linear"])
    evil = "<img src=x>"
    answer["rows"][-1]["surrogate"] = evil
    page = render({"observables": [answer]})
    assert "What the snapshots are worth" in page
    assert evil not in page
    assert "&lt;img src=x&gt;" in page
    assert "<i>truth</i>" in page


def test_plotly_accepts_the_figure_of_every_observable(run):
    import plotly.graph_objects as go

    from suffice.worth import observable_figure

    answer = compare_observables(run, 0.004, ["spline", "raw-linear"])
    for name in answer["observables"]:
        figure = observable_figure(answer, name)
        go.Figure(figure, skip_invalid=False)
        assert figure["data"]


def test_signs_are_shown_where_they_are_always_the_same_and_of_what_is_created():
    from suffice.worth import ranked_error, shown_error

    row = {"errors": {"a": 2.0, "b": 2.0}, "bias": {"a": -2.0, "b": -0.5}}
    assert shown_error(row, "a", {"error": "relative"}) == "-2"
    assert shown_error(row, "b", {"error": "relative"}) == "2"
    assert shown_error(row, "b", {"error": "created"}) == "-0.5"
    assert ranked_error(row, "b", {"error": "created"}) == 0.5
    assert ranked_error(row, "b", {"error": "relative"}) == 2.0


def test_the_report_says_who_wins_and_marks_a_baseline_that_beats_every_model():
    from suffice.worth import winners_section

    common = {"variable": "position.x", "interval": 0.003, "unit": "m", "projection_rmse": 0.9}
    rows = [{**common, "surrogate": name, "modes": n, "rmse": rmse} for name, n, rmse in (
        ("rbf", 12, 2.0), ("spline", 12, 2.01), ("rbf", 60, 1.0), ("spline", 60, 1.1), ("raw-hermite", None, 0.8),
    )]  # fmt: skip
    body = winners_section({"compare": {"rows": rows}})
    assert "<b>rbf</b> = <b>spline</b>" in body.body
    assert "<b>rbf</b>, spline +10 %" in body.body
    assert "<b>raw-hermite</b> -20 %" in body.body
    assert "no model wins here" in body.below
    assert winners_section({}) is None
