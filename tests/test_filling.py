"""Sizes and numbers of spheres against closed forms, and how densely they are packed at random."""

from math import exp, pi, sqrt

import numba
import numpy as np
import pytest
from scipy.spatial import cKDTree

from sim import InputError, Scene, Simulation
from sim.assembly import walls_of
from sim.filling import SAMPLES, _cells, free_volume, numbers_of, region_of, solid_fraction
from sim.kernel import most_threads
from sim.sizes import drawn_diameters, mean_volume
from sim.species import ParticleTable
from sim.start import StartState, starting_particles
from sim.timestep import time_limits

D = 1e-3
BOX = {"shape": "box", "lowest": [0.0, 0.0, 0.0], "highest": [0.01, 0.01, 0.01], "particles": "inside"}
DRUM = {"shape": "cylinder", "axis": [0.0, 0.0, 1.0], "radius": 0.01, "length": 0.01, "particles": "inside"}
SHAFT = {"shape": "cylinder", "axis": [0.0, 0.0, 1.0], "radius": 0.004, "particles": "outside"}
SIEVE = {"kind": "sieve", "diameter": [5e-4, 1e-3, 2e-3], "mass_fraction": [0.1, 0.6, 0.3]}
UNIFORM = {"kind": "uniform", "low": 8e-4, "high": 1.2e-3}
LOGNORMAL = {"kind": "lognormal", "sigma": 0.2, "low": 1e-4, "high": 1e-2}


def table(**fields):
    return ParticleTable.model_validate({"diameter": D, "density": 2500.0} | fields)


def scene(*species, shapes=(BOX,), **tables):
    return Scene.model_validate(
        {
            "particles": [{"diameter": D, "density": 2500.0} | one for one in species],
            "contact": {"stiffness": 1e3, "restitution": 0.9},
            "time": {"duration": 1e-3},
            "output": {"interval": 1e-3},
            "walls": [{"name": "vessel", "shapes": list(shapes)}],
        }
        | tables
    )


def deepest_gap(particles):
    """Smallest gap of any two spheres over the sum of their radii, negative where they overlap."""
    tree = cKDTree(particles.position)
    i, j = tree.query_pairs(2.0 * particles.radius.max() * 1.01, output_type="ndarray").T
    reach = particles.radius[i] + particles.radius[j]
    return (np.linalg.norm(particles.position[i] - particles.position[j], axis=1) / reach - 1.0).min()


@pytest.mark.parametrize("distribution", [UNIFORM, LOGNORMAL, SIEVE, LOGNORMAL | {"by": "mass"}])
def test_drawn_spheres_weigh_what_their_law_says_and_keep_its_bounds(distribution):
    species = table(count=1, distribution=distribution)
    drawn = drawn_diameters(species, 20_000, np.random.default_rng(1))
    assert species.smallest <= drawn.min() <= drawn.max() <= species.largest
    # drawn in 20,000 equal shares: the error is that of the tail's last share
    assert pi / 6 * np.mean(drawn**3) == pytest.approx(mean_volume(species), rel=2e-3)


def test_mean_volumes_of_the_laws_are_those_of_their_closed_forms():
    low, high = UNIFORM["low"], UNIFORM["high"]
    assert mean_volume(table(count=1, distribution=UNIFORM)) == pytest.approx(
        pi / 6 * (high**4 - low**4) / (4 * (high - low)), rel=1e-8
    )
    # E d³ = median³ exp(9σ²/2); the bounds are 11 standard deviations away
    by_number = mean_volume(table(count=1, distribution=LOGNORMAL))
    assert by_number == pytest.approx(pi / 6 * D**3 * exp(4.5 * 0.04), rel=1e-3)
    by_mass = mean_volume(table(count=1, distribution=LOGNORMAL | {"by": "mass"}))
    assert by_mass / by_number == pytest.approx(exp(-9 * 0.04), rel=1e-6)


def test_half_of_the_mass_of_a_lognormal_by_mass_is_in_spheres_below_the_median():
    law = LOGNORMAL | {"by": "mass", "sigma": 0.5}
    drawn = drawn_diameters(table(count=1, distribution=law), 200_000, np.random.default_rng(0))
    assert np.sum(drawn[drawn < D] ** 3) / np.sum(drawn**3) == pytest.approx(0.5, abs=5e-3)


def test_each_sieve_fraction_has_its_share_of_the_mass():
    drawn = drawn_diameters(table(count=1, distribution=SIEVE), 50_000, np.random.default_rng(0))
    mass = [np.sum(drawn[drawn == d] ** 3) for d in SIEVE["diameter"]]
    assert np.array(mass) / sum(mass) == pytest.approx(SIEVE["mass_fraction"], abs=5e-3)


def test_a_truncated_lognormal_far_in_its_tail_stays_within_its_bounds():
    law = LOGNORMAL | {"low": 1e-3, "high": 1.01e-3, "sigma": 0.02, "by": "mass"}
    drawn = drawn_diameters(table(count=1, distribution=law), 1000, np.random.default_rng(0))
    assert np.unique(drawn).size > 900
    assert 1e-3 <= drawn.min() <= drawn.max() <= 1.01e-3


@pytest.mark.parametrize(
    ("shapes", "volume"),
    [
        ((BOX,), 1e-6),
        ((DRUM,), pi * 1e-4 * 0.01),
        ((DRUM, SHAFT), pi * (1e-4 - 1.6e-5) * 0.01),
    ],
)
def test_free_volume_of_a_vessel_is_that_of_geometry(shapes, volume):
    vessel = scene({"count": 1}, shapes=shapes)
    region = region_of(vessel, walls_of(vessel))
    assert region.volume == pytest.approx(volume, rel=5e-4)  # 500,000 cells, surfaces cut as if along the axes


def test_a_box_without_walls_is_free_altogether():
    assert free_volume(np.zeros(3), np.array([1.0, 2.0, 3.0]), None) == 6.0


def test_a_filling_degree_is_bulk_of_which_six_tenths_are_solid():
    half = scene({"filling_degree": 0.5}, shapes=(DRUM, SHAFT))
    free = pi * (1e-4 - 1.6e-5) * 0.01
    assert numbers_of(half, walls_of(half))[0] == pytest.approx(0.5 * 0.6 * free / (pi / 6 * D**3), rel=2e-3)
    solid = scene({"volume_fraction": 0.3}, shapes=(DRUM, SHAFT))
    assert numbers_of(solid, walls_of(solid)) == numbers_of(half, walls_of(half))


def test_the_volume_fraction_asked_for_is_the_one_that_is_packed():
    wide = scene({"volume_fraction": 0.4, "distribution": UNIFORM}, {"count": 7, "diameter": 2e-3})
    particles = starting_particles(wide, walls_of(wide))
    seven = 7 * pi / 6 * 8e-9 / 1e-6
    assert solid_fraction(wide, walls_of(wide), particles.radius) == pytest.approx(0.4 + seven, abs=1e-3)
    assert deepest_gap(particles) > 0.0


def test_a_share_of_less_than_one_sphere_is_refused():
    with pytest.raises(InputError, match=r"particles\.0: .* m³ of spheres asked for is less than one"):
        Simulation(scene({"volume_fraction": 1e-5}))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"count": 3, "volume_fraction": 0.1}, "found count and volume_fraction"),
        ({}, "give one of count, filling_degree, volume_fraction and position"),
        ({"filling_degree": 0.5, "velocity": [[0, 0, 0]]}, "filling_degree decides how many"),
        ({"count": 3, "distribution": UNIFORM | {"low": 1.1e-3}}, "outside of its distribution"),
        ({"count": 3, "distribution": SIEVE | {"mass_fraction": [1.0]}}, "lists 3 fractions, mass_fraction 1"),
    ],
)
def test_numbers_and_sizes_that_contradict_each_other_are_refused(fields, says):
    with pytest.raises(ValueError, match=says):
        table(**fields)


def test_two_species_of_one_name_are_refused_and_unnamed_ones_are_numbered():
    assert scene({"count": 1}, {"count": 1, "name": "steel"}).species == ["species 0", "steel"]
    with pytest.raises(ValueError, match=r"particles\.1\.name = 'steel' is taken by particles\.0"):
        scene({"count": 1, "name": "steel"}, {"count": 1, "name": "steel"})


def test_the_smallest_sphere_that_can_be_drawn_limits_the_step():
    # t_c ∝ sqrt(m) ∝ d^(3/2)
    equal = time_limits(scene({"count": 2}))[0].advised
    spread = time_limits(scene({"count": 2, "distribution": UNIFORM}))[0].advised
    assert spread / equal == pytest.approx(sqrt(0.8**3), rel=1e-12)


def test_masses_follow_the_drawn_radii():
    wide = scene({"count": 300, "distribution": UNIFORM})
    particles = starting_particles(wide, walls_of(wide))
    assert particles.radius.std() > 0.1 * D / 2
    assert 1.0 / particles.inverse_mass == pytest.approx(2500.0 * 4 / 3 * pi * particles.radius**3, rel=1e-12)


def test_the_same_seed_draws_and_packs_the_same_on_any_number_of_threads():
    wide = scene({"count": 4500, "diameter": 5e-4, "distribution": UNIFORM | {"low": 4e-4, "high": 6e-4}})
    packed = []
    for threads in (1, most_threads()):
        numba.set_num_threads(threads)
        packed.append(starting_particles(wide, walls_of(wide)))
    first, second = packed
    assert np.array_equal(first.radius, second.radius)
    assert np.array_equal(first.position, second.position)


def test_a_tenfold_range_of_sizes_reaches_a_dense_packing_without_overlap():
    law = {"kind": "lognormal", "sigma": 0.6, "low": 4e-4, "high": 4e-3, "by": "mass"}
    wide = scene({"volume_fraction": 0.55, "distribution": law, "diameter": 2e-3})
    particles = starting_particles(wide, walls_of(wide))
    assert particles.radius.max() / particles.radius.min() > 5.0
    assert deepest_gap(particles) > 0.0
    assert (particles.position > particles.radius[:, None]).all()
    assert (particles.position < 0.01 - particles.radius[:, None]).all()


def test_packed_spheres_leave_room_for_those_whose_place_is_given():
    tables = ({"volume_fraction": 0.3}, {"position": [[5e-3, 5e-3, 5e-3]], "diameter": 4e-3})
    mixed = scene(*tables)
    particles = starting_particles(mixed, walls_of(mixed))
    assert particles.position[-1].tolist() == [5e-3, 5e-3, 5e-3]
    assert deepest_gap(particles) > 0.0


def test_a_dense_packing_has_no_layers_of_a_lattice():
    # in a lattice of this density centres stand in planes; at random, far from the walls, their heights are even
    box = BOX | {"highest": [0.02, 0.02, 0.02]}
    dense = scene({"volume_fraction": 0.5}, shapes=(box,))
    heights = starting_particles(dense, walls_of(dense)).position[:, 2]
    middle = heights[(heights > 6e-3) & (heights < 14e-3)]
    counts = np.histogram(middle, bins=32, range=(6e-3, 14e-3))[0]
    assert counts.std() / counts.mean() < 0.25  # 1 for planes at multiples of 0.8 diameters


@pytest.mark.physics
def test_twenty_thousand_beads_reach_the_density_of_a_poured_bed():
    box = BOX | {"highest": [0.026, 0.026, 0.026]}
    bed = scene({"volume_fraction": 0.59}, shapes=(box,))
    particles = starting_particles(bed, walls_of(bed))
    assert len(particles.radius) == pytest.approx(19_800, rel=0.01)
    assert deepest_gap(particles) > 0.0


def moment(n, radius=D / 2, species=0):
    place = np.linspace(1e-3, 9e-3, n)[:, None] * np.ones(3)
    return StartState(place, np.full((n, 3), 0.1), np.ones((n, 3)), np.full(n, radius), np.full(n, species))


def test_a_run_starts_where_another_one_stands():
    first = moment(4)
    run = Simulation(scene({"count": 4}, contact={"stiffness": 1e3, "restitution": 0.9, "friction": 0.2}), start=first)
    now = run.snapshot()
    assert np.array_equal(now.position, first.position)
    assert np.array_equal(now.velocity, first.velocity)
    assert np.array_equal(now.angular_velocity, first.angular_velocity)
    assert Simulation(scene({"count": 4}), start=first).snapshot().angular_velocity is None


def test_the_number_of_a_share_is_that_of_the_run_it_starts_from():
    assert len(Simulation(scene({"volume_fraction": 0.3}), start=moment(5)).particles.radius) == 5


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (moment(3), r"particles\.0: 4 particles, and start\.run has 3; give count = 3"),
        (moment(4, radius=6e-4), r"particles\.0\.diameter = 0\.001 m: start\.run has a sphere of 0\.0012 m"),
        (moment(4, species=1), r"start\.run: has 2 species and the scene 1"),
    ],
)
def test_a_start_with_other_particles_is_refused(start, says):
    with pytest.raises(InputError, match=says):
        Simulation(scene({"count": 4}), start=start)
    with pytest.raises(InputError, match=r"start\.run = 'a\.h5': only `suffice simulate` reads runs"):
        Simulation(scene({"count": 4}, start={"run": "a.h5"}))


@pytest.mark.parametrize("extent", [(1.0, 1.0, 1.0), (3.0, 2.0, 1e-9), (1e6, 1e-3, 1e-3), (1e300, 1e-3, 1.0)])
def test_a_free_volume_is_summed_over_half_a_million_cells_however_thin_the_vessel(extent):
    cells = _cells(np.array(extent))
    assert SAMPLES <= cells.prod() <= 1.05 * SAMPLES
