"""Files whose groups lead HDF5 in circles are refused within bounded memory."""

import re
import resource
import shutil
import struct
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from suffice import hdf5_memory, layout
from suffice.basis_file import read_card, read_gram
from suffice.checkpoint import checkpoint_path, read_checkpoint
from suffice.hdf5_memory import bounded_memory, names_in, open_hdf5
from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import RunWriter, check_place

MIB = 1 << 20
NO_FREE_PLACE = 1


@pytest.fixture
def bound(monkeypatch):
    """Leave the reading of names 64 MiB, and check that they are given back and nothing more was taken."""
    monkeypatch.setattr(hdf5_memory, "MOST", 64 * MIB)
    limits = resource.getrlimit(resource.RLIMIT_AS)
    Path("/proc/self/clear_refs").write_text("5")  # the peak of resident memory begins anew
    before = peak()
    yield
    assert resource.getrlimit(resource.RLIMIT_AS) == limits
    assert peak() - before < 150 * MIB


def peak():
    """Return the largest resident memory, bytes."""
    return int(re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) * 1024


def make_circles(path, number=None):
    """Let a free place of every heap in an HDF5 file, or of one, be followed by itself; return how many there are."""
    content, circles = bytearray(path.read_bytes()), 0
    for k, found in enumerate(re.finditer(b"HEAP", bytes(content))):
        _, free, data = struct.unpack_from("<QQQ", content, found.start() + 8)
        if free != NO_FREE_PLACE and number in (None, k):
            struct.pack_into("<Q", content, data + free, free)
            circles += 1
    path.write_bytes(content)
    return circles


def hdf5_of(path, *names):
    with h5py.File(path, "w") as file:
        for name in names:
            file[name] = np.arange(3.0)
    assert make_circles(path)
    return path


@pytest.mark.usefixtures("bound")
def test_a_run_with_a_circle_is_refused(write_run, tmp_path):
    path = shutil.copy(write_run(tmp_path / "run.h5", n_snapshots=3), tmp_path / "circle.h5")
    assert make_circles(path)
    with pytest.raises(Refusal, match="damaged"):
        Run(path)


@pytest.mark.usefixtures("bound")
@pytest.mark.parametrize("read", [read_card, read_gram])
def test_a_basis_with_a_circle_is_refused(tmp_path, read):
    with pytest.raises(Refusal, match="the basis is damaged"):
        read(hdf5_of(tmp_path / "basis.h5", "modes", "gram", "suffice/card"))


@pytest.mark.usefixtures("bound")
def test_a_checkpoint_with_a_circle_is_refused(tmp_path):
    run = tmp_path / "run.h5"
    hdf5_of(checkpoint_path(run), "position")
    with pytest.raises(Refusal, match=r"cannot be read.*start the run anew"):
        read_checkpoint(run)


@pytest.mark.usefixtures("bound")
@pytest.mark.parametrize("name", ["positions", "VTKHDF/Points"])
def test_a_file_of_another_code_with_a_circle_is_refused(tmp_path, name):
    with pytest.raises(Refusal, match="cannot be read"):
        import_run([hdf5_of(tmp_path / "other.h5", name)], tmp_path / "run.h5", interval=0.1)
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.usefixtures("bound")
def test_a_group_of_each_snapshot_with_a_circle_is_refused(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        for k in range(2):
            file[f"step_{k}/x"] = np.full((2, 3), float(k))
    assert make_circles(tmp_path / "other.h5", number=1)  # 0 is the root's
    with pytest.raises(Refusal, match="cannot be read"):
        import_run([tmp_path / "other.h5"], tmp_path / "run.h5", interval=0.1, maps=["position=step_*/x"])


@pytest.mark.usefixtures("bound")
def test_a_run_with_a_circle_in_any_group_is_not_continued(tmp_path, monkeypatch):
    monkeypatch.setattr(hdf5_memory, "MOST", 16 * MIB)  # the allocator may keep what each of seven refusals took
    whole, zeros = tmp_path / "run.h5", {"position": np.zeros((2, 3))}
    settings = {
        "n_snapshots": 3,
        "variables": ["position"],
        "series": ["a"],
        "impact_energy": [1e-9, 1e-8],
        "provenance": {"git": "0"},
    }
    found = {layout.FOUND: ((), np.dtype("S8"))}
    with RunWriter(whole, ids=[0, 1], radius=[1, 1], species=[1, 1], reserved=found, **settings) as run:
        run.append(0.0, zeros, {"a": 1.0})
    refused = 0
    for number in range(whole.read_bytes().count(b"HEAP")):
        path = shutil.copy(whole, tmp_path / f"{number}.h5")
        if make_circles(path, number):
            with pytest.raises(Refusal, match="damaged"):
                RunWriter.resume(path, 1)
            refused += 1
    assert refused == 7  # root, particles, suffice, and its series, impacts, in_situ, provenance


@pytest.mark.usefixtures("bound")
def test_an_output_in_whose_place_a_circle_stands_is_no_run(tmp_path):
    with pytest.raises(Refusal, match="exists and is not a run"):
        check_place(hdf5_of(tmp_path / "out.h5", "position"))


def test_the_bound_is_lifted_again_when_threads_read_at_once(tmp_path):
    with h5py.File(tmp_path / "good.h5", "w") as file:
        file["a/b"], file["c"] = 1, 2
    limits, found = resource.getrlimit(resource.RLIMIT_AS), []

    def look():
        for _ in range(50):
            with open_hdf5(tmp_path / "good.h5") as file:
                found.append(names_in(file))

    threads = [threading.Thread(target=look) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [["a", "c"]] * 200
    assert resource.getrlimit(resource.RLIMIT_AS) == limits


def test_python_out_of_memory_is_told_as_damage(monkeypatch):
    monkeypatch.setattr(hdf5_memory, "MOST", 16 * MIB)
    with pytest.raises(RuntimeError, match="more than 16 MiB"), bounded_memory():
        bytearray(1 << 30)
