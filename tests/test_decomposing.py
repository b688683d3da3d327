"""From a run to a basis on disk and back."""

import json

import h5py
import numpy as np
import pytest

from pod import InputError, lanczos_pod
from suffice.basis_file import ARRAYS, read_card
from suffice.decomposing import decompose_run
from suffice.refusal import Refusal
from suffice.run import Run


@pytest.fixture
def source(write_run, tmp_path):
    return write_run(tmp_path / "run.h5")


def matrix(source, variable):
    with Run(source) as run:
        rows = run.variable(variable)
        return np.asarray(rows[0 : rows.shape[0]], float)


def stored(path):
    with h5py.File(path) as file:
        return {name: file[name][()] for name in ARRAYS}


def test_the_basis_on_disk_reconstructs_the_run_to_the_energy_asked_for(source, tmp_path):
    card = decompose_run(source, tmp_path / "basis.h5", "position", energy=0.99)
    W, basis = matrix(source, "position"), stored(tmp_path / "basis.h5")
    assert basis["modes"].shape == (card["n_rows"], card["n_modes"]) == (72, card["n_modes"])
    motion = W - basis["mean"][:, None]
    kept = basis["modes"].T @ motion
    assert (kept**2).sum() / (motion**2).sum() == pytest.approx(card["energy_held"], rel=1e-10)
    assert card["energy_held"] >= 0.99
    assert np.abs(basis["modes"].T @ basis["modes"] - np.eye(card["n_modes"])).max() < 1e-12


def test_only_the_snapshots_of_the_interval_are_used(source, tmp_path):
    card = decompose_run(source, tmp_path / "basis.h5", "velocity.x", interval=0.004, modes=3)
    assert (card["n_snapshots"], card["n_modes"], card["interval"]) == (11, 3, pytest.approx(0.004))
    own = lanczos_pod(matrix(source, "velocity.x")[:, ::4], modes=3)
    basis = stored(tmp_path / "basis.h5")
    assert np.abs(basis["values"] - own.values).max() < 1e-12 * own.values[0]
    assert np.abs(basis["modes"] - own.modes).max() < 1e-9


def test_no_snapshot_is_further_off_than_the_tolerance(source, tmp_path):
    decompose_run(source, tmp_path / "basis.h5", "position.z", tolerance=0.05)
    W, basis = matrix(source, "position.z"), stored(tmp_path / "basis.h5")
    motion = W - basis["mean"][:, None]
    rest = motion - basis["modes"] @ (basis["modes"].T @ motion)
    assert np.sqrt((rest**2).mean(axis=0)).max() <= 0.05


def test_the_card_says_what_made_the_basis_and_info_shows_it(source, tmp_path, suffice):
    path = tmp_path / "basis.h5"
    card = decompose_run(source, path, "position.x", modes=2)
    assert read_card(path) == card
    assert (card["run"], card["variable"], card["unit"]) == (str(source), "position.x", "m")
    assert json.loads(suffice("info", path, "--json", "-").out) == card
    shown = suffice("info", path)
    assert "energy_held" in shown.out
    assert shown.code == 0
    assert read_card(source) is None


def test_a_basis_is_replaced_by_another(source, tmp_path):
    for modes in (2, 3):
        decompose_run(source, tmp_path / "basis.h5", "position.x", modes=modes)
        assert stored(tmp_path / "basis.h5")["modes"].shape[1] == modes
    assert sorted(path.name for path in tmp_path.iterdir()) == ["basis.h5", "run.h5", "run.particles.vtkhdf"]


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"variable": "position.w"}, "no variable 'position.w'; it has position.x"),
        ({"interval": 0.0015}, "0.0015 s is not a multiple of the dense interval 0.001 s"),
        ({"interval": 1.0}, "1 s is longer than the run"),
        ({"energy": 1.5}, "energy: 1.5; give a share above 0 and at most 1"),
        ({"modes": 0}, "modes: 0; give at least 1"),
        ({"tolerance": -1.0}, "tolerance: -1.0"),
        ({"modes": 2, "energy": 0.9}, "more than one is given; give one"),
    ],
)
def test_what_cannot_be_decomposed_is_refused_and_leaves_nothing(source, tmp_path, settings, says):
    with pytest.raises((Refusal, InputError), match=says):
        decompose_run(source, tmp_path / "basis.h5", **({"variable": "position.x"} | settings))
    assert not list(tmp_path.glob("basis*"))


def test_a_variable_that_does_not_move_is_refused(tmp_path, write_run):
    path = write_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file["particles/position"][:, 1] = 0.5
    with pytest.raises(InputError, match="nothing moves"):
        decompose_run(path, tmp_path / "basis.h5", "position.y")
