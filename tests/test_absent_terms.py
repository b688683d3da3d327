"""A term that a scene does not list takes no memory; `benchmarks/absent_terms.py` times it."""

import numpy as np
import pytest

from sim import Simulation
from sim.cost import memory_of

N, D = 900, 1e-3  # one chunk: no letter boxes
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}
ROLLING = {"friction": 0.01}


def bed(scene_of, friction=0.0, rolling=None, walls=(), impacts=False, species=1, **tables):
    """Spheres on a cubic lattice, each pressed against its neighbours by a hundredth of a radius."""
    places = np.stack(np.meshgrid(*[np.arange(k) for k in (10, 10, 9)], indexing="ij"), axis=-1).reshape(-1, 3)
    position = (places + 0.5) * 0.995 * D
    parts = np.array_split(position, species)
    return scene_of(
        particles=[{"diameter": D, "density": 2500.0, "position": part.tolist()} for part in parts],
        contact={"stiffness": 1e4, "restitution": 0.5, "friction": friction, "rolling": rolling},
        walls=list(walls), time={"duration": 0.1}, output={"interval": 0.1, "impacts": impacts}, **tables,
    )  # fmt: skip


def bytes_per_particle(scene):
    return {name: size / N for name, size in memory_of(Simulation(scene)).items()}


def test_a_frictionless_particle_takes_168_bytes_and_its_forces_see_no_spin(scene_of):
    """Position, velocity, radius, 1/m, id, species: 80; what forces see: 64; the force: 24."""
    plain = bytes_per_particle(bed(scene_of))
    assert plain["particles"] == 80
    assert plain["forces"] == 64 + 24
    assert plain["walls"] == 16  # where its list of walls begins and ends


def test_spin_friction_rolling_and_walls_each_add_what_they_need(scene_of):
    plain, rubbed = bytes_per_particle(bed(scene_of)), bytes_per_particle(bed(scene_of, 0.3))
    assert rubbed["particles"] - plain["particles"] == 24
    assert rubbed["forces"] - plain["forces"] == 32 + 24
    listed = Simulation(bed(scene_of)).listed
    room = len(listed.partner) / N
    assert rubbed["pairs"] - plain["pairs"] == pytest.approx(24 * room)
    rolled = bytes_per_particle(bed(scene_of, 0.3, ROLLING))
    assert rolled["pairs"] - rubbed["pairs"] == pytest.approx(24 * room)
    assert bytes_per_particle(bed(scene_of, walls=[FLOOR]))["walls"] > plain["walls"]


def test_what_is_not_asked_for_is_none(scene_of):
    run = Simulation(bed(scene_of))
    absent = (run.walls, run.gravity, run.spring, run.wall_spring, run.pair_laws, run.impacts, run.particles.image)
    assert absent == (None,) * 7
    assert run.listed.image.size == 0
