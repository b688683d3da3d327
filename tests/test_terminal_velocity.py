"""A bead that falls from rest in a rising gas, with and without its own wake (DEM06, a standard of open solvers)."""

from math import pi

import pytest

from sim.coupled import CoupledSimulation

RISE, STEP = 0.40, 1e-4  # m/s of the gas; s, of the particle, which touches nothing
FALL = {0.01: -0.01255261, 0.05: -0.04078891, 0.10: -0.05263133, 0.20: -0.05701037, 0.35: -0.05739251}  # m/s at s
MASS = 2000.0 * pi / 6 * 1e-4**3


def falling(scene_of, coupling, fluid_step):
    """Velocity (m/s) at the times (s) of `FALL`."""
    sides = {side: {"kind": "slip"} for side in ("-x", "+x", "-z", "+z")}
    scene = scene_of(
        particles=[{"diameter": 1e-4, "density": 2000.0, "position": [[0.005, 0.0925, 0.005]]}],
        contact={"stiffness": 0.25 * MASS * (pi / (50 * STEP)) ** 2, "restitution": 1.0},
        gravity={"acceleration": [0, -9.80665, 0]},
        time={"duration": 0.35, "step": STEP},
        output={"interval": 0.01, "precision": "double"},
        limits={"max_speed": 10.0},
        fluid={
            "density": 1.2, "viscosity": 1.8e-5, "lowest": [0, 0, 0], "highest": [0.01, 0.10, 0.01],
            "cells": [5, 20, 5], "velocity": [0, RISE, 0], "step": fluid_step,
            "faces": sides | {"-y": {"kind": "inflow", "speed": RISE}, "+y": {"kind": "outflow"}},
        },
        drag={"coupling": coupling},
    )  # fmt: skip
    run, found = CoupledSimulation(scene), {}
    for time in FALL:
        run.advance_to(round(time / 0.01) * run.steps_per_snapshot)
        found[time] = run.snapshot().velocity[0, 1]
    return found


@pytest.mark.physics
def test_bead_in_a_rising_gas_falls_as_the_published_solution_says(scene_of):
    """One-way, to 0.1 % of the speed at each moment: drag of the old slip makes it first order in the fluid's step."""
    worst = []
    for step in (4e-4, 2e-4):
        found = falling(scene_of, "one-way", step)
        errors = [found[t] / v - 1 for t, v in FALL.items()]
        print(f"\nDEM06 one-way, fluid step {step:g} s:", " ".join(f"{error:+.1e}" for error in errors))
        worst.append(max(map(abs, errors)))
    assert worst[1] < 1e-3
    assert 0.4 < worst[1] / worst[0] < 0.6


@pytest.mark.physics
def test_bead_that_stirs_its_own_gas_falls_within_a_hundredth_of_its_slip(scene_of):
    """Two-way: it drags along the gas that it sees, and so falls a little faster."""
    found = falling(scene_of, "two-way", 1e-3)
    errors = [(found[t] - v) / (RISE - v) for t, v in FALL.items()]
    print("\nDEM06 two-way, of the slip:", " ".join(f"{error:+.2e}" for error in errors))
    assert max(map(abs, errors)) < 1e-2
    assert errors[-1] < 0
