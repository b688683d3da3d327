"""Two processes at one output: the second is told, and nothing is mixed."""

import subprocess
import sys
import time

import pytest

from suffice.lock import only_writer
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
