"""Contacts of their own for pairs of species, particles that stay where they are, impacts counted by energy."""

from math import log10, pi

import numpy as np
import pytest

from sim import InputError, LimitError, Simulation, parse_scene, simulate
from sim.collisions import impact_energy_edges
from sim.law import contact_time

D = 1e-3
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}


def mass(density, diameter=D):
    return density * pi * diameter**3 / 6


def head_on(scene_of, kinds, pair_contact, speed=1.0, steps=250, **tables):
    """Two spheres of the species of `kinds`, about to collide."""
    names, density = ("glass", "steel"), (2500.0, 7800.0)
    dt = contact_time(1e4, 1.0, mass(2500.0) / 2) / 100
    particles = []
    for k, name in enumerate(names):
        at = [[0, 0, (D + 3 * speed * dt) * place] for place, kind in enumerate(kinds) if kind == name]
        moving = [[0, 0, speed * (0.5 - place)] for place, kind in enumerate(kinds) if kind == name]
        if at:
            particles.append({"name": name, "diameter": D, "density": density[k], "position": at, "velocity": moving})
        else:  # far away, so that the species is there
            particles.append({"name": name, "diameter": D, "density": density[k], "position": [[1.0, 0, 0]]})
    return scene_of(
        particles=particles, contact={"stiffness": 1e4, "restitution": 0.9}, pair_contact=pair_contact,
        time={"duration": steps * dt, "step": dt}, output={"interval": steps * dt, "precision": "double"}, **tables,
    )  # fmt: skip


def restitution(scene):
    first, last = simulate(scene)
    apart = np.abs(first.position[:, 0]) < 0.5
    before, after = first.velocity[apart, 2], last.velocity[apart, 2]
    return abs((after[1] - after[0]) / (before[1] - before[0]))


PAIRS = [
    {"between": ["glass", "steel"], "stiffness": 1e4, "restitution": 0.7},
    {"between": ["steel", "steel"], "stiffness": 2e4, "restitution": 0.5},
]


@pytest.mark.parametrize(
    ("kinds", "expected"), [(("glass",) * 2, 0.9), (("glass", "steel"), 0.7), (("steel",) * 2, 0.5)]
)
def test_every_pair_of_species_rebounds_with_its_own_restitution(scene_of, kinds, expected):
    assert restitution(head_on(scene_of, kinds, PAIRS)) == pytest.approx(expected, rel=1e-3)


def test_a_pair_without_an_entry_takes_the_constants_of_all(scene_of):
    assert restitution(head_on(scene_of, ("steel", "steel"), PAIRS[:1])) == pytest.approx(0.9, rel=1e-3)


def test_an_unknown_species_is_refused_with_the_names_there_are(scene_of):
    with pytest.raises(ValueError, match="names 'gold'; the species are 'glass', 'steel'"):
        head_on(scene_of, ("glass", "steel"), [PAIRS[0] | {"between": ["glass", "gold"]}])


def test_a_stiffer_pair_binds_the_time_step(scene_of):
    scene = head_on(scene_of, ("glass", "steel"), [PAIRS[0] | {"stiffness": 1e7}])
    with pytest.raises(InputError, match=r"glass.*steel"):
        Simulation(scene)


def test_a_fixed_bead_stays_and_another_bounces_off_it_as_off_a_wall(scene_of):
    dt = contact_time(1e4, 0.8, mass(2500.0)) / 100
    scene = scene_of(
        particles=[
            {"diameter": D, "density": 2500.0, "position": [[0, 0, 0]], "fixed": True},
            {"diameter": D, "density": 2500.0, "position": [[0, 0, D * 1.001]], "velocity": [[0, 0, -1.0]]},
        ],
        contact={"stiffness": 1e4, "restitution": 0.8, "friction": 0.3},
        time={"duration": 200 * dt, "step": dt},
        output={"interval": 200 * dt, "precision": "double"},
    )
    *_, last = simulate(scene)
    assert last.velocity[1, 2] == pytest.approx(0.8, rel=1e-3)
    np.testing.assert_array_equal(last.position[0], 0.0)
    np.testing.assert_array_equal(last.velocity[0], 0.0)


def test_fixed_beads_feel_neither_weight_nor_walls_nor_each_other(scene_of):
    scene = scene_of(
        particles=[{"diameter": D, "density": 2500.0, "position": [[0, 0, 0.4 * D], [0.9 * D, 0, 0.4 * D]],
                    "fixed": True}],
        gravity={"acceleration": [0, 0, -9.81]}, walls=[FLOOR],
        time={"duration": 0.01}, output={"interval": 0.01, "precision": "double"},
    )  # fmt: skip
    first, last = simulate(scene)
    np.testing.assert_array_equal(last.position, first.position)
    assert last.series["energy.kinetic"] == last.series["force.floor.z"] == 0.0


def test_moving_fixed_beads_are_refused(scene_of):
    with pytest.raises(ValueError, match="fixed particles must be 0"):
        scene_of(
            particles=[{"diameter": D, "density": 1e3, "position": [[0, 0, 0]], "fixed": True, "velocity": [1, 0, 0]}],
            time={"duration": 1.0}, output={"interval": 1.0},
        )  # fmt: skip


def test_a_particle_faster_than_the_limit_stops_the_run(scene_of):
    scene = scene_of(
        particles=[{"diameter": D, "density": 2500.0, "position": [[0, 0, 1.0]]}],
        gravity={"acceleration": [0, 0, -9.81]}, limits={"max_speed": 0.5},
        time={"duration": 0.1}, output={"interval": 0.01},
    )  # fmt: skip
    with pytest.raises(LimitError, match=r"particle 0 moves at 0\.\d+ m/s \(limits\.max_speed 0\.5 m/s\) at t = 0\.05"):
        list(simulate(scene))


@pytest.mark.parametrize("with_wall", [False, True])
def test_an_impact_counts_once_in_the_bin_of_half_reduced_mass_times_speed_squared(scene_of, with_wall):
    if with_wall:
        scene = scene_of(
            particles=[{"diameter": D, "density": 2500.0, "position": [[0, 0, 0.6 * D]], "velocity": [0, 0, -1.0]}],
            contact={"stiffness": 1e4, "restitution": 0.9}, walls=[FLOOR],
            time={"duration": 1e-3}, output={"interval": 1e-3, "impacts": True},
        )  # fmt: skip
        energy = 0.5 * mass(2500.0)
    else:
        scene = head_on(scene_of, ("glass", "glass"), [])
        scene = scene.model_copy(update={"output": scene.output.model_copy(update={"impacts": True})})
        energy = 0.5 * mass(2500.0) / 2
    first, last = simulate(scene)
    counts = last.impacts * (last.time - first.time)
    edges = impact_energy_edges()
    expected = np.zeros_like(counts)
    expected[int(with_wall), int(np.searchsorted(edges, energy)) - 1] = 1.0
    assert abs(log10(energy / edges[np.searchsorted(edges, energy)])) > 1e-3  # not at an edge
    np.testing.assert_allclose(counts, expected, atol=1e-9)


def test_the_mixed_law_of_a_scene_in_toml_is_read():
    text = """
[[particles]]
name = "glass"
diameter = 1e-3
density = 2500.0
position = [[0, 0, 0]]
[[particles]]
name = "steel"
diameter = 1e-3
density = 7800.0
position = [[0, 0, 2e-3]]
[contact]
stiffness = 1e4
restitution = 0.9
[[pair_contact]]
between = ["glass", "steel"]
stiffness = 2e4
restitution = 0.5
friction = 0.2
rolling = { model = "constant", friction = 0.01 }
[time]
duration = 0.01
[output]
interval = 0.01
"""
    scene = parse_scene(text)
    assert scene.turns
    assert scene.pairs_roll
