"""Kills, Ctrl-C, full disks, files that vanish, a clock that jumps: nothing that was told is lost."""

import errno
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from safetensors import SafetensorError

from suffice import model
from suffice.rows import Variable
from suffice.run import Run
from suffice.store import RunWriter

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
COMMANDS = ("simulate", "import", "decompose", "train", "combine", "study")


def harness(name, *words):
    """Run a harness in its short form and return its lines; it fails where anything was lost."""
    done = subprocess.run([sys.executable, BENCHMARKS / name, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.physics
def test_what_a_killed_interrupted_or_full_disk_leaves_is_whole_and_the_command_ends_as_if_let_alone():
    told = harness("faults.py", "--kills", "1", "--changes", "3", "--interrupts", "1", "--seed", "2")
    killed = {line["command"]: line for line in told if line["fault"] == "SIGKILL before a change"}
    assert tuple(killed) == COMMANDS
    assert all(line["hit"] == line["tried"] == 3 for line in killed.values())  # moments may miss, changes do not
    refused = {line["command"]: line["hit"] for line in told if line["fault"] == "read-only folder"}
    assert refused == dict.fromkeys(COMMANDS, 1)


@pytest.mark.physics
def test_broken_and_hostile_files_are_answered_by_one_message_in_bounded_memory():
    told = harness("hostile.py", "--mutants", "10", "--seed", "2")
    assert len(told) == 23  # kinds
    assert all(line["memory_mb"] < 1000 for line in told)
    # the mutants are no better than they should be; of the results of a study many change what only the page shows
    assert all(line["codes"].get("2", 0) >= 2 for line in told if line["kind"] not in ("results", "omissions"))


def simulated(suffice, folder, scene):
    (folder / "scene.toml").write_text(scene)
    return suffice("simulate", folder / "scene.toml", "-o", folder / "run.h5", "--threads", 1)


def motion(path):
    with Run(path) as run:
        return run.times, run.variable("position")[:], run.variable("velocity")[:]


def test_a_clock_that_jumps_back_changes_no_bit_of_a_run(suffice, beads, tmp_path, monkeypatch):
    for name in ("even", "jumping"):
        (tmp_path / name).mkdir()
    assert simulated(suffice, tmp_path / "even", beads).code == 0
    hours = iter(range(10**9, 0, -3600))
    monkeypatch.setattr(time, "time", lambda: float(next(hours)))
    assert simulated(suffice, tmp_path / "jumping", beads).code == 0
    for even, jumping in zip(*(motion(tmp_path / name / "run.h5") for name in ("even", "jumping")), strict=True):
        assert np.array_equal(even, jumping)


@pytest.mark.parametrize("what", ["file", "folder"])
def test_an_output_that_vanishes_during_a_run_is_told_in_one_message(suffice, beads, tmp_path, monkeypatch, what):
    folder = tmp_path / "made"
    folder.mkdir()
    append = RunWriter.append

    def losing(self, *values):
        append(self, *values)
        if self.n_complete == 3:
            for path in folder.iterdir():
                path.unlink()
            if what == "folder":
                folder.rmdir()

    monkeypatch.setattr(RunWriter, "append", losing)
    (tmp_path / "scene.toml").write_text(beads)
    answer = suffice("simulate", tmp_path / "scene.toml", "-o", folder / "run.h5", "--threads", 1)
    assert answer.code in (1, 2)
    assert answer.err.count("suffice: ") == 1
    assert "made/run." in answer.err
    assert "Traceback" not in answer.err


def test_an_output_under_a_file_is_refused_before_anything_is_computed(suffice, beads, tmp_path):
    (tmp_path / "scene.toml").write_text(beads)
    for words in (("simulate", tmp_path / "scene.toml"), ("import", tmp_path / "scene.toml")):
        answer = suffice(*words, "-o", tmp_path / "scene.toml" / "run.h5")
        assert answer.code == 2
        assert "suffice: refused: " in answer.err
    assert (tmp_path / "scene.toml").read_text() == beads


SELECT = "select {run} --json - --intervals 0.004,0.002"
READING = {
    "select": SELECT,
    "decompose": "decompose {run} --variable position -o {out} --json -",
    "train": "train {run} --variable position.x --variable position.y --interval 0.002 --surrogate spline "
    "-o {out} --json -",
}


def harmed(monkeypatch, harm):
    """Harm the source when its second block of rows is read: one has been read from what stood there before."""
    read, count = Variable.__getitem__, []

    def harming(self, rows):
        count.append(rows)
        if len(count) == 2:
            harm()
        return read(self, rows)

    monkeypatch.setattr(Variable, "__getitem__", harming)
    return count


def answered(suffice, command, run, out):
    answer = suffice(*READING[command].format(run=run, out=out).split())
    told = json.loads(answer.out) if answer.code == 0 else {}
    return answer, {name: told[name] for name in ("variables", "n_modes", "energy_held", "parts") if name in told}


@pytest.mark.parametrize("how", ["deleted", "replaced", "growing", "cut"])
@pytest.mark.parametrize("command", READING)
def test_a_source_that_changes_while_it_is_read_is_read_as_it_was_or_refused(
    suffice, write_run, tmp_path, monkeypatch, command, how
):
    run, out = write_run(tmp_path / "run.h5"), tmp_path / "out"
    other = write_run(tmp_path / "other.h5", radius=1e-3)
    if how == "growing":
        grown = run.read_bytes()
        with RunWriter.resume(run, 33):
            pass
    _, alone = answered(suffice, command, run, tmp_path / "alone")
    assert alone

    def grow():  # as another process does: room for all snapshots has been made before the first
        with run.open("r+b") as file:
            file.write(grown)

    harms = {
        "deleted": run.unlink,
        "replaced": lambda: other.replace(run),
        "growing": grow,
        "cut": lambda: os.truncate(run, run.stat().st_size // 3),
    }
    count = harmed(monkeypatch, harms[how])
    answer, told = answered(suffice, command, run, out)
    assert len(count) >= 2
    if how == "cut":
        assert answer.code == 2
        assert answer.err.count("suffice: refused: ") == 1
        assert "run.h5 was cut while it was read" in answer.err.replace("\n", " ")
        assert not list(tmp_path.glob("out*/**/model.json"))
    else:
        assert (answer.code, told) == (0, alone), answer.err


def test_a_training_is_not_resumed_on_another_run_of_the_same_name(suffice, write_run, tmp_path, monkeypatch):
    run, out = write_run(tmp_path / "run.h5"), tmp_path / "out"
    words = READING["train"].format(run=run, out=out).split()

    def stop():
        raise KeyboardInterrupt

    harmed(monkeypatch, stop)
    assert suffice(*words).code == 130
    with Run(run) as old:
        stood = old.digest()
    write_run(run, radius=1e-3, n_snapshots=41, interval=0.00101)
    answer = suffice(*words, "--resume")
    assert answer.code == 2
    assert f"was begun with {stood}" in answer.err.replace("\n", "")


def test_a_full_disk_does_not_cost_the_model_that_stood(suffice, write_run, tmp_path, monkeypatch):
    run, out = write_run(tmp_path / "run.h5"), tmp_path / "out"
    words = f"train {run} --variable position --interval 0.002 --surrogate spline -o {out}".split()
    assert suffice(*words).code == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def full(*_):
        raise SafetensorError("I/O error: No space left on device (os error 28)")

    monkeypatch.setattr(model, "save_file", full)
    answer = suffice(*words)
    assert answer.code == 2
    assert "No space left on device" in answer.err.replace("\n", " ")
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_basis_that_does_not_fit_on_the_disk_is_refused_before_hdf5_begins(suffice, write_run, tmp_path, monkeypatch):
    run, out = write_run(tmp_path / "run.h5"), tmp_path / "out"
    words = f"decompose {run} --variable position -o {out}".split()
    assert suffice(*words).code == 0
    before, asked = out.read_bytes(), []

    def full(_handle, _offset, size):
        asked.append(size)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    answer = suffice(*words)
    assert answer.code == 2
    assert "No space left on device" in answer.err.replace("\n", " ")
    assert asked[0] >= len(before)
    assert out.read_bytes() == before
    assert not out.with_name("out.part").exists()
