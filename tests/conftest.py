"""Scenes in a line, and the command line in a call."""

import os
import tarfile
from collections.abc import Callable, Iterator
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from sim import Scene
from sim.coupled import CoupledSimulation
from sim.coupling import Coupling

FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}

SHAKEN_BEADS = """# Twelve beads in a shaken box, thrown about.
seed = 1

[[particles]]
diameter = 2e-3        # m
density = 2500.0       # kg/m³
count = 12
velocity = [0.3, 0.2, 0.1]

[contact]
stiffness = 1e3        # N/m
restitution = 0.8
friction = 0.3

[gravity]
acceleration = [0.0, 0.0, -9.81]   # m/s²

[time]
duration = 0.02        # s

[output]
interval = 0.001       # s

[[walls]]
name = "box"
motion = { kind = "oscillation", amplitude = [0.0, 0.0, 0.001], frequency = 40.0 }
[[walls.shapes]]
shape = "box"
lowest = [0.0, 0.0, 0.0]
highest = [0.008, 0.008, 0.012]
particles = "inside"
"""


class Answer(NamedTuple):
    """What a command gave back."""

    code: int
    out: str
    err: str


def pytest_xdist_setupnodes() -> None:
    """Give each of several workers one thread: two that wait at a barrier beside others lose more than they gain."""
    os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def pytest_configure() -> None:
    """Compute on one thread where this process is one of several workers; tests may still ask for two."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        numba.set_num_threads(1)


@pytest.fixture(scope="session")
def reference() -> Path:
    """Return the folder of the foreign run, which lies beside the checkout; CI may not go without it."""
    folder = Path(__file__).parents[1].parent / "shared" / "reference"
    if not folder.exists() and "CI" not in os.environ:
        pytest.skip("the foreign run is not beside this checkout (../shared/reference)")
    return folder


@pytest.fixture
def unpacked(tmp_path: Path) -> Callable[[str, str], Path]:
    """Unpack files that a program wrote, kept in `reference/PROGRAM/` with the deck that made them."""

    def unpack(program: str, archive: str) -> Path:
        with tarfile.open(Path(__file__).parent / "reference" / program / f"{archive}.tar.xz") as tar:
            tar.extractall(tmp_path / program, filter="data")
        return tmp_path / program

    return unpack


@pytest.fixture
def vtk() -> None:
    """Skip where VTK, an extra, is not installed."""
    pytest.importorskip("vtkmodules.vtkIOLegacy")


@pytest.fixture(scope="session")
def engine() -> None:
    """Skip where LAMMPS is not installed; CI may not go without it."""
    from suffice.engine.lammps import find_lammps
    from suffice.refusal import Refusal

    try:
        find_lammps(2)
    except Refusal as absent:
        if "CI" in os.environ:
            raise
        pytest.skip(str(absent))


@pytest.fixture(autouse=True)
def third_law(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Hold every coupled run of every test to Newton's third law, whenever it has come to where it was sent.

    Drag on the beads, drag on the fluid and its sides, and what is still owed, cancel within 1e-12 of all exchanged.
    """
    runs: dict[Coupling, tuple[float, float]] = {}  # N s left over and N s exchanged, the most of each run
    advance = CoupledSimulation.advance_to

    def weighed(run: CoupledSimulation, step: int) -> None:
        advance(run, step)
        c = run.coupling
        if c is not None and c.two_way:
            rest, exchanged = runs.get(c, (0.0, 0.0))
            left = float(np.abs(c.impulse.sum(axis=0) + c.owed.sum(axis=0)).max())
            runs[c] = max(rest, left), max(exchanged, float(np.abs(c.impulse).max()))

    monkeypatch.setattr(CoupledSimulation, "advance_to", weighed)
    yield
    for rest, exchanged in runs.values():
        assert rest <= 1e-12 * exchanged, f"{rest:.2e} N s of {exchanged:.2e} exchanged by drag are lost"


@pytest.fixture
def scene_of() -> Callable[..., Scene]:
    """Build a scene of elastic contacts without an overlap limit, changed by the tables given."""

    def build(**tables: Any) -> Scene:
        contact = {"stiffness": 1e4, "restitution": 1.0} | tables.pop("contact", {})
        scene = {"contact": contact, "limits": {"max_overlap": inf}, **tables}
        return Scene.model_validate(scene)

    return build


@pytest.fixture(scope="session")
def beads() -> str:
    """Return a small scene as TOML: 12 beads, 21 snapshots."""
    return SHAKEN_BEADS


@pytest.fixture
def suffice(capsys: pytest.CaptureFixture[str]) -> Iterator[Callable[..., Answer]]:
    """Run a command line in this process and return exit code, standard output and standard error."""
    from suffice.__main__ import app
    from suffice.door import run_command

    def call(*arguments: object) -> Answer:
        capsys.readouterr()
        code = run_command(lambda: app([str(a) for a in arguments], standalone_mode=False))
        said = capsys.readouterr()
        return Answer(code, said.out, said.err)

    threads = numba.get_num_threads()
    yield call
    numba.set_num_threads(threads)  # --threads holds for the whole process


@pytest.fixture
def write_run() -> Callable[..., Path]:
    """Write a run of particles on smooth paths: positions and velocities, evenly in time."""
    from suffice.store import RunWriter

    def write(path: Path, n_snapshots: int = 41, n: int = 24, interval: float = 0.001, radius: float = 5e-4) -> Path:
        phase, pace = np.random.default_rng(0).uniform(0.0, 60.0, (2, n, 3))
        particles = {"ids": np.arange(n), "radius": np.full(n, radius), "species": np.ones(n, int)}
        motion = ("position", "velocity")
        provenance = {"suffice": "test"}
        with RunWriter(path, **particles, n_snapshots=n_snapshots, variables=motion, provenance=provenance) as run:
            for k in range(n_snapshots):
                angle = pace * k * interval + phase
                run.append(k * interval, {"position": np.sin(angle), "velocity": pace * np.cos(angle)})
        return path

    return write


STIRRED = """# Beads in a box of water with a paddle of two arms.
[[particles]]
diameter = 1e-3        # m
density = 2500.0       # kg/m³
count = 64

[contact]
stiffness = 1e3        # N/m
restitution = 0.8

[fluid]
density = 1000.0       # kg/m³
viscosity = 1e-3       # Pa s
lowest = [0.0, 0.0, 0.0]
highest = [0.006, 0.006, 0.006]
cells = [4, 4, 3]

[drag]

[time]
duration = 1.0         # s

[output]
interval = 0.01        # s

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


@pytest.fixture
def write_stirred() -> Callable[..., Path]:
    """Write a made-up run of stirred beads, whose fields turn with the phase of the rotor and grow with its speed.

    Beads stand on a lattice, two at each place, with velocities a (cos, sin, 1) of the phase ± a/2; the fluid follows,
    pressure is a² x (1 + cos/2), the void fraction 0.5 + 0.1 b z, with a and b functions of rpm / 1000. `noise` shakes
    everything at random from snapshot to snapshot.
    """
    from suffice.quantities import Grid
    from suffice.store import RunWriter

    def write(
        path: Path, rpm: float = 600.0, a: Callable[[float], float] = float, b: Callable[[float], float] = float,
        periods: int = 4, per_period: int = 8, noise: float = 0.0,
    ) -> Path:  # fmt: skip
        rng = np.random.default_rng(int(rpm))
        place = (np.stack(np.meshgrid(*[[0.002, 0.004]] * 3), axis=-1).reshape(-1, 3)).repeat(2, axis=0)
        n, grid, pace = len(place), Grid((3, 4, 4), (0.0, 0.0, 0.0), (0.0015, 0.0015, 0.002)), rpm / 1e3
        z, y, x = np.meshgrid(*[(np.arange(k) + 0.5) / k for k in grid.shape], indexing="ij")
        sign = np.where(np.arange(n) % 2, 0.5, -0.5)[:, None]
        text = STIRRED.replace("rpm = 600.0", f"rpm = {rpm}")
        names = ("position", "velocity", "fluid.velocity", "fluid.pressure", "fluid.void_fraction")
        particles = {"ids": np.arange(n), "radius": np.full(n, 5e-4), "species": np.zeros(n, int)}
        count = periods * per_period + 1
        with RunWriter(
            path, **particles, n_snapshots=count, variables=names, grid=grid, provenance={"scene": text},
            precision="double", beside=True,
        ) as run:  # fmt: skip
            for k in range(count):
                turned = 2.0 * np.pi * k / per_period
                way = np.array([np.cos(turned), np.sin(turned), 1.0])
                values = {
                    "position": place,
                    "velocity": a(pace) * (way + sign),
                    "fluid.velocity": a(pace) * y[..., None] * way,
                    "fluid.pressure": 1e3 * a(pace) ** 2 * x * (1.0 + 0.5 * way[0]),
                    "fluid.void_fraction": 0.5 + 0.1 * b(pace) * z,
                }
                for name in names[1:]:
                    size = noise * np.abs(values[name]).mean()
                    values[name] = values[name] + size * rng.normal(size=values[name].shape)
                run.append(k * 30.0 / rpm / per_period, values)
        return path

    return write
