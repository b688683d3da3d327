"""From a run to a basis on disk and back."""

import json

import h5py
import numpy as np
import pytest

from pod import InputError, lanczos_pod
from suffice.basis_file import ARRAYS, read_card
from suffice.decomposing import Wanted, decompose_run
from suffice.progress import Reporter
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import select_run
from suffice.store import RunWriter


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
    card = decompose_run(source, tmp_path / "basis.h5", Wanted("position", energy=0.99))
    W, basis = matrix(source, "position"), stored(tmp_path / "basis.h5")
    assert basis["modes"].shape == (card["n_rows"], card["n_modes"]) == (72, card["n_modes"])
    motion = W - basis["mean"][:, None]
    kept = basis["modes"].T @ motion
    assert (kept**2).sum() / (motion**2).sum() == pytest.approx(card["energy_held"], rel=1e-10)
    assert card["energy_held"] >= 0.99
    assert np.abs(basis["modes"].T @ basis["modes"] - np.eye(card["n_modes"])).max() < 1e-12


@pytest.mark.parametrize(("route", "energy"), [("svd", 0.999), ("gram", None)])
def test_the_papers_least_reconstructable_mode_is_the_one_that_select_finds(write_run, tmp_path, route, energy):
    source = write_run(tmp_path / "fast.h5", n_snapshots=61, n=101, interval=0.1)  # motion of full rank
    card = decompose_run(source, tmp_path / "b.h5", Wanted("velocity.x", interval=0.2, energy=energy, route=route))
    with Run(source) as run:
        (candidate,) = select_run(run, ["velocity.x"], [0.2])["velocity.x"].candidates
    assert candidate.n_lr_paper < candidate.n_lr
    assert (card["n_lr_paper"], card["n_lr"]) == (candidate.n_lr_paper, candidate.n_lr)
    assert card["n_lr_ritz"] == card["n_lr"]  # all are known, so the sum of those known is exact


@pytest.mark.parametrize("options", [{}, {"velocities": True, "interval": 0.002}, {"route": "block", "modes": 2}])
def test_progress_counts_rows_up_to_the_last_of_whole_passes_and_changes_nothing(source, tmp_path, capsys, options):
    wanted = Wanted("position", **options)
    card = decompose_run(source, tmp_path / "shown.h5", wanted, reporter=Reporter(as_json=True))
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    passes = lines[-1]["all"] / card["n_rows"]
    assert lines[-1]["done"] == lines[-1]["all"]
    assert passes == 2 if "route" not in options else passes > 2
    assert all(line["done"] <= line["all"] for line in lines)
    decompose_run(source, tmp_path / "silent.h5", wanted)
    for name, values in stored(tmp_path / "shown.h5").items():
        assert (values == stored(tmp_path / "silent.h5")[name]).all(), name


def test_the_least_mode_of_a_field_holds_the_energy_that_select_asks_of_fields(tmp_path):
    times, shapes = 0.001 * np.arange(60), np.random.default_rng(0).standard_normal((4 * 5 * 6, 8))
    motion = shapes @ (0.5 ** np.arange(8)[:, None] * np.sin(70.0 * np.arange(1, 9)[:, None] * times))
    none = {"ids": np.zeros(0, int), "radius": np.zeros(0), "species": np.zeros(0, int), "provenance": {}}
    grid = Grid((4, 5, 6), (0.0, 0.0, 0.0), (1e-3, 1e-3, 1e-3))
    source = tmp_path / "run.h5"
    with RunWriter(source, **none, n_snapshots=60, variables=("fluid.pressure",), grid=grid) as run:
        for k, time in enumerate(times):
            run.append(time, {"fluid.pressure": motion[:, k].reshape(4, 5, 6)})
    card = decompose_run(source, tmp_path / "b.h5", Wanted("fluid.pressure", interval=0.002))
    with Run(source) as run:
        (candidate,) = select_run(run, ["fluid.pressure"], [0.002])["fluid.pressure"].candidates
    assert card["n_lr"] == candidate.n_lr < card["n_modes"]  # modes are kept up to 0.999 of the energy
    assert (card["thresholds"], card["energy_held"] >= 0.999) == ({"energy": 0.99}, True)


def test_only_the_snapshots_of_the_interval_are_used(source, tmp_path):
    card = decompose_run(source, tmp_path / "basis.h5", Wanted("velocity.x", interval=0.004, modes=3))
    assert (card["n_snapshots"], card["n_modes"], card["interval"]) == (11, 3, pytest.approx(0.004))
    own = lanczos_pod(matrix(source, "velocity.x")[:, ::4], modes=3)
    basis = stored(tmp_path / "basis.h5")
    assert np.abs(basis["values"] - own.values).max() < 1e-12 * own.values[0]
    assert np.abs(basis["modes"] - own.modes).max() < 1e-9


def test_no_snapshot_is_further_off_than_the_tolerance(source, tmp_path):
    decompose_run(source, tmp_path / "basis.h5", Wanted("position.z", tolerance=0.05))
    W, basis = matrix(source, "position.z"), stored(tmp_path / "basis.h5")
    motion = W - basis["mean"][:, None]
    rest = motion - basis["modes"] @ (basis["modes"].T @ motion)
    assert np.sqrt((rest**2).mean(axis=0)).max() <= 0.05


def test_the_card_says_what_made_the_basis_and_info_shows_it(source, tmp_path, suffice):
    path = tmp_path / "basis.h5"
    card = decompose_run(source, path, Wanted("position.x", modes=2))
    assert read_card(path) == card
    assert (card["run"], card["variable"], card["unit"]) == (str(source), "position.x", "m")
    assert json.loads(suffice("info", path, "--json", "-").out) == card
    shown = suffice("info", path)
    assert "energy_held" in shown.out
    assert shown.code == 0
    assert read_card(source) is None


def test_a_basis_is_replaced_by_another(source, tmp_path):
    for modes in (2, 3):
        decompose_run(source, tmp_path / "basis.h5", Wanted("position.x", modes=modes))
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
        decompose_run(source, tmp_path / "basis.h5", Wanted(**({"variable": "position.x"} | settings)))
    assert not list(tmp_path.glob("basis*"))


def test_a_variable_that_does_not_move_is_refused(tmp_path, write_run):
    path = write_run(tmp_path / "run.h5")
    with h5py.File(path, "r+") as file:
        file["particles/position"][:, 1] = 0.5
    with pytest.raises(InputError, match="nothing moves"):
        decompose_run(path, tmp_path / "basis.h5", Wanted("position.y"))


def test_snapshots_are_appended_to_the_inner_products_that_stand_in_the_basis(source, tmp_path, suffice):
    output = tmp_path / "basis.h5"
    common = ("--variable", "position", "--modes", 4, "-o", output, "--append", "--json", "-")
    first = json.loads(suffice("decompose", source, *common).out)
    assert first["snapshots_known"] == 0
    known = h5py.File(output)["gram"][()]
    with h5py.File(output, "r+") as file:  # as if the run had been 30 snapshots long then
        del file["gram"]
        file["gram"] = known[:30, :30]
    again = json.loads(suffice("decompose", source, *common).out)
    assert again["snapshots_known"] == 30
    own, appended = lanczos_pod(matrix(source, "position"), modes=4), stored(output)
    assert np.abs(appended["values"] - own.values).max() < 1e-12 * own.values[0]
    assert np.abs(appended["modes"] - own.modes).max() < 1e-9
    other = suffice("decompose", source, "--variable", "velocity", "-o", output, "--append")
    assert other.code == 2
    assert "was made with variable position, now it is velocity" in other.err


def test_nothing_is_appended_to_a_basis_of_another_run_that_had_the_same_name(source, write_run, tmp_path, suffice):
    output = tmp_path / "basis.h5"
    common = ("decompose", source, "--variable", "position", "-o", output, "--append", "--json", "-")
    assert suffice(*common).code == 0
    with h5py.File(output, "r+") as file:  # as if everything had moved 1 % farther then
        file["gram"][...] *= 1.01**2
    before = output.read_bytes()
    other = suffice(*common)
    assert other.code == 2
    assert "inner products of other snapshots" in other.err
    assert "leave --append out" in other.err
    write_run(source, n_snapshots=30)
    shorter = suffice(*common)
    assert shorter.code == 2
    assert f"was made of 41 snapshots, {source} has 30" in shorter.err
    assert output.read_bytes() == before


def test_positions_are_enriched_by_velocities_where_that_errs_less(source, tmp_path, suffice):
    output = tmp_path / "basis.h5"
    answer = suffice(
        "decompose", source, "--variable", "position", "--velocities", "--interval", "0.008", "--modes", 9,
        "-o", output, "--json", "-",
    )  # fmt: skip
    card = json.loads(answer.out)
    errors = card["held_out_rmse"]
    assert min(errors, key=errors.get) == f"{card['velocity_weight']:g}"
    assert errors["0"] >= errors[f"{card['velocity_weight']:g}"]
    assert stored(output)["modes"].shape == (72, card["n_modes"])
    assert 4 < card["n_modes"] <= 9
    for arguments in (["--variable", "velocity"], ["--variable", "position"]):
        refused = suffice("decompose", source, *arguments, "--velocities", "-o", output)
        assert refused.code == 2
        assert "enriches a position at a coarser --interval" in refused.err


def test_the_convergence_of_the_lanczos_process_is_drawn(source, tmp_path, suffice):
    page = tmp_path / "lanczos.html"
    answer = suffice("decompose", source, "--variable", "position", "-o", tmp_path / "b.h5", "--plot", page)
    assert answer.code == 0, answer.err
    text = page.read_text()
    assert "Convergence of the Lanczos process" in text
    assert "of all Ritz values, the paper" in text


def test_the_route_can_be_asked_for(source, tmp_path, suffice):
    common = ("decompose", source, "--variable", "position", "--modes", 4, "-o", tmp_path / "b.h5", "--json", "-")
    for route in ("gram", "block", "svd"):
        card = json.loads(suffice(*common, "--route", route).out)
        assert (card["route"], card["route_reason"]) == (route, "asked for")
        assert card["orthogonality"] < 1e-12
    assert suffice(*common, "--route", "fast").code == 2
