"""Predictions beyond the snapshots trained on: against closed forms, a dense recomputation, and persistence."""

import json

import numpy as np
import pytest

from suffice import beyond, making
from suffice.beyond import compare_beyond
from suffice.foresight import first_above, foretold, show_beyond
from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import RunWriter
from surrogates import SURROGATES, Dmd, Network, StateMap

QUICK = [name for name, member in SURROGATES.items() if not issubclass(member, Network)]
N, INTERVAL, DIAMETER = 60, 0.001, 2e-3


def write(path, positions, velocities=None):
    """Store (snapshots, n, 3) positions in double precision, one every millisecond."""
    n = positions.shape[1]
    variables = ("position",) if velocities is None else ("position", "velocity")
    with RunWriter(
        path,
        ids=np.arange(n),
        radius=np.full(n, DIAMETER / 2),
        species=np.ones(n, int),
        n_snapshots=len(positions),
        variables=variables,
        precision="double",
        provenance={},
    ) as run:
        for k, position in enumerate(positions):
            run.append(
                k * INTERVAL, {"position": position} | ({} if velocities is None else {"velocity": velocities[k]})
            )
    return path


def aging_waves(snapshots=181):
    """Travelling waves whose wavelength shortens with time, so that the modes of the past age: x and v."""
    t = INTERVAL * np.arange(snapshots)[:, None, None]
    place = np.linspace(0, 1, N)[:, None]
    number = np.array([3.0, 5.0, 8.0]) * (1 + 2 * t)  # per component x, y, z
    omega = np.array([60.0, 90.0, 130.0])
    phase = 2 * np.pi * number * place - omega * t
    rate = 2 * np.pi * 2 * np.array([3.0, 5.0, 8.0]) * place - omega
    return 1e-3 * np.sin(phase), 1e-3 * rate * np.cos(phase)


@pytest.fixture(scope="module")
def waves(tmp_path_factory):
    with Run(write(tmp_path_factory.mktemp("waves") / "waves.h5", *aging_waves())) as run:
        yield run


@pytest.fixture(scope="module")
def answer(waves):
    return compare_beyond(waves, ["position.x"], 0.002, QUICK, horizons=(1, 2, 5, 20))


def row(answer, surrogate, which=0):
    return [r for r in answer["rows"] if r["surrogate"] == surrogate][which]


def test_the_floor_rises_the_farther_from_the_training_part(answer):
    for surrogate in ("dmd", "spline"):
        floor = row(answer, surrogate)["floor_of_modes"]
        assert (np.diff(floor) > 0).all()
        assert floor[-1] > 2 * floor[0]
        kept = row(answer, surrogate)["floor"]
        assert kept[0] < 0.5 * floor[0]  # what the modes miss of the start is kept, and hardly changes in one snapshot


def test_travelling_waves_are_foreseen_by_the_linear_map_and_not_by_persistence(answer):
    for which in (0, -1):
        found = row(answer, "dmd", which)
        assert found["starts"] == 8
        assert found["over_persistence"] < 0.25
        assert found["rmse"][1] < 0.5 * found["persistence"][1]


def test_every_model_of_the_coefficients_beats_persistence_one_snapshot_ahead(answer):
    for r in answer["rows"]:
        if r["modes"] is not None:
            assert r["over_persistence"] < 1, r["surrogate"]
            assert r["rmse"][0] >= r["floor"][0]


def test_errors_and_floors_are_those_of_a_dense_recomputation(waves):
    answer = compare_beyond(waves, ["position.y"], 0.002, ["dmd"], starts=3, horizons=(1, 6), energy=0.9)
    W = waves.variable("position.y")[:][:, ::2]
    m = answer["trained"]
    assert (m, W.shape[1]) == (61, 91)
    mean = W[:, :m].mean(axis=1)
    u, s, _ = np.linalg.svd(W[:, :m] - mean[:, None], full_matrices=False)
    n = int(np.argmax(np.cumsum(s**2) >= 0.9 * (s**2).sum())) + 1
    u = u[:, :n] * np.sign(u[np.abs(u[:, :n]).argmax(axis=0), np.arange(n)])
    c = (W - mean[:, None]).T @ u
    times = 0.002 * np.arange(91)
    model = Dmd().fit(times[:m], c[:m])
    starts = [60, 72, 84]
    assert answer["start_times"] == pytest.approx(times[starts])
    kept, alone, floor, projection, stay = np.zeros((5, 3, 6))
    for i, a in enumerate(starts):
        end = model.window_[1]
        rolled = model.predict(end + 0.002 * np.arange(1, 7), c[a - model.memory_ + 1 : a + 1], beyond=True)
        for h in range(1, 7):
            x = W[:, a + h]
            kept[i, h - 1] = np.sqrt(np.mean((W[:, a] + u @ (rolled[h - 1] - c[a]) - x) ** 2))
            alone[i, h - 1] = np.sqrt(np.mean((mean + u @ rolled[h - 1] - x) ** 2))
            floor[i, h - 1] = np.sqrt(np.mean((W[:, a] + u @ (c[a + h] - c[a]) - x) ** 2))
            projection[i, h - 1] = np.sqrt(np.mean((mean + u @ c[a + h] - x) ** 2))
            stay[i, h - 1] = np.sqrt(np.mean((W[:, a] - x) ** 2))
    found = row(answer, "dmd")
    assert found["modes"] == n
    # the same least squares on modes that agree to 1e-12
    assert found["rmse"] == pytest.approx(kept.mean(axis=0), rel=1e-7)
    assert found["rmse_of_modes"] == pytest.approx(alone.mean(axis=0), rel=1e-7)
    assert found["floor"] == pytest.approx(floor.mean(axis=0), rel=1e-8)
    assert found["floor_of_modes"] == pytest.approx(projection.mean(axis=0), rel=1e-8)
    assert found["persistence"] == pytest.approx(stay.mean(axis=0), rel=1e-12)
    assert row(answer, "persistence")["rmse"] == found["persistence"]
    assert found["from_end"]["rmse"] == pytest.approx(kept[0], rel=1e-7)
    assert found["relative"] == pytest.approx(kept.mean(axis=0) / np.sqrt((s**2).sum() / (m * N)), rel=1e-7)
    assert found["rmse_diameters"] == pytest.approx(kept.mean(axis=0) / DIAMETER, rel=1e-7)


def test_uniform_motion_is_ballistic_at_every_horizon(tmp_path):
    rng = np.random.default_rng(0)
    x, v = rng.uniform(0, 0.1, (2, N, 3))
    t = INTERVAL * np.arange(40)[:, None, None]
    with Run(write(tmp_path / "free.h5", x + v * t, np.broadcast_to(v, (40, N, 3)))) as run:
        answer = compare_beyond(run, ["position.z"], INTERVAL, ["ballistic", "dmd"], horizons=(1, 10))
    found = row(answer, "ballistic")
    assert max(found["rmse"]) < 1e-15  # positions of 0.1 m are rounded at 1e-17 m
    speed = np.sqrt((v[:, 2] ** 2).mean())
    assert found["persistence"] == pytest.approx(speed * INTERVAL * np.arange(1, 11), rel=1e-9)
    assert "ballistic errs least" in answer["sentences"]["position.z"]
    assert row(answer, "dmd")["rmse"][-1] < 1e-9 * found["persistence"][-1]


def test_nothing_is_learnt_from_what_comes_after_the_training_part(tmp_path):
    positions, velocities = aging_waves()
    positions[121:] = np.random.default_rng(1).uniform(-1, 1, positions[121:].shape)
    with Run(write(tmp_path / "a.h5", *aging_waves())) as run:
        one = compare_beyond(run, ["position.x"], 0.002, ["spline", "dmd"], horizons=(1, 5))
    with Run(write(tmp_path / "b.h5", positions, velocities)) as run:
        other = compare_beyond(run, ["position.x"], 0.002, ["spline", "dmd"], horizons=(1, 5))
    assert one["train_end"] == other["train_end"] == pytest.approx(0.12)
    for key in ("n_lr", "n_c", "modes", "motion"):
        assert one["bases"][0][key] == other["bases"][0][key]
    assert [r["modes"] for r in one["rows"]] == [r["modes"] for r in other["rows"]]


def test_regressors_in_time_go_on_from_the_end_of_training_and_the_others_from_every_start(answer):
    for r in answer["rows"]:
        assert r["starts"] == (1 if r["kind"] == "time" else 8), r["surrogate"]
        if r["starts"] == 1:
            assert r["from_end"]["rmse"] == r["rmse"]
    assert {r["surrogate"] for r in answer["rows"]} == set(QUICK)


def test_where_curves_cross_is_the_first_horizon_above():
    assert first_above([1.0, 2.0, 5.0], [1.0, 3.0, 4.0]) == 3
    assert first_above([1.0, 2.0], [2.0, 3.0]) is None
    assert first_above([1.0, None], [2.0, 3.0]) == 2  # a rollout that is lost is worse than anything


def test_where_nothing_is_better_than_persistence_the_sentence_praises_nobody():
    one = {"variable": "x", "surrogate": "dmd", "modes": 3, "starts": 1, "rmse": [2.0], "persistence": [1.5]}
    said = foretold("x", {"rows": [{**one, "from_end": {"over_persistence": 4 / 3}}], "interval": 0.002})
    assert "nothing is better than persistence, dmd with 3 modes least bad with 1.33 times its error" in said
    assert "errs least" not in said


def test_crossings_agree_with_the_curves(answer):
    for r in answer["rows"]:
        above = [k + 1 for k, (e, p) in enumerate(zip(r["rmse"], r["persistence"], strict=True)) if e > p]
        assert r["behind_persistence"] == (above[0] if above else None)
        below = [k + 1 for k, (e, b) in enumerate(zip(r["rmse"], r["ballistic"], strict=True)) if e < b]
        assert r["ahead_of_ballistic"] == (below[0] if below else None)


def test_the_answer_is_plain_json_and_is_shown(answer, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    assert answer["horizons"] == [1, 2, 5, 20]
    show_beyond(answer)
    shown = capsys.readouterr().out
    assert "position.x, Δτ = 0.002 s: error in diameters" in shown
    assert "spline*" in shown
    assert "one snapshot ahead: from the end of training" in shown


def test_without_velocities_there_is_no_ballistic_motion_and_it_says_so(tmp_path):
    with Run(write(tmp_path / "run.h5", aging_waves()[0])) as run:
        answer = compare_beyond(run, ["position.x"], 0.002, QUICK, horizons=(1, 3))
    assert {o["surrogate"] for o in answer["left_out"]} == {"hermite", "raw-hermite", "ballistic"}
    assert row(answer, "dmd")["behind_ballistic"] is None


class Exploding(StateMap):
    """Grows by 1e60 a step: two steps and its square is beyond any double."""

    name = "exploding"

    def __init__(self, seed=0):
        self.seed = seed

    def _learn(self, series):
        pass

    def _step(self, history):
        return 1e60 * (1 + history[-1])

    def _learnt(self):
        return {}

    def _recall(self, state):
        pass


def test_a_rollout_that_is_lost_ends_its_curve(waves, monkeypatch, capsys):
    known = {**SURROGATES, "exploding": Exploding}
    monkeypatch.setattr(beyond, "SURROGATES", known)
    monkeypatch.setattr(making, "SURROGATES", known)
    answer = compare_beyond(waves, ["position.x"], 0.002, ["exploding"], horizons=(1, 5))
    found = row(answer, "exploding")
    assert found["rmse"][1] > 1e50
    assert found["rmse"][2:] == [None, None, None]
    assert found["behind_persistence"] == 1
    json.dumps(answer, allow_nan=False)
    show_beyond(answer)
    assert "lost" in capsys.readouterr().out


def test_nothing_that_moves_is_left_out_with_its_reason(tmp_path):
    positions, velocities = aging_waves(61)
    positions[:, :, 1] = 0.01
    with Run(write(tmp_path / "run.h5", positions, velocities)) as run:
        answer = compare_beyond(run, ["position.x", "position.y"], 0.002, ["dmd"], horizons=(1,))
        assert "nothing moves" in answer["left_out"][0]["reason"]
        with pytest.raises(Refusal, match=r"nothing can be compared: position\.y"):
            compare_beyond(run, ["position.y"], 0.002, ["dmd"], horizons=(1,))


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"surrogates": ["magic"]}, "surrogate 'magic' is not known; use rbf"),
        ({"surrogates": []}, "none is named"),
        ({"share": 1.0}, "share is 1; the training part must be above 0 and below 1"),
        ({"starts": 0}, "starts is 0; predict from at least 1"),
        ({"horizons": (0, 1)}, r"horizons are \[0, 1\]; give at least one"),
        ({"horizons": (70,)}, "the shortest is 70 snapshots, but only 30 follow"),
        ({"energy": 0.0}, "energy is 0; it must be a share above 0"),
        ({"interval": 0.0015}, r"0\.0015 s is not a multiple of the dense interval"),
        ({"interval": 0.09}, "0.09 s leaves 3 snapshots, of which 2 would be trained on"),
        ({"variables": ["position.w"]}, "no variable 'position.w'"),
    ],
)
def test_what_cannot_be_asked_is_refused_with_the_remedy(waves, asked, says):
    given = {"variables": ["position.x"], "interval": 0.002, **asked}
    with pytest.raises(Refusal, match=says):
        compare_beyond(waves, **given)


@pytest.mark.physics
def test_on_a_shaken_bed_every_model_beats_persistence_at_one_snapshot_and_velocities_beat_every_model(
    reference, tmp_path
):
    import_run(reference / "shake.dump.xz", tmp_path / "shake.h5", interval=INTERVAL)
    with Run(tmp_path / "shake.h5") as run:
        answer = compare_beyond(run, ["position.z"], 0.003, QUICK)
    motion = answer["bases"][0]["motion"]
    for r in answer["rows"]:
        if r["modes"] is None:
            continue
        assert r["over_persistence"] < 0.6, r["surrogate"]
        assert r["from_end"]["over_persistence"] < 0.3, r["surrogate"]
        assert r["from_end"]["over_persistence"] > row(answer, "ballistic")["from_end"]["over_persistence"]
    # the modes of the past hold the next snapshot to some per cent of the motion and the 25th hardly
    floor = np.array(row(answer, "spline", -1)["floor_of_modes"]) / motion
    assert floor[0] < 0.05
    assert 0.4 < floor[-1] < 0.55
