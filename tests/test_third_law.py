"""What the fluid gives the beads by drag the beads take from the fluid, to round-off, however steps are cut."""

from math import pi

import numpy as np
import pytest

from sim.coupled import CoupledSimulation

pytestmark = pytest.mark.physics

DIAMETER, EDGE = 1e-3, 16e-3
WATER = {"density": 998.2, "viscosity": 1e-3, "lowest": [0, 0, 0], "highest": [EDGE] * 3, "cells": [8, 8, 8]}
BOX = {"name": "box", "shapes": [{"shape": "box", "lowest": [0, 0, 0], "highest": [EDGE] * 3, "particles": "inside"}]}
STEP = 2e-5  # s, of the particles


def loose(n, seed, low=0.1, high=0.9):
    """Places (n, 3) of beads that do not touch, in a part of the box along y."""
    at = np.stack(np.meshgrid(*[np.arange(1, 11)] * 3, indexing="ij"), -1).reshape(-1, 3) / 11 * EDGE
    at = at[(at[:, 1] >= low * EDGE) & (at[:, 1] <= high * EDGE)]
    rng = np.random.default_rng(seed)
    return (rng.permutation(at)[:n] + rng.uniform(-1e-4, 1e-4, (n, 3))).tolist()


def beads(**changes):
    return [{"diameter": DIAMETER, "density": 2500.0} | changes]


SCENES = {
    "one bead": {"particles": beads(position=[[7.1e-3, 9e-3, 8.3e-3]], velocity=[0.1, 0.0, -0.2])},
    "one bead, a step of the fluid for each of its own": {
        "particles": beads(position=[[7.1e-3, 9e-3, 8.3e-3]], velocity=[0.1, 0.0, -0.2]),
        "fluid": WATER | {"step": STEP},
    },
    "fixed bed in a stream": {
        "particles": beads(position=loose(300, 1, 0.3, 0.7), fixed=True),
        "fluid": WATER | {
            "velocity": [0, 0.05, 0], "step": 5e-4,
            "faces": {"-y": {"kind": "inflow", "speed": 0.05}, "+y": {"kind": "outflow"}, "+x": {"kind": "slip"}},
        },
    },
    "beads that hit each other and a floor": {
        "particles": beads(position=loose(300, 2, 0.0, 0.5), velocity=[0.05, -0.3, 0.0]),
        "contact": {"stiffness": 200.0, "restitution": 0.9, "friction": 0.3},
        "walls": [BOX],
    },
    "box that repeats": {
        "particles": beads(position=loose(200, 3), velocity=[0.3, 0.0, 0.1]),
        "periodic": {"directions": ["x", "z"], "lowest": [0, 0, 0], "highest": [EDGE] * 3},
        "walls": [BOX | {"shapes": [BOX["shapes"][0] | {"open": ["-x", "+x", "-z", "+z"]}]}],
    },
    "paddle that turns in the fluid": {
        "particles": beads(position=[x for x in loose(300, 4) if np.hypot(x[0] - 8e-3, x[1] - 8e-3) > 3.6e-3]),
        "contact": {"stiffness": 200.0, "restitution": 0.9, "friction": 0.3},
        "walls": [BOX, {
            "name": "rotor", "immersed": True, "motion": {"kind": "rotation", "axis": [0, 0, 1], "rpm": 300.0,
                                                          "point": [8e-3, 8e-3, 0]},
            "shapes": [{"shape": "box", "lowest": [5.5e-3, 7.2e-3, -1e-3], "highest": [10.5e-3, 8.8e-3, 17e-3],
                        "particles": "outside"}],
        }],
    },
}  # fmt: skip


def run_of(scene_of, tables):
    return CoupledSimulation(
        scene_of(
            **{
                "contact": {"stiffness": 200.0, "restitution": 1.0},
                "gravity": {"acceleration": [0, -9.81, 0]},
                "time": {"duration": 0.02, "step": STEP},
                "output": {"interval": 0.005, "precision": "double"},
                "limits": {"max_speed": 10.0},
                "fluid": WATER,
                "drag": {},
            }
            | tables
        )
    )


@pytest.mark.parametrize("name", SCENES)
def test_impulses_of_beads_and_fluid_cancel(scene_of, name):
    """With what is still owed; 1e-12 of all that was exchanged, along every axis and at every moment."""
    run = run_of(scene_of, SCENES[name])
    c, worst, exchanged = run.coupling, 0.0, 0.0
    for k in range(1, run.snapshots):
        run.advance_to(k * run.steps_per_snapshot)
        exchanged = max(exchanged, float(np.abs(c.impulse).max()))
        rest = np.abs(c.impulse[0] + c.impulse[1] + c.owed.sum(axis=0)).max()
        worst = max(worst, rest / exchanged)
    owed = np.abs(c.owed).sum() / exchanged
    print(f"\n{name}: {exchanged:.2e} N s exchanged in {run.fluid_steps} steps of the fluid and {run.step} of the "
          f"beads, {worst:.1e} of it lost, {owed:.1e} still owed")  # fmt: skip
    assert worst < 1e-12
    assert exchanged > 0


def test_speed_that_a_bead_gains_is_explained_by_drag_weight_and_pressure(scene_of):
    """m Δv = J + (m g − V ∇p − V ρ g) t, with J as the coupling counts it, in sub-steps."""
    run = run_of(scene_of, SCENES["one bead"] | {"fluid": WATER | {"step": 25 * STEP}})
    mass, before = 2500.0 * pi / 6 * DIAMETER**3, run.particles.velocity[0].copy()
    others = np.zeros(3)
    for n in range(1, 41):
        run.advance_to(25 * n)
        others += mass * 25 * run.dt * (run.suspended.lift[0] + np.array([0, -9.81, 0]))
    gained, by_drag = mass * (run.particles.velocity[0] - before), run.coupling.impulse[0]
    print(f"\nm Δv {gained} N s, of which {by_drag} by drag, {others} by weight, buoyancy and pressure")
    assert run.fluid_steps == 40
    assert by_drag + others == pytest.approx(gained, abs=1e-12 * np.abs(others).max())
