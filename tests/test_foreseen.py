"""Snapshots foreseen beyond the window, observed: against closed forms, and the errors that `beyond` finds."""

import json

import numpy as np
import pytest

from suffice import beyond, foreseen, making
from suffice.beyond import compare_beyond
from suffice.foreseen import observe_beyond
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.show_foreseen import show_foreseen
from suffice.store import RunWriter
from surrogates import SURROGATES, Network, StateMap

QUICK = [name for name, member in SURROGATES.items() if not issubclass(member, Network)]
INTERVAL, DIAMETER = 0.001, 2e-3


def write(path, position, velocity=None):
    """Store (snapshots, n, 3) positions in double precision, one every millisecond."""
    n = position.shape[1]
    with RunWriter(
        path,
        ids=np.arange(n),
        radius=np.full(n, DIAMETER / 2),
        species=np.zeros(n, int),
        n_snapshots=len(position),
        variables=("position",) if velocity is None else ("position", "velocity"),
        precision="double",
        provenance={},
    ) as run:
        for k in range(len(position)):
            run.append(
                k * INTERVAL, {"position": position[k]} | ({} if velocity is None else {"velocity": velocity[k]})
            )
    return path


def aging_waves(snapshots=121, n=40):
    """Beads in a row that travelling waves shake, whose wavelength shortens with time."""
    t = INTERVAL * np.arange(snapshots)[:, None, None]
    place = np.linspace(0, 1, n)[:, None]
    number, omega = np.array([3.0, 5.0, 8.0]), np.array([60.0, 90.0, 130.0])
    phase = 2 * np.pi * number * (1 + 2 * t) * place - omega * t
    rate = 4 * np.pi * number * place - omega
    home = np.array([0.2, 0.0, 0.0]) * place
    return home + 1e-3 * np.sin(phase), 1e-3 * rate * np.cos(phase)


def bouncing(snapshots=31, speed=0.25, contact=0.020):
    """Two hard beads that meet at the end of training, and fly back as fast as they came."""
    t = INTERVAL * np.arange(snapshots)
    gap = DIAMETER + 2 * speed * np.abs(contact - t)
    rate = np.where(t <= contact, -speed, speed)
    along = np.array([1.0, 0.0, 0.0])
    position, velocity = 0.5 * gap[:, None] * along, rate[:, None] * along
    return np.stack([position, -position], axis=1), np.stack([velocity, -velocity], axis=1)


@pytest.fixture(scope="module")
def waves(tmp_path_factory):
    with Run(write(tmp_path_factory.mktemp("foreseen") / "waves.h5", *aging_waves())) as run:
        yield run


@pytest.fixture(scope="module")
def answer(waves):
    return observe_beyond(waves, 0.002, horizons=(5, 1, 2, 99))


def row(answer, surrogate):
    (found,) = [r for r in answer["rows"] if r["surrogate"] == surrogate]
    return found


def test_positions_err_as_much_as_the_comparison_beyond_the_window_finds(waves, answer):
    compared = compare_beyond(waves, ["position"], 0.002, QUICK, horizons=(1, 2, 5))
    assert compared["bases"][0]["n_lr"] == answer["modes"]
    for surrogate in QUICK:
        one = next(r for r in compared["rows"] if r["surrogate"] == surrogate and r["modes"] in (answer["modes"], None))
        curve = [one["from_end"]["rmse"][h - 1] for h in answer["horizons"]]
        assert row(answer, surrogate)["rmse"] == pytest.approx(curve, rel=1e-9), surrogate
        if surrogate == "spline":
            floor = [one["floor"][h - 1] for h in answer["horizons"]]
            assert row(answer, "projection")["rmse"] == pytest.approx(floor, rel=1e-9)


def test_no_surrogate_of_the_modes_is_nearer_than_exact_coefficients(answer):
    for r in answer["rows"]:
        if r["modes"] is not None:
            assert all(np.array(r["rmse"]) >= np.array(row(answer, "projection")["rmse"]) * (1 - 1e-12))


def test_beads_that_would_bounce_are_put_into_each_other_by_all_that_fly_on(tmp_path):
    asked = ["ballistic", "raw-linear", "linear", "spline", "dmd"]
    with Run(write(tmp_path / "run.h5", *bouncing())) as two:
        answer = observe_beyond(two, INTERVAL, asked, horizons=(1, 2, 4, 5))
    assert answer["train_end"] == pytest.approx(0.020)
    assert answer["observables"]["overlap.largest"]["truths"] == [0.0] * 4
    for name in ("projection", *asked):
        # 0.5 mm nearer per snapshot; after four they sit at one place, then part again; modes know this line only
        expected = [0.25, 0.5, 1.0, 0.75] if name != "projection" else [0.0] * 4
        assert row(answer, name)["errors"]["overlap.largest"] == pytest.approx(expected, abs=1e-9), name
        assert row(answer, name)["errors"]["kinetic_energy"] == pytest.approx([0.0] * 4, abs=1e-6), name
    assert row(answer, "persistence")["errors"]["overlap.largest"] == pytest.approx([0.0] * 4, abs=1e-12)


def test_what_stands_still_has_lost_all_of_its_energy_and_what_flies_on_none_of_what_it_had(waves, answer):
    assert row(answer, "persistence")["errors"]["kinetic_energy"] == pytest.approx([-100.0] * 3)
    end = round(answer["train_end"] / INTERVAL)
    speed = [np.square(waves.snapshot(k).values["velocity"]).sum() for k in (end, end + 2, end + 4, end + 10)]
    expected = 100 * (speed[0] / np.array(speed[1:]) - 1)
    assert row(answer, "ballistic")["errors"]["kinetic_energy"] == pytest.approx(expected, rel=1e-6)


def test_the_answer_is_plain_json_and_networks_are_not_trained_unless_named(waves, answer):
    told = []
    observe_beyond(waves, 0.002, ["dmd"], horizons=(1,), progress=lambda done, total: told.append((done, total)))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    assert answer["horizons"] == [1, 2, 5]
    assert answer["times"] == pytest.approx([answer["train_end"] + 0.002 * h for h in answer["horizons"]])
    assert [r["surrogate"] for r in answer["rows"]] == ["projection", *QUICK]
    for r in answer["rows"]:
        assert set(r["errors"]) == set(answer["observables"])
        assert all(len(curve) == 3 for curve in (r["rmse"], r["rmse_diameters"], *r["errors"].values()))
        assert r["rmse_diameters"][0] == pytest.approx(r["rmse"][0] / DIAMETER)
    assert "no scene" in {left["observable"]: left["reason"] for left in answer["left_out"]}["bed_height"]


def test_without_velocities_no_energy_is_observed_and_what_needs_them_is_left_out(tmp_path):
    with Run(write(tmp_path / "run.h5", aging_waves()[0])) as run:
        answer = observe_beyond(run, 0.002, ["hermite", "ballistic", "dmd"], horizons=(1,))
    reasons = {left["observable"] or left["surrogate"]: left["reason"] for left in answer["left_out"]}
    assert "no velocities" in reasons["kinetic_energy"]
    assert {"hermite", "ballistic"} <= set(reasons)
    assert [r["surrogate"] for r in answer["rows"]] == ["projection", "dmd", "persistence"]
    assert "kinetic_energy" not in answer["observables"]


class Exploding(StateMap):
    """Grows by 1e60 a step: it leaves every scale at once, and the numbers after two steps."""

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


def test_a_rollout_that_is_lost_has_no_observables_and_says_from_where_on(waves, monkeypatch, capsys):
    for module in (beyond, making, foreseen):
        monkeypatch.setattr(module, "SURROGATES", {**SURROGATES, "exploding": Exploding})
    answer = observe_beyond(waves, 0.002, ["exploding"], horizons=(1, 5))
    found = row(answer, "exploding")
    assert found["rmse"] == [None, None]
    assert all(curve == [None, None] for curve in found["errors"].values())
    assert "lost by 1 snapshots ahead" in answer["left_out"][-1]["reason"]
    show_foreseen(answer)
    assert "lost" in capsys.readouterr().out


def test_the_tables_fit_a_terminal_of_80_columns_and_show_the_truth_first(answer, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    show_foreseen(answer)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 80
    for word in ("RMSE of positions (d)", "kinetic energy of translation: error (%)", "truth", "projection", "-100"):
        assert word in said
    energies = said[said.index("kinetic energy") :]
    assert [name for name in QUICK if name not in energies] == []


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"surrogates": ["magic"]}, "surrogate 'magic' is not known"),
        ({"share": 1.0}, "share is 1; the training part must be"),
        ({"horizons": ()}, r"horizons are \[\]; give at least one"),
        ({"horizons": (70,)}, "the shortest is 70 snapshots, but only 20 follow"),
        ({"energy": 0.0}, "energy is 0; it must be a share above 0"),
        ({"interval": 0.0015}, r"0\.0015 s is not a multiple of the dense interval"),
    ],
)
def test_what_cannot_be_asked_is_refused_with_the_remedy(waves, asked, says):
    with pytest.raises(Refusal, match=says):
        observe_beyond(waves, **{"interval": 0.002, **asked})


def test_what_never_moves_cannot_be_foreseen(tmp_path):
    still = np.broadcast_to(aging_waves()[0][:1], (31, 40, 3))
    with Run(write(tmp_path / "run.h5", still)) as run, pytest.raises(Refusal, match=r"position: .*nothing moves"):
        observe_beyond(run, INTERVAL, horizons=(1,))


def test_the_command_adds_observables_to_what_lies_beyond(suffice, waves):
    asked = ("--task", "beyond", "--interval", "0.002", "--surrogate", "dmd", "--variable", "position.x")
    found = suffice("compare", str(waves.path), *asked, "--observables", "--json", "-")
    assert found.code == 0, found.err
    told = json.loads(found.out)
    assert {r["surrogate"] for r in told["observables"]["rows"]} == {"projection", "dmd", "persistence"}
    assert told["observables"]["trained"] == told["trained"]
    assert "observables" not in json.loads(suffice("compare", str(waves.path), *asked, "--json", "-").out)
    shown = suffice("compare", str(waves.path), *asked, "--observables")
    assert "kinetic energy of translation" in shown.out
    wrong = suffice("compare", str(waves.path), "--observables")
    assert wrong.code != 0
    assert "--observables belongs to --task beyond, not to between" in " ".join(wrong.err.split())


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("--task", "beyond", "--max-error", "0.05d"), "--max-error belongs to --task between or timescales, not to"),
        (("--task", "observables", "--variable", "position.x"), "--variable belongs to --task between or beyond or"),
        (("--task", "timescales", "--seed", "0"), "--seed belongs to --task between or beyond or unseen or"),
        (("--task", "unseen", "--interval", "0.002", "--held-out", "600"), "--interval belongs to --task between or"),
        (("--held-out", "600"), "--held-out belongs to --task unseen, not to between; leave it out"),
    ],
)
def test_an_option_that_a_comparison_would_not_heed_is_refused(suffice, waves, given, says):
    found = suffice("compare", str(waves.path), *given)
    assert (found.code, found.out) == (2, "")
    assert says in " ".join(found.err.split())
