import tomllib
from math import inf, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim import Scene, Simulation, simulate
from sim.assembly import walls_of
from suffice.engine.lammps import find_lammps, run_deck
from suffice.engine.observed import touching
from suffice.engine.running import moments, write_input

DIAMETER, DENSITY = 2e-3, 2500.0  # m, kg/m³
MASS = DENSITY * pi * DIAMETER**3 / 6.0  # kg
STIFF = 1e6  # N/m: overlaps below 0.1 % of a radius, and with them the difference in lever arms
GROUPS = 8
FOUR = np.array([[0, 0, 0], [2.3e-3, 3e-4, 1e-4], [4.8e-3, -2e-4, 5e-4], [2.4e-3, 2.7e-3, 3e-4]])  # m
GRAVITY = {"acceleration": [0.0, 0.0, -9.81]}


def on_lammps(scene: Scene, folder: Path, ranks: int = 1) -> np.ndarray:
    """Positions (snapshots, n, 3) m of a scene run by LAMMPS."""
    folder.mkdir()
    start = Simulation(scene)
    write_input(start, folder, ranks)
    run_deck(find_lammps(ranks), folder, ranks, lambda _step: None)
    return np.stack([frame.values["position"] for _, frame in moments(start, folder)])


def on_ours(scene: Scene) -> np.ndarray:
    return np.stack([snapshot.position for snapshot in simulate(scene)])


def tables(steps: float, stiffness: float = STIFF, duration: float = 0.008, **contact: float) -> dict[str, Any]:
    """Tables of a scene whose undamped binary contact takes so many steps."""
    step = pi * sqrt(MASS / 2.0 / stiffness) / steps
    return {
        "contact": {"stiffness": stiffness, "restitution": 0.9, "friction": 0.3} | contact,
        "time": {"duration": duration, "step": step},
        "output": {"interval": 0.001, "precision": "double"},
        "limits": {"max_overlap": inf},
    }


def beads(position: list[list[float]], velocity: Any = (0.0, 0.0, 0.0), spin: Any = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    rows = {"position": position, "velocity": velocity, "angular_velocity": spin}
    return {"particles": [{"diameter": DIAMETER, "density": DENSITY, **rows}]}


def body(shapes: list[dict[str, Any]], motion: dict[str, Any] | None = None, name: str = "body") -> dict[str, Any]:
    return {"name": name, "shapes": shapes} | ({} if motion is None else {"motion": motion})


@pytest.mark.physics
@pytest.mark.usefixtures("engine")
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_spheres_that_collide_three_times_go_where_lammps_sends_them_the_closer_the_shorter_the_step(
    tmp_path: Path, friction: float
) -> None:
    shift = np.random.default_rng(0).uniform(-1e-4, 1e-4, (GROUPS, 4, 3))  # m; contacts begin anywhere within a step
    places = FOUR + shift + 0.02 * np.arange(GROUPS)[:, None, None] * [1.0, 0.0, 0.0]
    spin = np.tile([[0, 30, 0], [0, 0, 0], [10, 0, 5], [0, 0, 40]], (GROUPS, 1)).tolist() if friction else (0.0,) * 3
    velocity = np.tile([[0.5, 0.02, 0], [0, 0, 0.03], [-0.2, 0, 0], [0.02, -0.3, 0]], (GROUPS, 1))
    groups = beads(places.reshape(-1, 3).tolist(), velocity.tolist(), spin)
    apart = []
    for steps in (200.4, 800.1):
        scene = Scene.model_validate(groups | tables(steps, duration=0.005, friction=friction))
        ours = on_ours(scene)
        turned = np.linalg.norm(np.diff(ours, n=2, axis=0), axis=2) > 0.01 * DIAMETER
        assert turned.sum() >= 6 * GROUPS  # two spheres change their course in each of three contacts
        theirs = on_lammps(scene, tmp_path / str(steps))
        apart.append(np.sqrt(np.square(ours - theirs).sum(axis=2).mean(axis=1)).max() / DIAMETER)
    # LAMMPS is of first order in the step, unless a contact takes a whole number of them: its errors at the two ends
    # then cancel, so 200.4 and not 200. What lever arms contribute (the radius in its slip, r − δ/2 in ours) stays
    assert apart[0] < 1e-3
    assert apart[1] < 0.5 * apart[0]


INSIDE = {"particles": "inside"}
OUTSIDE = {"particles": "outside"}
SHAKEN = {"kind": "oscillation", "amplitude": [0.001, 0, 0.0015], "frequency": 50.0, "phase": 0.7}
FALLING = [[0, 0, -0.5], [0, 0, -0.5], [0, 0, -0.5], [0.5, 0, 0]]
CUBE = {"shape": "box", "lowest": [-0.003] * 3, "highest": [0.003] * 3, **OUTSIDE}
PIN = {"shape": "cylinder", "axis": [0.6, 0.8, 0], "centre": [0.00294, 0.00392, -0.003], "radius": 0.001}
WALLS = {
    "a shaken box": (
        [body([{"shape": "box", "lowest": [0, 0, 0], "highest": [0.006, 0.007, 0.008], **INSIDE}], SHAKEN)],
        beads([[0.003, 0.003, 0.003], [0.003, 0.003, 0.0065]], [0.4, 0.6, 0.5]),
    ),
    "sloping planes": (
        [body([{"shape": "plane", "normal": [1, 0, 1]}, {"shape": "plane", "normal": [-1, 0.2, 1]}])],
        beads([[0.002, 0, 0.005], [-0.002, 0.003, 0.006]], [0, 0, -0.8]),
    ),
    "a tilted tube": (
        [body([{"shape": "cylinder", "axis": [1, 1, 1], "radius": 0.004, **INSIDE}])],
        beads([[0, 0, 0.001], [0.003, 0.003, 0.0035]], [0.5, 0.1, -0.4]),
    ),
    "a turning drum": (
        [
            body(
                [{"shape": "cylinder", "axis": [0, 1, 0], "radius": 0.004, "length": 0.006, **INSIDE}],
                {"kind": "rotation", "axis": [0, 1, 0], "rpm": 600.0},
            )
        ],
        beads([[0, 0, -0.0015], [0.001, 0.0005, 0.0015]], [0.1, 0.5, -0.4]),
    ),
    "the side, the edge and the end of a pin": (
        [body([{"shape": "cylinder", "axis": [0, 0, 1], "radius": 0.003, "length": 0.004, **OUTSIDE}])],
        beads([[0, 0, 0.005], [0.0034, 0, 0.004], [0.0022, 0.0024, 0.0045], [-0.006, 0, 0]], FALLING),
    ),
    "a sloping pin that moves": (
        [
            body(
                [{"shape": "cylinder", "axis": [1, 2, 0.5], "radius": 0.003, "length": 0.02, **OUTSIDE}],
                {"kind": "translation", "velocity": [0, 0, 0.2]},
            )
        ],
        beads([[0, 0, 0.005], [0.0014, 0, 0.007], [-0.006, 0, 0]], FALLING[1:]),
    ),
    "faces, edges and corners of a block": (
        [body([CUBE])],
        beads([[0, 0, 0.005], [0.0034, 0, 0.004], [0.0035, 0.0036, 0.005], [-0.006, 0, 0]], FALLING),
    ),
    "a block turning about a slanting axis": (
        [body([CUBE], {"kind": "rotation", "axis": [1, 1, 0], "rpm": 900.0})],
        beads([[0, 0, 0.005], [0.0044, 0, 0.004], [-0.006, 0, 0]], [FALLING[0], FALLING[0], FALLING[3]]),
    ),
    "a rotor with pins": (
        [
            body([{"shape": "cylinder", "axis": [0, 0, 1], "radius": 0.01, "length": 0.012, **INSIDE}], name="vessel"),
            body(
                [
                    {"shape": "cylinder", "axis": [0, 0, 1], "radius": 0.0025, **OUTSIDE},
                    {**PIN, "length": 0.0058, "copies": 4, **OUTSIDE},
                ],
                {"kind": "rotation", "axis": [0, 0, 1], "rpm": 1000.0},
            ),
        ],
        beads([[0.006, 0, -0.003], [-0.006, 0, -0.0025], [0, 0.0065, -0.004]]),
    ),
}


@pytest.mark.physics
@pytest.mark.usefixtures("engine")
@pytest.mark.parametrize("walls", WALLS)
def test_every_wall_throws_spheres_where_the_region_of_the_deck_throws_them(tmp_path: Path, walls: str) -> None:
    bodies, spheres = WALLS[walls]
    scene = tables(100) | spheres | {"gravity": GRAVITY}
    ours = on_ours(Scene.model_validate(scene | {"walls": bodies}))
    unhindered = on_ours(Scene.model_validate(scene))
    assert (np.linalg.norm(ours - unhindered, axis=2).max(axis=0) > 0.1 * DIAMETER).all()  # each has met a wall
    theirs = on_lammps(Scene.model_validate(scene | {"walls": bodies}), tmp_path / "run")
    # first order in the step: a difference in speed of about half a step's damping, 0.5 % at t_c/100, over 8 ms
    assert np.abs(ours - theirs).max() < 8e-3 * DIAMETER


@pytest.mark.physics
@pytest.mark.usefixtures("engine")
def test_a_shaken_bed_has_the_same_energy_height_and_contacts_on_both_engines(tmp_path: Path) -> None:
    box = {"shape": "box", "lowest": [0, 0, 0], "highest": [0.012, 0.012, 0.03], **INSIDE}
    motion = {"kind": "oscillation", "amplitude": [0, 0, 0.001], "frequency": 50.0}
    scene = tables(50, stiffness=2e3, duration=0.12, restitution=0.8) | {
        "gravity": GRAVITY,
        "walls": [body([box], motion)],
    }
    filling = {"lowest": [0, 0, 0], "highest": [0.012, 0.012, 0.015]}
    means: dict[str, list[list[float]]] = {"ours": [], "theirs": []}
    for seed in range(6):
        packed = {"particles": [{"diameter": DIAMETER, "density": DENSITY, "count": 120}], "seed": seed}
        one = Scene.model_validate(scene | packed | {"filling": filling})
        for name, rows in (("ours", on_ours(one)), ("theirs", on_lammps(one, tmp_path / str(seed)))):
            means[name].append(_statistics(one, rows))
    ours, theirs = (np.array(means[name]) for name in ("ours", "theirs"))
    error = np.sqrt((ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / len(ours))
    # five standard errors of six seeds each: once in two thousand by chance
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 5.0 * error).all()
    assert (error < 0.04 * ours.mean(axis=0)).all()  # and the means are sharp enough to be worth comparing


def _statistics(scene: Scene, positions: np.ndarray) -> list[float]:
    """Means over the last 80 ms, four periods of the box: squared displacement in a millisecond, height, contacts."""
    walls, radius = walls_of(scene), np.full(positions.shape[1], DIAMETER / 2.0)
    late = range(41, len(positions))
    contacts = [touching(positions[k], radius, walls, 1e-3 * k).coordination for k in late]
    moved = np.square(np.diff(positions[40:], axis=0)).sum(axis=2).mean()
    return [float(moved), float(positions[41:, :, 2].mean()), float(np.mean(contacts))]


@pytest.mark.usefixtures("engine")
def test_two_ranks_move_the_spheres_as_one_does(tmp_path: Path, beads: str) -> None:
    scene = tomllib.loads(beads)
    scene["time"]["duration"] = 0.005
    one = on_lammps(Scene.model_validate(scene), tmp_path / "one")
    two = on_lammps(Scene.model_validate(scene), tmp_path / "two", ranks=2)
    assert np.abs(one - two).max() < 1e-9  # m: sums in another order, over a few contacts
