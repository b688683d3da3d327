"""Kills, Ctrl-C, full disks, files that vanish, a clock that jumps: nothing that was told is lost."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

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
    told = harness("faults.py", "--kills", "3", "--interrupts", "2", "--seed", "2")
    killed = {line["command"]: line for line in told if line["fault"] == "SIGKILL"}
    assert tuple(killed) == COMMANDS
    assert sum(line["hit"] for line in killed.values()) >= 6  # of eighteen: a busy machine makes moments miss


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
