"""Fluid between a turning cylinder and a resting one: u = A r + B/r, and the torque that keeps it turning.

Both are bodies immersed in a Cartesian grid. A = −Ω R₁²/(R₂² − R₁²), B = −A R₂², torque 4 π μ Ω R₁² R₂²/(R₂² − R₁²) a
length. `n` counts the cells across the outer cylinder's diameter.
"""

from math import pi

import numpy as np
import pytest

from sim import Scene, simulate

DENSITY, VISCOSITY, INNER, OUTER, OMEGA = 50.0, 0.1, 0.005, 0.010, 2.0 * pi
GROWTH = -OMEGA * INNER**2 / (OUTER**2 - INNER**2)
TORQUE = 4.0 * pi * VISCOSITY * OMEGA * INNER**2 * OUTER**2 / (OUTER**2 - INNER**2)


def cylinder(radius, particles, **wall):
    shape = {"shape": "cylinder", "axis": [0, 0, 1], "radius": radius, "particles": particles}
    return {"immersed": True, "shapes": [shape], **wall}


def between_cylinders(n, duration=0.03, **fluid):
    """Run until the flow is steady; return cells across, r and tangential velocity in the gap, and the series."""
    h = 2.0 * OUTER / n
    half, slip = OUTER + 2.0 * h, {"kind": "slip"}
    turning = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0 * OMEGA / (2.0 * pi)}
    scene = {
        "fluid": {
            "density": DENSITY, "viscosity": VISCOSITY, "lowest": [-half, -half, 0.0], "highest": [half, half, h],
            "cells": [n + 4, n + 4, 1], "faces": {"-z": slip, "+z": slip}, "largest_step": 1e-3, **fluid,
        },
        "time": {"duration": duration}, "output": {"interval": duration / 2, "precision": "double"},
        "walls": [
            cylinder(OUTER, "inside", name="vessel"), cylinder(INNER, "outside", name="rotor", motion=turning),
        ],
    }  # fmt: skip
    end = list(simulate(Scene.model_validate(scene)))[-1]
    x = -half + (np.arange(n + 4) + 0.5) * h
    y = x[:, None]
    r = np.hypot(x, y)
    u = end.fluid.velocity[0]
    around, outward = (x * u[..., 1] - y * u[..., 0]) / r, (x * u[..., 0] + y * u[..., 1]) / r
    gap = (r > INNER) & (r < OUTER)
    torque = {name: end.series[f"fluid_torque.{name}.z"] / h for name in ("rotor", "vessel")}
    return r[gap], around[gap], outward[gap], torque, end.series


@pytest.mark.physics
def test_fluid_between_cylinders_turns_as_couette_found():
    """Velocity at first order at least, 1 % at 64 cells across (gate 3 %), torque to 1 %."""
    errors, torques = [], []
    for n in (16, 32, 64):
        r, around, outward, torque, _ = between_cylinders(n)
        wrong = (around - GROWTH * r + GROWTH * OUTER**2 / r) / (OMEGA * INNER)
        errors.append(np.sqrt(np.mean(wrong**2)))
        assert np.abs(wrong).max() < 1.0 / n
        torques.append(abs(torque["rotor"] / TORQUE - 1.0))
        print(
            f"\n{n} cells: velocity {errors[-1]:.4f} of the rotor's, largest {np.abs(wrong).max():.4f}, "
            f"outward {np.abs(outward).max() / (OMEGA * INNER):.4f}, torque {torque['rotor'] / TORQUE - 1:+.4f}, "
            f"vessel's {-torque['vessel'] / TORQUE - 1:+.4f}"
        )
        assert torque["vessel"] == pytest.approx(-torque["rotor"], rel=5e-3)
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    print(f"order of velocity {order}")
    assert order.min() >= 1.0
    assert max(np.abs(wrong).max(), torques[-1]) < 0.01


@pytest.mark.physics
@pytest.mark.parametrize(("n", "gate"), [(16, 0.015), (32, 0.005)])
def test_torque_does_not_depend_on_the_time_step(n, gate):
    """Δt ν/h² from 1 down to 0.01: a body whose rim held the fluid in proportion grew by half a cell (torque +18 %)."""
    h = 2.0 * OUTER / n
    steps = [part * h**2 * DENSITY / VISCOSITY for part in (1.0, 0.1, 0.01)]
    torque = [between_cylinders(n, 0.012, largest_step=step)[3]["rotor"] / TORQUE for step in steps]
    print(f"\n{n} cells: torque {torque} at steps of {steps} s")
    assert torque == pytest.approx([1.0] * 3, abs=gate)
