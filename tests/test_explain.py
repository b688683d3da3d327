"""What a scene is said to do before it runs: against closed forms, and against the run itself."""

import json
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from sim import Simulation, parse_scene, scene_text
from sim.cost import _forces, emptied
from sim.filling import region_of
from sim.impact import expected_speeds, overlaps_at, stiffness_for, surface_speed
from suffice.store import Run

D = 1e-3


def test_the_deepest_overlap_of_an_elastic_impact_is_the_one_foretold(scene_of):
    # head-on at 1 m/s: δ = v sqrt(m*/k), and the run must reach it
    pair = {"diameter": D, "density": 2500.0, "position": [[0, 0, 0], [1.001 * D, 0, 0]]}
    moving = pair | {"velocity": [[1.0, 0, 0], [0, 0, 0]]}
    scene = scene_of(particles=[moving], time={"duration": 4e-5, "step": 1e-7}, output={"interval": 1e-7})
    run, deepest = Simulation(scene), 0.0
    for k in range(run.snapshots):
        run.advance_to(k)
        deepest = max(deepest, run.series()["overlap.100"])
    assert overlaps_at(scene, 1.0)["contact"] == pytest.approx(deepest, rel=1e-3)  # between two samples of a contact
    foretold = stiffness_for(scene, 1.0, deepest)["contact"]
    assert foretold == pytest.approx(scene.contact.stiffness, rel=2e-3)


def test_speeds_to_expect_are_those_of_free_fall_and_of_the_tip_of_the_rotor():
    scene = parse_scene(scene_text("mini_mill"))
    run = Simulation(scene)
    speeds = {
        one.source: one.speed for one in expected_speeds(scene, run.particles, run.walls, region_of(scene, run.walls))
    }
    assert speeds["free fall through 0.02 m"] == pytest.approx(sqrt(2 * 9.81 * 0.02), rel=1e-12)
    tip = 1000.0 * 2 * pi / 60 * 0.0078
    # a pin ends at 7.8 mm; samples are 20 mm / 48 apart
    assert speeds["surface of the wall 'rotor'"] == pytest.approx(tip, rel=0.1)


def test_the_surface_of_a_drum_moves_at_omega_r(scene_of):
    drum = {"shape": "cylinder", "axis": [0, 0, 1], "radius": 0.05, "length": 0.02, "particles": "inside"}
    turn = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0}
    beads = {"diameter": D, "density": 2500.0, "count": 3}
    walls = [{"name": "drum", "shapes": [drum], "motion": turn}]
    scene = scene_of(particles=[beads], walls=walls, time={"duration": 1e-3}, output={"interval": 1e-3})
    run = Simulation(scene)
    assert surface_speed(run.walls, 0, region_of(scene, run.walls)) == pytest.approx(2 * pi * 0.05, rel=0.05)


@pytest.mark.usefixtures("in_folder")
def test_an_explanation_tells_what_the_run_then_does(suffice, beads):
    Path("scene.toml").write_text(beads)
    told = json.loads(suffice("simulate", "scene.toml", "--explain", "--json", "-").out)
    assert not list(Path().glob("*.h5"))
    ran = json.loads(suffice("simulate", "scene.toml", "-o", "run.h5", "--json", "-").out)
    assert told["time_step"]["steps"] == ran["steps"]
    assert told["time_step"]["step"] == ran["time_step"]
    assert told["particles"]["count"] == ran["n_particles"] == 12
    assert told["particles"]["volume_fraction"] == ran["volume_fraction"]
    assert ran["volume_fraction"] == pytest.approx(12 * pi / 6 * 8e-9 / (64e-6 * 0.012), rel=1e-3)
    with Run("run.h5") as run:
        stored = sum(3 * 4 * run.n_particles * run.n_snapshots for _ in run.quantities)
    assert told["cost"]["file_bytes"] == stored


@pytest.mark.usefixtures("in_folder")
def test_terms_share_the_whole_step_and_absent_ones_are_named(suffice, beads):
    Path("scene.toml").write_text(beads.replace("[gravity]\nacceleration = [0.0, 0.0, -9.81]", ""))
    told = json.loads(suffice("simulate", "scene.toml", "--explain", "--json", "-").out)
    spent = [term["seconds_per_step"] for term in told["terms"]]
    assert sum(spent) >= told["cost"]["seconds_per_step"] * (1 - 1e-9)
    assert {term["term"] for term in told["terms"]} == {"contact", "walls", "lists", "motion"}
    assert {"gravity", "filling", "start", "wall_contact"} <= set(told["left_out"])


@pytest.mark.usefixtures("in_folder")
def test_an_explanation_fits_a_hundred_columns_and_names_what_binds(suffice):
    shown = suffice("simulate", "shaken_box", "--explain")
    assert shown.code == 0
    assert max(len(line) for line in shown.out.splitlines()) <= 100
    assert "  binds " in shown.out
    assert "particle-steps/s" in shown.out


def test_a_simulation_without_a_file_to_write_is_refused(suffice):
    answer = suffice("simulate", "mini_mill")
    assert answer.code == 2
    assert "simulate needs -o RUN" in answer.err


@pytest.fixture
def in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_measuring_what_forces_cost_leaves_the_forces_as_they_are(scene_of):
    # three beads in a row pressed into each other: the middle one feels nothing, the outer ones k δ outwards
    row = {"diameter": D, "density": 2500.0, "position": [[0, 0, 0], [0.96 * D, 0, 0], [1.92 * D, 0, 0]]}
    run = Simulation(scene_of(particles=[row], time={"duration": 1e-6, "step": 1e-7}, output={"interval": 1e-7}))
    before = run.wrench.copy()
    forces = np.sort(before[:, 0])
    assert forces == pytest.approx(run.scene.contact.stiffness * 0.04 * D * np.array([-1.0, 0.0, 1.0]), rel=1e-9)
    _forces(run)
    np.testing.assert_array_equal(run.wrench, before)
    # and without its entries a list gives no force, however its particles lie in chunks
    run.listed, run.wrench[:] = emptied(run.listed), 0.0
    run._fill_starting_forces()
    assert not run.wrench.any()
