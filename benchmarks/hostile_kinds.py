"""What `hostile.py` breaks: the kinds of files, one good file of each, and the commands that open it."""

import importlib
import json
import os
import shutil
import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from faults import write_dump
from foreign_files import foreign_files
from foreign_mutants import mutate_foam, mutate_npz, mutate_one_dump, mutate_vtk, mutate_vtkhdf
from forked import Child
from mutants import Rng, mutate_dump, mutate_hdf5, mutate_model, mutate_toml
from state_mutants import mutate_checkpoint, mutate_combined, mutate_results, mutate_training

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


SMALL = """scene = "long.toml"
[select]
variables = ["position.x", "velocity.z"]
intervals = [0.004, 0.002]
[compare]
variables = ["position.z"]
intervals = [0.002]
surrogates = ["spline"]
"""
OMISSIONS = """scene = "long.toml"
[omissions]
seeds = 2
variable = "position.x"
interval = 0.002
observables = ["kinetic_energy"]
max_difference = 0.1
[[omissions.variants]]
name = "smooth"
changes = { "contact.friction" = 0.0 }
"""
TRAINING = ["train", "in/run.h5", "--variable", "position.x", "--interval", "0.002", "--surrogate", "mlp", "-o",
            "out/training"]  # fmt: skip
COMBINING = ["train", "in/run.h5", "--variable", "position.x", "--variable", "position.y", "--interval", "0.002",
             "--surrogate", "spline"]  # fmt: skip


def importing(*words: str) -> list[str]:
    """Return the command that imports some files."""
    return ["import", *words, "-o", "out/run.h5"]


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
    "vtk": Kind("in/vtk", mutate_vtk, [importing("in/vtk/a300.vtk", "in/vtk/a600.vtk", "--timestep", "1e-5")]),
    "vtk_binary": Kind(
        "in/vtk_binary", mutate_vtk, [importing("in/vtk_binary/a1.vtk", "in/vtk_binary/a2.vtk", "--interval", "1e-3")]
    ),
    "vtu": Kind("in/vtu", mutate_vtk, [importing("in/vtu/a1.vtu", "in/vtu/a2.vtu", "--interval", "1e-3")]),
    "vtp": Kind(
        "in/vtp",
        mutate_vtk,
        [importing("in/vtp/a1.vtp", "in/vtp/a2.vtp", "in/vtp/f1.vti", "in/vtp/f2.vti", "--interval", "1e-3")],
    ),
    "pvd": Kind("in/pvd", mutate_vtk, [importing("in/pvd/particles.pvd")]),
    "vtkhdf": Kind("in/vtkhdf", mutate_vtkhdf, [importing("in/vtkhdf/run.particles.vtkhdf")]),
    "vtkhdf_of_vtk": Kind(
        "in/vtkhdf_of_vtk", mutate_vtkhdf, [importing("in/vtkhdf_of_vtk/a.vtkhdf", "--interval", "1e-3")]
    ),
    "foam": Kind("in/foam", mutate_foam, [importing("in/foam")]),
    "liggghts": Kind("in/liggghts", mutate_one_dump, [importing("in/liggghts/shaken.dump", "--timestep", "1e-5")]),
    "npz": Kind("in/other.npz", mutate_npz, [importing("in/other.npz")]),
    "hdf5": Kind(
        "in/other.h5",
        mutate_hdf5,
        [importing("in/other.h5", "--map", "position=group/x", "--map", "time=t", "--map", "velocity=group/v")],
    ),
    "checkpoint": Kind(
        "out/begun/run.h5.checkpoint",
        mutate_checkpoint,
        [["simulate", "in/long.toml", "-o", "out/begun/run.h5", "--threads", "1", "--resume"]],
    ),
    "training": Kind("out/training", mutate_training, [[*TRAINING, "--resume"]]),
    "plan": Kind("out/plan", mutate_combined, [[*COMBINING, "-o", "out/plan", "--resume"]]),
    "combined": Kind(
        "in/combined",
        mutate_combined,
        [
            ["info", "in/combined"],
            ["predict", "in/combined", "--times", "0.005:0.01:0.001", "-o", "out/made.h5"],
        ],
    ),
    "results": Kind(
        "out/study", mutate_results, [["study", "in/small.toml", "-o", "out/study"], ["report", "out/study"]]
    ),
    "omissions": Kind(
        "out/omissions",
        mutate_results,
        [["study", "in/omissions.toml", "-o", "out/omissions"], ["report", "out/omissions"]],
    ),
}  # fmt: skip
SHARED = ("in", "out", "model")  # folders that every kind gets; of the others each gets its own


def copied(kind: Kind, good: Path, folder: Path) -> None:
    """Copy what a kind needs of the good files."""
    own = Path(kind.place).parts

    def left_out(where: str, names: list[str]) -> list[str]:
        return [name for name in names if (Path(where) / name).is_dir() and name not in (*SHARED, *own)]

    shutil.copytree(good, folder, symlinks=True, ignore=lambda w, n: left_out(w, n) if Path(w).parent == good else [])


def made(words: Sequence[str], folder: Path, prepare: Callable[[], Any] | None = None) -> None:
    """Make one of the good files."""
    done = Child(words, folder, prepare=prepare).wait()
    assert done.code == 0, done.said


def good_files(home: Path) -> Path:
    """Make one good file of each kind by the programs themselves, with a file beside that nobody may read or change."""
    folder = home / "good"
    for part in ("in", "out"):
        (folder / part).mkdir(parents=True)
    inside = folder / "in"
    (inside / "scene.toml").write_text(SCENE)
    (inside / "long.toml").write_text(SCENE.replace("duration = 0.002", "duration = 0.02"))
    (inside / "study.toml").write_text(STUDY)
    write_dump(inside / "other.dump", snapshots=21, n=12)
    made(["import", "in/other.dump", "--timestep", "1e-5", "--diameter", "0.01", "-o", "in/run.h5"], folder)
    made(KINDS["basis"].commands[1], folder)
    made([*KINDS["run"].commands[3][:-1], "in/model"], folder)
    shutil.copy(inside / "run.h5", inside / "secret.h5")
    foreign_files(folder, made)
    states(folder)
    return folder


def states(folder: Path) -> None:
    """Interrupt a simulation and a training, stop short of the card of a combined model, and finish two studies."""
    inside, out = folder / "in", folder / "out"
    (out / "begun").mkdir()
    words = KINDS["checkpoint"].commands[0][:-1]
    done = Child(words, folder, prepare=lambda: stopped_after("suffice.recording", "Recorder", "advance", 5)).wait()
    assert done.code == 130, done.said
    done = Child(
        TRAINING, folder, prepare=lambda: stopped_after("surrogates.regression", "Keeper", "on_validation_end", 9)
    ).wait()
    assert done.code == 130, done.said
    made([*COMBINING, "-o", "in/combined"], folder)
    made([*COMBINING, "-o", "out/plan"], folder)
    plan = out / "plan" / "plan.json"
    plan.write_text(json.dumps(json.loads((out / "plan" / "model.json").read_text())["asked"]))
    (out / "plan" / "model.json").unlink()
    (inside / "small.toml").write_text(SMALL)
    (inside / "omissions.toml").write_text(OMISSIONS)
    made(KINDS["results"].commands[0], folder)
    made(KINDS["omissions"].commands[0], folder)


def stopped_after(module: str, kind: str, method: str, calls: int) -> None:
    """Let a method send its process a Ctrl-C at one of its calls, so that every harness begins with the same state."""
    owner = getattr(importlib.import_module(module), kind)
    whole, left = getattr(owner, method), [calls]

    def counting(*arguments: Any, **named: Any) -> Any:
        left[0] -= 1
        if left[0] == 0:
            os.kill(os.getpid(), signal.SIGINT)
        return whole(*arguments, **named)

    setattr(owner, method, counting)
