"""A simulation that watches itself says what `select` says of its file, and ends when that suffices."""

import json
from contextlib import contextmanager

import h5py
import numpy as np
import pytest

from selection.settled import checks
from suffice import in_situ, simulating
from suffice.checkpoint import checkpoint_path
from suffice.progress import Reporter
from suffice.run import Run
from suffice.selecting import select_run
from suffice.simulating import simulate_to
from suffice.watching import Watching

WATER = """
[fluid]
density = 998.2
viscosity = 1e-3
lowest = [0.0, 0.0, 0.0]
highest = [0.008, 0.008, 0.012]
cells = [4, 4, 6]

[drag]
"""
WATCHED = ("position.z", "velocity")


@pytest.fixture(params=["dry", "wet"])
def scene(request, beads):
    """Return forty shaken beads for 61 snapshots, in air that does nothing or in water."""
    text = beads.replace("count = 12", "count = 40").replace("interval = 0.001", "interval = 0.0002")
    return text.replace("duration = 0.02", "duration = 0.012") + (WATER if request.param == "wet" else "")


class Killer(Reporter):
    """Kill the program at a snapshot, before its checkpoint is written."""

    def __init__(self, at):
        super().__init__(as_json=True)
        self.at = at

    def _lines(self, *_stage):
        @contextmanager
        def lines():
            def advance(done, _all):
                if done == self.at:
                    raise RuntimeError("killed")

            yield advance

        return lines()


def content(path):
    """Every dataset of a run but the moment it was made at."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, node: found.update({name: node[()]} if isinstance(node, h5py.Dataset) else {}))
    del found["suffice/provenance/made"]
    return found


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert np.asarray(values).tobytes() == np.asarray(other[name]).tobytes(), name


def run_of(folder, text, variables=WATCHED, reporter=None, **options):
    folder.mkdir(exist_ok=True)
    path = folder / "run.h5"
    return path, simulate_to(
        text, "scene.toml", path, reporter or Reporter(as_json=True), threads=1, watching=Watching(variables), **options
    )


def killed_and_resumed(folder, text, at, monkeypatch, variables=WATCHED):
    monkeypatch.setattr(simulating, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)
    for k in at:
        with pytest.raises(RuntimeError, match="killed"):
            run_of(folder, text, variables, Killer(k), resume=k != at[0])
        assert checkpoint_path(folder / "run.h5").exists()
    return run_of(folder, text, variables, resume=True)


def assert_as_offline(path, answer):
    """Every integer and both indices of every candidate are those that `select` finds in the file."""
    with Run(path) as run:
        table = select_run(run, list(answer["in_situ"]["variables"]))
        assert run.n_snapshots == answer["in_situ"]["n_snapshots"] == answer["n_snapshots"]
    for name, offline in table.items():
        found = answer["in_situ"]["variables"][name]
        assert found["chosen_interval"] == offline.chosen_interval
        for one, other in zip(found["candidates"], offline.as_dict()["candidates"], strict=True):
            spread, expected = one.pop("K_f_interval"), other.pop("K_f_interval")
            assert (spread is None) == (expected is None)
            assert spread is None or spread == pytest.approx(expected, rel=1e-6)
            resolution, expected = one.pop("R_a"), other.pop("R_a")
            assert resolution == (expected and pytest.approx(expected, rel=1e-6))
            assert one == other


def test_the_verdict_is_that_of_select_on_the_file(scene, tmp_path, monkeypatch):
    path, answer = run_of(tmp_path / "whole", scene)
    assert any(c["K_f_interval"] for c in answer["in_situ"]["variables"]["velocity"]["candidates"])
    assert_as_offline(path, json.loads(json.dumps(answer)))
    broken, again = killed_and_resumed(tmp_path / "broken", scene, (24, 25, 50), monkeypatch)
    assert_as_offline(broken, json.loads(json.dumps(again)))
    assert_same(content(broken), content(path))


def smooth(beads):
    """Return a hundred beads watched so often that few of them collide in between."""
    text = beads.replace("count = 12", "count = 100").replace("interval = 0.001", "interval = 0.0001")
    return text.replace("[0.008, 0.008, 0.012]", "[0.012, 0.012, 0.018]").replace("duration = 0.02", "duration = 0.015")


def test_a_run_ends_when_what_it_watches_suffices_and_not_before(beads, tmp_path, monkeypatch):
    path, answer = run_of(tmp_path / "whole", smooth(beads), ("position.z",))
    found, n = answer["in_situ"], answer["n_snapshots"]
    assert found["sufficient"]
    assert n in checks(151)[:-1]
    at = found["variables"]["position.z"]
    settled = next(c for c in at["candidates"] if c["interval"] == at["settled_interval"])
    assert (settled["verdict"], settled["sufficient"]) == ("sufficient", True)
    assert f"after {n} of 151 snapshots" in found["sentences"][0]
    assert f"Δτ = {1e6 * at['settled_interval']:g} µs suffices" in found["sentences"][1]
    with Run(path) as run:
        first = np.array(checks(151))
        first = first[first <= n / 2].max()  # the verdict has held at least since then
        for k in (count for count in checks(151) if first <= count <= n):
            assert verdict_of(run, "position.z", k, at["settled_interval"]) == "sufficient"
    assert not checkpoint_path(path).exists()
    broken, _ = killed_and_resumed(tmp_path / "broken", smooth(beads), (n - 1, n), monkeypatch, ("position.z",))
    assert_same(content(broken), content(path))


def verdict_of(run, variable, n, interval):
    """Judge the first n snapshots of a run by their matrix."""
    from selection import sweep

    found = sweep(run.variable(variable)[:][:, :n], run.times[:n], [interval], groups=None)
    return found.candidates[0].verdict


def test_a_run_that_suffices_is_not_run_again(beads, tmp_path):
    _, first = run_of(tmp_path, smooth(beads), ("position.z",))
    _, second = run_of(tmp_path, smooth(beads), ("position.z",), resume=True)
    assert second["in_situ"] == json.loads(json.dumps(first["in_situ"]))
    assert second["particle_steps_per_second"] == 0.0


def test_a_run_that_never_suffices_says_how_far_it_came(scene, tmp_path):
    _, answer = run_of(tmp_path, scene, ("velocity.x",))
    assert not answer["in_situ"]["sufficient"]
    assert answer["n_snapshots"] == 61
    end, said = answer["in_situ"]["sentences"]
    assert "time is up at t = 12 ms, after 61 snapshots" in end
    assert "velocity.x: not sufficient at any Δτ; the best, " in said
    assert "below 2" in said
    assert "go on longer or watch finer" in said


def test_watching_changes_no_bit_of_the_simulation(scene, tmp_path):
    watched, answer = run_of(tmp_path / "watched", scene, ("velocity.x",))
    plain, _ = run_of(tmp_path / "plain", scene, ())
    one, other = content(watched), content(plain)
    assert set(one) - set(other) == {"suffice/in_situ/found", "suffice/provenance/watching"}
    assert_same({name: one[name] for name in other}, other)
    assert answer["seconds_of"]["in_situ"] > 0.0


def test_snapshots_that_do_not_fit_into_memory_are_refused_at_once(beads, tmp_path, monkeypatch, suffice):
    monkeypatch.setattr(in_situ, "free_memory", lambda: 10_000)
    (tmp_path / "scene.toml").write_text(beads)
    options = ("--until-sufficient", "--variable", "velocity")
    code, _, err = suffice("simulate", tmp_path / "scene.toml", "-o", tmp_path / "run.h5", *options)
    assert code == 2
    assert "holds up to 21 snapshots of what it watches, 41.8 kB, and 10 kB of memory are free" in err
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--variable", "position.z"), "add --until-sufficient"),
        (("--until-sufficient",), "such as --variable position.x"),
        (("--until-sufficient", "--variable", "position.q"), "it has position.x, position.y"),
        (("--until-sufficient", "--variable", "position", "--engine", "lammps"), "use --engine numba"),
    ],
)
def test_wishes_that_cannot_be_met_are_refused(beads, tmp_path, suffice, options, says):
    (tmp_path / "scene.toml").write_text(beads)
    code, _, err = suffice("simulate", tmp_path / "scene.toml", "-o", tmp_path / "run.h5", *options)
    assert code == 2
    assert says in err.replace("\n", " ")
    assert not (tmp_path / "run.h5").exists()


def test_a_run_cannot_be_resumed_with_other_wishes(beads, tmp_path, suffice):
    path, _ = run_of(tmp_path, beads, ("position.z",))
    (tmp_path / "scene.toml").write_text(beads)
    code, _, err = suffice("simulate", tmp_path / "scene.toml", "-o", path, "--resume")
    assert code == 2
    assert "was made with another" in err
