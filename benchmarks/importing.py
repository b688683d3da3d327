"""How fast a foreign run comes in, and in how much memory: text dumps, plain or gz, VTU files and npz.

    python benchmarks/importing.py --megabytes 2000 --particles 20000

A made-up run of that size is written into a folder that is removed again; every format is imported in a process of its
own. Some snapshots differ, and are repeated: text is parsed whatever it says. Memory is the resident peak of the
process above what it holds once Python and its libraries are there, and the peak of the process that runs VTK. On a
busy machine look at the CPU seconds.
"""

import argparse
import gzip
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from peak_memory import PeakMemory

from suffice.xml_vtk import write_list, write_particles

DISTINCT = 8  # snapshots that are made up
COLUMNS = "id type x y z vx vy vz radius"


def moment(k, n):
    """Positions and velocities of particles, (n, 3) each."""
    angle = np.arange(n)[:, None] + np.arange(3) + 0.1 * k
    return 0.05 + 0.05 * np.sin(angle), np.cos(angle)


def atoms(k, n):
    """Return the lines of one snapshot of a dump, in another order each time."""
    position, velocity = moment(k, n)
    rows = np.column_stack([np.arange(1, n + 1), np.ones(n), position, velocity, np.full(n, 0.0005)])
    line = "%d %d %.6g %.6g %.6g %.6g %.6g %.6g %.6g\n"
    return "".join(line % tuple(row) for row in rows[np.random.default_rng(k).permutation(n)]).encode()


def write_dump(folder, size, n, opener=open):
    """Write a dump of about `size` bytes."""
    texts = [atoms(k, n) for k in range(DISTINCT)]
    steps = max(size // len(texts[0]), 2)
    with opener(folder / "run.dump", "wb") as file:
        for k in range(steps):
            box = "ITEM: BOX BOUNDS ff ff ff\n0 0.1\n0 0.1\n0 0.1"
            head = f"ITEM: TIMESTEP\n{100 * k}\nITEM: NUMBER OF ATOMS\n{n}\n{box}\nITEM: ATOMS {COLUMNS}\n"
            file.write(head.encode() + texts[k % DISTINCT])
    return [folder / "run.dump"]


def write_gz(folder, size, n):
    """Write a dump that takes `size` bytes unpacked."""
    return write_dump(folder, size, n, lambda path, mode: gzip.open(path, mode, compresslevel=1))


def write_vtu(folder, size, n):
    """Write .vtu files of about `size` bytes and the list of them."""
    files = []
    while not files or len(files) * (folder / files[0]).stat().st_size < size:
        position, velocity = (rows.astype(np.float32) for rows in moment(len(files) % DISTINCT, n))
        known = {"velocity": velocity, "id": np.arange(n), "radius": np.full(n, 0.0005)}
        files.append(f"run_{len(files)}.vtu")
        write_particles(folder / files[-1], 1e-3 * len(files), position, known)
    write_list(folder / "run.pvd", files, [1e-3 * k for k in range(len(files))])
    return [folder / "run.pvd"]


def write_npz(folder, size, n):
    """Write one .npz of about `size` bytes."""
    steps = max(size // (2 * n * 3 * 8), 2)
    made = [moment(k, n) for k in range(DISTINCT)]
    position, velocity = (np.stack([made[k % DISTINCT][i] for k in range(steps)]) for i in (0, 1))
    np.savez(folder / "run.npz", position=position, velocity=velocity, time=1e-3 * np.arange(steps))
    return [folder / "run.npz"]


WRITERS = {"dump": write_dump, "dump.gz": write_gz, "vtu": write_vtu, "npz": write_npz}


def measure(output, sources):
    """Import in this process, and print seconds and memory."""
    from suffice.readers import import_run

    peak, began, began_work = PeakMemory(), time.perf_counter(), time.process_time()
    timed = {"timestep": 1e-5} if sources[0].endswith(".dump") else {}
    made = import_run(sources, output, **timed)
    seconds = time.perf_counter() - began
    beside = resource.getrusage(resource.RUSAGE_CHILDREN)
    worked = time.process_time() - began_work + beside.ru_utime + beside.ru_stime
    vtk = 1024 * beside.ru_maxrss if sources[0].endswith(".pvd") else 0
    found = {"seconds": seconds, "worked": worked, "extra": peak.extra(), "vtk": vtk, "snapshots": made.n_snapshots}
    print(json.dumps(found))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--megabytes", type=float, default=200.0)
    parser.add_argument("--particles", type=int, default=20_000)
    parser.add_argument("--formats", nargs="+", choices=WRITERS, default=list(WRITERS))
    parser.add_argument("--measure", nargs="+", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.measure:
        return measure(asked.measure[0], asked.measure[1:])
    print(
        f"{'format':<8} {'MB read':>8} {'snapshots':>9} {'s':>7} {'CPU s':>7} {'MB/s':>7} {'peak MB':>8} {'VTK MB':>7}"
    )
    for name in asked.formats:
        with tempfile.TemporaryDirectory(dir=Path.cwd()) as folder:
            sources = WRITERS[name](Path(folder), int(1e6 * asked.megabytes), asked.particles)
            command = [sys.executable, __file__, "--measure", f"{folder}/run.h5", *map(str, sources)]
            found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            # of an archive, what it holds unpacked
            size = 1e6 * asked.megabytes if name == "dump.gz" else sum(f.stat().st_size for f in source_files(folder))
            print(
                f"{name:<8} {size / 1e6:8.0f} {found['snapshots']:9} {found['seconds']:7.1f} {found['worked']:7.1f} "
                f"{size / 1e6 / found['seconds']:7.1f} {found['extra'] / 1e6:8.0f} {found['vtk'] / 1e6:7.0f}",
                flush=True,
            )
    return None


def source_files(folder):
    """Return the files that were written to be imported."""
    return [path for path in Path(folder).iterdir() if path.suffix in (".dump", ".vtu", ".npz")]


if __name__ == "__main__":
    main()
