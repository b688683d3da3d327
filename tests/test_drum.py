"""Dynamic angle of repose in a rotating drum."""

from math import atan2, degrees

import numpy as np
import pytest

from sim import simulate

D, RADIUS = 1.5e-3, 0.015


def repose(scene_of, friction):
    """Mean angle (°) of the bed's centre of mass from the vertical, as seen from the axis, once the bed flows."""
    depth = 3 * D
    scene = scene_of(
        particles=[{"diameter": D, "density": 2500.0, "count": 480}],
        contact={"stiffness": 2e3, "restitution": 0.8, "friction": friction},
        wall_contact={"stiffness": 2e3, "restitution": 0.8, "friction": 0.8},
        gravity={"acceleration": [0.0, 0.0, -9.81]},
        periodic={"directions": ["y"], "lowest": [0, 0, 0], "highest": [0, depth, 0]},
        filling={"lowest": [-RADIUS, 0, -RADIUS], "highest": [RADIUS, depth, 0.5 * RADIUS]},
        walls=[{
            "name": "drum", "motion": {"kind": "rotation", "axis": [0, 1, 0], "rpm": 40.0},
            "shapes": [{"shape": "cylinder", "axis": [0, 1, 0], "radius": RADIUS, "particles": "inside"}],
        }],
        time={"duration": 0.8}, output={"interval": 0.02},
    )  # fmt: skip
    angles = []
    for moment in simulate(scene):
        x, _, z = moment.position.mean(axis=0)
        angles.append(degrees(atan2(abs(x), -z)))
    return float(np.mean(angles[20:]))


@pytest.mark.physics
def test_the_angle_of_repose_rises_with_friction(scene_of, capsys):
    found = {friction: repose(scene_of, friction) for friction in (0.05, 0.2, 0.6)}
    with capsys.disabled():
        print("\n  " + ", ".join(f"μ {mu}: {angle:.1f}°" for mu, angle in found.items()))
    gentle, middle, steep = found.values()
    assert gentle + 2 < middle < steep - 2
    assert gentle > 5
    assert steep < 45
