"""Kill `suffice` at random moments and look at what is left: `python benchmarks/faults.py --kills 100`.

Half of the kills come at a random moment of the work, half before a random change of a file (opened for writing,
renamed, removed). After each one: what stands is whole, all that was reported as written can be read, and the same
command (simulate, train: with --resume) ends with the same bits as one that was let alone. Then one Ctrl-C each at
random moments: exit code 130, and the same again. Then a disk that is full: files may not grow beyond a random size,
while a finished output stands there; one message, and what stood is whole, of import and decompose the very same. The
seed is told, so that a failure can be made again.
"""

import argparse
import hashlib
import json
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from forked import Child, Outcome, import_all
from safetensors.numpy import load_file

INTERRUPTED = 130
UNEQUAL = ("seconds", "made", "versions", "training", "energy_j")  # in JSON, what two runs of one command may differ by
SCENE = """seed = 1
[[particles]]
diameter = 1e-3
density = 2500.0
count = 48
[contact]
stiffness = 1e3
restitution = 0.8
friction = 0.3
[fluid]
density = 1000.0
viscosity = 1e-3
lowest = [0.0, 0.0, 0.0]
highest = [0.006, 0.006, 0.006]
cells = [4, 4, 3]
[drag]
[time]
duration = 0.02
[output]
interval = 0.0005
[filling]
lowest = [0.0005, 0.0005, 0.0005]
highest = [0.0055, 0.0055, 0.0055]
[[walls]]
name = "paddle"
motion = { kind = "rotation", axis = [0.0, 0.0, 1.0], point = [0.003, 0.003, 0.0], rpm = 600.0 }
[[walls.shapes]]
shape = "cylinder"
axis = [1.0, 0.0, 0.0]
centre = [0.004, 0.003, 0.003]
radius = 0.0002
length = 0.001
copies = 2
particles = "outside"
"""
STUDY = """scene = "scene.toml"
[select]
variables = ["position.x", "velocity.z"]
intervals = [0.002, 0.001]
[compare]
variables = ["position.z"]
intervals = [0.001]
surrogates = ["spline", "rbf"]
"""


KEEPING = ("import", "decompose")  # what stood at the output stays until the new one is whole


class Case(NamedTuple):
    """A command, how it is given again after a kill, and what may be seen of its output then."""

    words: Sequence[str]
    look: Callable[
        [Path, "Case", int], None
    ]  # told how many were reported as done; raises AssertionError for what must not stand
    content: Callable[[Path], dict[str, Any]]  # of the finished output
    resumes: str = ""  # the file or folder that must stand for --resume
    expected: dict[str, Any] = {}  # noqa: RUF012


def digest(values: Any) -> str:
    """Return a digest of an array, with its shape."""
    return f"{np.shape(values)} {hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()}"


def plain(value: Any) -> Any:
    """Return JSON without what differs between two runs of the same command: times and dates."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items() if not any(word in k for word in UNEQUAL)}
    return [plain(v) for v in value] if isinstance(value, list) else value


def arrays_of(path: Path) -> dict[str, Any]:
    """Return a digest of every dataset of an HDF5 file, but for when, how fast, and of which revision, it was made."""
    found: dict[str, Any] = {}

    def note(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and not name.endswith(("/made", "/git", "/pace")):
            told = name == "suffice/card"
            found[name] = plain(json.loads(bytes(node[()]))) if told else digest(node[()])

    with h5py.File(path) as file:
        file.visititems(note)
    return found


def of_run(folder: Path) -> dict[str, Any]:
    """Content of the run in a folder."""
    return arrays_of(folder / "run.h5")


def of_basis(folder: Path) -> dict[str, Any]:
    """Content of the basis in a folder."""
    return arrays_of(folder / "basis.h5")


def of_model(folder: Path) -> dict[str, Any]:
    """Content of the model in a folder."""
    arrays = load_file(folder / "model" / "model.safetensors")
    card = plain(json.loads((folder / "model" / "model.json").read_text()))
    return {name: digest(array) for name, array in arrays.items()} | {"card": card}


def of_combined(folder: Path) -> dict[str, Any]:
    """Content of a model of several variables: its parts, and what its card says of them."""
    card = json.loads((folder / "model" / "model.json").read_text())
    parts = {name: load_file(folder / "model" / name / "model.safetensors") for name in card["parts"]}
    return {f"{part}/{name}": digest(array) for part, held in parts.items() for name, array in held.items()}


def of_study(folder: Path) -> dict[str, Any]:
    """Content of a study: its run, verdicts and errors."""
    out = folder / "out"
    answers = {name: plain(json.loads((out / name).read_text())) for name in ("select.json",)}
    rows = json.loads((out / "compare.json").read_text())["rows"]
    errors = [(row["surrogate"], row["modes"], row["precision"], row["rmse"]) for row in rows]
    log = json.loads((out / "stages.json").read_text())
    page = (out / "report.html").read_text()
    assert page.rstrip().endswith("</html>"), "the report is cut"
    return arrays_of(out / "run.h5") | answers | {"errors": errors, "stages": sorted(log)}


def look_at_run(path: Path, reported: int = 0) -> None:
    """Read all counted snapshots of a run, which are at least those reported."""
    from suffice.run import Run

    with Run(path) as run:
        assert run.n_snapshots >= reported, f"{reported} snapshots were reported, {run.n_snapshots} stand"
        for k in range(run.n_snapshots):
            values = run.snapshot(k).values
            assert all(np.isfinite(v).all() for v in values.values()), f"snapshot {k} is not whole"
    for view in path.parent.glob("*.vtkhdf"):
        with h5py.File(view) as file:
            file["VTKHDF/Steps/Values"][()]


def look_while_simulated(folder: Path, _case: Case, reported: int) -> None:
    """Find the run whole as far as it counts; before it begins there may be none."""
    if reported or (folder / "run.h5").exists():
        look_at_run(folder / "run.h5", reported)


def look_at_whole(content: Callable[[Path], dict[str, Any]], name: str) -> Callable[[Path, Case, int], None]:
    """Return the look that finds the output absent, or the finished one."""

    def look(folder: Path, case: Case, _reported: int) -> None:
        if (folder / name).exists():
            assert content(folder) == case.expected, f"{name} stands and is not whole"

    return look


def look_at_study(folder: Path, _case: Case, _reported: int) -> None:
    """Find every JSON that stands whole, and so the run."""
    out = folder / "out"
    for path in out.glob("*.json"):
        json.loads(path.read_text())
    if (out / "run.h5").exists():
        look_at_run(out / "run.h5")
    if (out / "report.html").exists():
        assert (out / "report.html").read_text().rstrip().endswith("</html>"), "the report is cut"


PARTS = ("train", "source.h5", "--variable", "position.x", "--variable", "position.z")  # one model of both
CASES = {
    "simulate": Case(
        ["--log-json", "simulate", "scene.toml", "-o", "run.h5", "--threads", "1"],
        look_while_simulated,
        of_run,
        "run.h5",
    ),
    "import": Case(
        ["import", "other.dump", "--timestep", "1e-5", "-o", "run.h5"], look_at_whole(of_run, "run.h5"), of_run
    ),
    "decompose": Case(
        ["decompose", "source.h5", "--variable", "position", "-o", "basis.h5"],
        look_at_whole(of_basis, "basis.h5"),
        of_basis,
    ),
    "train": Case(
        ["train", "source.h5", "--variable", "position.x", "--interval", "0.001", "--surrogate", "mlp", "-o", "model"],
        look_at_whole(of_model, "model/model.json"),
        of_model,
        "model",
    ),
    "combine": Case(
        [*PARTS, "--interval", "0.001", "--surrogate", "spline", "-o", "model"],
        look_at_whole(of_combined, "model/model.json"),
        of_combined,
        "model/plan.json",
    ),
    "study": Case(["study", "study.toml", "-o", "out"], look_at_study, of_study),
}


def write_dump(path: Path, snapshots: int = 300, n: int = 100) -> None:
    """Write a dump of LAMMPS: particles that circle."""
    with path.open("w") as file:
        for k in range(snapshots):
            file.write(f"ITEM: TIMESTEP\n{100 * k}\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS ff ff ff\n")
            file.write("-2 2\n" * 3 + "ITEM: ATOMS id x y z\n")
            for i in range(1, n + 1):
                angle = 1e-3 * i * k
                file.write(f"{i} {np.sin(angle):.6g} {np.cos(angle):.6g} {i}\n")


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

    def whole(self, case: Case) -> tuple[Case, Outcome]:
        """Let a command alone; return the case with what it must end with, and how long it takes."""
        folder = self.folder()
        done = self.ended(case, folder)
        assert done.code == 0, done.said
        case = case._replace(expected=case.content(folder))
        case.look(folder, case, 0)
        shutil.rmtree(folder)
        return case, done

    def disturbed(self, name: str, kills: int, how: signal.Signals) -> dict[str, int]:
        """Disturb a command so often, each time from the start, and look at what is left; return what happened."""
        rng = np.random.default_rng([self.seed, list(CASES).index(name), how])
        case, alone = self.whole(CASES[name])
        hit = stood = unheard = 0
        for trial in range(kills):
            folder = self.folder()
            told = self._disturb(case, folder, rng, alone, how, at_change=trial % 2 == 1)
            caught = told.code in (-signal.SIGKILL, INTERRUPTED)
            assert caught or told.code == 0, f"{name}: exit code {told.code}: {told.said[-2000:]}"
            lost = told.code == 0 and "Exception ignored" in told.said and "KeyboardInterrupt" in told.said
            assert lost or "Traceback" not in told.said, told.said
            unheard += lost  # Python drops what is raised in a callback of its own: the command goes on to its end
            case.look(folder, case, reported(told.said))
            hit, stood = hit + caught, stood + (folder / (case.resumes or "out")).exists()
            again = self.ended(case, folder, resume=True)
            assert again.code == 0, f"{name}: after the kill: {again.said[-2000:]}"
            assert case.content(folder) == case.expected, f"{name}: it does not end as if let alone"
            left = [p.name for p in folder.rglob("*") if p.name.endswith((".part", ".checkpoint"))]
            assert not left, f"{name}: {left} are left"
            shutil.rmtree(folder)
        return {"tried": kills, "hit": hit, "resumed": stood, "unheard": unheard}

    def filled(self, name: str, times: int) -> dict[str, int]:
        """Give a command a disk that is full, over a finished output; return what happened."""
        rng = np.random.default_rng([self.seed, list(CASES).index(name)])
        case, _ = self.whole(CASES[name])
        refused = 0
        for _ in range(times):
            folder = self.folder()
            self.ended(case, folder)
            most = max(path.stat().st_size for path in folder.rglob("*") if path.name not in os.listdir(self.inputs))
            size = int(np.exp(rng.uniform(np.log(500.0), np.log(1.1 * most))))
            told = started(case, folder, size=size).wait()
            assert told.code in (0, 1, 2), f"{name}: files of {size} bytes: {told.code}: {told.said[-2000:]}"
            assert "Traceback" not in told.said, f"{name}: files of {size} bytes: {told.said[-2000:]}"
            case.look(folder, case, 0)
            if name in KEEPING:
                assert case.content(folder) == case.expected, f"{name}: the output that stood there is lost"
            again = self.ended(case, folder)
            assert again.code == 0, f"{name}: with room again: {again.said[-2000:]}"
            assert case.content(folder) == case.expected, f"{name}: it does not end as if let alone"
            refused += told.code > 0
            shutil.rmtree(folder)
        return {"tried": times, "hit": refused}

    def _disturb(
        self,
        case: Case,
        folder: Path,
        rng: np.random.Generator,
        alone: Outcome,
        how: signal.Signals,
        *,
        at_change: bool,
    ) -> Outcome:
        if at_change and how == signal.SIGKILL:
            return started(case, folder, dies_at=int(rng.integers(1, alone.changes + 1))).wait()
        return started(case, folder).kill_after(rng.uniform(0.0, alone.seconds), how)


def main() -> None:
    """Disturb every command, and say how often."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100, help="of each command")
    parser.add_argument("--interrupts", type=int, default=10, help="of each command, and full disks")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=list(CASES), action="append")
    wanted = parser.parse_args()
    import_all()
    with tempfile.TemporaryDirectory() as folder:
        harness = Harness(Path(folder), wanted.seed)
        for name in wanted.only or CASES:
            for how, times in ((signal.SIGKILL, wanted.kills), (signal.SIGINT, wanted.interrupts)):
                told = harness.disturbed(name, times, how)
                print(json.dumps({"command": name, "fault": how.name, "seed": wanted.seed, **told}), flush=True)
            told = harness.filled(name, wanted.interrupts)
            print(json.dumps({"command": name, "fault": "full disk", "seed": wanted.seed, **told}), flush=True)


if __name__ == "__main__":
    sys.exit(main())
