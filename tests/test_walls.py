"""Walls: where they are, how they move, what they do to a bead."""

from math import pi

import numpy as np
import pytest
from pydantic import ValidationError

from sim import InputError, Scene, Simulation, simulate
from sim.assembly import walls_of
from sim.motion import move_bodies
from sim.surface import beyond_shells, wall_distance
from sim.timestep import time_limits, time_step

BEAD = {"diameter": 1e-3, "density": 2500.0}
MASS = 2500.0 * pi * 1e-3**3 / 6
RUN = {"time": {"duration": 1e-2}, "output": {"interval": 1e-4}}
MOTIONS = {
    "rotation": {"kind": "rotation", "axis": [0, 1, 1], "point": [1e-3, 0, 0], "rpm": 700.0},
    "oscillation": {"kind": "oscillation", "amplitude": [1e-3, 0, 2e-3], "frequency": 20.0, "phase": 0.4},
    "translation": {"kind": "translation", "velocity": [0.1, 0.2, -0.3]},
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_velocity_of_a_moving_body_is_the_derivative_of_its_pose(scene_of, motion):
    wall = {"name": "w", "shapes": [{"shape": "plane", "normal": [1, 1, 0]}], "motion": MOTIONS[motion]}
    walls = walls_of(scene_of(particles=[{**BEAD, "position": [[0, 0, 1]]}], walls=[wall], **RUN))

    def placed(time, point):
        move_bodies(walls, time)
        return walls.rotation[0] @ (point - walls.centre[0]) + walls.centre[0] + walls.shift[0]

    point, time, step = np.array([4e-3, -2e-3, 5e-3]), 0.0123, 1e-6
    numeric = (placed(time + step, point) - placed(time - step, point)) / (2 * step)
    here = placed(time, point)
    velocity = walls.velocity[0] + np.cross(walls.turn[0], here - walls.centre[0] - walls.shift[0])
    np.testing.assert_allclose(velocity, numeric, atol=1e-7)


@pytest.mark.parametrize("motion", MOTIONS)
def test_distance_to_a_moving_wall_travels_with_it(scene_of, motion):
    box = {"shape": "box", "lowest": [0, 0, 0], "highest": [1e-2] * 3, "particles": "outside"}
    wall = {"name": "w", "motion": MOTIONS[motion], "shapes": [box]}
    walls = walls_of(scene_of(particles=[{**BEAD, "position": [[0, 0, 1]]}], walls=[wall], **RUN))
    point = np.array([1.3e-2, 4e-3, 1.1e-2])
    before = wall_distance(walls, 0, *point)
    move_bodies(walls, 0.0321)
    moved = walls.rotation[0] @ (point - walls.centre[0]) + walls.centre[0] + walls.shift[0]
    after = wall_distance(walls, 0, *moved)
    assert after[0] == pytest.approx(before[0], rel=1e-12)
    np.testing.assert_allclose(after[1:], walls.rotation[0] @ np.array(before[1:]), atol=1e-12)


def fall_on(scene_of, shape, velocity, spin):
    scene = scene_of(
        particles=[{**BEAD, "position": [[3e-4, 1e-4, 1.4e-3]], "velocity": [velocity], "angular_velocity": [spin]}],
        contact={"restitution": 0.8, "friction": 0.3},
        walls=[{"name": "floor", "shapes": [shape]}],
        **RUN,
    )
    return np.array(
        [[*(s.position[0] / 5e-4), *s.velocity[0], *(5e-4 * s.angular_velocity[0])] for s in simulate(scene)]
    )


@pytest.mark.parametrize(
    ("velocity", "spin"),
    [([0.2, -0.1, -0.7], [0, 0, 0]), ([0.5, 0.1, -0.2], [300, -900, 100]), ([0, 0, -1], [0, 0, 500])],
)
def test_face_of_a_box_is_a_plane(scene_of, velocity, spin):
    """Position in radii, velocity and spin agree to the rounding of a distance against the size of the box."""
    plane, box, lid = (
        fall_on(scene_of, shape, velocity, spin)
        for shape in (
            {"shape": "plane", "normal": [0, 0, 3]},
            {"shape": "box", "lowest": [-0.01] * 3, "highest": [0.01, 0.01, 0], "particles": "outside"},
            {"shape": "box", "lowest": [-0.01, -0.01, 0], "highest": [0.01] * 3, "particles": "inside"},
        )
    )
    assert plane[-1, 5] > 0.1
    assert np.abs(box - plane).max() < 1e-12
    assert np.abs(lid - plane).max() < 1e-12


def test_bead_in_a_corner_rests_on_all_three_faces(scene_of):
    g = 9.81 / np.sqrt(3)
    depth = MASS * g / 1e4  # each face carries a third of the weight
    scene = scene_of(
        particles=[{**BEAD, "position": [[5e-4 - 2 * depth] * 3]}],
        contact={"restitution": 0.5},
        gravity={"acceleration": [-g, -g, -g]},
        walls=[{"name": "box", "shapes": [{"shape": "box", "lowest": [0, 0, 0], "highest": [1, 1, 1],
                                           "particles": "inside"}]}],
        **RUN,
    )  # fmt: skip
    *_, last = simulate(scene)
    np.testing.assert_allclose(5e-4 - last.position[0], depth, rtol=1e-6)
    np.testing.assert_allclose([last.series[f"force.box.{axis}"] for axis in "xyz"], MASS * g, rtol=1e-3)


def test_ball_on_a_turning_drum_ends_without_slip_and_the_shaft_pays_for_it(scene_of):
    """A ball held in the groove above two equal rollers spins up until its surface moves with theirs."""
    roller = {"shape": "cylinder", "axis": [0, 1, 0], "radius": 4e-3, "particles": "outside"}
    bodies = [
        {"name": name, "shapes": [{**roller, "centre": [x, 0, 0]}],
         "motion": {"kind": "rotation", "axis": [0, 1, 0], "point": [x, 0, 0], "rpm": 300.0}}
        for name, x in (("left", -4.1e-3), ("right", 4.1e-3))
    ]  # fmt: skip
    height = float(np.sqrt(4.5e-3**2 - 4.1e-3**2))
    scene = scene_of(
        particles=[{**BEAD, "position": [[0, 0, height]]}],
        contact={"restitution": 0.7, "friction": 0.4},
        gravity={"acceleration": [0, 0, -9.81]},
        walls=bodies,
        time={"duration": 0.1},
        output={"interval": 1e-3},
    )
    snapshots = list(simulate(scene))
    last, first = snapshots[-1], snapshots[0]
    assert last.angular_velocity[0, 1] * 5e-4 == pytest.approx(-300 * 2 * pi / 60 * 4e-3, rel=0.01)
    work = last.series["energy.wall_work"]
    assert work > 0
    assert last.series["energy.balance"] - first.series["energy.balance"] == pytest.approx(0.0, abs=0.01 * work)
    shaft = sum(s.series["torque.left.y"] + s.series["torque.right.y"] for s in snapshots[1:]) * 1e-3
    assert shaft * 300 * 2 * pi / 60 == pytest.approx(work, rel=1e-6)


def test_copies_stand_at_equal_angles_about_the_axis(scene_of):
    pins = {"shape": "cylinder", "axis": [1, 0, 0], "centre": [5e-3, 0, 0], "radius": 1e-3, "length": 4e-3,
            "particles": "outside", "copies": 3}  # fmt: skip
    body = {"name": "rotor", "shapes": [pins], "motion": {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0}}
    walls = walls_of(scene_of(particles=[{**BEAD, "position": [[0, 0, 1]]}], walls=[body], **RUN))
    angles = np.degrees(np.arctan2(walls.parameter[:, 1], walls.parameter[:, 0])) % 360
    np.testing.assert_allclose(angles, [0, 120, 240], atol=1e-9)


def test_copies_without_an_axis_are_refused(scene_of):
    pins = {"shape": "cylinder", "axis": [1, 0, 0], "radius": 1e-3, "particles": "outside", "copies": 3}
    scene = scene_of(particles=[{**BEAD, "position": [[0, 0, 1]]}], walls=[{"name": "rotor", "shapes": [pins]}], **RUN)
    with pytest.raises(InputError, match=r"walls\.0\.shapes\.0\.copies = 3.*rotation"):
        Simulation(scene)


@pytest.mark.physics
def test_sphere_in_a_turning_drum_ends_without_slip_and_the_shaft_pays_for_it(scene_of):
    """Held at the lowest place of a drum, ω_s r_s = Ω R: both surfaces go the same way where they touch."""
    drum = {"shape": "cylinder", "axis": [0, 1, 0], "radius": 5e-3, "particles": "inside"}
    omega = 100 * 2 * pi / 60
    scene = scene_of(
        particles=[{**BEAD, "position": [[0, 0, -4.5e-3]]}],
        contact={"restitution": 0.7, "friction": 0.4},
        gravity={"acceleration": [0, 0, -9.81]},
        walls=[{"name": "drum", "shapes": [drum],
                "motion": {"kind": "rotation", "axis": [0, 1, 0], "rpm": 100.0}}],
        time={"duration": 1.0},
        output={"interval": 1e-2},
    )  # fmt: skip
    snapshots = list(simulate(scene))
    first, last = snapshots[0], snapshots[-1]
    slip = last.velocity[0] + np.cross(last.angular_velocity[0], 5e-4 * last.position[0] / 4.5e-3)
    wall = np.cross([0, omega, 0], 5e-3 * last.position[0] / 4.5e-3)
    assert np.abs(slip - wall).max() < 0.01 * omega * 5e-3
    work = last.series["energy.wall_work"]
    assert work > 0
    assert last.series["energy.balance"] - first.series["energy.balance"] == pytest.approx(0.0, abs=0.01 * work)
    shaft = sum(s.series["torque.drum.y"] for s in snapshots[1:]) * 1e-2
    assert shaft * omega == pytest.approx(work, rel=1e-6)


CONE = {"shape": "cone", "axis": [0, 0, 1], "radii": [2e-3, 8e-3], "length": 6e-3, "particles": "inside"}


def slide_down(scene_of, shapes, **bead):
    scene = scene_of(
        particles=[{**BEAD, **bead}],
        contact={"restitution": 0.9, "friction": 0.3},
        gravity={"acceleration": [0, 0, -9.81]},
        walls=[{"name": "hopper", "shapes": shapes}],
        time={"duration": 0.06},
        output={"interval": 1e-4},
    )
    return list(simulate(scene))


def test_bead_rolls_down_the_side_of_a_cone_as_down_a_plane(scene_of):
    """In the plane of symmetry a slope of 45° is that of the plane which touches the cone there."""
    plane = {"shape": "plane", "point": [5e-3, 0, 0], "normal": [-1, 0, 1]}
    bead = {"position": [[4e-3, 0, 4e-4]]}
    paths = [np.array([s.position[0] for s in slide_down(scene_of, [shape], **bead)]) for shape in
             (plane, CONE, CONE | {"open": ["-", "+"]})]  # fmt: skip
    while_on_it = (paths[0][:, 2] > -2e-3).nonzero()[0]
    assert len(while_on_it) > 100
    for path in paths[1:]:
        assert np.abs(path - paths[0])[while_on_it].max() < 1e-12


def test_bead_leaves_a_hopper_that_is_open_below_and_stays_in_one_that_is_closed(scene_of):
    bead = {"position": [[3e-3, 1e-3, 1e-3]]}
    out = slide_down(scene_of, [CONE | {"open": ["-", "+"]}], **bead)
    kept = slide_down(scene_of, [CONE | {"open": ["+"]}], **bead)
    assert out[-1].position[0, 2] < -5e-3
    assert min(s.position[0, 2] for s in kept) > -3e-3
    assert max(np.hypot(*s.position[0, :2]) for s in kept) < 8e-3


def test_cone_that_is_a_cylinder_holds_as_a_cylinder(scene_of):
    cone = CONE | {"radii": [4e-3, 4e-3]}
    tube = {"shape": "cylinder", "axis": [0, 0, 1], "radius": 4e-3, "length": 6e-3, "particles": "inside"}
    bead = {"position": [[3e-3, 1e-3, 1e-3]], "velocity": [0.3, 0.2, 0.4]}
    for opened in ([], ["+"], ["-", "+"]):
        paths = [
            [s.position[0] for s in slide_down(scene_of, [shape | {"open": opened}], **bead)] for shape in (cone, tube)
        ]
        np.testing.assert_allclose(*paths, atol=1e-12)


def test_beads_are_packed_in_a_hopper_and_not_around_it(scene_of):
    hopper = CONE | {"open": ["-", "+"]}
    filling = {"lowest": [-8e-3, -8e-3, -3e-3], "highest": [8e-3, 8e-3, 6e-3]}
    for table in ({}, {"filling": filling}):
        scene = scene_of(particles=[{**BEAD, "count": 150}], walls=[{"name": "w", "shapes": [hopper]}], **table, **RUN)
        run = Simulation(scene)
        beads = run.particles.position
        beside = np.abs(beads[:, 2]) < 3e-3
        side = (5e-3 + beads[:, 2] - np.hypot(beads[:, 0], beads[:, 1])) / np.sqrt(2)
        assert (side[beside] > 5e-4).all()
        assert not beyond_shells(beads, run.walls).any()


@pytest.mark.parametrize("shape", ["sphere", "capsule", "torus", "cone"])
def test_every_closed_shape_holds_a_shaken_bead_and_keeps_its_energy(scene_of, shape):
    table = {
        "sphere": {"radius": 3e-3},
        "capsule": {"axis": [1, 0, 1], "radius": 2e-3, "length": 3e-3},
        "torus": {"axis": [0, 0, 1], "radius": 3e-3, "tube_radius": 1.5e-3},
        "cone": {"axis": [0, 1, 1], "radii": [1.5e-3, 4e-3], "length": 5e-3},
    }[shape]
    start = [3e-3, 0, 0] if shape == "torus" else [0, 0, 0]
    scene = scene_of(
        particles=[{**BEAD, "position": [start], "velocity": [0.3, 0.5, 0.2]}],
        walls=[{"name": "w", "shapes": [{"shape": shape, "particles": "inside", **table}]}],
        time={"duration": 0.1},
        output={"interval": 1e-3},
    )
    snapshots = list(simulate(scene))
    balance = [s.series["energy.balance"] for s in snapshots]
    assert max(np.abs(s.position).max() for s in snapshots) < 6e-3  # of the 60 mm that it goes
    np.testing.assert_allclose(balance, balance[0], rtol=1e-3)


SMOOTH = {"stiffness": 4e4, "restitution": 0.6}
ROUGH = {"stiffness": 1e4, "restitution": 0.9, "friction": 0.5}


def two_floors(scene_of, **tables):
    """Two beads that hit a rough and a smooth floor."""

    def floor(name, x, **more):
        box = {"shape": "box", "lowest": [x - 0.1, -1, -1], "highest": [x + 0.1, 1, 0], "particles": "outside"}
        return {"name": name, "shapes": [box], **more}

    return scene_of(
        particles=[{**BEAD, "position": [[-0.1, 0, 7e-4], [0.1, 0, 7e-4]], "velocity": [0.0, 0.2, -0.5]}],
        contact={"stiffness": 1e3},
        wall_contact=ROUGH,
        walls=[floor("rough", -0.1), floor("smooth", 0.1, contact=SMOOTH)],
        **({"time": {"duration": 2e-3}, "output": {"interval": 1e-4}} | tables),
    )


def test_each_body_has_the_contact_that_it_was_given(scene_of):
    snapshots = list(simulate(two_floors(scene_of)))
    rough, smooth = snapshots[-1].velocity
    assert rough[2] == pytest.approx(0.9 * 0.5, rel=1e-3)
    assert smooth[2] == pytest.approx(0.6 * 0.5, rel=4e-3)
    spin = snapshots[-1].angular_velocity
    assert spin[0, 0] < -100.0
    np.testing.assert_allclose(smooth[:2], [0, 0.2], atol=1e-15)
    np.testing.assert_array_equal(spin[1], 0)
    balance = [s.series["energy.balance"] for s in snapshots]
    assert balance[-1] == pytest.approx(balance[0], rel=1e-3)


def test_the_stiffest_body_binds_the_time_step_and_is_named(scene_of):
    limits = time_limits(two_floors(scene_of))
    assert min(limits, key=lambda limit: limit.largest).term == "contact with the wall 'smooth', normal spring"
    with pytest.raises(
        InputError, match=r"set by the contact with the wall 'smooth', normal spring \(stiffness 40000 N/m"
    ):
        time_step(two_floors(scene_of, time={"duration": 2e-3, "step": 2e-5}))


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        ({"shape": "sphere", "radius": 1.0}, 'particles: missing; give "inside" or "outside"'),
        (CONE | {"particles": "outside", "open": ["+"]}, "open: a solid has no open faces"),
        ({"shape": "cylinder", "axis": [0, 0, 1], "radius": 1.0, "particles": "inside", "open": ["+"]},
         "open: an endless cylinder has no ends"),
    ],
)  # fmt: skip
def test_a_wall_without_a_side_or_with_ends_that_it_has_not_is_refused(shape, says):
    scene = {"particles": [{**BEAD, "count": 1}], "contact": ROUGH, **RUN, "walls": [{"name": "w", "shapes": [shape]}]}
    with pytest.raises(ValidationError, match=says):
        Scene.model_validate(scene)


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        (CONE | {"radii": [0.0, 0.0]}, r"radii = \[0.0, 0.0\] m: must not be negative, nor both zero"),
        (CONE | {"axis": [0, 0, 0]}, r"axis = \[0.0, 0.0, 0.0\]: has no direction"),
        ({"shape": "torus", "axis": [0, 0, 1], "radius": 1.0, "tube_radius": 2.0, "particles": "outside"},
         "tube_radius = 2 m: leaves no hole; at most radius 1"),
    ],
)  # fmt: skip
def test_shapes_that_are_none_are_refused(scene_of, shape, says):
    scene = scene_of(particles=[{**BEAD, "position": [[9, 9, 9]]}], walls=[{"name": "w", "shapes": [shape]}], **RUN)
    with pytest.raises(InputError, match=r"walls\.0\.shapes\.0\." + says):
        Simulation(scene)
