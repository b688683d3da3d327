"""Files that would mislead, found by the mutants of benchmarks/hostile.py or thought of: one message each."""

import json
import re

import h5py
import numpy as np
import pytest

from sim import InputError, parse_scene, simulation_of
from suffice.basis_file import read_card, read_gram
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.study import load_study


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
