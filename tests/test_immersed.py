"""Bodies immersed in the fluid: nothing flows through them, and what they give the fluid it receives."""

from math import pi

import numpy as np
import pytest

from sim import Scene, simulate
from sim.flowing import FlowSimulation
from sim.grid import cells_of, faces_of

BOX, DENSITY, VISCOSITY = 0.02, 1000.0, 0.01
SLIP = {"kind": "slip"}


def body(name, *shapes, **motion):
    table = {"name": name, "immersed": True, "shapes": [{"particles": "outside", **shape} for shape in shapes]}
    return table | ({"motion": motion} if motion else {})


SPHERE = {"shape": "sphere", "radius": 0.005}
ROD = {"shape": "capsule", "axis": [1, 2, 0.5], "radius": 0.002, "length": 0.008}


def scene(walls, duration=0.1, count=1, periodic="", **fluid):
    """Fluid in a cube about the origin, with bodies in it."""
    corner = 0.5 * BOX
    tables = {
        "fluid": {
            "density": DENSITY, "viscosity": VISCOSITY, "lowest": [-corner] * 3, "highest": [corner] * 3,
            "cells": [16] * 3, **fluid,
        },
        "time": {"duration": duration}, "output": {"interval": duration / count, "precision": "double"}, "walls": walls,
    }  # fmt: skip
    if periodic:
        tables["periodic"] = {"directions": list(periodic), "lowest": [-corner] * 3, "highest": [corner] * 3}
    return Scene.model_validate(tables)


def momentum(run):
    """Σ ρ u V over the faces, once each, in a box that repeats."""
    fluid, n = run.fluid, run.fluid.grid.cells
    faces = [faces_of(fluid.velocity[a], a, fluid.grid)[: n[2], : n[1], : n[0]] for a in range(3)]
    return DENSITY * fluid.grid.volume * np.array([u.sum() for u in faces])


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (SPHERE, 4 / 3 * pi * 0.005**3),
        (ROD | {"radius": 0.004}, pi * 0.004**2 * 0.008 + 4 / 3 * pi * 0.004**3),
        ({"shape": "box", "lowest": [-0.0041, -0.0052, -0.0033], "highest": [0.0047, 0.0013, 0.0061]},
         0.0088 * 0.0065 * 0.0094),
    ],
)  # fmt: skip
def test_solid_shares_add_up_to_the_volume_of_a_body(shape, volume):
    """Walls are flat within a cell, so that errors go with the square of the spacing over the radius."""
    wrong = []
    for n in (16, 32):
        run = FlowSimulation(scene([body("body", shape)], cells=[n] * 3))
        found = cells_of(run.fluid.immersed.share[3], run.fluid.grid).sum() * run.fluid.grid.volume
        wrong.append(found / volume - 1.0)
    print(f"\n{shape['shape']}: shares add up to {wrong} of the volume more, order {np.log2(wrong[0] / wrong[1]):.2f}")
    assert abs(wrong[-1]) < 0.01


def test_a_body_leaves_nothing_on_the_faces_where_it_has_been():
    """What the fluid sees of bodies follows from where they stand, not from where they stood before."""
    spinning = [body("sphere", SPHERE), body("rod", ROD, kind="rotation", axis=[0, 0, 1], rpm=300.0)]
    passed, fresh = FlowSimulation(scene(spinning)), FlowSimulation(scene(spinning))
    for time in np.linspace(0.0, 0.05, 6):  # s, a quarter of a turn
        passed._place_bodies(time)
    fresh._place_bodies(0.05)
    seen, wanted = vars(passed.fluid.immersed), vars(fresh.fluid.immersed)
    for name in ("share", "grip", "wall", "part", "speed", "place"):
        assert seen[name].tobytes() == wanted[name].tobytes(), name


def test_bodies_at_rest_in_still_fluid_do_nothing():
    for seen in simulate(scene([body("sphere", SPHERE), body("rod", ROD)], step=0.01)):
        assert not seen.fluid.velocity.any()
        assert not any(value for name, value in seen.series.items() if name.startswith("fluid_force"))


def test_nothing_flows_through_a_wall_across_the_channel():
    """A plate thicker than a cell, aslant, closes the box: a pressure gradient meets nothing that yields."""
    plate = {"shape": "box", "lowest": [-0.002, -1, -1], "highest": [0.002, 1, 1]}
    end = list(simulate(scene([body("plate", plate)], 0.1, periodic="xyz", pressure_gradient=[-100.0, 0, 0])))[-1]
    flux = end.fluid.velocity[..., 0].mean(axis=(0, 1))  # m/s; unhindered it would be 10
    assert np.abs(flux).max() < 1e-6
    area, gradient = BOX**2, 100.0
    force = end.series["fluid_force.plate.x"]
    assert force == pytest.approx(-gradient * area * BOX, rel=1e-4)  # it holds all of the fluid


@pytest.mark.physics
@pytest.mark.parametrize("n", [16, 24])
def test_net_flux_through_the_faces_around_a_sphere_in_a_stream_is_zero(n):
    """The stream goes round: the faces within the sphere have its velocity, those of its cells no net flux."""
    faces = {"-x": {"kind": "inflow", "speed": 0.1}, "+x": {"kind": "outflow"}}
    faces |= dict.fromkeys(("-y", "+y", "-z", "+z"), SLIP)
    run = FlowSimulation(scene([body("sphere", SPHERE)], 0.1, faces=faces, cells=[n] * 3, velocity=[0.1, 0, 0]))
    run.advance_to(run.steps_per_snapshot)
    fluid = run.fluid
    covered = cells_of(fluid.immersed.share[3], fluid.grid)
    assert np.abs(fluid.divergence(None)).max() < 1e-6 * 0.1 / fluid.grid.spacing[0]
    speed = np.sqrt(sum(u**2 for u in run.fields().velocity[covered >= 1.0].T))
    through = faces_of(fluid.velocity[0], 0, fluid.grid)[:, :, n // 2] * np.prod(fluid.grid.spacing[1:])
    middle = faces_of(fluid.immersed.share[0], 0, fluid.grid)[:, :, n // 2]
    leak = through[middle > 0.5].sum() / (0.1 * pi * 0.005**2)
    print(f"\n{n} cells: {leak:.2e} of the stream goes through the sphere; fastest within {speed.max() / 0.1:.1e}")
    assert abs(leak) < 0.02
    assert through.sum() == pytest.approx(0.1 * BOX**2, rel=1e-6)


@pytest.mark.physics
@pytest.mark.parametrize(
    "motion",
    [
        {"kind": "translation", "velocity": [0.05, 0.02, -0.03]},
        {"kind": "rotation", "axis": [1, 1, 0], "point": [0.001, 0, 0], "rpm": 300.0},
        {"kind": "oscillation", "amplitude": [0.002, 0.0, 0.001], "frequency": 20.0},
    ],
)
def test_momentum_of_the_fluid_is_what_moving_bodies_gave_it(motion):
    """In a box that repeats no one else can: Σ ρ u V = Σ impulses, to round-off of what was given."""
    run = FlowSimulation(scene([body("rod", ROD, **motion)], 0.04, periodic="xyz"))
    largest = 0.0
    for k in range(1, 5):
        run.advance_to(k * run.steps_per_snapshot // 4)
        largest = max(largest, np.abs(run.fluid.given[0, :3]).max())
        assert momentum(run) == pytest.approx(run.fluid.given[0, :3], abs=1e-5 * largest)
    assert largest > 1e-9


@pytest.mark.physics
def test_drag_on_a_sphere_in_a_stream_is_what_the_sphere_takes_from_it():
    """What flows through the sides and the pressure on them balance the sphere's force in the steady state.

    Re = 2 between slip walls at twice the diameter: drag above that of Schiller and Naumann, below thrice that.
    """
    faces = {"-x": {"kind": "inflow", "speed": 0.02}, "+x": {"kind": "outflow"}}
    faces |= dict.fromkeys(("-y", "+y", "-z", "+z"), SLIP)
    fluid = {"faces": faces, "viscosity": 0.1, "velocity": [0.02, 0, 0], "cells": [20] * 3}
    series = list(simulate(scene([body("sphere", SPHERE)], 1.0, 2, **fluid)))[-1].series
    force, reynolds = -series["fluid_force.sphere.x"], DENSITY * 0.02 * 0.01 / 0.1
    lone = 3.0 * pi * 0.1 * 0.01 * 0.02 * (1.0 + 0.15 * reynolds**0.687)
    print(f"\nsphere at Re {reynolds:g}: {force / lone:.3f} of the drag of a lone one")
    assert series["fluid.pressure_drop"] * BOX**2 == pytest.approx(force, rel=0.05)
    assert 1.0 < force / lone < 3.0


@pytest.mark.physics
@pytest.mark.parametrize("kind", ["translation", "rotation"])
def test_pressure_of_a_moving_body_does_not_grow_as_the_step_falls(kind):
    """Faces change hands as a body passes; were that abrupt, pressure would rise as 1/Δt."""
    motion = {"kind": kind, "velocity": [0.05, 0, 0]} if kind == "translation" else {
        "kind": kind, "axis": [0, 0, 1], "rpm": 200.0}  # fmt: skip
    highest = []
    for step in (1e-3, 2.5e-4):
        run = FlowSimulation(scene([body("rod", ROD, **motion)], 0.04, cells=[12] * 3, step=step))
        spikes = []
        for k in range(1, 40):
            run.advance_to(k * run.steps_per_snapshot // 40)
            field = cells_of(run.fluid.pressure, run.fluid.grid)
            spikes.append(field.max() - field.min())
        highest.append(max(spikes[10:]))
    print(f"\n{kind}: largest pressure difference {highest[0]:.3g} and {highest[1]:.3g} Pa at a quarter of the step")
    assert highest[1] < 2.0 * highest[0]


@pytest.mark.physics
def test_drag_of_spheres_in_a_cubic_array_does_not_depend_on_the_step():
    """Slow flow under a pressure gradient G: G L³ = 6 π μ a U K, K = 3.973 for a = 0.3 L.

    Zick and Homsy, doi 10.1017/S0022112082000627.
    4.8 cells to the radius, Δt ν/h² of 1 and 0.1. U is the mean velocity over the whole cube, sphere included.
    """
    factors, gradient, viscosity, radius, n = [], 0.1, 10.0, 0.3 * BOX, 16
    for part in (1.0, 0.1):
        step = part * (BOX / n) ** 2 * DENSITY / viscosity
        fluid = {"pressure_gradient": [-gradient, 0, 0], "largest_step": step, "viscosity": viscosity}
        run = FlowSimulation(scene([body("sphere", SPHERE | {"radius": radius})], 0.02, periodic="xyz", **fluid))
        run.advance_to(run.steps_per_snapshot)
        mean = momentum(run)[0] / (DENSITY * BOX**3)
        factors.append(gradient * BOX**3 / (6.0 * pi * viscosity * radius * mean))
    print(f"\ndrag of a sphere in a cubic array over that of a lone one: {factors}")
    assert factors == pytest.approx([3.973] * 2, rel=0.015)
    assert factors[0] == pytest.approx(factors[1], rel=2e-3)


@pytest.mark.physics
def test_power_of_a_thin_paddle_does_not_depend_on_the_grid():
    """Two and four cells thick: 4.8e-5 and 5.0e-5 W (six: 4.4e-5); 12e-5 and 8e-5 W where rims held in proportion."""
    shape = {"shape": "capsule", "axis": [1, 0, 0], "radius": 1e-3, "length": 3e-3}
    paddle = body("paddle", shape, kind="rotation", axis=[0, 0, 1], rpm=1200.0)
    power = []
    for n in (8, 16):
        box = {"lowest": [-4e-3] * 3, "highest": [4e-3] * 3, "cells": [n] * 3, "viscosity": 1e-3}
        snapshots = list(simulate(scene([paddle], 0.4, 20, **box)))
        power.append(np.mean([s.series["fluid_power.paddle"] for s in snapshots[10:]]))
    print(f"\npower of the paddle on water: {power} W")
    assert power[0] == pytest.approx(power[1], rel=0.15)
    assert power == pytest.approx([4.4e-5] * 2, rel=0.2)
