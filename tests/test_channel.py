"""Flow between plates: the parabola of Poiseuille, the line of Couette and how it comes about, frictionless plug flow.

Viscosity is implicit, so that a few long steps reach the steady state.
"""

from math import pi

import numpy as np
import pytest

from sim import Scene, simulate, simulation_of
from sim.flow import FluidTable
from sim.fluid import Fluid
from sim.grid import faces_of, grid_of

DENSITY, VISCOSITY, WIDTH, LENGTH, SPEED = 1.0, 1.0, 1.0, 2.0, 1.0
SLIP = {"kind": "slip"}


def snapshots(fluid, duration, count, periodic=""):
    """Run a fluid between the corners 0 and `highest`; return its snapshots."""
    tables = {
        "fluid": {"density": DENSITY, "viscosity": VISCOSITY, "lowest": [0.0, 0.0, 0.0], **fluid},
        "time": {"duration": duration},
        "output": {"interval": duration / count, "precision": "double"},
    }
    if periodic:
        tables["periodic"] = {"directions": list(periodic), "lowest": [0.0, 0.0, 0.0], "highest": fluid["highest"]}
    return list(simulate(Scene.model_validate(tables)))


def poiseuille(n, along, across, faces=None):
    """Velocity across a channel that a pressure gradient drives, at rest at first; unit of its largest one."""
    cells, gradient = [1, 1, 1], [0.0, 0.0, 0.0]
    cells[across], cells[along] = n, 2
    gradient[along] = -8.0 * VISCOSITY * 1e-3 / WIDTH**2
    fluid = {"highest": [WIDTH] * 3, "cells": cells, "pressure_gradient": gradient, "faces": faces or {}}
    periodic = "".join(name for axis, name in enumerate("xyz") if axis != across)
    speed = snapshots(fluid, 10.0, 10, periodic)[-1].fluid.velocity
    others = [a for a in range(3) if a != along]
    assert np.abs(speed[..., others]).max() < 1e-15
    return np.moveaxis(speed[..., along], 2 - across, 0)[:, 0, 0] / 1e-3


@pytest.mark.parametrize(("along", "across"), [(0, 1), (1, 2), (2, 0)])
def test_pressure_gradient_drives_a_parabola_with_second_order(along, across):
    errors = []
    for n in (8, 16, 32):
        y = (np.arange(n) + 0.5) / n
        errors.append(np.abs(poiseuille(n, along, across) - 4.0 * y * (1.0 - y)).max())
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    print(f"\nPoiseuille along {'xyz'[along]}: error {errors}, order {order}")
    assert order == pytest.approx(2.0, abs=0.01)
    assert errors[-1] < 1e-3


def test_plane_of_symmetry_is_a_wall_without_friction():
    whole = poiseuille(16, 0, 1)
    assert whole == pytest.approx(whole[::-1], rel=1e-9)
    half = snapshots(
        {"highest": [1.0, 0.5 * WIDTH, 1.0], "cells": [2, 8, 1], "faces": {"+y": SLIP}}
        | {"pressure_gradient": [-8.0 * VISCOSITY * 1e-3 / WIDTH**2, 0.0, 0.0]},
        10.0, 10, "xz",
    )[-1].fluid.velocity[0, :, 0, 0]  # fmt: skip
    assert half / 1e-3 == pytest.approx(whole[:8], rel=1e-8)


def inflow_channel(n, face, across=None):
    across = across or {"-z": SLIP, "+z": SLIP}
    fluid = {"highest": [LENGTH, WIDTH, 1.0], "cells": [2 * n, n, 1], "convection": "central"}
    return fluid | {"faces": {"-x": {"kind": "inflow", **face}, "+x": {"kind": "outflow"}, **across}}


@pytest.mark.physics
def test_parabola_that_flows_in_flows_out_with_second_order_and_takes_the_pressure_of_poiseuille():
    velocity, pressure = [], []
    for n in (8, 16, 32):
        end = snapshots(inflow_channel(n, {"speed": SPEED, "profile": "parabolic"}), 1.0, 1)[-1]
        y = (np.arange(n) + 0.5) / n
        parabola = 6.0 * SPEED * y * (1.0 - y)
        velocity.append(np.abs(end.fluid.velocity[0, :, :, 0] - parabola[:, None]).max() / (1.5 * SPEED))
        drop = 12.0 * VISCOSITY * SPEED * LENGTH / WIDTH**2
        pressure.append(abs(end.series["fluid.pressure_drop"] / drop - 1.0))
        assert np.abs(end.fluid.velocity[..., 1:]).max() < 0.05 / n
    orders = [np.log2(np.divide(e[:-1], e[1:])) for e in (velocity, pressure)]
    print(f"\nchannel: u {velocity} order {orders[0]}; pressure drop {pressure} order {orders[1]}")
    assert orders[0] == pytest.approx(2.0, abs=0.15)
    assert orders[1] == pytest.approx(2.0, abs=0.2)
    assert velocity[-1] < 1e-3


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_sliding_wall_drags_a_straight_line_of_velocities(axis):
    """Couette; the scheme is exact on lines."""
    cells, wall, other = [1, 1, 1], [0.0, 0.0, 0.0], (axis + 1) % 3
    cells[axis], wall[other] = 16, 1e-3
    fluid = {"highest": [1.0, 1.0, 1.0], "cells": cells}
    fluid["faces"] = {f"+{'xyz'[axis]}": {"kind": "wall", "velocity": wall}}
    end = snapshots(fluid, 20.0, 10, "xyz".replace("xyz"[axis], ""))[-1].fluid.velocity[..., other]
    line = (np.arange(16) + 0.5) / 16
    assert np.moveaxis(end, 2 - axis, 0)[:, 0, 0] / 1e-3 == pytest.approx(line, abs=1e-8)


@pytest.mark.physics
def test_couette_flow_comes_about_by_diffusion_with_second_order():
    """u/U = y + Σ 2 (−1)^m/(mπ) sin(mπy) e^(−m²π²νt): t = 0.05 s, steps with the square of the spacing."""
    table = {"density": DENSITY, "viscosity": VISCOSITY, "lowest": (0, 0, 0), "highest": (1, 1, 1)}
    errors, m = [], np.arange(1, 60)
    for n, steps in ((8, 40), (16, 160), (32, 640)):
        sides = {"+y": {"kind": "wall", "velocity": (1.0, 0.0, 0.0)}}
        flow = FluidTable.model_validate(table | {"cells": (1, n, 1), "faces": sides})
        fluid = Fluid(flow, grid_of(flow, (True, False, True)))
        for k in range(steps):
            fluid.step_((k + 1) * 0.05 / steps, 0.05 / steps, None)
        y = (np.arange(n) + 0.5) / n
        decay = np.exp(-(m**2) * pi**2 * VISCOSITY / DENSITY * 0.05)
        exact = y + (2.0 * (-1.0) ** m / (m * pi) * np.sin(m * pi * y[:, None]) * decay).sum(axis=1)
        errors.append(np.abs(faces_of(fluid.velocity[0], 0, fluid.grid)[0, :, 0] - exact).max())
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    print(f"\nCouette starting: {errors} order {order}")
    assert order[-1] == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-3


def test_between_walls_without_friction_all_fluid_moves_as_one():
    """Plug flow that is ramped up: at every moment ρ L dU/dt is the pressure drop."""
    slip = dict.fromkeys(("-y", "+y", "-z", "+z"), SLIP)
    fluid = inflow_channel(4, {"speed": 1.0, "start_speed": 0.2, "ramp": 0.4}, slip) | {"step": 0.02, "viscosity": 1e-3}
    for k, seen in enumerate(snapshots(fluid, 0.6, 6)):
        if k == 0:
            continue
        speed = min(0.2 + 2.0 * seen.time, 1.0)
        assert seen.fluid.velocity[..., 0] == pytest.approx(speed, rel=1e-7)
        assert np.abs(seen.fluid.velocity[..., 1:]).max() < 1e-7
        push = DENSITY * LENGTH * 2.0 if seen.time < 0.41 else 0.0
        assert seen.series["fluid.pressure_drop"] == pytest.approx(push, abs=1e-3)


def test_pressure_gradient_accelerates_fluid_without_walls_as_newton_says():
    fluid = {"highest": [1.0, 1.0, 1.0], "cells": [2, 3, 4], "pressure_gradient": [-0.1, 0.2, 0.0], "step": 0.01}
    for seen in snapshots(fluid, 0.5, 5, "xyz"):
        assert seen.fluid.velocity[..., 0] == pytest.approx(0.1 * seen.time / DENSITY, abs=1e-12)
        assert seen.fluid.velocity[..., 1] == pytest.approx(-0.2 * seen.time / DENSITY, abs=1e-12)


def test_inflow_through_a_region_brings_its_mean_speed_over_the_region():
    fluid = inflow_channel(8, {"speed": 1.0, "lowest": [0, 0.25, 0], "highest": [0, 0.75, 1]}) | {"step": 0.01}
    seen = snapshots(fluid, 0.05, 1)[-1].fluid.velocity
    assert seen[..., 0].mean(axis=(0, 1)) == pytest.approx(0.5, rel=1e-6)  # through every section of the channel


def test_the_largest_step_that_a_scene_allows_is_kept_however_far_apart_its_snapshots_are():
    """A twentieth of a thousandth of the interval: the flow from rest is U = G t/ρ, and its steps are counted."""
    fluid = {"highest": [1.0, 1.0, 1.0], "cells": [2, 2, 2], "pressure_gradient": [-1e-3, 0, 0], "largest_step": 5e-4}
    seen = snapshots(fluid, 1.0, 1, "xyz")[-1]
    assert seen.series["fluid.steps"] >= 2000
    assert seen.fluid.velocity[..., 0] == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize(("gradient", "duration"), [(10.0, 2.0), (1e4, 0.08)])
def test_a_flow_that_a_pressure_gradient_starts_keeps_to_the_limits_of_its_steps(gradient, duration):
    """From rest over hundreds of cells a snapshot, without a step in the scene: U = G t/ρ of a box that repeats."""
    scene = {
        "fluid": {"density": DENSITY, "viscosity": VISCOSITY, "lowest": [0.0] * 3, "highest": [1.0] * 3,
                  "cells": [10, 2, 2], "pressure_gradient": [-gradient, 0, 0]},
        "periodic": {"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [1, 1, 1]},
        "time": {"duration": duration}, "output": {"interval": duration, "precision": "double"},
    }  # fmt: skip
    run = simulation_of(Scene.model_validate(scene))
    run.advance_to(run.steps_per_snapshot)
    assert run.guards["courant"].value < 0.75  # the second step starts with half of the speed that it ends with
    assert run.snapshot().fluid.velocity[..., 0] == pytest.approx(gradient * duration / DENSITY, rel=1e-9)


@pytest.mark.physics
@pytest.mark.parametrize("viscosity", [1e3, 1e-6])
def test_jet_of_honey_and_one_without_friction_stay_stable(viscosity):
    """Box of a centimetre: ν Δt/h² is about 200 at one end, and the cells' Reynolds number 1e6 at the other."""
    fluid = inflow_channel(12, {"speed": 1.0, "lowest": [0, 3e-3, 3e-3], "highest": [0, 7e-3, 7e-3]}, {})
    fluid |= {"density": 1000.0, "viscosity": viscosity, "highest": [0.01] * 3, "cells": [12, 12, 12]}
    for seen in snapshots(fluid | {"convection": "bounded"}, 0.02, 2)[1:]:
        speed = np.sqrt((seen.fluid.velocity**2).sum(axis=-1))
        assert speed.max() < 2.0
        assert seen.series["fluid.divergence"] < 1e-6 * 1.0 / (0.01 / 12)
        assert seen.fluid.velocity[..., 0].sum(axis=(0, 1)) == pytest.approx(
            (0.4 * 12) ** 2, rel=1e-5
        )  # cells in the region
    print(f"\njet, {viscosity:g} Pa s: fastest {speed.max():.3g} m/s after {seen.series['fluid.steps']:.0f} steps")


def test_fluid_at_rest_between_walls_at_rest_rests():
    end = snapshots({"highest": [1.0] * 3, "cells": [4, 4, 4], "step": 0.1}, 1.0, 1)[-1].fluid
    assert not end.velocity.any()
    assert not end.pressure.any()
