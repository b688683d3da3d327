"""The rotor of a scene: its speed, and after which part of a turn it looks the same."""

import pytest

from sim import parse_scene, scene_text
from sim.vessel import Rotation, WallTable
from suffice.refusal import Refusal
from suffice.rotor import fold_of, rotor_of

AXIS = {"kind": "rotation", "axis": [0.0, 0.0, 2.0], "rpm": 300.0}
SHAFT = {"shape": "cylinder", "axis": [0.0, 0.0, 1.0], "radius": 0.1, "particles": "outside"}
PIN = {"shape": "cylinder", "axis": [1.0, 0.0, 0.0], "radius": 0.1, "length": 1.0, "particles": "outside"}
BALL = {"shape": "sphere", "centre": [0.0, 0.0, 0.3], "radius": 0.1, "particles": "outside"}


def fold(*shapes, **motion):
    wall = WallTable.model_validate({"name": "rotor", "shapes": shapes, "motion": {**AXIS, **motion}})
    assert isinstance(wall.motion, Rotation)
    return fold_of(wall, wall.motion)


def test_the_small_mill_looks_the_same_four_times_a_turn():
    rotor = rotor_of(parse_scene(scene_text("mini_mill")))
    assert (rotor.name, rotor.rpm, rotor.fold) == ("rotor", 1000.0, 4)
    assert rotor.period == pytest.approx(0.015)


def test_a_shaft_on_the_axis_breaks_no_symmetry_and_a_pin_beside_it_does():
    assert fold(SHAFT) == 0
    assert fold(SHAFT, {**PIN, "copies": 6}) == 6
    assert fold(SHAFT, {**PIN, "copies": 6}, {**PIN, "copies": 4}) == 2
    assert fold({**PIN, "copies": 4}, PIN) == 1
    assert fold(BALL) == 0
    assert fold({**BALL, "centre": [0.1, 0.0, 0.0]}) == 1
    assert fold(SHAFT, point=[0.0, 0.5, 7.0]) == 1
    assert fold({**SHAFT, "centre": [0.0, 0.5, 0.0]}, point=[0.0, 0.5, 7.0]) == 0


def test_a_scene_without_one_rotor_has_no_speed():
    with pytest.raises(Refusal, match="one wall has to rotate, none does"):
        rotor_of(parse_scene(scene_text("hopper")), "hopper")
