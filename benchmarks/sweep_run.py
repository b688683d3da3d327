"""A run that does not fit in memory, swept as `suffice select` does: time, memory, and what reading it once takes.

`sweep.py --out-of-core` runs it: the run is written once, and swept in a process of its own.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from peak_memory import PeakMemory

from pod import SnapshotMatrix
from suffice.run import Run
from suffice.selecting import select_run
from suffice.store import RunWriter

MODES = 60  # of the motion, whose amplitudes fall over three decades
VARIABLES = ("position.x", "position.y", "position.z", "position")


def write_run(path, particles, snapshots, noise):
    """Write beads that move in some modes, with noise on every coordinate, unless the run is there."""
    if path.exists():
        return
    rng = np.random.default_rng(0)
    about = {"ids": np.arange(particles), "radius": np.full(particles, 5e-4), "species": np.ones(particles, int)}
    shapes = rng.standard_normal((3 * particles, MODES), dtype=np.float32)
    shapes *= (0.02 * 10.0 ** (-3 * np.arange(1, MODES + 1) / MODES)).astype(np.float32)
    phase, still = rng.uniform(0.0, 2.0 * np.pi, MODES), rng.uniform(0.0, 0.1, 3 * particles).astype(np.float32)
    with RunWriter(
        path, **about, n_snapshots=snapshots, variables=("position",), provenance={"suffice": "benchmark"}
    ) as run:
        for k in range(snapshots):
            signal = np.cos(np.pi * np.arange(1, MODES + 1) * 2.0 * k / snapshots + phase).astype(np.float32)
            position = still + shapes @ signal + np.float32(noise) * rng.standard_normal(len(still), dtype=np.float32)
            run.append(1e-3 * k, {"position": position.reshape(-1, 3)})


def measure(path):
    """Read the run once and sweep it, in this process, and print what it took."""
    with Run(path) as run:
        rows = run.variable("position")
        height = SnapshotMatrix(rows).block_rows
        began = time.perf_counter()
        for low in range(0, rows.shape[0], height):
            rows[low : low + height]
        read = time.perf_counter() - began
        peak, began = PeakMemory(), time.perf_counter()
        table = select_run(run, VARIABLES)
        seconds = time.perf_counter() - began
    chosen = {name: found.chosen_interval for name, found in table.items()}
    widest = [table["position"].candidates[-1].n_lr, table["position"].candidates[-1].n_c]
    print(json.dumps({"read": read, "seconds": seconds, "extra": peak.extra(), "chosen": chosen, "finest": widest}))


def out_of_core(folder, particles, snapshots):
    """Write, sweep in a process of its own, and print."""
    path = folder / f"sweep_{particles}x{snapshots}.h5"
    began = time.perf_counter()
    write_run(path, particles, snapshots, noise=2e-5)
    print(f"{path.stat().st_size / 1e9:.2f} GB, written in {time.perf_counter() - began:.0f} s or there before")
    done = subprocess.run(
        [sys.executable, str(Path(__file__).parent / "sweep.py"), "--measure", str(path)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout.splitlines()[-1])
    print(f"{3 * particles} rows x {snapshots}, nine Δτ, {', '.join(VARIABLES)}, with intervals for K_f:")
    print(f"read once {found['read']:.1f} s; swept {found['seconds']:.1f} s, ", end="")
    print(f"{found['seconds'] / found['read']:.1f} times; peak {found['extra'] / 1e6:.0f} MB above the libraries")
    print(f"chosen Δτ {found['chosen']}; n_lr, n_c of the whole at 2 ms {found['finest']}")
