"""Random packing: no overlap with anything, and as much of it as fits."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from sim import InputError, Scene, Simulation, parse_scene, scene_text
from sim.assembly import walls_of
from sim.filling import region_of
from sim.packing import close_packed_sites, free_sites
from sim.start import starting_particles

D = 1e-3
BOX = {"shape": "box", "lowest": [0.0, 0.0, 0.0], "highest": [8e-3, 8e-3, 8e-3], "particles": "inside"}
PIN = {
    "shape": "cylinder",
    "axis": [0.0, 0.0, 1.0],
    "centre": [4e-3, 4e-3, 0.0],
    "radius": 1e-3,
    "particles": "outside",
}


def scene(count, shapes=(BOX,), seed=0, **tables):
    return Scene.model_validate(
        {
            "particles": [{"diameter": D, "density": 2500.0, "count": count}],
            "contact": {"stiffness": 1e3, "restitution": 0.9},
            "time": {"duration": 1e-3},
            "output": {"interval": 1e-3},
            "walls": [{"name": "vessel", "shapes": list(shapes)}] if shapes else [],
            "seed": seed,
        }
        | tables
    )


def packed(scene, seed=0):
    return starting_particles(scene.model_copy(update={"seed": seed}), walls_of(scene)).position


@pytest.mark.parametrize("count", [1, 30, 250])
def test_packed_spheres_touch_neither_each_other_nor_a_wall(count):
    position = packed(scene(count, (BOX, PIN)))
    assert position.shape == (count, 3)
    assert count == 1 or pdist(position).min() > D
    assert (position >= D / 2).all()
    assert (position <= 8e-3 - D / 2).all()
    from_pin = np.linalg.norm(position[:, :2] - 4e-3, axis=1) - 1e-3
    assert (from_pin >= D / 2).all()


def test_the_same_seed_packs_the_same_and_another_seed_another():
    first = packed(scene(50))
    assert np.array_equal(first, packed(scene(50)))
    assert np.abs(first - packed(scene(50), 1)).max() > D


def test_the_seed_of_a_scene_is_the_one_that_packs():
    one, two = (Simulation(scene(50, seed=seed)).snapshot().position for seed in (1, 2))
    assert np.abs(one - two).max() > D
    assert np.array_equal(one, Simulation(scene(50, seed=1)).snapshot().position)


def test_neighbours_in_space_are_not_neighbours_in_number():
    position = packed(scene(250))
    to_the_next = np.linalg.norm(np.diff(position, axis=0), axis=1)
    assert np.median(to_the_next) > 2 * D  # in the order of the lattice it would be about one diameter


def test_close_packed_sites_have_twelve_neighbours_and_the_closest_density():
    sites = close_packed_sites(np.zeros(3), np.full(3, 10.0), 1.0)
    inner = sites[((sites > 2.5) & (sites < 7.5)).all(axis=1)]
    distance = np.linalg.norm(inner[:, None] - sites[None], axis=2)
    touching = np.abs(distance - 1.0) < 1e-9
    assert (touching.sum(axis=1) == 12).all()
    assert (distance > 1.0 - 1e-9).sum(axis=1).tolist() == [len(sites) - 1] * len(inner)


def test_species_of_several_sizes_all_get_room():
    sizes = [{"diameter": d, "density": 2500.0, "count": n} for d, n in ((1e-3, 40), (6e-4, 60))]
    position = packed(scene(1, particles=sizes))
    radius = np.repeat([5e-4, 3e-4], [40, 60])
    gap = np.linalg.norm(position[:, None] - position[None], axis=2) - radius[:, None] - radius[None]
    assert gap[np.triu_indices(100, 1)].min() > 0.0


def test_given_positions_stand_where_they_are_beside_packed_ones():
    given = {"diameter": D, "density": 2500.0, "position": [[4e-3, 4e-3, 0.1]]}
    tables = [{"diameter": D, "density": 2500.0, "count": 5}, given]
    snapshot = Simulation(scene(1, (BOX | {"open": ["+z"]},), particles=tables)).snapshot()
    assert snapshot.position[5].tolist() == [4e-3, 4e-3, 0.1]
    assert (snapshot.position[:5, 2] < 8e-3).all()


def test_a_vessel_that_is_too_small_says_how_many_fit():
    with pytest.raises(InputError, match=r"only about (\d+) of 5000 spheres of 0\.001 m fit") as caught:
        packed(scene(5000))
    fits = int(str(caught.value).split("about ")[1].split()[0])
    assert 300 < fits <= int(0.7405 * 8**3 * 6 / np.pi)  # no more than the closest packing of the whole box
    assert len(packed(scene(int(0.97 * fits)))) == int(0.97 * fits)
    with pytest.raises(InputError, match="only about"):
        packed(scene(int(1.06 * fits)))


def test_spheres_of_one_size_that_random_places_cannot_hold_are_close_packed():
    fits = len(free_sites(region_of(scene(1), None), D / 2, None))
    assert pdist(packed(scene(fits))).min() > D


def test_without_a_closed_vessel_there_must_be_a_filling_box():
    floor = {"shape": "plane", "normal": [0.0, 0.0, 1.0]}
    with pytest.raises(InputError, match=r"no wall encloses the particles.*\[filling\].* in m"):
        packed(scene(5, (floor,)))
    filling = {"lowest": [0.0, 0.0, 0.0], "highest": [5e-3, 5e-3, 5e-3]}
    position = packed(scene(5, (floor,), filling=filling))
    assert ((position >= D / 2) & (position <= 5e-3 - D / 2)).all()


def test_the_mill_packs_its_beads_between_vessel_and_rotor():
    position = Simulation(parse_scene(scene_text("mini_mill"))).snapshot().position
    axis = np.linalg.norm(position[:, :2], axis=1)
    assert pdist(position).min() > D
    assert axis.max() <= 10e-3 - D / 2
    assert axis.min() >= 2.5e-3 + D / 2
