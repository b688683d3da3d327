import h5py
import numpy as np
import pytest

from suffice.refusal import Refusal
from suffice.store import Run, RunWriter

N, STEPS = 30, 12


def write(path):
    particles = {"ids": np.arange(N), "radius": np.full(N, 5e-4), "species": np.ones(N, int)}
    motion = {"position": np.ones((N, 3)), "velocity": np.ones((N, 3))}
    with RunWriter(path, **particles, n_snapshots=STEPS, variables=tuple(motion), provenance={"scene": "x"}) as run:
        for k in range(STEPS):
            run.append(0.001 * k, motion)
    return path


def test_what_is_no_run_is_refused(tmp_path):
    (tmp_path / "text.h5").write_text("no")
    (tmp_path / "empty.h5").touch()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    for name, says in [
        ("missing.h5", "missing"),
        (".", "folder"),
        ("text.h5", "cannot be opened"),
        ("empty.h5", "cannot be opened"),
        ("other.h5", "not a run"),
    ]:
        with pytest.raises(Refusal, match=says):
            Run(tmp_path / name)


def test_a_run_of_other_shapes_than_it_says_is_refused(tmp_path):
    damage = {
        "particles/radius": np.zeros(N + 1),
        "particles/velocity": np.zeros((N * STEPS, 2)),
        "suffice/complete": STEPS + 1,
        "suffice/time": np.zeros(STEPS),
    }
    for name, value in damage.items():
        path = write(tmp_path / "run.h5")
        with h5py.File(path, "r+") as file:
            del file[name]
            file[name] = value
        with pytest.raises(Refusal, match="damaged"):
            Run(path)


def test_a_run_that_lacks_a_dataset_is_refused(tmp_path):
    for name in ("particles/id", "suffice/time", "suffice/complete", "suffice"):
        path = write(tmp_path / "run.h5")
        with h5py.File(path, "r+") as file:
            del file[name]
        with pytest.raises(Refusal, match=r"damaged|not a run"):
            Run(path)


def test_a_run_that_leads_out_of_its_file_is_refused(tmp_path):
    secret = write(tmp_path / "secret.h5")
    virtual = h5py.VirtualLayout((N * STEPS, 3), np.float32)
    virtual[:] = h5py.VirtualSource(secret, "particles/position", (N * STEPS, 3))
    raw = tmp_path / "raw"
    raw.write_bytes(b"\0" * N * STEPS * 12)

    def link(file):
        file["particles/position"] = h5py.ExternalLink("secret.h5", "particles/position")

    def group(file):
        del file["particles"]
        file["particles"] = h5py.ExternalLink("secret.h5", "particles")

    def soft(file):
        file["particles/position"] = h5py.SoftLink("/particles/velocity")

    def virtually(file):
        file.create_virtual_dataset("particles/position", virtual)

    def stored_outside(file):
        file.create_dataset("particles/position", (N * STEPS, 3), np.float32, external=[(raw, 0, h5py.h5f.UNLIMITED)])

    for lead_out in (link, group, soft, virtually, stored_outside):
        path = write(tmp_path / "run.h5")
        with h5py.File(path, "r+") as file:
            del file["particles/position"]
            lead_out(file)
        with pytest.raises(Refusal, match=r"is a link|lies in another file"):
            Run(path)


def test_a_file_that_was_not_copied_whole_is_refused_wherever_it_is_cut(tmp_path):
    whole = write(tmp_path / "whole.h5").read_bytes()
    path = tmp_path / "run.h5"
    for length in np.linspace(1, len(whole) - 1, 40).astype(int):
        path.write_bytes(whole[:length])
        with pytest.raises(Refusal, match=r"cannot be opened as a run .* copied whole"):
            Run(path)


def test_a_run_of_a_newer_layout_or_of_other_types_is_refused(tmp_path):
    for name, value, says in [
        ("suffice/layout", 99, "layout version 99, newer"),
        ("particles/radius", ["a"] * N, "neither numbers nor plain text"),
    ]:
        path = write(tmp_path / "run.h5")
        with h5py.File(path, "r+") as file:
            del file[name]
            file[name] = value
        with pytest.raises(Refusal, match=says):
            Run(path)
