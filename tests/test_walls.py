"""Walls: where they are, how they move, what they do to a bead."""

from math import pi

import numpy as np
import pytest

from sim import InputError, Simulation, simulate
from sim.assembly import walls_of
from sim.motion import move_bodies
from sim.walls import wall_distance

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


def fall_on(scene_of, shape):
    scene = scene_of(
        particles=[{**BEAD, "position": [[3e-4, 1e-4, 1.4e-3]], "velocity": [[0.2, -0.1, -0.7]]}],
        contact={"restitution": 0.8, "friction": 0.3},
        walls=[{"name": "floor", "shapes": [shape]}],
        **RUN,
    )
    return np.array([s.position[0] for s in simulate(scene)])


def test_face_of_a_large_box_is_a_plane(scene_of):
    plane = fall_on(scene_of, {"shape": "plane", "normal": [0, 0, 3]})
    box = fall_on(scene_of, {"shape": "box", "lowest": [-1, -1, -1], "highest": [1, 1, 0], "particles": "outside"})
    lid = fall_on(scene_of, {"shape": "box", "lowest": [-1, -1, 0], "highest": [1, 1, 1], "particles": "inside"})
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
