import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim import Scene, Simulation
from sim.assembly import walls_of
from sim.energy import kinetic_energy
from sim.motion import rotation_about
from suffice.engine import lammps, regions
from suffice.engine.expressible import EXPRESSIBLE, check_expressible
from suffice.engine.observed import touching
from suffice.engine.regions import wall_commands
from suffice.engine.running import in_order
from suffice.refusal import Refusal
from suffice.run import Run


@pytest.mark.usefixtures("engine")
def test_a_run_by_lammps_reads_like_one_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffice: Callable[..., Any], beads: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(beads)
    assert suffice("simulate", "scene.toml", "-o", "ours.h5", "--until", 0.005).code == 0
    answer = suffice("simulate", "scene.toml", "-o", "theirs.h5", "--until", 0.005, "--engine", "lammps")
    assert answer.code == 0, answer.err
    with Run(Path("ours.h5")) as ours, Run(Path("theirs.h5")) as theirs:
        assert ours.quantities == theirs.quantities
        assert np.array_equal(ours.times, theirs.times)
        assert np.array_equal(ours.radius, theirs.radius)
        assert theirs.provenance["engine"] == "lammps"
        assert "20" in theirs.provenance["lammps"]  # a release is named by its date
        assert set(theirs.series) <= set(ours.series)
        for name in theirs.series:  # the same start, to single precision; the first contacts differ by truncation
            assert theirs.series[name][:1] == pytest.approx(ours.series[name][:1], rel=1e-6, abs=1e-15)
        assert theirs.series["energy.potential"] == pytest.approx(ours.series["energy.potential"], rel=1e-2)
        assert theirs.series["energy.kinetic"] == pytest.approx(ours.series["energy.kinetic"], rel=0.05)
    assert not Path("theirs.h5.lammps").exists()


@pytest.mark.usefixtures("engine")
def test_a_deck_that_lammps_stops_at_leaves_its_folder_and_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffice: Callable[..., Any], beads: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(beads)
    monkeypatch.setattr("suffice.engine.deck.COLUMNS", "id x y z nonsense")
    answer = suffice("simulate", "scene.toml", "-o", "run.h5", "--engine", "lammps")
    assert answer.code == 1
    assert "ERROR" in answer.err
    assert "run.h5.lammps" in answer.err
    assert not Path("run.h5").exists()
    assert Path("run.h5.lammps/run.log").exists()


def test_without_lammps_the_engine_is_refused_with_its_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffice: Callable[..., Any], beads: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(beads)
    monkeypatch.setattr(lammps.util, "find_spec", lambda _name: None)
    monkeypatch.setattr(lammps.shutil, "which", lambda _name: None)
    answer = suffice("simulate", "scene.toml", "-o", "run.h5", "--engine", "lammps")
    assert answer.code == 2
    assert "pip install lammps mpich" in answer.err
    assert list(tmp_path.iterdir()) == [tmp_path / "scene.toml"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--engine", "gpu"], "numba and lammps"),
        (["--engine", "lammps", "--threads", 2], "--ranks 2"),
        (["--engine", "lammps", "--resume"], "checkpoint"),
        (["--engine", "lammps", "--ranks", 0], "one at least"),
        (["--ranks", 2], "--engine lammps"),
    ],
)
def test_options_of_another_engine_are_refused(suffice: Callable[..., Any], options: list[Any], says: str) -> None:
    answer = suffice("simulate", "mini_mill", "-o", "run.h5", *options)
    assert answer.code == 2
    assert says in answer.err


def test_what_a_deck_cannot_say_is_refused_by_name(monkeypatch: pytest.MonkeyPatch, beads: str) -> None:
    scene = Scene.model_validate(tomllib.loads(beads))
    check_expressible(scene)
    monkeypatch.setitem(EXPRESSIBLE, "Contact", {"stiffness", "restitution"})
    with pytest.raises(Refusal, match=r"contact\.friction = 0\.3.*--engine numba"):
        check_expressible(scene)
    monkeypatch.delitem(EXPRESSIBLE, "Oscillation")
    monkeypatch.setitem(EXPRESSIBLE, "Contact", {"stiffness", "restitution", "friction"})
    with pytest.raises(Refusal, match=r"walls\.0\.motion"):
        check_expressible(scene)


def test_a_cylinder_on_a_turning_body_stands_at_time_zero_where_the_scene_puts_it() -> None:
    about, centre, axis = np.array([0.0, 0.0, 1.0]), np.array([0.003, 0.004, 0.001]), np.array([0.6, 0.8, 0.0])
    turned = regions._turned(centre, axis, about, np.array([0.001, 0.0, 0.0]), "rotor")
    turn = np.zeros((3, 3))
    rotation_about(turned.about, turned.angle, turn)
    assert turn @ np.eye(3)[turned.coordinate] == pytest.approx(axis, abs=1e-15)
    assert turn @ (turned.centre - turned.point) + turned.point == pytest.approx(centre, abs=1e-15)


def test_a_cylinder_that_no_turn_of_its_body_brings_into_line_is_refused(scene_of: Callable[..., Scene]) -> None:
    pin = {"shape": "cylinder", "axis": [1, 1, 1], "radius": 0.001, "length": 0.01, "particles": "outside"}
    turning = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0}
    scene = scene_of(
        particles=[{"diameter": 2e-3, "density": 2500.0, "position": [[0, 0, 0.02]]}],
        walls=[{"name": "rotor", "shapes": [pin], "motion": turning}],
        time={"duration": 0.1},
        output={"interval": 0.1},
    )
    with pytest.raises(Refusal, match=r"'rotor'.*--engine numba"):
        wall_commands(scene, walls_of(scene), "")


def test_energies_and_contacts_seen_from_outside_are_those_of_the_run(beads: str) -> None:
    run = Simulation(Scene.model_validate(tomllib.loads(beads)))
    run.advance_to(10 * run.steps_per_snapshot)
    ledger, coordination, overlap = run.ledger()
    p = in_order(run)
    seen = touching(p.position, p.radius, run.walls, run.time)
    assert seen.coordination == coordination
    assert seen.max_overlap == pytest.approx(overlap, abs=1e-12)
    assert kinetic_energy(p) == pytest.approx(ledger.kinetic, rel=1e-12)
