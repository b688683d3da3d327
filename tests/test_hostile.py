"""Files that would mislead, found by the mutants of benchmarks/hostile.py or thought of: one message each."""

import json
import os
import re
import signal

import h5py
import numpy as np
import pytest
import torch

from sim import InputError, parse_scene, simulation_of
from suffice.basis_file import read_card, read_gram
from suffice.checkpoint import checkpoint_path, read_checkpoint
from suffice.checkpoint_check import check_state
from suffice.door import write_json
from suffice.logbook import Logbook
from suffice.model import read_card as read_model
from suffice.omissions_section import _observables, terms_figure
from suffice.readers import import_run, vtk_process
from suffice.readers.foam_folders import FoamFolders
from suffice.recording import Recorder
from suffice.refusal import Refusal
from suffice.results import read_json
from suffice.run import Run
from suffice.study import load_study, read_log
from surrogates import InputError as UnfitTraining
from surrogates.training_state import DECISIVE, Facts, State, read_state, write_state


@pytest.fixture
def basis(suffice, write_run, tmp_path):
    path = tmp_path / "basis.h5"
    made = suffice("decompose", write_run(tmp_path / "run.h5"), "--variable", "position.x", "--append", "-o", path)
    assert made.code == 0
    return path


def replace(path, name, put):
    with h5py.File(path, "r+") as file:
        del file[name]
        put(file)


@pytest.mark.parametrize("chunks", [None, (4096,)], ids=["never written", "in chunks"])
def test_a_run_that_declares_more_than_its_file_holds_is_refused_before_memory_is_taken(write_run, tmp_path, chunks):
    path = write_run(tmp_path / "run.h5")
    replace(path, "particles/id", lambda f: f.create_dataset("particles/id", (10**12,), np.int64, chunks=chunks))
    with pytest.raises(Refusal, match=r"particles/id declares \(1000000000000,\) numbers, of which 0 bytes are in the"):
        Run(path)


def test_a_run_whose_numbers_are_packed_says_how_to_unpack_them(write_run, tmp_path):
    path = write_run(tmp_path / "run.h5")
    zeros = np.zeros((24 * 41, 3), np.float32)
    replace(path, "particles/position", lambda f: f.create_dataset("particles/position", data=zeros, compression=9))
    with pytest.raises(Refusal, match="unpack it with `h5repack -f NONE`"):
        Run(path)


@pytest.mark.parametrize(
    ("name", "put", "says"),
    [
        ("suffice/card", lambda f: f.update({"suffice/card": h5py.ExternalLink("other.h5", "x")}), "is a link"),
        ("gram", lambda f: f.update({"gram": h5py.ExternalLink("other.h5", "x")}), "is a link"),
        ("gram", lambda f: f.create_dataset("gram", (10**6, 10**6), float), "declares"),
        ("gram", lambda f: f.update({"gram": np.zeros((3, 4))}), "no square"),
        ("gram", lambda f: f.update({"gram": np.full((3, 3), np.nan)}), "of finite numbers"),
        ("suffice/card", lambda f: f.update({"suffice/card": np.bytes_(b"[" * 100000)}), "damaged"),
        ("suffice/card", lambda f: f.update({"suffice/card": np.bytes_(b"[]")}), "no object of JSON"),
    ],
)
def test_a_basis_that_leads_out_of_its_file_or_makes_no_sense_is_refused(basis, name, put, says):
    replace(basis, name, put)
    with pytest.raises(Refusal, match=says):
        (read_gram if name == "gram" else read_card)(basis)


def test_a_card_that_is_a_device_is_no_card(suffice, tmp_path):
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "model.json").symlink_to("/dev/zero")
    answer = suffice("predict", tmp_path / "model", "--times", "0.001", "-o", tmp_path / "made.h5")
    assert answer.code == 2
    assert "holds no model" in answer.err


def test_weights_that_are_a_pipe_are_refused_and_not_waited_for(suffice, write_run, tmp_path):
    words = ("--variable", "position.x", "--interval", "0.002", "--surrogate", "spline", "-o", tmp_path / "model")
    assert suffice("train", write_run(tmp_path / "run.h5"), *words).code == 0
    (tmp_path / "model" / "model.safetensors").unlink()
    os.mkfifo(tmp_path / "model" / "model.safetensors")
    answer = suffice("predict", tmp_path / "model", "--times", "0.001", "-o", tmp_path / "made.h5")
    assert answer.code == 2
    assert "is missing or no file" in answer.err


@pytest.mark.parametrize(
    "text", ["seed = " + "9" * 5000, "seed = " + "[" * 3000 + "]" * 3000], ids=["digits", "nested"]
)
def test_toml_beyond_what_python_reads_is_refused_as_toml_that_is_none(tmp_path, text):
    with pytest.raises(InputError, match="not valid TOML"):
        parse_scene(text)
    (tmp_path / "my.toml").write_text(text)
    with pytest.raises(Refusal, match="not valid TOML"):
        load_study(str(tmp_path / "my.toml"))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("diameter = 2e-3", "diameter = 1e-300", "diameter = 1e-300: beyond 1e-40 to 1e+40"),
        ("diameter = 2e-3", "diameter = 1e300", "diameter = 1e+300: beyond"),
        ("[0.008, 0.008, 0.012]", "[1e300, 0.008, 0.012]", "highest = 1e+300: beyond"),
        ("count = 12", "count = 10000000000", "1e+10 of them take 4e+03 GB at least, and this machine has"),
        ("stiffness = 1e3 ", "stiffness = 1e39", "steps of .* which nobody can count; soften the contact"),
    ],
)
def test_numbers_that_no_machine_can_compute_with_are_refused_with_field_and_value(beads, old, new, says):
    assert old in beads
    with pytest.raises(InputError, match=says.replace("+", re.escape("+"))):
        simulation_of(parse_scene(beads.replace(old, new)))


def test_more_cells_than_memory_are_refused_before_they_are_made():
    fluid = {"density": 1e3, "viscosity": 1e-3, "lowest": [0, 0, 0], "highest": [1, 1, 1], "cells": [10**6] * 3}
    lines = "\n".join(f"{name} = {json.dumps(value)}" for name, value in fluid.items())
    with pytest.raises(InputError, match=r"fluid\.cells: 1e\+18 of them take 5.5e\+11 GB at least"):
        simulation_of(parse_scene(f"time = {{ duration = 1.0 }}\noutput = {{ interval = 0.1 }}\n[fluid]\n{lines}"))


@pytest.fixture
def begun(suffice, beads, tmp_path, monkeypatch):
    """A run that was interrupted after five snapshots, and the state beside it."""
    advance, calls = Recorder.advance, []

    def interrupted(self):
        calls.append(advance(self))
        if len(calls) == 5:
            os.kill(os.getpid(), signal.SIGINT)

    (tmp_path / "scene.toml").write_text(beads)
    with monkeypatch.context() as patch:
        patch.setattr(Recorder, "advance", interrupted)
        stopped = suffice("simulate", tmp_path / "scene.toml", "-o", tmp_path / "run.h5", "--threads", 1)
    assert stopped.code == 130
    return checkpoint_path(tmp_path / "run.h5")


def test_a_checkpoint_whose_lists_would_lead_a_compiled_loop_astray_is_refused(beads, begun):
    simulation, state = simulation_of(parse_scene(beads)), read_checkpoint(begun.with_suffix(""))
    check_state(simulation, state)  # as it was written
    pairs, near = len(state["listed.partner"]), len(state["near.surface"])
    wrong = {
        "listed.partner": [12],
        "listed.owner": [2**31],
        "listed.first": [-1],
        "listed.last": [pairs + 1],
        "listed.boxes": [1],
        "near.last": [near + 1],
        "near.surface": [6],
        "particles.id": [99],
        "particles.radius": [1.0],
        "particles.position": [np.nan],
        "particles.velocity": [1e200],  # its square would be infinite
        "step": [10**12],
        "record.seen": [-1],
    }
    for name, values in wrong.items():
        broken = np.array(state[name])
        broken.reshape(-1)[: len(values)] = values
        with pytest.raises(ValueError, match=name.replace(".", r"\.")):
            check_state(simulation, {**state, name: broken})
    for name in ("listed.touching", "near.touching", "spring", "particles.velocity", "wall_spring"):
        with pytest.raises(ValueError, match=r"differ in length|is float64 of shape"):
            check_state(simulation, {**state, name: state[name][:-1]})
    with pytest.raises(ValueError, match="is float32"):
        check_state(simulation, {**state, "seen": state["seen"].astype(np.float32)})


def test_a_logbook_that_could_not_be_told_is_refused(begun):
    state = read_checkpoint(begun.with_suffix(""))
    Logbook().restore_(state)  # as it was written
    wrong = {"seconds": [np.nan, np.inf, 1e300], "put_in": [np.inf], "start": [-1e200], "largest": [np.nan]}
    for name, values in wrong.items():
        for value in values:
            with pytest.raises(ValueError, match=f"logbook.{name} is "):
                Logbook().restore_({**state, f"logbook.{name}": np.asarray(value)})
    for text in (b"[" * 100_000, b'{"a": [-1, "b"]}', b'{"a": [1, 2]}', b'{"a": ["1", "b"]}', b'{"a": 1}'):
        with pytest.raises(ValueError, match="validation error"):
            Logbook().restore_({**state, "logbook.warnings": np.asarray(np.bytes_(text))})


@pytest.mark.parametrize(
    ("put", "says"),
    [
        (lambda f: f.update({"seen": h5py.ExternalLink("run.h5", "particles/position")}), "is a link"),
        (lambda f: f.create_dataset("seen", (10**9, 12), float), "declares"),
        (lambda f: f.update({"seen": np.zeros((11, 12))}), "seen is float64 of shape"),
    ],
)
def test_a_checkpoint_that_leads_elsewhere_or_does_not_fit_is_refused_by_name(suffice, begun, tmp_path, put, says):
    replace(begun, "seen", put)
    answer = suffice("simulate", tmp_path / "scene.toml", "-o", tmp_path / "run.h5", "--threads", 1, "--resume")
    assert answer.code == 2
    assert "checkpoint" in answer.err
    assert says in answer.err


def test_a_pipe_in_the_place_of_a_file_is_refused_and_not_waited_for(suffice, tmp_path):
    pipe = tmp_path / "beads_1.vtu"
    os.mkfifo(pipe)
    for name in ("results.json", "run.h5.checkpoint", "training.safetensors"):
        os.mkfifo(tmp_path / name)
    for format in ("vtk", "hdf5", "npz", "lammps"):
        answer = suffice("import", pipe, "--format", format, "-o", tmp_path / "made.h5")
        assert answer.code == 2
        assert "neither a file nor a folder" in answer.err
    with pytest.raises(Refusal, match="no file"):
        read_json(tmp_path / "results.json")
    with pytest.raises(Refusal, match="cannot be written"):
        write_json({}, str(tmp_path / "results.json"))
    with pytest.raises(Refusal, match="no file"):
        read_checkpoint(tmp_path / "run.h5")
    with pytest.raises(UnfitTraining, match="no file"):
        read_state(tmp_path)


def test_half_a_character_in_stored_results_is_refused_before_it_is_shown(tmp_path):
    (tmp_path / "stages.json").write_text('{"simulate": {"detail": "\\ud800"}}')
    with pytest.raises(Refusal, match="surrogates not allowed"):
        read_json(tmp_path / "stages.json")


def test_a_folder_among_vtk_files_is_refused(suffice, tmp_path):
    (tmp_path / "beads_1.vtk").write_text("# vtk DataFile Version 3.0\n")
    (tmp_path / "beads_2.vtk").mkdir()
    answer = suffice("import", *sorted(tmp_path.glob("*.vtk")), "-o", tmp_path / "made.h5")
    assert answer.code == 2
    assert "beads_2.vtk is missing or not a file" in answer.err


def test_vtk_that_turns_in_circles_is_ended_and_told_so(tmp_path, monkeypatch):
    pytest.importorskip("vtkmodules.vtkIOLegacy")
    monkeypatch.setattr(vtk_process, "SECONDS_OF_VTK", 1)
    os.mkfifo(tmp_path / "a.vtu")  # VTK waits for whoever writes to it
    with vtk_process.VtkProcess() as vtk, pytest.raises(Refusal, match="takes far longer than a file of this size"):
        vtk.read(tmp_path / "a.vtu", "UnstructuredGrid")


def test_a_case_of_openfoam_with_a_pipe_in_it_is_refused(tmp_path):
    (tmp_path / "0.1").mkdir()
    os.mkfifo(tmp_path / "0.1" / "U")
    with pytest.raises(Refusal, match=r"0\.1/U is no file"):
        FoamFolders(tmp_path, [tmp_path]).size_of(0.1)


def test_arrays_of_vtkhdf_that_are_groups_or_groups_that_are_arrays_are_refused(tmp_path):
    for name, put in (
        ("PointData", lambda f: f.update({"VTKHDF/PointData": np.zeros(3, np.uint8)})),
        ("Points", lambda f: f.create_group("VTKHDF/Points/x")),
    ):
        path = tmp_path / f"{name}.vtkhdf"
        with h5py.File(path, "w") as file:
            root = file.create_group("VTKHDF")
            root.attrs["Type"] = np.bytes_(b"PolyData")
            file["VTKHDF/NumberOfPoints"] = [3]
            if name != "PointData":
                file["VTKHDF/PointData/id"] = np.arange(3)
            put(file)
        with pytest.raises(Refusal, match=r"none is the id|no such dataset"):
            import_run(path, tmp_path / "made.h5", interval=1.0)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("compare.json", "[" * 100000, "cannot be read"),
        ("compare.json", '{"rows": 7}', "results that cannot be shown"),
        ("select.json", '{"curves": {}}', "results that cannot be shown"),
    ],
)
def test_results_of_a_study_that_something_else_wrote_are_refused(suffice, write_run, tmp_path, name, text, says):
    folder = tmp_path / "study"
    folder.mkdir()
    write_run(folder / "run.h5")
    (folder / name).write_text(text)
    answer = suffice("report", folder)
    assert answer.code == 2
    assert says in answer.err


@pytest.mark.parametrize("text", ['{"simulate": 3}', "[1]", '{"simulate": {"digest": ""}}'])
def test_a_log_of_stages_that_no_study_wrote_is_refused_with_the_remedy(tmp_path, text):
    (tmp_path / "stages.json").write_text(text)
    with pytest.raises(Refusal, match="is no list of stages as a study writes it; remove it"):
        read_log(tmp_path / "stages.json")


def test_the_state_of_a_training_that_counts_backwards_is_refused(tmp_path):
    weights = {"a": torch.zeros(1)}
    settings = dict.fromkeys(DECISIVE, 1.0)
    for steps, best, since in ((-1, -5, 0), (3, 9, 0), (3, 1, -2)):
        facts = Facts(steps, best, 0.1, since, 1.0)
        write_state(tmp_path, State(facts, settings, weights, weights, {}))
        with pytest.raises(UnfitTraining, match="is damaged"):
            read_state(tmp_path)


@pytest.mark.parametrize("change", [{"parts": {"position.x": 3}}, {"derived": 1.5}, {"limits": []}])
def test_a_card_of_a_combined_model_that_cannot_be_shown_is_refused(suffice, tmp_path, change):
    card = {"kind": "combined", "version": 1, "parts": {}, "derived": {}, "limits": {}} | change
    (tmp_path / "model.json").write_text(json.dumps(card))
    answer = suffice("info", tmp_path)
    assert answer.code == 2
    assert next(iter(change)) in answer.err


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
def test_a_card_with_what_is_no_number_is_no_card(tmp_path, number):
    (tmp_path / "model.json").write_text('{"kind": "model", "rmse": 1.0}')
    assert read_model(tmp_path / "model.json") == {"kind": "model", "rmse": 1.0}
    (tmp_path / "model.json").write_text('{"kind": "model", "rmse": ' + number + "}")
    assert read_model(tmp_path / "model.json") is None


def test_names_in_what_was_left_out_never_act_as_markup_on_the_page():
    evil = "<img src=x onerror=alert(1)>"
    cost = {"seconds": 1.0, "processor_seconds": 1.0, "particle_steps_per_second": 1e6, "seconds_of": {evil: 1.0}}
    row = cost | {"variant": evil, "left_out": evil, "refused": None, "relative_cost": 1.0, "differences": {}}
    known = {evil: {"unit": evil, "text": evil, "mean": 1.0, "floor": 0.1}}
    answer = {"reference": cost, "rows": [row], "observables": known}
    for text in (_observables(answer), json.dumps(terms_figure(answer))):
        assert "<img" not in text
        assert "&lt;img" in text
