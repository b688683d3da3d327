"""Processes that share the rows find what one finds, each from its own rows, and end together."""

import json
import lzma
import os
import subprocess
import sys
import textwrap
from itertools import pairwise

import h5py
import numpy as np
import pytest

from pod.ranks import Ranks
from suffice.ranks import shared_rows


def torchrun(folder, *arguments, count=2):
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    launch = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", str(count), "--master-port", "0",
              "--rdzv-backend", "c10d", "--rdzv-endpoint", "localhost:0"]  # fmt: skip
    return subprocess.run(
        [*launch, *map(str, arguments)], cwd=folder, env=environment, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("ranks")


@pytest.fixture
def source(write_run, folder):
    path = folder / "run.h5"
    return path if path.exists() else write_run(path, n_snapshots=61, n=101, interval=0.02)  # motion of full rank


@pytest.mark.parametrize(("gpus", "backend", "chosen"), [(0, "gloo", []), (1, "gloo", [0]), (2, "nccl", [1])])
def test_two_processes_on_one_gpu_share_it_and_sum_elsewhere(gpus, backend, chosen, monkeypatch):
    import torch
    import torch.distributed as dist

    backends, devices = [], []
    for name in ("WORLD_SIZE", "LOCAL_WORLD_SIZE"):
        monkeypatch.setenv(name, "2")
    monkeypatch.setenv("LOCAL_RANK", "1")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: gpus)
    monkeypatch.setattr(torch.cuda, "set_device", devices.append)
    monkeypatch.setattr(dist, "init_process_group", lambda name, **_: backends.append(name))
    monkeypatch.setattr(dist, "destroy_process_group", lambda: None)
    monkeypatch.setattr("pod.TorchRanks", Ranks)
    with shared_rows():
        pass
    assert (backends, devices) == ([backend], chosen)


@pytest.mark.parametrize(("rows", "together", "size"), [(303, 3, 2), (303, 3, 7), (5, 1, 8), (1000, 1, 3)])
def test_every_row_has_one_rank_and_no_particle_two(rows, together, size):
    class One(Ranks):
        def __init__(self, rank):
            self.rank, self.size = rank, size

    shares = [One(rank).share(rows, together) for rank in range(size)]
    assert shares[0].start == 0
    assert shares[-1].stop == rows
    assert all(one.stop == other.start for one, other in pairwise(shares))
    assert all(share.start % together == 0 for share in shares)


@pytest.mark.physics
@pytest.mark.parametrize("route", ["gram", "block"])
def test_two_ranks_find_the_basis_of_one(source, folder, suffice, route):
    common = ("decompose", source, "--variable", "position", "--modes", "5", "--route", route)
    alone = suffice(*common, "-o", folder / "one.h5", "--json", folder / "one.json")
    assert alone.code == 0, alone.err
    done = torchrun(folder, "-m", "suffice", *common, "-o", "two.h5", "--json", "two.json")
    assert done.returncode == 0, done.stderr
    one, two = (json.loads((folder / name).read_text()) for name in ("one.json", "two.json"))
    assert (one["ranks"], two["ranks"]) == (1, 2)
    assert (one["n_lr"], one["n_rows"], one["lanczos_steps"]) == (two["n_lr"], two["n_rows"], two["lanczos_steps"])
    with h5py.File(folder / "one.h5") as a, h5py.File(folder / "two.h5") as b:
        values = a["values"][()]
        assert np.abs(b["values"][()] - values).max() <= 1e-12 * values[0]
        assert np.abs(b["mean"][()] - a["mean"][()]).max() <= 1e-14
        modes, other = a["modes"][:, :4], b["modes"][:, :4]
        gap = (values[3] - values[4]) / values[0]
        assert np.linalg.norm(modes @ modes.T - other @ other.T, 2) <= 100 * np.finfo(float).eps / gap
        assert np.abs(b["modes"][()].T @ b["modes"][()] - np.eye(5)).max() <= 1e-12
    assert done.stdout.count("two.h5") == 1  # the first rank alone tells


@pytest.mark.physics
def test_two_ranks_judge_as_one(source, folder, suffice):
    alone = suffice("select", source, "--json", "-")
    assert alone.code == 0, alone.err
    done = torchrun(folder, "-m", "suffice", "select", source, "--json", "two-select.json")
    assert done.returncode == 0, done.stderr
    one, two = json.loads(alone.out), json.loads((folder / "two-select.json").read_text())
    assert one["variables"].keys() == two["variables"].keys()
    for name, found in one["variables"].items():
        other = two["variables"][name]
        assert found["chosen_interval"] == other["chosen_interval"]
        for a, b in zip(found["candidates"], other["candidates"], strict=True):
            assert {k: a[k] for k in ("n_lr", "n_c", "verdict")} == {k: b[k] for k in ("n_lr", "n_c", "verdict")}
            assert (a["K_f_interval"] is None) == (b["K_f_interval"] is None) == (a["n_snapshots"] < 10)
            if a["K_f_interval"] is not None:
                assert a["K_f_interval"] == pytest.approx(b["K_f_interval"], rel=1e-9)


@pytest.mark.physics
def test_two_ranks_find_every_integer_of_the_foreign_run(reference, folder, suffice):
    dump, run = folder / "shake.dump", folder / "shake.h5"
    dump.write_bytes(lzma.decompress((reference / "shake.dump.xz").read_bytes()))
    assert suffice("import", dump, "--interval", "0.001", "-o", run).code == 0
    done = torchrun(folder, "-m", "suffice", "select", run, "--json", "two-shake.json")
    assert done.returncode == 0, done.stderr
    found = json.loads((folder / "two-shake.json").read_text())["variables"]
    for name, by_interval in json.loads((reference / "shake.expected.json").read_text()).items():
        for candidate in found[name]["candidates"]:
            expected = by_interval[str(round(candidate["interval"] * 1e3))]
            assert {field: candidate[field] for field in expected} == pytest.approx(expected, rel=1e-14)


@pytest.mark.physics
def test_rows_of_another_rank_that_are_not_finite_are_refused_once_by_all(write_run, folder):
    path = write_run(folder / "bad.h5", n_snapshots=21, n=40)
    with h5py.File(path, "r+") as file:
        file["particles/position"][40 * 3 + 38] = np.nan  # particle 38 of snapshot 3 belongs to the second rank
    arguments = ("decompose", path, "--variable", "position", "-o", "bad-basis.h5")
    done = torchrun(folder, "-m", "suffice", *arguments)
    assert done.returncode != 0
    assert done.stderr.count("of snapshot 3 is nan; repair the run or leave the snapshot out") == 1
    assert "Traceback (most recent call last):\n  File" not in done.stderr.split("torch/distributed")[0]
    assert not list(folder.glob("bad-basis*"))


@pytest.mark.physics
def test_a_rank_that_dies_ends_the_others_with_a_message(source, folder):
    program = """
        import os, signal, sys
        from suffice.__main__ import main
        from pod.ranks import TorchRanks
        whole = TorchRanks.summed
        def summed(self, values):
            if self.rank == 1:
                os.kill(os.getpid(), signal.SIGKILL)
            return whole(self, values)
        TorchRanks.summed = summed
        sys.exit(main())
    """
    (folder / "dies.py").write_text(textwrap.dedent(program))
    arguments = ("decompose", source, "--variable", "position", "-o", "dead.h5")
    done = torchrun(folder, "dies.py", *arguments)
    assert done.returncode != 0
    assert not (folder / "dead.h5").exists()
    said = "another rank has ended" in done.stderr or "Sending process" in done.stderr
    assert said, done.stderr
    assert "SIGKILL" in done.stderr or "Signal 9" in done.stderr
