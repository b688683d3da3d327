"""What `faults.py` does to which command, and what may be seen of its output then."""

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from safetensors.numpy import load_file

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


class Case(NamedTuple):
    """A command, how it is given again after a kill, and what may be seen of its output then."""

    words: Sequence[str]
    look: Callable[
        [Path, "Case", int], None
    ]  # told how many were reported as done; raises AssertionError for what must not stand
    content: Callable[[Path], dict[str, Any]]  # of the finished output
    resumes: str = ""  # the file or folder that must stand for --resume
    finished: bool = True  # whether a full disk finds a finished output, which else would be all there is to do
    keeps: bool = False  # whether what stood at the output stays until the new one is whole
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
    """Content of the run in a folder, and of the views beside it."""
    return {f"{path.name}/{name}": held for path in _run_files(folder) for name, held in arrays_of(path).items()}


def _run_files(folder: Path) -> list[Path]:
    return [folder / "run.h5", *sorted(folder.glob("run.*.vtkhdf"))]


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
    return of_run(out) | answers | {"errors": errors, "stages": sorted(log)}


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
            found = content(folder)
            lacking = {key for key in case.expected.keys() - found.keys() if ".vtkhdf/" not in key}
            assert not lacking, f"{name} stands and lacks {lacking}"  # but for views, which come after their run
            assert found == {key: case.expected[key] for key in found}, f"{name} stands and is not whole"

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
        resumes="run.h5",
    ),
    "import": Case(
        ["import", "other.dump", "--timestep", "1e-5", "-o", "run.h5"],
        look_at_whole(of_run, "run.h5"),
        of_run,
        keeps=True,
    ),
    "decompose": Case(
        ["decompose", "source.h5", "--variable", "position", "-o", "basis.h5"],
        look_at_whole(of_basis, "basis.h5"),
        of_basis,
        keeps=True,
    ),
    "train": Case(
        ["train", "source.h5", "--variable", "position.x", "--interval", "0.001", "--surrogate", "mlp", "-o", "model"],
        look_at_whole(of_model, "model/model.json"),
        of_model,
        resumes="model",
        keeps=True,
    ),
    "combine": Case(
        [*PARTS, "--interval", "0.001", "--surrogate", "spline", "-o", "model"],
        look_at_whole(of_combined, "model/model.json"),
        of_combined,
        resumes="model/plan.json",
    ),
    "study": Case(["study", "study.toml", "-o", "out"], look_at_study, of_study, finished=False),
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
