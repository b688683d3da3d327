"""Lanczos POD of snapshots that do not fit in memory: time against reading them once, and memory.

    python benchmarks/out_of_core.py [--rows 1500000] [--snapshots 500] [--modes 20] [--state FOLDER]
    python benchmarks/out_of_core.py --run [--particles 500000] [--snapshots 60] [--modes 20] [--state FOLDER]

The first writes single-precision snapshots of a known spectrum, far from the origin, to one HDF5 dataset (kept in
`--state`), reads them once by blocks as the decomposition does, and decomposes them, in a process of its own; memory is
the peak above the libraries. The file has just been written or read: what fits stays in the system's cache. The second
writes a run of so many particles as `suffice simulate` does and times `suffice decompose`.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHOSEN_BY_HAND = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
if any(name in os.environ for name in CHOSEN_BY_HAND):  # they slow one library down; start again before it is loaded
    os.execve(
        sys.executable, [sys.executable, *sys.argv], {k: v for k, v in os.environ.items() if k not in CHOSEN_BY_HAND}
    )

import h5py  # noqa: E402 (the environment first)
import numpy as np  # noqa: E402
from known_spectrum import KnownSnapshots, granular  # noqa: E402
from peak_memory import PeakMemory  # noqa: E402

from pod import SnapshotMatrix, lanczos_pod  # noqa: E402

LIMIT = 1e9  # bytes above the libraries


def sigma_of(modes):
    return granular(5 * modes, modes)


def write_snapshots(path, rows, snapshots, modes):
    """Write the snapshots, unless they are there."""
    if path.exists():
        return
    part = path.with_suffix(".part")
    with h5py.File(part, "w") as file:
        stored = file.create_dataset("W", (rows, snapshots), "float32")
        for low, block in KnownSnapshots(rows, snapshots, sigma_of(modes)).blocks():
            stored[low : low + len(block)] = block
    part.rename(path)


def measure(path, modes):
    """Read once and decompose, in this process, and print what it took."""
    small = np.random.default_rng(0).standard_normal((20_000, 50))
    lanczos_pod(small, modes=5)  # libraries are loaded and start their threads
    with h5py.File(path) as file:
        dataset = file["W"]
        height = SnapshotMatrix(dataset).block_rows
        began = time.perf_counter()
        for low in range(0, len(dataset), height):
            dataset[low : low + height]
        read = time.perf_counter() - began
        peak, began = PeakMemory(), time.perf_counter()
        basis = lanczos_pod(dataset, modes=modes)
        seconds, extra = time.perf_counter() - began, peak.extra()
        own = np.sqrt(basis.values * dataset.shape[1])
    error = np.abs(own / sigma_of(modes)[: len(own)] - 1.0).max()
    answer = {"read": read, "seconds": seconds, "extra": extra, "error": error, "orthogonality": basis.orthogonality}
    print(json.dumps(answer | {"route": basis.route, "reason": basis.route_reason}))


def on_disk(options, folder):
    path = folder / f"tall_{options.rows}x{options.snapshots}_{options.modes}.h5"
    began = time.perf_counter()
    write_snapshots(path, options.rows, options.snapshots, options.modes)
    print(f"{path.stat().st_size / 1e9:.2f} GB, written in {time.perf_counter() - began:.0f} s or there before")
    done = subprocess.run(
        [sys.executable, __file__, "--measure", str(path), "--modes", str(options.modes)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout.splitlines()[-1])
    goal = "met" if found["extra"] <= LIMIT else "MISSED"
    print(f"read once {found['read']:.1f} s; {options.modes} modes {found['seconds']:.1f} s, ", end="")
    print(f"{found['seconds'] / found['read']:.1f} times; route {found['route']}: {found['reason']}")
    print(f"peak above the libraries {found['extra'] / 1e6:.0f} MB, goal 1 GB: {goal}")
    print(f"worst relative error of a singular value {found['error']:.1e}, orthogonality {found['orthogonality']:.1e}")


def write_run(path, particles, snapshots):
    """Write a run of particles on smooth paths, unless it is there."""
    from suffice.store import RunWriter

    if path.exists():
        return
    phase, pace = np.random.default_rng(0).uniform(0.0, 60.0, (2, particles, 3))
    about = {"ids": np.arange(particles), "radius": np.full(particles, 5e-4), "species": np.ones(particles, int)}
    with RunWriter(
        path, **about, n_snapshots=snapshots, variables=("position",), provenance={"suffice": "benchmark"}
    ) as run:
        for k in range(snapshots):
            run.append(0.02 * k, {"position": 0.05 * np.sin(0.02 * k * pace + phase)})


def of_a_run(options, folder):
    path = folder / f"run_{options.particles}x{options.snapshots}.h5"
    write_run(path, options.particles, options.snapshots)
    command = ["decompose", str(path), "--variable", "position", "--modes", str(options.modes), "--json", "-"]
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "suffice", *command, "-o", str(folder / "basis.h5")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    card, memory = json.loads(done.stdout), 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(f"{path.stat().st_size / 1e9:.2f} GB: suffice {' '.join(command[:1] + command[2:6])}")
    print(
        f"{card['n_rows']} rows x {card['n_snapshots']}: {card['seconds']:.1f} s of {time.perf_counter() - began:.1f}"
    )
    print(f"peak {memory / 1e6:.0f} MB with the libraries, orthogonality {card['orthogonality']:.1e}, {card['route']}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_500_000)
    parser.add_argument("--particles", type=int, default=500_000)
    parser.add_argument("--snapshots", type=int)
    parser.add_argument("--modes", type=int, default=20)
    parser.add_argument("--state", type=Path, help="folder where the snapshots are kept; default a temporary one")
    parser.add_argument("--run", action="store_true", help="time `suffice decompose` on a run instead")
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure is not None:
        measure(options.measure, options.modes)
        return
    options.snapshots = options.snapshots or (60 if options.run else 500)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.state or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        of_a_run(options, folder) if options.run else on_disk(options, folder)


if __name__ == "__main__":
    main()
