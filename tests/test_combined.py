"""Combined models: each variable at its own interval and rank, on disk in parts, and refused when hostile."""

import json
import subprocess
import sys

import numpy as np
import pytest
from safetensors.numpy import load_file

from suffice.combined import PLAN, load_models, read_combined_card
from suffice.combining import Request, train
from suffice.door import InterruptedRunError
from suffice.model import ARRAYS, CARD
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import RunWriter

QUIET = Reporter(as_json=True)
DENSE, COUNT, BEADS = 0.001, 241, 60
SLOW, FAST = 4.0, 40.0  # Hz, bands of x and of y


@pytest.fixture(scope="module")
def two_speeds(tmp_path_factory):
    """Write a run whose x moves within 4 Hz, whose y moves within 40 Hz, and whose z hardly differs from x."""
    path, rng = tmp_path_factory.mktemp("run") / "run.h5", np.random.default_rng(2)
    t = DENSE * np.arange(COUNT)
    position, velocity = np.zeros((2, COUNT, BEADS, 3))
    for axis, band in enumerate((SLOW, FAST, SLOW)):
        pace, phase = 2 * np.pi * rng.uniform(0.2, 1.0, (6, 1)) * band, rng.uniform(0, 6, (6, 1))
        weight = rng.normal(size=(BEADS, 6)) * 1e-3
        position[..., axis] = (weight @ np.sin(pace * t + phase)).T
        velocity[..., axis] = (weight @ (pace * np.cos(pace * t + phase))).T
    particles = {"ids": np.arange(BEADS), "radius": np.full(BEADS, 5e-4), "species": np.zeros(BEADS, int)}
    with RunWriter(
        path, **particles, n_snapshots=COUNT, variables=("position", "velocity"), provenance={}, precision="double"
    ) as run:
        for k in range(COUNT):
            run.append(t[k], {"position": position[k], "velocity": velocity[k]})
    return path


@pytest.fixture
def combined(two_speeds, tmp_path):
    card = train(two_speeds, tmp_path / "model", Request("hermite", max_error=["1e-6m"]), QUIET)
    return tmp_path / "model", card


def bytes_of(folder):
    return sum(path.stat().st_size for path in folder.rglob(ARRAYS))


def error_of(run, models, name):
    """RMSE over rows, mean over all dense times in the window, by reading the run itself."""
    (model,) = (model for model in models if model.variable == name)
    last = round(model.surrogate.window_[1] / DENSE)
    miss = model.snapshots(run.times[: last + 1]) - run.variable(name)[:][:, : last + 1].T
    return float(np.sqrt(np.square(miss).mean(axis=1)).mean())


def test_a_slow_variable_gets_a_coarse_interval_and_a_fast_one_a_fine_one(two_speeds, combined, tmp_path):
    folder, card = combined
    interval = {name: part["interval"] for name, part in card["parts"].items()}
    assert interval["position.y"] < interval["position.x"]
    assert interval["position.y"] < interval["position.z"]
    # half a period of the fastest motion holds several snapshots
    assert interval["position.y"] < 0.2 / FAST
    models = load_models(folder)
    with Run(two_speeds) as run:
        errors = [error_of(run, models, f"position.{axis}") for axis in "xyz"]
    assert np.sqrt(np.mean(np.square(errors))) < 1e-6
    alike = train(
        two_speeds, tmp_path / "alike",
        Request("hermite", intervals=[min(interval.values())], max_error=["1e-6m"]), QUIET,
    )  # fmt: skip
    assert card["storage_bytes"] < alike["storage_bytes"]
    assert bytes_of(folder) < bytes_of(tmp_path / "alike")


def test_the_card_tells_errors_and_bytes_that_the_files_have(two_speeds, combined):
    folder, card = combined
    models = load_models(folder)
    assert [model.variable for model in models] == [f"{w}.{a}" for w in ("position", "velocity") for a in "xyz"]
    with Run(two_speeds) as run:
        for told in (*card["parts"].items(), *card["derived"].items()):
            (model,) = (model for model in models if model.variable == told[0])
            step = round(model.surrogate.interval_ / DENSE)
            last = round(model.surrogate.window_[1] / DENSE)
            unseen = np.setdiff1d(np.arange(last + 1), np.arange(0, last + 1, step))
            miss = model.snapshots(run.times[unseen]) - run.variable(told[0])[:][:, unseen].T
            assert told[1]["rmse"] == pytest.approx(np.sqrt(np.square(miss).mean(axis=1)).mean(), rel=1e-5)
    total = 0
    for name in card["parts"]:
        arrays = load_file(folder / name / ARRAYS)
        total += sum(array.nbytes for key, array in arrays.items() if key not in ("ids", "radius", "species"))
    assert card["storage_bytes"] == total


def test_velocities_are_the_slope_of_the_positions(combined):
    models = {model.variable: model for model in load_models(combined[0])}
    times, h = np.linspace(0.01, 0.2, 50), 1e-7
    for axis in "xyz":
        x, v = models[f"position.{axis}"], models[f"velocity.{axis}"]
        slope = (x.snapshots(times + h) - x.snapshots(times - h)) / (2 * h)
        np.testing.assert_allclose(v.snapshots(times), slope, atol=1e-7)


def test_a_velocity_is_not_told_in_diameters(two_speeds, tmp_path):
    card = train(two_speeds, tmp_path / "own", Request("spline", ["velocity.y"], [0.002]), QUIET)
    assert card["unit"] == "m/s"
    assert card["rmse_diameters"] is None
    assert not (tmp_path / "own" / "velocity.y").exists()  # an ordinary model, not a combined one


def test_a_combined_model_answers_all_variables_at_any_times_in_one_run(combined, tmp_path, suffice):
    folder, card = combined
    end = card["window"][1]
    assert suffice("predict", folder, "--times", f"0:{end}:0.0005", "-o", tmp_path / "made.h5").code == 0
    models = {model.variable: model for model in load_models(folder)}
    with Run(tmp_path / "made.h5") as made:
        assert made.quantities == ("position", "velocity")
        assert "hermite (derivative)" in made.provenance["predicted"]
        for name, model in models.items():
            np.testing.assert_allclose(made.variable(name)[:].T, model.snapshots(made.times), rtol=1e-6, atol=1e-9)
    refused = suffice("predict", folder, "--times", f"0,{end + 0.1}", "-o", tmp_path / "other.h5")
    assert refused.code == 2
    assert "outside the fitted window" in refused.err
    told = suffice("info", folder)
    assert told.code == 0
    assert "velocity.y" in told.out
    assert "d/dt" in told.out


@pytest.mark.physics
def test_a_combined_model_answers_bitwise_the_same_in_a_new_process(combined, tmp_path):
    folder, _ = combined
    times = np.linspace(0.0, 0.2, 37)
    program = (
        "import sys, numpy as np; from pathlib import Path; from suffice.combined import load_models; "
        "np.save(sys.argv[2], np.hstack([m.snapshots(np.load(sys.argv[3])) for m in load_models(Path(sys.argv[1]))]))"
    )
    np.save(tmp_path / "times.npy", times)
    words = [str(folder), *(str(tmp_path / name) for name in ("answer.npy", "times.npy"))]
    subprocess.run([sys.executable, "-c", program, *words], check=True)
    here = np.hstack([model.snapshots(times) for model in load_models(folder)])
    assert np.array_equal(np.load(tmp_path / "answer.npy"), here)


def change(folder, **changes):
    card = json.loads((folder / CARD).read_text())
    (folder / CARD).write_text(json.dumps(card | changes))


def point_outside(folder):
    outside = folder.parent / "outside"
    (folder / "position.x").rename(outside)
    (folder / "position.x").symlink_to(outside)


def swap(folder):
    (folder / "position.x").rename(folder / "kept")
    (folder / "position.y").rename(folder / "position.x")


def nest(folder):
    (folder / "position.x" / CARD).write_text((folder / CARD).read_text())


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (lambda f: change(f, parts={"../model": {}}), "part '../model' is not a variable"),
        (lambda f: change(f, parts={"/etc": {}}), "part '/etc' is not a variable"),
        (lambda f: change(f, parts={".": {}}), "part '.' is not a variable"),
        (lambda f: change(f, parts={}), "lists no parts"),
        (lambda f: change(f, parts=["position.x"]), "lists no parts"),
        (lambda f: change(f, derived=None), "lists no parts"),
        (lambda f: change(f, derived={"velocity.x": {"of": "../position.x"}}), "is not a variable"),
        (lambda f: change(f, derived={"velocity.x": "position.x"}), "part None is not a variable"),
        (lambda f: change(f, derived={"velocity.x": {"of": "position.y"}}), "is not the derivative of a part"),
        (lambda f: change(f, derived={"velocity.x": {"of": "velocity.x"}}), "is not the derivative of a part"),
        (lambda f: change(f, version=7), "version 7"),
        (lambda f: (f / "position.y" / CARD).unlink(), "holds no model"),
        (lambda f: (f / "position.y").rename(f / "gone"), "part position.y is missing"),
        (point_outside, "part position.x is missing"),
        (swap, "holds a model of position.y, not of position.x"),
        (nest, "holds no model"),
    ],
    ids=range(16),
)
def test_a_damaged_or_hostile_card_is_refused_by_one_message(combined, tmp_path, suffice, harm, says):
    folder, _ = combined
    harm(folder)
    with pytest.raises(Refusal, match=says):
        load_models(folder)
    answer = suffice("predict", folder, "--times", "0.001", "-o", tmp_path / "made.h5")
    assert answer.code == 2
    assert "Traceback" not in answer.err
    assert not (tmp_path / "made.h5").exists()


def test_an_interrupted_training_goes_on_with_the_parts_that_are_left(two_speeds, tmp_path, monkeypatch):
    folder, request, count = tmp_path / "model", Request("spline", finest=True), []
    from suffice import combining

    trained = combining.train_model

    def stopping(source, place, wish, reporter):
        count.append(place.name)
        if len(count) == 2:
            raise KeyboardInterrupt
        return trained(source, place, wish, reporter)

    monkeypatch.setattr(combining, "train_model", stopping)
    with pytest.raises(InterruptedRunError, match=r"finished parts stand in .* --resume goes on"):
        train(two_speeds, folder, request, QUIET)
    assert (folder / PLAN).exists()
    with pytest.raises(Refusal, match="holds no model"):
        load_models(folder)
    first = (folder / "position.x" / ARRAYS).stat().st_mtime_ns
    with pytest.raises(Refusal, match=r"--resume: seed is 5, the training in .* was begun with 0; give the same"):
        train(two_speeds, folder, request._replace(seed=5, resume=True), QUIET)
    with pytest.raises(Refusal, match=r"--resume: surrogate is linear, .* was begun with spline"):
        train(two_speeds, folder, request._replace(surrogate="linear", resume=True), QUIET)
    whole = (folder / "position.x" / CARD).read_text()
    for harm in ({"window": ["0", 1.0]}, {"window": [0.0]}, {"storage_bytes": None}, {"unit": 5}):
        change(folder / "position.x", **harm)
        with pytest.raises(Refusal, match=r"position\.x is damaged; remove that folder"):
            train(two_speeds, folder, request._replace(resume=True), QUIET)
        (folder / "position.x" / CARD).write_text(whole)
    card = train(two_speeds, folder, request._replace(resume=True), QUIET)
    assert count == ["position.x", "position.y", "position.y", "position.z"]
    assert (folder / "position.x" / ARRAYS).stat().st_mtime_ns == first
    assert not (folder / PLAN).exists()
    assert train(two_speeds, folder, request._replace(resume=True), QUIET) == read_combined_card(folder)
    assert card["parts"].keys() == {"position.x", "position.y", "position.z"}
    assert len(count) == 4


@pytest.mark.physics
def test_networks_are_combined_and_resumed_part_by_part(two_speeds, tmp_path, suffice):
    words = (
        "train", two_speeds, "--surrogate", "mlp", "--interval", "0.004", "--variable", "position.x", "--variable",
        "velocity.x", "--max-seconds", "1", "-o", tmp_path / "model",
    )  # fmt: skip
    assert suffice(*words).code == 0
    x, v = load_models(tmp_path / "model")
    assert (x.variable, v.variable) == ("position.x", "velocity.x")
    assert not v.moving  # a network has no derivative in closed form here: it has modes of its own
    refused = suffice(*words, "--resume", "--seed", "1")
    assert refused.code == 2
    assert "seed is 1" in refused.err
    (tmp_path / "model" / "velocity.x" / CARD).unlink()
    (tmp_path / "model" / CARD).rename(tmp_path / "model" / PLAN)
    (tmp_path / "model" / PLAN).write_text(json.dumps(json.loads((tmp_path / "model" / PLAN).read_text())["asked"]))
    assert suffice(*words, "--resume").code == 0
    assert np.array_equal(load_models(tmp_path / "model")[0].snapshots([0.01]), x.snapshots([0.01]))


def test_a_single_network_is_not_resumed_with_another_seed(two_speeds, tmp_path, suffice):
    words = (
        "train", two_speeds, "--surrogate", "mlp", "--interval", "0.004", "--variable", "position.x", "--max-seconds",
        "1", "-o", tmp_path / "model",
    )  # fmt: skip
    assert suffice(*words).code == 0
    refused = suffice(*words, "--resume", "--seed", "1")
    assert refused.code == 2
    assert "seed is 1, the training to be resumed was begun with 0; give the same, or start it anew" in refused.err


def test_one_interval_for_all_is_taken_as_it_is_given(two_speeds, tmp_path):
    card = train(two_speeds, tmp_path / "model", Request("linear", intervals=[0.004]), QUIET)
    assert {part["interval"] for part in card["parts"].values()} == {0.004}
    assert not card["derived"]  # a line has no slope at its ends
    assert len(card["parts"]) == 6


def test_the_rule_gives_each_variable_the_interval_that_select_chooses(two_speeds, tmp_path, suffice):
    assert suffice("select", two_speeds, "--json", tmp_path / "select.json").code == 0
    told = json.loads((tmp_path / "select.json").read_text())["variables"]
    chosen = {name: told[name]["chosen_interval"] for name in ("position.x", "position.y", "position.z")}
    short = [name for name, interval in chosen.items() if interval is None]
    answer = suffice("train", two_speeds, "--surrogate", "hermite", "-o", tmp_path / "model")
    assert (answer.code == 2) == bool(short)
    for name in short:
        assert f"{name} (best K_f" in answer.err
    assert suffice("train", two_speeds, "--surrogate", "hermite", "--finest", "-o", tmp_path / "model").code == 0
    for name, part in read_combined_card(tmp_path / "model")["parts"].items():
        assert part["interval"] == (chosen[name] or 0.002)
        assert part["n_modes"] == max(part["n_c"], part["n_lr"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--surrogate", "hermite", "--max-error", "1e-12m"), "cannot keep it down to Δτ = 2 ms; the closest errs by"),
        (("--surrogate", "linear", "--max-error", "0.05d"), "velocity.x is in m/s and no limit is; add one such as"),
        (("--surrogate", "hermite", "--max-error", "0.05d,3K"), "no variable is in K"),
        (("--surrogate", "hermite", "--max-error", "0.05d,1e-4"), "a limit in m is given already"),
        (("--surrogate", "hermite", "--max-error", "-1m"), "must be a positive number"),
        (("--surrogate", "hermite", "--max-error", "d"), "not an error"),
        (("--surrogate", "hermite", "--max-error", "0.05d", "--finest"), "give one of them"),
        (("--surrogate", "hermite", "--modes", "3"), "each variable gets its own number"),
        (("--surrogate", "mlp", "--max-error", "0.05d"), "is not known without training it; use rbf"),
        (("--surrogate", "hermite", "--max-error", "0.05d", "--interval", "0.001"), "leaves no snapshot to predict"),
        (("--surrogate", "hermite", "--variable", "position", "--variable", "position.x"), "give one of them"),
        (("--surrogate", "hermite", "--variable", "position.w"), "has no variable 'position.w'"),
        (("--surrogate", "hermite", "--resume", "--finest"), "--resume: no training stands in"),
    ],
)
def test_what_cannot_be_combined_is_refused_and_nothing_written(two_speeds, tmp_path, suffice, options, says):
    answer = suffice("train", two_speeds, *options, "-o", tmp_path / "model")
    assert answer.code == 2, answer.err
    assert says in answer.err.replace("\n", " ")
    assert not (tmp_path / "model").exists()
