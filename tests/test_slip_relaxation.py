"""A bead and the fluid around it come to a common velocity: exponentially, whatever the step, and no further."""

from math import exp, pi

import numpy as np
import pytest

from sim.coupled import CoupledSimulation

DIAMETER, EDGE, DENSITY, VISCOSITY = 1e-3, 4e-3, 1000.0, 1e-3
VOLUME, CELL = pi / 6 * DIAMETER**3, EDGE**3
VOID = 1 - VOLUME / CELL
KAPPA = 3 * pi * VISCOSITY * DIAMETER * VOID**-2.65  # kg/s, Stokes drag of Wen and Yu
SLIP = 1e-9  # m/s: Re_p is 1e-6, and drag 1e-5 above that of Stokes


def one_cell(scene_of, density, step, steps, substeps=1, fixed=False, first=0.0):
    """A bead in a periodic cell of fluid that moves at `SLIP`: the run, and velocities of both after every step."""
    k = 0.25 * 4 * VOLUME * density * (pi / (50 * step / substeps)) ** 2
    scene = scene_of(
        particles=[{"diameter": DIAMETER, "density": density, "position": [[1.3e-3, 2e-3, 2.9e-3]], "fixed": fixed,
                    "velocity": [first, 0, 0]}],
        contact={"stiffness": 0.1 * k},
        time={"duration": step * steps, "step": step / substeps},
        output={"interval": step, "precision": "double"},
        limits={"max_speed": 1.0},
        periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [EDGE, EDGE, EDGE]},
        fluid={"density": DENSITY, "viscosity": VISCOSITY, "lowest": [0, 0, 0], "highest": [EDGE, EDGE, EDGE],
               "cells": [1, 1, 1], "velocity": [SLIP, 0, 0], "step": step},
        drag={},
    )  # fmt: skip
    run, rows = CoupledSimulation(scene), []
    for n in range(steps + 1):
        run.advance_to(n * run.steps_per_snapshot)
        rows.append((run.particles.velocity[0, 0], run.fields().velocity[0, 0, 0, 0], run.coupling.owed[0, 0]))
    return run, np.array(rows).T


def masses(density):
    """Mass of the bead and of the fluid in the cell, kg."""
    return density * VOLUME, DENSITY * VOID * CELL


@pytest.mark.parametrize("density", [2500.0, 1e6])
def test_slip_decays_exponentially_at_the_rate_of_both_inertias(scene_of, density):
    """dw/dt = −κ (1/m + 1/M) w. The step is of first order: halving it halves the error."""
    bead, fluid = masses(density)
    rate, errors = KAPPA * (1 / bead + 1 / fluid), []
    for steps in (100, 200):
        step = 2 / rate / steps
        _, (v, u, _) = one_cell(scene_of, density, step, steps)
        exact = SLIP * np.exp(-rate * step * np.arange(steps + 1))
        errors.append(np.abs(u - v - exact).max() / SLIP)
    print(f"\nbead of {density:g} kg/m³: slip departs from the exponential by {errors[0]:.1e}, {errors[1]:.1e}")
    assert errors[1] < 5e-3
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("stiffness", np.logspace(-6, 4, 6))
@pytest.mark.parametrize("density", [1.0, 2500.0, 1e7])
def test_bead_and_fluid_meet_at_their_common_velocity_without_overshoot(scene_of, density, stiffness):
    """Δt K/(ρε) from 1e-6 to 1e4, beads light, common and heavy; sub-steps too. Momentum is what there was."""
    bead, fluid = masses(density)
    step = stiffness * fluid / KAPPA
    for substeps in (1, 3):
        run, (v, u, owed) = one_cell(scene_of, density, step, 40, substeps)
        slip = u - v
        assert (slip >= -1e-9 * SLIP).all()
        assert (np.diff(slip) <= 1e-9 * SLIP).all()
        momentum = bead * v + fluid * u + owed
        assert np.abs(momentum / momentum[0] - 1).max() < 1e-9 + 1e-11 * stiffness  # K u of a u to 1e-10
        assert run.fluid.report.imbalance < 1e-12
        common = fluid * SLIP / (bead + fluid)
        exact = SLIP * exp(-KAPPA * (1 / bead + 1 / fluid) * 40 * step)
        if exact < 1e-9 * SLIP:
            assert v[-1] == pytest.approx(common, rel=1e-6)
            assert u[-1] == pytest.approx(common, rel=1e-6)
        if exact > 0.99 * SLIP:
            assert slip[-1] == pytest.approx(exact, rel=1e-4)
    print(f"\n{density:g} kg/m³, Δt K/ρε {stiffness:g}: last slip {slip[-1] / SLIP:.2e}, exact {exact / SLIP:.2e}")


@pytest.mark.parametrize("stiffness", np.logspace(-6, 4, 6))
def test_fixed_bead_stops_the_fluid(scene_of, stiffness):
    """u' = u/(1 + Δt K/ρε) at every step: implicit, so never backwards."""
    _, fluid = masses(1.0)
    run, (v, u, _) = one_cell(scene_of, 2500.0, stiffness * fluid / KAPPA, 20, fixed=True)
    assert (v == 0).all()
    assert (u > 0).all()
    assert u == pytest.approx(SLIP * (1 + stiffness * (1 + 2e-5)) ** -np.arange(21.0), rel=1e-3, abs=1e-9 * SLIP)
    assert run.coupling.impulse.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-12 * fluid * SLIP)


@pytest.mark.parametrize("stiffness", [1e-2, 1.0, 1e4])
def test_many_beads_are_taken_along_by_a_stream_and_none_outruns_it(scene_of, stiffness):
    """Two hundred in 4 × 4 × 4 cells that repeat: all ends at one velocity, that of the common momentum."""
    n, rng = 200, np.random.default_rng(5)
    at = np.stack(np.meshgrid(*[np.arange(6)] * 3), -1).reshape(-1, 3)[:n]
    edge = 4 * EDGE
    position = (at + 0.5 + rng.uniform(-0.2, 0.2, at.shape)) * edge / 6
    bead, fluid = 2500.0 * VOLUME, DENSITY * (edge**3 - n * VOLUME)
    step = stiffness * fluid / n / KAPPA
    scene = scene_of(
        particles=[{"diameter": DIAMETER, "density": 2500.0, "position": position.tolist()}],
        contact={"stiffness": 0.1 * bead * (pi / (50 * step)) ** 2},
        time={"duration": 60 * step, "step": step},
        output={"interval": step, "precision": "double"},
        limits={"max_speed": 1.0},
        periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [edge] * 3},
        fluid={"density": DENSITY, "viscosity": VISCOSITY, "lowest": [0, 0, 0], "highest": [edge] * 3,
               "cells": [4, 4, 4], "velocity": [SLIP, 0, 0], "step": step},
        drag={},
    )  # fmt: skip
    run, common = CoupledSimulation(scene), fluid * SLIP / (n * bead + fluid)
    for _ in range(60):
        run.advance_to(run.step + 1)
        v = run.particles.velocity
        seen = run.fields().velocity[..., 0]
        assert v[:, 0].min() > 0
        assert v[:, 0].max() <= seen.max() * (1 + 1e-9)
    c, density = run.coupling, run.fields().void_fraction * DENSITY
    momentum = bead * v.sum(axis=0) + c.owed.sum(axis=0)
    momentum += (density[..., None] * run.fields().velocity).sum(axis=(0, 1, 2)) * CELL
    missing = momentum[0] / (fluid * SLIP) - 1
    print(f"\n{n} beads, Δt K/ρε {stiffness:g}: at {v[:, 0].mean() / common - 1:+.1e} of the common velocity, "
          f"{missing:+.1e} of the momentum")  # fmt: skip
    assert missing == pytest.approx(0, abs=1e-3)
    assert np.abs(c.impulse[0] + c.impulse[1] + c.owed.sum(axis=0)).max() < 1e-12 * np.abs(c.impulse).max()
    if stiffness > 0.5:
        assert v[:, 0] == pytest.approx(common, rel=1e-3)
