"""Give `suffice` broken and hostile files: `python benchmarks/hostile.py --mutants 1000`.

Each mutant is opened by a command in a process of its own, whose memory and time are bounded. It may succeed, be
refused (exit code 2) or fail with a message (1). It may not end in a traceback, be killed, take memory without bound,
change a file outside its output folder, or be deaf to Ctrl-C. Each mutant is told by its kind, seed and number.
"""

import argparse
import collections
import json
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from faults import write_dump
from forked import Child, Outcome, import_all
from mutants import Rng, mutate_dump, mutate_hdf5, mutate_model, mutate_toml

MEMORY, MOST_MEMORY = 4 << 30, 1 << 30  # bytes above the parent's: address space, and what may be resident
PATIENCE = 20.0  # s, then it is interrupted: a valid file may ask for a long run
SCENE = """seed = 1
[[particles]]
name = "bead"
diameter = 2e-3
density = 2500.0
count = 12
velocity = [0.3, 0.2, 0.1]
[contact]
stiffness = 1e3
restitution = 0.8
friction = 0.3
[gravity]
acceleration = [0.0, 0.0, -9.81]
[limits]
max_overlap = 0.2
[time]
duration = 0.002
[output]
interval = 0.001
precision = "single"
[filling]
lowest = [0.0, 0.0, 0.0]
highest = [0.008, 0.008, 0.012]
[[walls]]
name = "box"
motion = { kind = "oscillation", amplitude = [0.0, 0.0, 0.001], frequency = 40.0 }
[[walls.shapes]]
shape = "box"
lowest = [0.0, 0.0, 0.0]
highest = [0.008, 0.008, 0.012]
particles = "inside"
"""
STUDY = """seed = 1
[source]
files = ["other.dump"]
timestep = 1e-5
diameter = 0.01
[select]
variables = ["position.x"]
intervals = [0.004, 0.002]
[select.thresholds]
energy = 0.999
consistency = 1.05
feasibility = 2.0
[compare]
variables = ["position.x"]
intervals = [0.004]
surrogates = ["spline"]
max_error = 0.001
"""


class Kind(NamedTuple):
    """A kind of file, how it is broken, and the commands that open it."""

    place: str
    mutate: Callable[[Rng, Path], None]
    commands: Sequence[Sequence[str]]


KINDS = {
    "scene": Kind(
        "in/scene.toml",
        mutate_toml,
        [
            ["simulate", "in/scene.toml", "-o", "out/run.h5", "--threads", "1"],
            ["simulate", "in/scene.toml", "--explain"],
        ],
    ),
    "study": Kind("in/study.toml", mutate_toml, [["study", "in/study.toml", "-o", "out"]]),
    "dump": Kind("in/other.dump", mutate_dump, [["import", "in/other.dump", "--timestep", "1e-5", "-o", "out/run.h5"]]),
    "run": Kind(
        "in/run.h5",
        mutate_hdf5,
        [
            ["info", "in/run.h5"],
            ["decompose", "in/run.h5", "--variable", "position", "-o", "out/basis.h5"],
            ["select", "in/run.h5", "--variable", "position.x"],
            ["train", "in/run.h5", "--variable", "position.x", "--interval", "0.002", "--surrogate", "spline",
             "-o", "out/model"],
        ],
    ),
    "basis": Kind(
        "out/basis.h5",
        mutate_hdf5,
        [
            ["info", "out/basis.h5"],
            ["decompose", "in/run.h5", "--variable", "position", "-o", "out/basis.h5", "--append"],
        ],
    ),
    "model": Kind(
        "in/model",
        mutate_model,
        [["info", "in/model"], ["predict", "in/model", "--times", "0.001:0.005:0.001", "-o", "out/made.h5"]],
    ),
}  # fmt: skip


def made(words: Sequence[str], folder: Path) -> None:
    """Make one of the good files."""
    done = Child(words, folder).wait()
    assert done.code == 0, done.said


def good_files(home: Path) -> Path:
    """Make one good file of each kind by the program itself, with a file beside that nobody may read or change."""
    folder = home / "good"
    for part in ("in", "out"):
        (folder / part).mkdir(parents=True)
    (folder / "in" / "scene.toml").write_text(SCENE)
    (folder / "in" / "study.toml").write_text(STUDY)
    write_dump(folder / "in" / "other.dump", snapshots=21, n=12)
    made(["import", "in/other.dump", "--timestep", "1e-5", "--diameter", "0.01", "-o", "in/run.h5"], folder)
    made(KINDS["basis"].commands[1], folder)
    made([*KINDS["run"].commands[3][:-1], "in/model"], folder)
    shutil.copy(folder / "in" / "run.h5", folder / "in" / "secret.h5")
    return folder


def told_state(folder: Path) -> dict[str, tuple[int, int]]:
    """Return size and time of change of every file outside the output folder."""
    stats = {str(path): path.lstat() for path in folder.rglob("*") if "out" not in path.relative_to(folder).parts}
    return {name: (stat.st_size, stat.st_mtime_ns) for name, stat in stats.items() if not Path(name).is_dir()}


def judged(outcome: Outcome, base: int, changed: bool) -> str:
    """Return what is wrong with an outcome, empty for nothing."""
    if outcome.code not in (0, 1, 2, 130):
        return f"exit code {outcome.code}: {outcome.said[-1500:]}"
    if "Traceback" in outcome.said:
        return f"a traceback: {outcome.said[-1500:]}"
    if outcome.code in (1, 2) and "suffice: " not in outcome.said:
        return f"no message: {outcome.said[-500:]!r}"
    if outcome.memory - base > MOST_MEMORY:
        return f"{(outcome.memory - base) / 1e9:.1f} GB of memory: {outcome.said[-300:]}"
    if outcome.outside or changed:
        return f"changed outside of its folder: {outcome.outside}"
    return ""


def opened(kind: Kind, good: Path, folder: Path, rng: Rng) -> tuple[Outcome, bool]:
    """Break a file and open it; return how that ended, and whether a file outside the output folder was changed."""
    shutil.copytree(good, folder, symlinks=True)
    kind.mutate(rng, folder / kind.place)
    before = told_state(folder)
    words = kind.commands[int(rng.integers(len(kind.commands)))]
    child = Child(words, folder, limits={"memory": MEMORY}, writes=folder / "out")
    outcome = child.kill_after(PATIENCE, signal.SIGINT)
    changed = told_state(folder) != before
    shutil.rmtree(folder)
    return outcome, changed


def main() -> int:
    """Break files of every kind, and say how they were answered."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=1000, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--only", choices=list(KINDS), action="append")
    wanted = parser.parse_args()
    import_all()
    findings = 0
    with tempfile.TemporaryDirectory() as home:
        good = good_files(Path(home))
        base = Child(["info", "in/run.h5"], good).wait().memory
        for name in wanted.only or KINDS:
            codes: collections.Counter[int] = collections.Counter()
            most, slowest = 0, 0.0
            for number in range(wanted.first, wanted.first + wanted.mutants):
                rng = np.random.default_rng([wanted.seed, list(KINDS).index(name), number])
                outcome, changed = opened(KINDS[name], good, Path(home) / "tried", rng)
                codes[outcome.code] += 1
                most, slowest = max(most, outcome.memory - base), max(slowest, outcome.seconds)
                if problem := judged(outcome, base, changed):
                    findings += 1
                    print(f"{name} {number}: {problem}", file=sys.stderr, flush=True)
            told = {"kind": name, "seed": wanted.seed, "mutants": wanted.mutants, "memory_mb": round(most / 1e6)}
            told |= {"codes": dict(sorted(codes.items())), "slowest_s": round(slowest, 1)}
            print(json.dumps(told), flush=True)
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main())
