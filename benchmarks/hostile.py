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
from pathlib import Path

import numpy as np
from forked import Child, Outcome, import_all
from hostile_kinds import KINDS, Kind, copied, good_files
from mutants import Rng

MEMORY, MOST_MEMORY = 4 << 30, 1 << 30  # bytes above the parent's: address space, and what may be resident
INTERRUPTED = 130
PATIENCE = 20.0  # s, then it is interrupted: a valid file may ask for a long run


def told_state(home: Path, writes: Path) -> dict[str, tuple[int, int]]:
    """Return size and time of change of every file at home outside the output folder, and which folders there are."""
    stats = {path: path.lstat() for path in home.rglob("*") if writes not in (path, *path.parents)}
    return {
        str(path): (0, 0) if path.is_dir() else (stat.st_size, stat.st_mtime_ns)
        for path, stat in stats.items()
        if path.suffix != ".said"
    }


def judged(outcome: Outcome, base: int, changed: bool) -> str:
    """Return what is wrong with an outcome, empty for nothing."""
    if outcome.code not in (0, 1, 2, INTERRUPTED):
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


def impatient() -> None:
    """Give VTK's readers less time than the harness has, so that what ends them is seen to."""
    from suffice.readers import vtk_process

    vtk_process.SECONDS_OF_VTK = 10


def opened(kind: Kind, good: Path, folder: Path, rng: Rng) -> tuple[Outcome, bool]:
    """Break a file and open it; return how that ended, and whether a file outside the output folder was changed.

    The folder lies two below the home of all, so that `../../outside` is seen, too.
    """
    home = folder.parents[1]
    copied(kind, good, folder)
    kind.mutate(rng, folder / kind.place)
    before = told_state(home, folder / "out")
    words = kind.commands[int(rng.integers(len(kind.commands)))]
    child = Child(words, folder, limits={"memory": MEMORY}, writes=folder / "out", prepare=impatient)
    outcome = child.kill_after(PATIENCE, signal.SIGINT)
    changed = told_state(home, folder / "out") != before
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
    import surrogates.regression  # noqa: F401  it makes folders for the caches of what it imports

    findings = 0
    with tempfile.TemporaryDirectory() as home:
        good = good_files(Path(home))
        base = Child(["info", "in/run.h5"], good).wait().memory
        for name in wanted.only or KINDS:
            codes: collections.Counter[int] = collections.Counter()
            most, slowest, endless, ended = 0, 0.0, [], 0
            for number in range(wanted.first, wanted.first + wanted.mutants):
                rng = np.random.default_rng([wanted.seed, list(KINDS).index(name), number])
                outcome, changed = opened(KINDS[name], good, Path(home) / "a" / "tried", rng)
                codes[outcome.code] += 1
                most, slowest = max(most, outcome.memory - base), max(slowest, outcome.seconds)
                ended += "stops VTK's reader" in outcome.said
                endless += [number] if outcome.code == INTERRUPTED else []
                if problem := judged(outcome, base, changed):
                    findings += 1
                    print(f"{name} {number}: {problem}", file=sys.stderr, flush=True)
            told = {"kind": name, "seed": wanted.seed, "mutants": wanted.mutants, "memory_mb": round(most / 1e6)}
            told |= {"codes": dict(sorted(codes.items())), "slowest_s": round(slowest, 1), "interrupted": endless}
            told |= {"vtk_ended": ended} if ended else {}  # its process died, or was ended after too long
            print(json.dumps(told), flush=True)
    return int(findings > 0)


if __name__ == "__main__":
    sys.exit(main())
