"""A simulation that watches itself says what `select` says of its file, and ends when that suffices."""

import json
from contextlib import contextmanager
from itertools import pairwise

import h5py
import numpy as np
import pytest

from selection.settled import checks
from selection.spacing import Moment, hermite_errors
from suffice import in_situ, simulating
from suffice.checkpoint import checkpoint_path
from suffice.progress import Reporter
from suffice.run import Run
from suffice.selecting import select_run
from suffice.simulating import simulate_to
from suffice.thinning import FINEST
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
    """Every dataset of a run but the moment it was made at, and how fast."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, node: found.update({name: node[()]} if isinstance(node, h5py.Dataset) else {}))
    del found["suffice/provenance/made"], found["suffice/pace"]
    return found


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert np.asarray(values).tobytes() == np.asarray(other[name]).tobytes(), name


def run_of(folder, text, variables=WATCHED, reporter=None, keep=None, **options):
    folder.mkdir(exist_ok=True)
    path, reporter = folder / "run.h5", reporter or Reporter(as_json=True)
    watching = Watching(variables, keep)
    return path, simulate_to(text, "scene.toml", path, reporter, threads=1, watching=watching, **options)


def killed_and_resumed(folder, text, at, monkeypatch, variables=WATCHED, keep=None):
    monkeypatch.setattr(simulating, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)
    for k in at:
        with pytest.raises(RuntimeError, match="killed"):
            run_of(folder, text, variables, Killer(k), keep, resume=k != at[0])
        assert checkpoint_path(folder / "run.h5").exists()
    return run_of(folder, text, variables, keep=keep, resume=True)


def assert_as_offline(path, answer):
    """Every integer and both indices of every candidate are those that `select` finds in the file.

    Only of a thinned run all are judged; else those the verdict rests on: the Δτ that settled, or the best.
    """
    with Run(path) as run:
        table = select_run(run, list(answer["in_situ"]["variables"]))
        assert run.n_snapshots == answer["in_situ"]["n_snapshots"] == answer["n_snapshots"]
    for name, offline in table.items():
        found = answer["in_situ"]["variables"][name]
        expected = offline.as_dict()["candidates"]
        if "chosen_interval" in found:
            assert found["chosen_interval"] == offline.chosen_interval
        else:
            judged = [c["interval"] for c in found["candidates"]]
            best = max(expected, key=lambda c: (c["verdict"] == "sufficient", c["K_f"] or 0.0, -c["interval"]))
            assert (found["settled_interval"] or best["interval"]) in judged
            expected = [c for c in expected if c["interval"] in judged]
        for one, other in zip(found["candidates"], expected, strict=True):
            spread, expected = one.pop("K_f_interval"), other.pop("K_f_interval")
            assert (spread is None) == (expected is None)
            assert spread is None or spread == pytest.approx(expected, rel=1e-6)
            for field in ("R_a", "R_lr", "error_n_lr", "error_n_c"):
                value, expected = one.pop(field), other.pop(field)
                assert value == (expected and pytest.approx(expected, rel=1e-6))
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


@pytest.mark.physics
def test_a_run_ends_when_what_it_watches_suffices_and_not_before(beads, tmp_path, monkeypatch):
    path, answer = run_of(tmp_path / "whole", smooth(beads), ("position.z",))
    found, n = answer["in_situ"], answer["n_snapshots"]
    assert found["sufficient"]
    assert n in checks(151)[:-1]
    at = found["variables"]["position.z"]
    settled = next(c for c in at["candidates"] if c["interval"] == at["settled_interval"])
    assert (settled["verdict"], settled["sufficient"]) == ("sufficient", True)
    assert f"after {n} of 151 snapshots; `suffice select` judges every Δτ" in found["sentences"][0]
    assert_as_offline(path, json.loads(json.dumps(answer)))
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
        (("--keep-error", "0.02d", "--engine", "lammps"), "use --engine numba"),
        (("--keep-error", "-1d"), "give diameters such as 0.02d"),
        (("--keep-error", "0.02 kg"), "give diameters such as 0.02d"),
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


def test_a_thinned_run_keeps_few_snapshots_of_the_whole_one_and_its_verdict(beads, tmp_path):
    text, keep = smooth(beads), (0.02, "d")
    whole, dense = run_of(tmp_path / "whole", text, ("position.z",))
    thin, answer = run_of(tmp_path / "thin", text, ("position.z",), keep=keep)
    assert_same_verdict(answer["in_situ"], dense["in_situ"])
    assert_as_offline(whole, json.loads(json.dumps(answer | {"n_snapshots": dense["n_snapshots"]})))
    assert answer["kept"]["unchecked_intervals"] == 0
    with Run(whole) as run, Run(thin) as some:
        assert some.n_snapshots == answer["kept"]["kept"] < run.n_snapshots / 5
        at = np.searchsorted(run.times, some.times - 1e-9)
        for one, other in zip(map(some.snapshot, range(some.n_snapshots)), map(run.snapshot, at), strict=True):
            assert one.time == other.time
            assert_same(dict(one.values), dict(other.values))
        assert_interpolated_within(2e-3 * 0.02, run, [run.snapshot(k) for k in range(run.n_snapshots)], some)
        gram = some.watched("suffice/in_situ/products/position.z")[()]
        motion = np.asarray(run.variable("position.z")[:], float)
        motion -= motion[:, :1]
        np.testing.assert_allclose(gram, motion.T @ motion, rtol=0.0, atol=1e-13 * gram.max())
        # forces are means since the snapshot before, so that nothing of what they gave is lost
        for name in ("force.box.z", "power.box"):
            given = [float((r.series[name][1:] * np.diff(r.times)).sum()) for r in (run, some)]
            assert given[0] == pytest.approx(given[1], rel=1e-9)
            assert given[0] != 0.0
    assert thin.stat().st_size < 0.4 * whole.stat().st_size


def assert_same_verdict(thinned, dense):
    """Both runs ended for the same Δτ; only of the thinned one all others are judged, because `select` refuses it."""
    for one, other in zip(thinned["sentences"], dense["sentences"], strict=True):
        assert other in (one, f"{one}; `suffice select` judges every Δτ")
    for name, whole in thinned["variables"].items():
        ended = dense["variables"][name]["candidates"][-1]
        assert ended in whole["candidates"]
        assert len(whole["candidates"]) == 9
        assert whole["settled_interval"] == dense["variables"][name]["settled_interval"] == ended["interval"]


def moment(s):
    return Moment(s.time, *(np.asarray(s.values[name], float) for name in ("position", "velocity")))


def assert_interpolated_within(tolerance, run, snapshots, some):
    """Every snapshot lies within the tolerance (m, RMSE) of the interpolant through those that were kept."""
    kept = [some.snapshot(k) for k in range(some.n_snapshots)]
    for one, other in pairwise(kept):
        ends = [
            Moment(s.time, *(np.asarray(s.values[v], float) for v in ("position", "velocity"))) for s in (one, other)
        ]
        between = [s for s in snapshots if one.time < s.time < other.time]
        if between:
            rows = np.stack([np.asarray(s.values["position"], float) for s in between])
            assert hermite_errors(*ends, np.array([s.time for s in between]), rows).max() <= tolerance
    assert len(snapshots) == run.n_snapshots


def test_a_run_whose_interval_is_too_coarse_is_kept_more_often(beads, tmp_path):
    text = beads.replace("count = 12", "count = 40").replace("interval = 0.001", "interval = 0.002")
    whole, _ = run_of(tmp_path / "whole", text, ())
    thin, answer = run_of(tmp_path / "thin", text, (), keep=(0.002, "d"))
    with Run(whole) as run, Run(thin) as some:
        assert some.n_snapshots > run.n_snapshots
        assert answer["kept"]["shortest_interval"] == pytest.approx(0.002 / 2**FINEST, rel=0.02)  # whole steps
        last = [r.snapshot(r.n_snapshots - 1) for r in (run, some)]
        assert last[0].time == last[1].time
        # a dry simulation is not disturbed by who looks at it
        assert_same(dict(last[0].values), dict(last[1].values))


@pytest.mark.physics
def test_a_thinned_run_killed_and_resumed_ends_bitwise_like_one_that_was_not(scene, tmp_path, monkeypatch):
    keep = (0.002, "d")
    path, answer = run_of(tmp_path / "whole", scene, keep=keep)
    broken, again = killed_and_resumed(tmp_path / "broken", scene, (3, 24, 25, 50), monkeypatch, keep=keep)
    assert_same(content(broken), content(path))
    assert (again["in_situ"], again["kept"]) == (answer["in_situ"], answer["kept"])
    assert not [p for p in broken.parent.iterdir() if p.suffix in (".part", ".checkpoint")]


def test_who_needs_even_times_refuses_a_thinned_run_and_says_what_is_known(beads, tmp_path, suffice):
    path, answer = run_of(tmp_path, smooth(beads), ("position.z",), keep=(0.02, "d"))
    chosen = 1e6 * answer["in_situ"]["variables"]["position.z"]["chosen_interval"]
    for command in (("select",), ("compare",), ("train", "--variable", "position", "--interval", "1e-3",
                    "--surrogate", "rbf", "-o", tmp_path / "model")):  # fmt: skip
        code, _, err = suffice(command[0], path, *command[1:])
        assert code == 2
        assert f"judged at {answer['n_snapshots'] and answer['in_situ']['n_snapshots']} even times" in err
        assert f"position.z {chosen:g} µs" in err
    code, out, _ = suffice("info", path, "--json", "-")
    assert code == 0
    told = json.loads(out)
    assert told["in_situ"] == json.loads(json.dumps(answer["in_situ"]))
    assert told["kept"] == answer["kept"]
    code, out, _ = suffice("decompose", path, "--variable", "position", "-o", tmp_path / "basis.h5", "--json", "-")
    assert (code, json.loads(out)["interval"]) == (0, None)


def test_what_watching_will_take_is_told_before_it_runs(beads, tmp_path, suffice):
    (tmp_path / "scene.toml").write_text(beads)
    options = ("--until-sufficient", "--variable", "position", "--keep-error", "0.02d")
    code, out, _ = suffice("simulate", tmp_path / "scene.toml", "--explain", *options)
    assert code == 0
    # 21 snapshots of 36 rows in single precision, and eleven matrices of their products in double
    assert (
        f"position: judged 2 times at most, from 20 snapshots on; {(21 * 36 * 4 + 11 * 21**2 * 8) / 1e3:.3g} kB" in out
    )
    assert "within 4e-05 m, looked at every 250 µs where needed" in out
