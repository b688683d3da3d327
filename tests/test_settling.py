"""A sphere that settles in a liquid at rest: its terminal velocity, and how far it disturbs its own liquid."""

from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

from sim import parse_scene, scene_text, simulate
from sim.coupled import CoupledSimulation

pytestmark = pytest.mark.physics

G, DENSITY = 9.81, 6050.0
WATER, SLURRY = (998.2, 1.0e-3), (1202.4, 4.13e-2)  # kg/m³, Pa s
TERMINAL = {(WATER, 1e-4): 0.02191, (WATER, 1e-3): 0.31375, (SLURRY, 1e-4): 6.384e-4, (SLURRY, 1e-3): 0.05319}  # m/s


def closed_form(liquid, diameter):
    """Speed (m/s) at which Schiller and Naumann's drag carries the weight less buoyancy."""
    density, viscosity = liquid

    def surplus(v):
        re = v * density * diameter / viscosity
        return 18 * viscosity / diameter**2 * v * (1 + 0.15 * re**0.687) - (DENSITY - density) * G

    return brentq(surplus, 1e-9, 10.0)


def sinking(scene_of, liquid, diameter, speed, step, fluid_step, duration, coupling="one-way", cells=3, edge=None):
    """A sphere that sinks at a speed (m/s) in the middle of a closed box of cubic cells of an edge (m)."""
    edge = edge or 0.02
    stiffness = 0.1 * DENSITY * pi / 6 * diameter**3 * (pi / (50 * step)) ** 2
    scene = scene_of(
        particles=[{"diameter": diameter, "density": DENSITY, "position": [[cells * edge / 2] * 3],
                    "velocity": [0, -speed, 0]}],
        contact={"stiffness": stiffness},
        gravity={"acceleration": [0, -G, 0]},
        time={"duration": duration, "step": step},
        output={"interval": duration, "precision": "double"},
        limits={"max_speed": 10.0},
        fluid={"density": liquid[0], "viscosity": liquid[1], "lowest": [0, 0, 0], "highest": [cells * edge] * 3,
               "cells": [cells] * 3, "step": fluid_step},
        drag={"coupling": coupling},
    )  # fmt: skip
    run = CoupledSimulation(scene)
    run.advance_to(run.steps_per_snapshot)
    return run


def steady(after, low, high):
    """Speed that a time leaves as it is, where `after` of a speed is nearly linear between two."""
    first, second = after(low), after(high)
    slope = (second - first) / (high - low)
    return low + (first - low) / (1 - slope)


@pytest.mark.parametrize(("liquid", "diameter"), TERMINAL)
def test_terminal_velocity_does_not_depend_on_any_step(scene_of, liquid, diameter):
    """0.5 %, steps of sphere and fluid from 1e-6 to 1e-3 s; it neither gains nor loses speed at its terminal one."""
    expected = TERMINAL[liquid, diameter]
    assert closed_form(liquid, diameter) == pytest.approx(expected, rel=1e-3)
    errors = {}
    for step, fluid_step in ((1e-6, 1e-6), (1e-6, 1e-3), (1e-5, 1e-4), (1e-4, 1e-4), (1e-3, 1e-3)):
        window = 20 * fluid_step

        def after(v, steps=(step, fluid_step, window)):
            return -sinking(scene_of, liquid, diameter, v, *steps).particles.velocity[0, 1]

        errors[step, fluid_step] = steady(after, 0.99 * expected, 1.01 * expected) / expected - 1
    print(f"\n{diameter * 1e3:g} mm in {liquid[0]} kg/m³:", " ".join(f"{error:+.1e}" for error in errors.values()))
    assert max(map(abs, errors.values())) < 5e-3
    assert max(errors.values()) - min(errors.values()) < 5e-5


def test_settling_scene_ends_at_the_terminal_velocity():
    """The built-in scene, from rest: 0.5 %, and never faster."""
    speed = np.array([-s.velocity[0, 1] for s in simulate(parse_scene(scene_text("settling_sphere")))])
    print(f"\nsettling_sphere: {speed[-1] / TERMINAL[SLURRY, 1e-3] - 1:+.1e}")
    assert (np.diff(speed) >= -1e-12).all()
    assert speed[-1] == pytest.approx(TERMINAL[SLURRY, 1e-3], rel=5e-3)


def test_sphere_disturbs_its_own_liquid_less_in_larger_cells(scene_of):
    """Two-way, 0.1 mm in slurry: the velocity that it sees is partly its own, in proportion to 1/edge."""
    diameter, excess = 1e-4, []
    for edge in (2, 4, 8, 16):
        wide = edge * diameter
        step = wide**2 / (SLURRY[1] / SLURRY[0]) / 30  # s, of the time in which momentum crosses a cell
        run = sinking(scene_of, SLURRY, diameter, 6.384e-4, step, step, 180 * step, "two-way", 9, wide)
        fluid = run.fields().velocity[4, 4, 4, 1]
        excess.append(-run.particles.velocity[0, 1] / TERMINAL[SLURRY, diameter] - 1)
        print(f"\ncells of {edge} diameters: {excess[-1]:+.2%}, its cell sinks at {-fluid:.2e} m/s")
    ratio = np.array(excess[:-1]) / excess[1:]
    assert (np.array(excess) > 0).all()
    assert (ratio > 1.3).all()
    assert ratio[-1] == pytest.approx(2, abs=0.2)
