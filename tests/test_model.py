"""Trained surrogates on disk: written, read back in another process, asked, and refused when they are damaged."""

import json
import pickle
import subprocess
import sys

import h5py
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from suffice.model import ARRAYS, BEGUN, CARD, begin_training, check_model_place, load_model
from suffice.predicting import parse_times
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.training import Wish, train_model
from suffice.views import view_paths
from surrogates import SURROGATES

QUIET = Reporter(as_json=True)
MODAL = [name for name, member in SURROGATES.items() if not member.raw]
INTERVAL = 0.002  # s, twice the dense one


@pytest.fixture
def source(write_run, tmp_path):
    return write_run(tmp_path / "run.h5")


def trained(source, folder, name="spline", variable="position", **more):
    with Run(source) as run:
        return train_model(run, folder, Wish(variable, INTERVAL, name, **more), QUIET)


@pytest.mark.parametrize("name", MODAL)
def test_a_saved_model_predicts_bitwise_what_it_predicted_before(source, tmp_path, name):
    few = {"max_seconds": 2.0} if name in ("mlp", "lstm") else {}
    card = trained(source, tmp_path / "model", name, "position.x", **few)
    first, second = load_model(tmp_path / "model"), load_model(tmp_path / "model")
    times = np.linspace(*card["window"], 17)
    assert np.array_equal(first.snapshots(times), second.snapshots(times))
    program = (
        "import sys, numpy as np; from pathlib import Path; from suffice.model import load_model; "
        "np.save(sys.argv[2], load_model(Path(sys.argv[1])).snapshots(np.load(sys.argv[3])))"
    )
    np.save(tmp_path / "times.npy", times)
    words = [str(tmp_path / part) for part in ("model", "answer.npy", "times.npy")]
    subprocess.run([sys.executable, "-c", program, *words], check=True)
    assert np.array_equal(np.load(tmp_path / "answer.npy"), first.snapshots(times))


def test_the_card_holds_what_the_errors_are_against_a_dense_recomputation(source, tmp_path):
    card = trained(source, tmp_path / "model", "spline", "position.x", modes=3)
    with Run(source) as run:
        W = run.variable("position.x")[:].astype(float)
        times = run.times
    unseen = np.setdiff1d(np.arange(len(times) - (len(times) + 1) % 2), np.arange(0, len(times), 2))
    predicted = load_model(tmp_path / "model").snapshots(times[unseen])
    rmse = np.sqrt(np.square(predicted.T - W[:, unseen]).mean(axis=0)).mean()
    assert card["rmse"] == pytest.approx(rmse, rel=1e-6)
    assert card["rmse"] >= card["projection_rmse"]
    assert card["n_modes"] == 3
    stored = json.loads((tmp_path / "model" / CARD).read_text())
    assert stored["versions"].keys() >= {"suffice", "torch", "numpy", "scipy"}
    assert stored["thresholds"] == {"energy": 0.999, "consistency": 1.05}


def test_what_a_model_predicts_is_a_run_with_a_view_for_paraview(source, tmp_path, suffice):
    assert suffice("train", source, "--variable", "position", "--interval", "0.002", "--surrogate", "hermite",
                   "-o", tmp_path / "model").code == 0  # fmt: skip
    with Run(source) as run:
        known, times = run.snapshot(4).values["position"].astype(float), run.times
    end = float(times[-1] - (len(times) + 1) % 2 * 0.001)
    asked = f"0:{end}:0.0005"
    assert suffice("predict", tmp_path / "model", "--times", asked, "-o", tmp_path / "made.h5").code == 0
    with Run(tmp_path / "made.h5") as made:
        assert made.n_snapshots == round(end / 0.0005) + 1
        assert made.quantities == ("position",)
        assert "hermite" in made.provenance["predicted"]
        # all modes at a training time leave what the modes leave
        left = np.abs(made.snapshot(8).values["position"] - known).max()
    assert left < 0.2 * np.abs(known - known.mean(axis=0)).max()
    with h5py.File(view_paths(tmp_path / "made.h5")[0]) as view:
        assert view["VTKHDF/Steps"].attrs["NSteps"] == round(end / 0.0005) + 1
    answer = suffice("info", tmp_path / "model")
    assert answer.code == 0
    assert "hermite" in answer.out


def test_models_of_three_components_make_one_run(source, tmp_path, suffice):
    folders = [tmp_path / axis for axis in "xyz"]
    for folder in folders:
        trained(source, folder, "linear", f"position.{folder.name}")
    refused = suffice("predict", *folders[:2], "--times", "0:0.01:0.001", "-o", tmp_path / "made.h5")
    assert refused.code == 2
    assert "one of each of position.x, position.y, position.z" in refused.err
    assert not (tmp_path / "made.h5").exists()
    assert suffice("predict", *folders[::-1], "--times", "0.001,0.003", "-o", tmp_path / "made.h5").code == 0
    with Run(tmp_path / "made.h5") as made:
        for axis, folder in enumerate(folders):
            expected = load_model(folder).snapshots(made.times)
            np.testing.assert_allclose(made.variable("position")[:][axis::3].T, expected, rtol=1e-6)


def test_nothing_is_extrapolated_in_silence(source, tmp_path, suffice):
    trained(source, tmp_path / "model")
    words = ("predict", tmp_path / "model", "--times", "0:1:0.1", "-o", tmp_path / "made.h5")
    refused = suffice(*words)
    assert refused.code == 2
    assert "lies outside the fitted window" in refused.err
    assert not (tmp_path / "made.h5").exists()
    assert suffice(*words, "--beyond").code == 0
    with Run(tmp_path / "made.h5") as made:
        assert "extrapolated" in made.provenance["predicted"]


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (lambda folder: (folder / ARRAYS).write_bytes((folder / ARRAYS).read_bytes()[:-100]), "damaged"),
        (lambda folder: (folder / ARRAYS).write_bytes(pickle.dumps({"mean": 1})), "damaged"),
        (lambda folder: (folder / ARRAYS).unlink(), "damaged"),
        (lambda folder: (folder / CARD).write_text("{"), "holds no model"),
        (lambda folder: change_card(folder, surrogate="os.system"), "is not known here"),
        (lambda folder: change_card(folder, version=99), "version 99"),
        (lambda folder: change_card(folder, settings={"kernel": "__import__"}), "damaged"),
        (lambda folder: change_card(folder, variable="../etc"), "is not known"),
        (lambda folder: change_array(folder, "modes", lambda a: a[:-1]), "modes of shape"),
        (lambda folder: change_array(folder, "modes", lambda a: a * np.nan), "not finite"),
        (lambda folder: change_array(folder, "radius", lambda a: a[:-1]), "differ in number"),
        (lambda folder: change_array(folder, "surrogate/values", lambda a: a[:, :-1]), "modes of shape|damaged"),
        (lambda folder: change_array(folder, "surrogate/times", lambda a: a[::-1]), "damaged"),
    ],
    ids=range(13),
)
def test_a_damaged_or_hostile_model_is_refused_by_one_message(source, tmp_path, suffice, harm, says):
    trained(source, tmp_path / "model")
    harm(tmp_path / "model")
    with pytest.raises(Refusal, match=says):
        load_model(tmp_path / "model")
    answer = suffice("predict", tmp_path / "model", "--times", "0.001", "-o", tmp_path / "made.h5")
    assert answer.code == 2
    assert "Traceback" not in answer.err
    assert not (tmp_path / "made.h5").exists()


def change_card(folder, **changes):
    card = json.loads((folder / CARD).read_text())
    (folder / CARD).write_text(json.dumps(card | changes))


def change_array(folder, name, change):
    arrays = load_file(folder / ARRAYS)
    arrays[name] = np.ascontiguousarray(change(arrays[name]))
    save_file(arrays, folder / ARRAYS)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"surrogate": "magic"}, "'magic' is not one that is trained on modes; use rbf, "),
        ({"surrogate": "raw-linear"}, "not one that is trained on modes"),
        ({"modes": 1000}, "--modes is 1000; these snapshots have"),
        ({"resume": True}, "only networks are trained in steps"),
        ({"interval": 0.0015}, "multiple"),
        ({"variable": "position.w"}, "has no variable 'position.w'"),
    ],
)
def test_what_cannot_be_trained_is_refused_and_nothing_written(source, tmp_path, change, says):
    wish = Wish("position", INTERVAL, "spline")._replace(**change)
    with Run(source) as run, pytest.raises(Refusal, match=says):
        train_model(run, tmp_path / "model", wish, QUIET)
    assert not (tmp_path / "model").exists()


def test_a_folder_with_other_things_is_no_place_for_a_model(source, tmp_path):
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "mother.txt").write_text("dear")
    with pytest.raises(Refusal, match="holds other things than a model"):
        trained(source, tmp_path / "letters")
    assert [path.name for path in (tmp_path / "letters").iterdir()] == ["mother.txt"]


@pytest.mark.parametrize("text", ["", "a", "0:1", "1:0:0.1", "0:1:0", "0:1:1e-9", "0.2,0.1", "nan", "0:inf:1"])
def test_times_that_are_none_are_refused(text):
    with pytest.raises(Refusal, match="--times"):
        parse_times(text)


def test_times_are_a_range_that_holds_its_end_or_a_list():
    np.testing.assert_allclose(parse_times("0:0.3:0.1"), [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(parse_times("0.5,0.75"), [0.5, 0.75])


def test_a_surrogate_without_a_network_says_that_it_is_trained(source, tmp_path, suffice):
    words = ("--variable", "position", "--interval", "0.002", "--surrogate", "spline", "-o", tmp_path / "model")
    told = suffice("--log-json", "train", source, *words)
    assert told.code == 0
    lines = [json.loads(line) for line in told.err.splitlines()]
    assert [(line["stage"], line["done"], line["all"]) for line in lines] == [("train", 0, 1), ("train", 1, 1)]


def test_a_model_takes_as_many_bytes_as_its_card_tells_beside_the_particles(source, tmp_path):
    card = trained(source, tmp_path / "model")
    arrays = load_file(tmp_path / "model" / ARRAYS)
    assert arrays["modes"].dtype == arrays["mean"].dtype == np.float32  # as the snapshots they were made of
    kept = sum(array.nbytes for name, array in arrays.items() if name not in ("ids", "radius", "species"))
    assert card["storage_bytes"] == kept


@pytest.mark.parametrize("left", ["training.begun", "log/version_0/hparams.yaml", "training.safetensors.part"])
def test_what_a_kill_before_the_first_state_leaves_does_not_stand_in_the_way(tmp_path, left):
    begin_training(tmp_path)
    (tmp_path / left).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / left).touch()
    check_model_place(tmp_path)


def test_a_finished_network_leaves_no_mark_of_a_training_that_goes_on(source, tmp_path):
    trained(source, tmp_path / "model", "mlp", "position.x", max_seconds=1.0)
    assert (tmp_path / "model" / CARD).exists()
    assert not (tmp_path / "model" / BEGUN).exists()


def test_what_a_kill_while_writing_leaves_does_not_stand_in_the_way(tmp_path):
    for name in ("model.safetensors", "model.safetensors.part", "model.json.part"):
        (tmp_path / name).write_text("")
        check_model_place(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(Refusal, match="holds other things than a model"):
        check_model_place(tmp_path)


def test_a_model_of_every_snapshot_takes_n_lr_modes_and_claims_no_error(source, tmp_path):
    with Run(source) as run:
        card = train_model(run, tmp_path / "model", Wish("position", 0.001, "spline"), QUIET)
        W, times = run.variable("position")[:].astype(float), run.times
    assert card["n_snapshots"] == len(times)
    # nothing lies between the snapshots, so R_c is 1 for every n and tells nothing
    assert (card["n_c"], card["rmse"], card["projection_rmse"]) == (None, None, None)
    assert card["n_modes"] == card["n_lr"]
    left = W - load_model(tmp_path / "model").snapshots(times).T
    assert np.square(left).sum() <= 1.001e-3 * np.square(W - W.mean(axis=1, keepdims=True)).sum()


def test_a_prediction_replaces_a_prediction_but_not_the_run_it_was_learnt_from(source, tmp_path, suffice):
    trained(source, tmp_path / "model")
    before = source.read_bytes()
    asked = ("predict", tmp_path / "model", "--times", "0.001", "-o")
    refused = suffice(*asked, source)
    assert refused.code == 2
    assert "holds a run that no model predicted" in refused.err
    assert source.read_bytes() == before
    for _ in range(2):
        assert suffice(*asked, tmp_path / "made.h5").code == 0
