"""Observables of a moment, against figures known exactly."""

import math

import numpy as np
import pytest

from sim import parse_scene
from suffice.observables import observable_errors, observe, room_at, rotor_side, watch_of
from suffice.run import Run
from suffice.setting import Axis, setting_of
from suffice.solids import free_volumes, shells, slabs, solid_volumes, void_fraction
from suffice.store import RunWriter
from suffice.swept import swept_radius
from suffice.touching import pair_overlaps

UP, Z = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])

COLUMN = """
[[particles]]
diameter = 2e-3
density = 2500.0
count = 8

[contact]
stiffness = 1e3
restitution = 0.8

[gravity]
acceleration = [0.0, 0.0, -9.81]

[time]
duration = 0.1

[output]
interval = 0.01
"""

MILL = """
[[walls]]
name = "vessel"
[[walls.shapes]]
shape = "cylinder"
axis = [0.0, 0.0, 1.0]
radius = 0.010
length = 0.012
particles = "inside"

[[walls]]
name = "rotor"
motion = { kind = "rotation", axis = [0.0, 0.0, 1.0], rpm = 60.0 }
[[walls.shapes]]
shape = "cylinder"
axis = [0.0, 0.0, 1.0]
radius = 0.002
particles = "outside"
[[walls.shapes]]
shape = "box"
lowest = [-0.004, -0.003, -0.001]
highest = [0.004, 0.003, 0.001]
particles = "outside"
"""


def write(path, positions, velocities=None, radius=1e-3, species=0, scene=None):
    """Store (snapshots, n, 3) positions in double precision, one every millisecond, with the scene that made them."""
    n = positions.shape[1]
    with RunWriter(
        path,
        ids=np.arange(n),
        radius=np.full(n, radius),
        species=np.broadcast_to(species, n).astype(int),
        n_snapshots=len(positions),
        variables=("position",) if velocities is None else ("position", "velocity"),
        precision="double",
        provenance={} if scene is None else {"scene": scene},
    ) as run:
        for k, position in enumerate(positions):
            values = {"position": position} if velocities is None else {"position": position, "velocity": velocities[k]}
            run.append(k * 0.001, values)
    return path


def seen(run, position=None, velocity=None):
    """Observe the last snapshot of a run, or another state of its particles."""
    watch = watch_of(run, [run.n_snapshots - 1])
    values = run.snapshot(run.n_snapshots - 1).values
    position = values["position"] if position is None else position
    velocity = values.get("velocity") if velocity is None else velocity
    return observe(watch, room_at(watch, float(run.times[-1])), position, velocity)


def cubic_packing(n, diameter):
    """Centres of n³ spheres that touch their neighbours, in a box from 0 to n diameters."""
    return (np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * diameter


def test_two_spheres_a_tenth_of_a_diameter_too_near_overlap_by_a_tenth():
    position = np.array([[0.0, 0.0, 0.0], [0.0, 1.8e-3, 0.0], [1.0, 0.0, 0.0]])
    assert pair_overlaps(position, np.full(3, 1e-3)) == pytest.approx([0.1])


def test_spheres_of_two_sizes_overlap_in_diameters_of_the_smaller():
    position = np.array([[0.0, 0.0, 0.0], [2.9e-3, 0.0, 0.0]])
    assert pair_overlaps(position, np.array([1e-3, 2e-3])) == pytest.approx([0.05])


@pytest.mark.parametrize("shift", [0.0, 0.02, -0.01])
def test_spheres_touch_across_the_border_of_a_box_that_repeats(shift):
    period = np.array([0.0, -1.0, 0.0]), np.array([0.01, 0.0, 0.0])
    position = np.array([[0.0005 + shift, 0.0, 5.0], [0.0097, 0.0, 5.0]])
    assert pair_overlaps(position, np.full(2, 0.5e-3), period) == pytest.approx([0.2])


def test_a_cubic_packing_touches_three_times_per_bead_in_the_bulk_and_does_not_overlap():
    position = cubic_packing(6, 2e-3 * (1 - 1e-9))
    assert len(pair_overlaps(position, np.full(216, 1e-3))) == 3 * 6 * 6 * 5


def test_the_void_fraction_of_a_cubic_packing_integrates_to_its_solid_volume():
    position, radius = cubic_packing(6, 2e-3), np.full(216, 1e-3)
    bins = slabs(UP, np.zeros(3), np.full(3, 0.012), 2e-3)
    room = free_volumes(bins, None, 0.0)
    profile = void_fraction(bins, position, radius, room)
    assert room.sum() == pytest.approx(0.012**3)
    assert len(profile.values) == 6
    # each slab holds one layer: π / 6 of it is solid
    assert profile.values == pytest.approx(np.full(6, 1.0 - math.pi / 6.0))
    assert ((1.0 - profile.values) * room).sum() == pytest.approx(216 * 4 / 3 * math.pi * 1e-9)


def test_a_slab_that_cuts_spheres_in_half_takes_half_of_each():
    bins = slabs(UP, np.zeros(3), np.array([0.01, 0.01, 0.004]), 2e-3)
    volumes = solid_volumes(bins, np.array([[0.005, 0.005, 0.002]]), np.array([1e-3]))
    assert volumes == pytest.approx(np.full(2, 2 / 3 * math.pi * 1e-9))


def test_shells_around_an_axis_fill_the_cylinder_and_keep_all_solid_volume():
    axis = Axis(np.array([1.0, 2.0, 3.0]), np.array([0.6, 0.0, 0.8]))
    bins = shells(axis, 0.01, -0.004, 0.006, 1e-3)
    assert bins.volumes.sum() == pytest.approx(math.pi * 0.01**2 * 0.01)
    rng = np.random.default_rng(0)
    position, radius = axis.point + rng.uniform(-4e-3, 4e-3, (50, 3)), np.full(50, 5e-4)
    assert solid_volumes(bins, position, radius).sum() == pytest.approx(50 * 4 / 3 * math.pi * 5e-4**3)


@pytest.mark.physics
def test_the_room_in_a_mill_is_the_vessel_without_the_rotor_wherever_that_has_turned(tmp_path):
    position = np.random.default_rng(1).uniform(-0.0055, 0.0055, (2, 30, 3))
    position[:, 0], position[:, 1] = (9e-3, 0, 5e-3), (-9e-3, 0, -5e-3)
    with Run(write(tmp_path / "run.h5", position, scene=COLUMN + MILL)) as run:
        watch = watch_of(run, [1])
    bins, rotor = watch.bins["radius"], 0.0
    assert bins.edges[-1] == pytest.approx(0.010)
    # shaft, and a box of 8 x 6 x 2 mm that the shaft pierces: a cylinder of 2 mm radius is within it
    rotor = math.pi * 0.002**2 * 0.012 + 0.008 * 0.006 * 0.002 - math.pi * 0.002**2 * 0.002
    for time in (0.0, 0.11):
        room = room_at(watch, time)
        assert room.free["radius"].sum() == pytest.approx(math.pi * 0.01**2 * 0.012 - rotor, rel=0.01)
        # no room within the shaft, so no void fraction
        profile = void_fraction(bins, position[0], np.full(30, 1e-3), room.free["radius"])
        assert np.isnan(profile.values[0])
        assert np.isfinite(profile.values[-1])


def test_kinetic_energy_of_uniform_motion_is_half_m_v_squared_and_its_error_relative(tmp_path):
    position = np.tile(cubic_packing(2, 2e-3), (2, 1, 1))
    velocity = np.full(position.shape, 2.0)
    with Run(write(tmp_path / "run.h5", position, velocity, scene=COLUMN)) as run:
        truth, faster = seen(run), seen(run, velocity=1.1 * velocity[0])
    mass = 8 * 2500.0 * 4 / 3 * math.pi * 1e-9
    assert truth["kinetic_energy"] == pytest.approx(0.5 * mass * 12.0)
    assert observable_errors(truth, faster)["kinetic_energy"] == pytest.approx(21.0)


def test_without_a_scene_energy_is_weighted_by_volume_and_gravity_is_missed_by_name(tmp_path):
    position = np.tile(cubic_packing(2, 2e-3), (2, 1, 1))
    with Run(write(tmp_path / "run.h5", position, np.ones(position.shape))) as run:
        watch, found = watch_of(run, [1]), seen(run)
    assert found["kinetic_energy"] == pytest.approx(0.5 * 8 * 4 / 3 * math.pi * 1e-9 * 3.0)
    assert watch.setting.weight_unit == "m³"
    assert watch.notes[-1] == "weights: the run holds no scene"
    assert {"bed_height", "rotor_side", "overlap.walls", "void_fraction.height"} <= set(watch.left_out)
    assert not {"bed_height", "rotor_side", "overlap.walls"} & set(found)


def test_without_radii_what_needs_them_is_left_out_with_the_remedy(tmp_path):
    position = np.tile(cubic_packing(2, 2e-3), (2, 1, 1))
    with Run(write(tmp_path / "run.h5", position, radius=math.nan)) as run:
        watch, found = watch_of(run, [1]), seen(run)
    assert found == {}
    assert "with its diameter" in watch.left_out["overlap"]
    assert "no velocities" in watch.left_out["kinetic_energy"]


def test_a_column_is_as_high_as_the_centres_of_99_of_100_beads(tmp_path):
    heights = np.arange(8) * 2e-3 + 1e-3
    position = np.zeros((2, 8, 3))
    position[:, :, 2] = heights
    with Run(write(tmp_path / "run.h5", position, scene=COLUMN)) as run:
        found = seen(run)
        taller = seen(run, position=position[0] + 1e-3 * UP)
    # 0.99 of 7 steps of a diameter over the lowest centre, itself a radius over the floor
    assert found["bed_height"] == pytest.approx(1e-3 + 0.99 * 14e-3)
    assert observable_errors(found, taller)["bed_height"] == pytest.approx(100 * 1e-3 / (1e-3 + 0.99 * 14e-3))


def test_halves_that_stay_apart_are_unmixed_and_a_shuffled_bed_is_mixed(tmp_path):
    position = np.tile(cubic_packing(16, 2e-3), (2, 1, 1))
    shuffled = position[0][np.random.default_rng(0).permutation(len(position[0]))]
    with Run(write(tmp_path / "run.h5", position, scene=COLUMN)) as run:
        apart, mixed = seen(run)["mixing"], seen(run, position=shuffled)["mixing"]
    assert apart == pytest.approx(0.0, abs=1e-12)
    assert mixed == pytest.approx(1.0, abs=0.02)


def test_two_species_mix_with_each_other_and_not_by_halves(tmp_path):
    position = np.tile(cubic_packing(8, 2e-3), (2, 1, 1))
    species = (position[0, :, 0] > 0.008).astype(int)
    with Run(write(tmp_path / "run.h5", position, species=species)) as run:
        assert seen(run)["mixing.species 0.species 1"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("distance", "share"), [(5e-3 + 1e-3, 1.0), (5e-3, 0.5), (7e-3, 0.5), (9e-3, 0.0), (2e-3, 0.0)]
)
def test_a_ring_of_beads_lies_beside_the_rotor_wholly_half_or_not_at_all(distance, share):
    angle = np.linspace(0, 2 * math.pi, 40, endpoint=False)
    ring = distance * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + [0.0, 0.0, 0.3]
    beads = np.full(40, 1e-3)
    assert rotor_side(Axis(np.zeros(3), Z), 5e-3, 2e-3, ring, beads, np.ones(40)) == pytest.approx(share)


def test_a_rotor_sweeps_as_far_as_the_corner_of_its_box():
    rotor = parse_scene(COLUMN + MILL).walls[1]
    assert swept_radius(rotor) == pytest.approx(math.hypot(4e-3, 3e-3))


def test_pins_sweep_a_little_farther_than_their_length_by_the_edge_of_their_ends():
    scene = parse_scene(
        COLUMN
        + MILL.replace(
            'shape = "box"\nlowest = [-0.004, -0.003, -0.001]\nhighest = [0.004, 0.003, 0.001]',
            'shape = "cylinder"\naxis = [1.0, 0.0, 0.0]\ncentre = [0.0049, 0.0, 0.0]\n'
            "radius = 0.001\nlength = 0.0058\ncopies = 4",
        )
    )
    assert swept_radius(scene.walls[1]) == pytest.approx(math.hypot(7.8e-3, 1e-3), rel=1e-4)
    assert swept_radius(scene.walls[0]) is None  # it does not turn


def test_a_turning_vessel_has_an_axis_but_no_rotor_among_the_beads(tmp_path):
    drum = MILL.split("[[walls]]")[1].replace(
        'name = "vessel"', 'name = "drum"\nmotion = { kind = "rotation", axis = [0, 0, 1], rpm = 40.0 }'
    )
    position = np.tile(cubic_packing(2, 2e-3), (2, 1, 1))
    with Run(write(tmp_path / "run.h5", position, scene=f"{COLUMN}[[walls]]{drum}")) as run:
        setting = setting_of(run)
    assert setting.axis is not None
    assert setting.swept is None
    assert "turns among the particles" in setting.missing["rotor"]


@pytest.mark.physics
def test_a_bead_half_way_through_the_vessel_overlaps_it_by_half_a_diameter(tmp_path):
    position = np.zeros((2, 3, 3))
    position[:, :, 0] = (5.5e-3, -7e-3, 7.5e-3)
    with Run(write(tmp_path / "run.h5", position, scene=COLUMN + MILL)) as run:
        truth = seen(run)
        through = seen(run, position=position[0] + [2.5e-3, 0.0, 0.0])
    assert truth["overlap.walls"] == 0.0
    assert through["overlap.walls"] == pytest.approx(0.5)
    assert observable_errors(truth, through)["overlap.walls"] == pytest.approx(0.5)


@pytest.mark.physics
def test_what_is_observed_in_a_simulated_run_is_what_the_run_itself_recorded(tmp_path, suffice, beads):
    scene = tmp_path / "beads.toml"
    scene.write_text(beads)
    assert suffice("simulate", scene, "-o", tmp_path / "run.h5").code == 0
    with Run(tmp_path / "run.h5") as run:
        watch, touched = watch_of(run, range(run.n_snapshots)), 0
        for k in range(run.n_snapshots):
            values = run.snapshot(k).values
            found = observe(watch, room_at(watch, float(run.times[k])), values["position"], values["velocity"])
            # snapshots are in single precision: 1e-7 of 12 mm is 5e-7 of a diameter
            assert found["kinetic_energy"] == pytest.approx(run.series["energy.kinetic"][k], rel=1e-6)
            deepest = max(found["overlap.largest"], found["overlap.walls"])
            assert deepest == pytest.approx(run.series["overlap.100"][k], abs=1e-6)
            touched += deepest > 0
        assert touched > 3
