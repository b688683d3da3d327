"""Two processes at one output: the second is told, and nothing is mixed."""

import errno
import fcntl
import os
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest

from suffice.lock import only_writer, only_writer_in
from suffice.refusal import Refusal

HOLD = """
import sys, time
from pathlib import Path
from suffice.lock import only_writer
with only_writer(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_a_second_writer_is_refused_until_the_first_is_gone_even_by_death(tmp_path, kind):
    path = tmp_path if kind == "folder" else tmp_path / "run.h5"
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE)
    try:
        assert holder.stdout.readline() == b"held\n"
        told = rf"is being written by another suffice \(process {holder.pid}\)"
        with pytest.raises(Refusal, match=told), only_writer(path):
            pass
    finally:
        holder.kill()
        holder.communicate()
    deadline = time.monotonic() + 10
    with only_writer(path):
        assert time.monotonic() < deadline
    assert [p.name for p in tmp_path.iterdir()] == []


def test_json_is_not_written_over_a_run(suffice, write_run, tmp_path):
    run = tmp_path / "run.h5"
    write_run(run)
    before = run.read_bytes()
    answer = suffice("info", str(run), "--json", str(run))
    assert answer.code == 2
    assert "is no JSON" in answer.err
    assert run.read_bytes() == before


WORDS = {
    "simulate": "simulate {folder}/scene.toml -o {out}",
    "import": "import {folder}/other.dump --interval 1 -o {out}",
    "decompose": "decompose {folder}/run.h5 --variable position -o {out}",
    "train": "train {folder}/run.h5 --variable position --interval 0.002 --surrogate spline -o {out}",
    "combine": "train {folder}/run.h5 --interval 0.002 --surrogate spline -o {out}",
    "predict": "predict {folder}/model --times 0:0.01:0.001 -o {out}",
    "study": "study mini -o {out}",
}


@pytest.fixture
def inputs(suffice, beads, write_run, tmp_path):
    write_run(tmp_path / "run.h5")
    (tmp_path / "scene.toml").write_text(beads)
    (tmp_path / "other.dump").write_text(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n"
        "ITEM: ATOMS id x y z\n1 0.5 0.5 0.5\n"
    )
    train = WORDS["train"].format(folder=tmp_path, out=tmp_path / "model")
    assert suffice(*train.split()).code == 0
    return tmp_path


@pytest.mark.parametrize("command", WORDS)
def test_a_second_command_at_the_same_output_is_told_and_changes_nothing(suffice, inputs, command):
    out = inputs / "out"
    with (only_writer_in if command in ("train", "combine", "study") else only_writer)(out):
        before = sorted(inputs.rglob("*"))
        answer = suffice(*WORDS[command].format(folder=inputs, out=out).split())
        assert (answer.code, answer.out) == (2, "")
        assert f"is being written by another suffice (process {os.getpid()})" in answer.err.replace("\n", " ")
        assert sorted(inputs.rglob("*")) == before
    assert not out.exists()


@pytest.mark.parametrize("command", sorted(WORDS.keys() - {"train", "combine", "study"}))
def test_an_output_that_is_a_pipe_or_a_device_is_refused_at_once_and_stays_one(suffice, inputs, command):
    os.mkfifo(inputs / "pipe")
    for out in (inputs / "pipe", "/dev/full"):
        answer = suffice(*WORDS[command].format(folder=inputs, out=out).split())
        assert answer.code == 2
        assert "exists and is not a" in answer.err.replace("\n", " ")
    assert (inputs / "pipe").is_fifo()


def test_a_lock_that_its_holder_has_removed_meanwhile_is_no_lock(tmp_path, monkeypatch):
    flock, place = fcntl.flock, tmp_path / ".run.h5.lock"

    def late(handle, how):
        monkeypatch.setattr(fcntl, "flock", flock)
        place.unlink()  # between our opening it and locking it, the first holder ends, and a third one begins
        stack.enter_context(only_writer(tmp_path / "run.h5"))
        return flock(handle, how)

    with ExitStack() as stack:
        monkeypatch.setattr(fcntl, "flock", late)
        with pytest.raises(Refusal, match="is being written by another"), only_writer(tmp_path / "run.h5"):
            pass


def test_a_file_system_without_locks_is_said_and_used(tmp_path, monkeypatch, capsys):
    def absent(_handle, _how):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(fcntl, "flock", absent)
    with only_writer(tmp_path / "run.h5"):
        pass
    assert "run.h5 cannot be locked ([Errno 38] Function not implemented); let no other" in capsys.readouterr().err
