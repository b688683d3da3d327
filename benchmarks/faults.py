"""Kill `suffice` at any moment and look at what is left: `python benchmarks/faults.py --kills 100 --seed 1`.

Each command is killed at random moments of its work; then before every single change of a file (opened for writing,
renamed, removed), or before as many of them, drawn by chance, as `--changes` says. After each kill: what stands is
whole, all that was reported as written can be read, and the same command (simulate, train: with --resume) ends with the
same bits as one that was let alone. Then Ctrl-C and SIGTERM at random moments: exit code 130 or 143, and the same
again. Then a disk that is full: files may not grow beyond a random size, mostly while a finished output stands there;
one message, and what stood is whole, of import, decompose and train the very same. Then a folder that is read-only:
one message, and nothing has changed. The seed is told, so that a failure can be made again.
"""

import argparse
import ctypes
import json
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from fault_cases import CASES, SCENE, STUDY, Case, write_dump
from forked import Child, Outcome, import_all

LATE = 0.2  # of the time a command takes: a signal that it hears and does not obey for so long was lost


def reported(said: str) -> int:
    """Return how many snapshots a simulation has reported as done."""
    lines = [json.loads(line) for line in said.splitlines() if line.startswith("{") and line.endswith("}")]
    return max((line.get("done", 0) for line in lines), default=0)


def often() -> None:
    """Report, and write checkpoint and views, after every snapshot, so that kills fall into them."""
    import suffice.progress
    import suffice.simulating
    import suffice.store

    suffice.progress.SECONDS_BETWEEN_LINES = 0.0
    suffice.simulating.SECONDS_BETWEEN_CHECKPOINTS = 0.0
    suffice.store.SECONDS_BETWEEN_VIEWS = 0.0


def unprivileged() -> None:
    """Give up what lets root write where the mode bits forbid it."""
    often()
    version_3, nothing = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
    assert ctypes.CDLL(None).capset(version_3, nothing) == 0


def started(
    case: Case, folder: Path, resume: bool = False, dies_at: int | None = None, size: int | None = None
) -> Child:
    """Start a command in its folder, in the form that goes on where that is asked, with files of `size` at most."""
    words = [*case.words, *(["--resume"] if resume and case.resumes and (folder / case.resumes).exists() else [])]
    limits = None if size is None else {"file": size}
    return Child(words, folder, dies_at=dies_at, prepare=often, limits=limits)


class Harness:
    """Folders with the inputs of every case, and the undisturbed outputs."""

    def __init__(self, home: Path, seed: int) -> None:
        self.home, self.seed, self.tried = home, seed, 0
        self._known: dict[str, tuple[Case, Outcome]] = {}
        self.inputs = home / "inputs"
        self.inputs.mkdir()
        (self.inputs / "scene.toml").write_text(SCENE)
        (self.inputs / "study.toml").write_text(STUDY)
        write_dump(self.inputs / "other.dump")
        done = self.ended(CASES["simulate"], self.inputs)
        assert done.code == 0, done.said
        (self.inputs / "run.h5").rename(self.inputs / "source.h5")

    def folder(self) -> Path:
        """Return a fresh folder with the inputs."""
        self.tried += 1
        folder = self.home / f"try{self.tried}"
        shutil.copytree(self.inputs, folder)
        return folder

    def ended(self, case: Case, folder: Path, resume: bool = False) -> Outcome:
        """Run a command to its end."""
        return started(case, folder, resume).wait()

    def whole(self, name: str) -> tuple[Case, Outcome]:
        """Let a command alone, once; return its case with what it must end with, and how long it takes."""
        if name not in self._known:
            case, folder = CASES[name], self.folder()
            done = self.ended(case, folder)
            assert done.code == 0, done.said
            case = case._replace(expected=case.content(folder))
            case.look(folder, case, 0)
            shutil.rmtree(folder)
            self._known[name] = case, done
        return self._known[name]

    def killed(self, name: str, times: int) -> dict[str, int]:
        """Kill a command at random moments, each time from the start; return what happened."""
        return self._disturbed(name, [None] * times, signal.SIGKILL)

    def killed_at_changes(self, name: str, most: int) -> dict[str, int]:
        """Kill a command before each of its changes of a file, or before so many of them."""
        alone = self.whole(name)[1].changes
        chosen = self._chance(name, 0).permutation(alone)[:most] + 1
        return {"changes": alone} | self._disturbed(name, sorted(chosen.tolist()), signal.SIGKILL)

    def stopped(self, name: str, times: int, how: signal.Signals) -> dict[str, int]:
        """Ask a command to stop at random moments; return what happened."""
        return self._disturbed(name, [None] * times, how)

    def _chance(self, name: str, what: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, list(CASES).index(name), what])

    def refused(self, name: str) -> dict[str, int]:
        """Give a command a folder in which it may not write, over a finished output; return what happened."""
        case, _ = self.whole(name)
        folder = self.folder()
        self.ended(case, folder)
        inside = [folder, *folder.rglob("*")]
        for path in inside:
            path.chmod(0o555 if path.is_dir() else 0o444)
        told = Child(case.words, folder, prepare=unprivileged).wait()
        assert told.code in (1, 2), f"{name}: read-only folder: {told.code}: {told.said[-2000:]}"
        assert told.said.count("suffice: ") == 1, f"{name}: read-only folder: {told.said[-2000:]}"
        assert case.content(folder) == case.expected, f"{name}: the output that stood there is lost"
        assert sorted(folder.rglob("*")) == sorted(inside[1:]), f"{name}: it has written into a read-only folder"
        for path in inside:
            path.chmod(0o755)
        shutil.rmtree(folder)
        return {"tried": 1, "hit": int(told.code > 0)}

    def _disturbed(self, name: str, moments: Sequence[int | None], how: signal.Signals) -> dict[str, int]:
        """Disturb a command before each of these changes, None at a random moment, and look at what is left."""
        rng = self._chance(name, how)
        case, alone = self.whole(name)
        hit = stood = unheard = 0
        for dies_at in moments:
            folder = self.folder()
            child = started(case, folder, dies_at=dies_at)
            told = child.wait() if dies_at else child.kill_after(rng.uniform(0.0, alone.seconds), how)
            where = f"{name}, {how.name} at {dies_at or 'a moment'} (seed {self.seed})"
            caught = told.code == (-how if how == signal.SIGKILL else 128 + how)
            assert caught or told.code == 0, f"{where}: exit code {told.code}: {told.said[-2000:]}"
            assert "Traceback" not in told.said, f"{where}: {told.said}"
            unheard += told.code == 0 and told.heard and told.seconds_after > LATE * alone.seconds
            case.look(folder, case, reported(told.said))
            hit, stood = hit + caught, stood + (folder / (case.resumes or "out")).exists()
            again = self.ended(case, folder, resume=True)
            assert again.code == 0, f"{where}: again: {again.said[-2000:]}"
            assert case.content(folder) == case.expected, f"{where}: it does not end as if let alone"
            left = [p.name for p in folder.rglob("*") if p.name.endswith((".part", ".checkpoint", ".lock"))]
            assert not left, f"{where}: {left} are left"
            shutil.rmtree(folder)
        return {"tried": len(moments), "hit": hit, "resumed": stood, "unheard": unheard}

    def filled(self, name: str, times: int) -> dict[str, int]:
        """Give a command a disk that is full, over a finished output; return what happened."""
        rng, inputs = self._chance(name, 1), os.listdir(self.inputs)
        case, _ = self.whole(name)
        refused = 0
        for _ in range(times):
            folder = self.folder()
            self.ended(case, folder)
            most = max(path.stat().st_size for path in folder.rglob("*") if path.name not in inputs)
            if not case.finished:
                shutil.rmtree(folder)
                shutil.copytree(self.inputs, folder)
            size = int(np.exp(rng.uniform(np.log(500.0), np.log(1.1 * most))))
            told = started(case, folder, size=size).wait()
            assert told.code in (0, 1, 2), f"{name}: files of {size} bytes: {told.code}: {told.said[-2000:]}"
            assert "Traceback" not in told.said, f"{name}: files of {size} bytes: {told.said[-2000:]}"
            case.look(folder, case, 0)
            if case.keeps:
                assert case.content(folder) == case.expected, f"{name}: the output that stood there is lost"
            again = self.ended(case, folder)
            assert again.code == 0, f"{name}: with room again: {again.said[-2000:]}"
            assert case.content(folder) == case.expected, f"{name}: it does not end as if let alone"
            refused += told.code > 0
            shutil.rmtree(folder)
        return {"tried": times, "hit": refused}


def main() -> None:
    """Disturb every command, and say how often."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100, help="of each command, at random moments")
    parser.add_argument("--changes", type=int, default=sys.maxsize, help="before so many changes; default: before each")
    parser.add_argument("--interrupts", type=int, default=10, help="of each command by each signal, and full disks")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=list(CASES), action="append")
    wanted = parser.parse_args()
    import_all()
    with tempfile.TemporaryDirectory() as folder:
        harness = Harness(Path(folder), wanted.seed)
        for name in wanted.only or CASES:
            found = {
                "SIGKILL": lambda name=name: harness.killed(name, wanted.kills),
                "SIGKILL before a change": lambda name=name: harness.killed_at_changes(name, wanted.changes),
                "SIGINT": lambda name=name: harness.stopped(name, wanted.interrupts, signal.SIGINT),
                "SIGTERM": lambda name=name: harness.stopped(name, wanted.interrupts, signal.SIGTERM),
                "full disk": lambda name=name: harness.filled(name, wanted.interrupts),
                "read-only folder": lambda name=name: harness.refused(name),
            }
            for fault, told in found.items():
                print(json.dumps({"command": name, "fault": fault, "seed": wanted.seed, **told()}), flush=True)


if __name__ == "__main__":
    sys.exit(main())
