"""Mixing, granular temperature and overlaps against closed forms."""

import numpy as np
import pytest

from sim import Scene, Simulation
from sim.averaging import cells_of
from sim.collisions import BINS, count_impact, impact_energy_edges
from sim.granular_temperature import granular_temperature
from sim.mixing import lacey_index

D = 1e-3


@pytest.fixture
def cloud():
    """20,000 places in a cube of 40 diameters, and the cells of four."""
    rng = np.random.default_rng(0)
    position = rng.uniform(0.0, 40 * D, (20_000, 3))
    return position, cells_of(position, 4 * D), rng


def test_species_in_different_cells_are_not_mixed_at_all(cloud):
    _, cell, _ = cloud
    assert lacey_index((cell % 2).astype(np.uint8), cell) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_species_dealt_by_chance_have_the_index_one(cloud, share):
    _, cell, rng = cloud
    n = len(cell)
    dealt = [lacey_index((rng.permutation(n) < share * n).astype(np.uint8), cell) for _ in range(40)]
    assert np.mean(dealt) == pytest.approx(1.0, abs=4 * np.std(dealt) / np.sqrt(40))
    assert np.std(dealt) < 0.01  # relative scatter of a variance of 1000 cells, and σ_R² is a twentieth of σ₀²


def test_half_mixed_means_half_of_the_variance_is_gone(cloud):
    # shares 1/2 ± a in alternate cells: σ² = a², σ₀² = 1/4
    _, cell, _ = cloud
    n, cells = len(cell), int(cell.max()) + 1
    rank = np.empty(n, int)
    order = np.lexsort((np.arange(n), cell))
    counts = np.bincount(cell)
    rank[order] = np.arange(n) - np.repeat(np.cumsum(counts) - counts, counts)
    aim = np.where(np.arange(cells) % 2, 0.5 + np.sqrt(0.125), 0.5 - np.sqrt(0.125))
    first = rank < np.round(aim[cell] * counts[cell])
    expected = 0.125 / (0.25 - 0.25 * (cells - 1) / (n - 1))
    assert lacey_index(first.astype(np.uint8), cell) == pytest.approx(expected, abs=0.01)  # whole particles per cell


def test_one_species_alone_has_no_mixing_index(cloud):
    _, cell, _ = cloud
    assert np.isnan(lacey_index(np.zeros(len(cell), np.uint8), cell))


@pytest.mark.parametrize("number", [20_000, 6000])
def test_a_maxwellian_gas_has_its_temperature_whatever_streams_shears_or_turns(cloud, number):
    position, _, rng = cloud
    position, mass = position[:number], rng.choice([1e-6, 1e-6], number)
    cell = cells_of(position, 4 * D)
    noise = rng.normal(0.0, 0.02, (number, 3))
    scatter = 4.0 * np.sqrt(2.0 / (3 * number))  # of a variance of 3 N numbers
    still = granular_temperature(position, noise, mass, cell)
    assert still == pytest.approx(4e-4, rel=scatter + 0.01)
    flow = np.array([3.0, 0.0, 0.0]) + np.cross([0.0, 0.0, 80.0], position)
    flow[:, 0] += 200.0 * position[:, 2]
    assert granular_temperature(position, noise + flow, mass, cell) == pytest.approx(still, rel=1e-9)


def test_a_linear_flow_is_cold_and_heavy_particles_count_by_their_mass(cloud):
    position, cell, rng = cloud
    turn = np.cross([10.0, -20.0, 30.0], position)
    assert granular_temperature(position, turn, np.full(len(cell), 1e-6), cell) < 1e-24 + 1e-20
    # half of the mass at a temperature, half at rest, each in cells of its own
    mass = np.where(cell % 2, 3e-6, 1e-6)
    noise = rng.normal(0.0, 0.1, position.shape) * (cell % 2)[:, None]
    total = mass * 1.0
    hot = np.sum(total[cell % 2 == 1]) / total.sum()
    assert granular_temperature(position, noise, mass, cell) == pytest.approx(0.01 * hot, rel=0.03)


def test_a_flat_layer_has_a_temperature_too():
    rng = np.random.default_rng(3)
    position = rng.uniform(0.0, 40 * D, (4000, 3)) * [1.0, 1.0, 0.0]
    noise = rng.normal(0.0, 0.1, position.shape)
    found = granular_temperature(position, noise, np.ones(4000), cells_of(position, 4 * D))
    assert found == pytest.approx(0.01, rel=4 * np.sqrt(2 / 12_000) + 0.01)


def test_too_few_neighbours_have_no_temperature():
    assert np.isnan(granular_temperature(np.eye(3), np.eye(3), np.ones(3), np.zeros(3, int)))


def test_overlaps_are_told_in_diameters_and_species_by_their_names(scene_of):
    one = {"diameter": D, "density": 2500.0, "position": [[0.0, 0.0, 0.0], [0.99 * D, 0.0, 0.0]], "name": "glass"}
    two = one | {"position": [[5e-3, 0.0, 0.0], [5e-3, 0.98 * D, 0.0]], "name": "steel"}
    scene = scene_of(particles=[one, two], time={"duration": 1e-3}, output={"interval": 1e-3})
    series = Simulation(scene).series()
    assert series["overlap.100"] == pytest.approx(0.02, rel=1e-9)
    assert series["overlap.50"] == pytest.approx(0.015, rel=1e-9)
    assert series["mixing.glass.steel"] == pytest.approx(0.0, abs=1e-12)


def test_a_bead_in_the_floor_is_an_overlap_too():
    floor = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}
    scene = Scene.model_validate(
        {
            "particles": [{"diameter": D, "density": 2500.0, "position": [[0.0, 0.0, 0.49 * D]]}],
            "contact": {"stiffness": 1e3, "restitution": 0.9},
            "time": {"duration": 1e-3},
            "output": {"interval": 1e-3},
            "walls": [floor],
        }
    )
    series = Simulation(scene).series()
    assert series["overlap.50"] == series["overlap.100"] == pytest.approx(0.01, rel=1e-9)
    assert np.isnan(series["granular_temperature"])


def test_an_impact_counts_in_the_bin_of_its_energy_and_only_when_approaching():
    edges = impact_energy_edges()
    impacts = np.zeros(BINS)
    for speed in (-1.0, 1.0, 0.0):
        count_impact(impacts, speed, 1e-6, 1e4, 2e-6)
    energy = 0.5 * 2e-6 + 0.5 * 1e4 * 1e-12
    (place,) = impacts.nonzero()[0]
    assert impacts[place] == 1.0
    assert edges[place] <= energy < edges[place + 1]
    for weak_or_strong in (-1e-12, -1e12):
        count_impact(impacts, weak_or_strong, 0.0, 1e4, 2e-6)
    assert (impacts[0], impacts[-1]) == (1.0, 1.0)
