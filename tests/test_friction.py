"""Tangential spring, dashpot and slider against rigid-body closed forms."""

from math import atan2, cos, degrees, pi, radians, sin

import numpy as np
import pytest

from sim import Simulation, simulate
from sim.law import contact_time

G = 9.81
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}


@pytest.mark.parametrize("friction", [0.2, 0.6, 1.0])
def test_sliding_sphere_rolls_after_two_sevenths_with_five_sevenths_of_its_speed(scene_of, friction):
    """DEM04: t' = μ g t / u₀ = 2/7 at the first end of slip, u' = 5/7 whatever μ."""
    radius, density, speed, stiffness = 5e-4, 1e4, 0.1, 1e4
    weight = density * 4 / 3 * pi * radius**3 * G
    duration = 2.2 / 7 * speed / (friction * G)
    scene = scene_of(
        particles=[
            {"diameter": 2 * radius, "density": density, "position": [[0, 0, radius - weight / stiffness]],
             "velocity": [[speed, 0, 0]]}
        ],
        contact={"stiffness": stiffness, "friction": friction, "tangential_damping_ratio": 0.0},
        gravity={"acceleration": [0, 0, -G]},
        time={"duration": duration},
        output={"interval": duration / 1000, "precision": "double"},
        walls=[FLOOR],
    )  # fmt: skip
    moments = [
        (s.time, s.velocity[0, 0], s.velocity[0, 0] - s.angular_velocity[0, 1] * radius) for s in simulate(scene)
    ]
    time, velocity, slip = np.array(moments).T
    end = int(np.argmax(slip <= 0))
    part = slip[end - 1] / (slip[end - 1] - slip[end])
    stops, rolls = (a[end - 1] + part * (a[end] - a[end - 1]) for a in (time, velocity))
    assert friction * G * stops / speed == pytest.approx(2 / 7, rel=6e-3)
    assert rolls / speed == pytest.approx(5 / 7, rel=2e-4)


def oblique_impact(scene_of, angle, friction, restitution, steps_per_contact, ratio=1.0, speed=3.9):
    """Throw a 5 mm sphere at a floor, the angle measured from the normal; return the run after it, and its energy."""
    diameter, density, stiffness = 5e-3, 4000.0, 1.72e7
    mass = density * pi * diameter**3 / 6
    dt = contact_time(stiffness, restitution, mass) / steps_per_contact
    steps = int(1.5 * steps_per_contact) + 8
    normal, along = speed * cos(radians(angle)), speed * sin(radians(angle))
    height = diameter / 2 + 2.3 * normal * dt
    scene = scene_of(
        particles=[
            {"diameter": diameter, "density": density, "position": [[0, 0, height]], "velocity": [[along, 0, -normal]]}
        ],
        contact={"stiffness": stiffness, "restitution": restitution, "friction": friction,
                 "tangential_stiffness_ratio": ratio},
        time={"duration": steps * dt, "step": dt},
        output={"interval": steps * dt},
        walls=[FLOOR],
    )  # fmt: skip
    run = Simulation(scene)
    run.advance_to(run.steps_per_snapshot)
    return run, 0.5 * mass * speed**2


PEER_ANGLES = {5: 3.99, 10: 6.60, 20: 12.21, 30: 21.48, 40: 33.23, 50: 45.22, 60: 57.14}


@pytest.mark.parametrize("angle", PEER_ANGLES)
def test_sphere_leaves_an_oblique_impact_at_the_angle_of_kharaz(scene_of, angle):
    """DEM05."""
    run, _ = oblique_impact(scene_of, angle, 0.092, 1.0, 100, 1.48 / 1.72)
    velocity = run.snapshot().velocity[0]
    assert degrees(atan2(velocity[0], velocity[2])) == pytest.approx(PEER_ANGLES[angle], rel=0.05)


@pytest.mark.parametrize("angle", [40, 50, 60, 75])
def test_sphere_that_slides_throughout_loses_what_coulomb_takes(scene_of, angle):
    run, _ = oblique_impact(scene_of, angle, 0.092, 1.0, 100, 1.48 / 1.72)
    after = run.snapshot()
    taken = 0.092 * 2 * 3.9 * cos(radians(angle))
    assert after.velocity[0, 0] == pytest.approx(3.9 * sin(radians(angle)) - taken, rel=0.02)
    assert after.angular_velocity[0, 1] == pytest.approx(2.5 * taken / 2.5e-3, rel=0.02)


ANGLES = (2, 20, 40, 60, 76, 85, 89)
FRICTIONS = (0.01, 0.1, 0.5, 1.0, 10.0)


def greatest_gain(scene_of, restitution, steps_per_contact):
    gains = []
    for friction in FRICTIONS:
        for angle in ANGLES:
            run, before = oblique_impact(scene_of, angle, friction, restitution, steps_per_contact)
            after = run.snapshot().series
            gains.append((after["energy.kinetic"] + after["energy.rotational"]) / before - 1)
    return max(gains)


@pytest.mark.parametrize("restitution", [0.9, 0.5, 0.1])
def test_frictional_impact_with_damping_never_gains_energy(scene_of, restitution):
    assert greatest_gain(scene_of, restitution, 50) <= 0.0


def test_frictional_impact_without_damping_gains_less_than_truncation(scene_of):
    assert greatest_gain(scene_of, 1.0, 50) < 1e-3
    assert greatest_gain(scene_of, 1.0, 100) < 3e-4
