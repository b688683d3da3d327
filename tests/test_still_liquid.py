"""A liquid at rest stays at rest, whatever lies in it: buoyancy is all that it does to beads.

A floor carries N V_p (ρ_p − ρ_f) g, a bead as dense as the liquid hangs where it is, and no volume is lost: what the
beads take up of the cells is their volume.
"""

from math import pi

import numpy as np
import pytest

from sim import Scene, simulate
from sim.coupled import CoupledSimulation
from sim.exchange import cloud_of
from sim.grid import cells_of

G, LIQUID, DIAMETER, BOX = 9.81, 1000.0, 2e-3, 0.012
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}
VOLUME = pi / 6.0 * DIAMETER**3


def scene(particles, duration, **tables):
    """Beads in a closed box of liquid that stands on a floor."""
    return Scene.model_validate({
        "particles": [{"diameter": DIAMETER, "density": 2500.0, **particles}],
        "contact": {"stiffness": 1e3, "restitution": 0.3},
        "gravity": {"acceleration": [0, 0, -G]},
        "time": {"duration": duration},
        "output": {"interval": duration / 2, "precision": "double"},
        "walls": [FLOOR],
        "fluid": {
            "density": LIQUID, "viscosity": 1e-3, "lowest": [0, 0, 0], "highest": [BOX] * 3, "cells": [4, 4, 4],
            **tables.pop("fluid", {}),
        },
        "drag": {},
        **tables,
    })  # fmt: skip


def layer(height):
    """Sixteen beads on a square lattice."""
    steps = (np.arange(4) + 0.5) * BOX / 4
    return [[float(a), float(b), height] for a in steps for b in steps]


def test_liquid_about_fixed_beads_rests():
    for seen in simulate(scene({"position": layer(0.7 * DIAMETER), "fixed": True}, 0.02)):
        assert not seen.fluid.velocity.any()
        assert not seen.fluid.pressure.any()


@pytest.mark.physics
@pytest.mark.parametrize("coupling", ["one-way", "two-way"])
def test_floor_carries_the_beads_less_the_liquid_that_they_displace(coupling):
    weight = 16 * VOLUME * (2500.0 - LIQUID) * G
    rest = 0.5 * DIAMETER - weight / 16 / 1e3
    end = list(simulate(scene({"position": layer(rest)}, 0.2, drag={"coupling": coupling})))[-1]
    carried, moves = end.series["force.floor.z"], np.abs(end.fluid.velocity).max()
    print(f"\n{coupling}: the floor carries {carried / weight - 1:+.1e} of the weight more; u {moves:.1e} m/s")
    assert carried == pytest.approx(weight, rel=1e-6)
    assert moves < 1e-9  # m/s; a bead sinks at 0.3


@pytest.mark.physics
@pytest.mark.parametrize("coupling", ["one-way", "two-way"])
def test_bead_as_dense_as_the_liquid_hangs_where_it_is(coupling):
    places = {"position": [[0.0051, 0.0062, 0.0073]], "density": LIQUID}
    for seen in simulate(scene(places, 0.1, drag={"coupling": coupling})):
        assert np.abs(seen.velocity).max() <= 1e-6 * G * 0.05
        assert np.abs(seen.fluid.velocity).max() <= 1e-12


@pytest.mark.physics
def test_liquid_comes_to_rest_over_beads_that_have_settled():
    """Beads let go above the floor sink, and end with the same weight on it."""
    weight = 16 * VOLUME * (2500.0 - LIQUID) * G
    end = list(simulate(scene({"position": layer(0.7 * DIAMETER)}, 1.0, fluid={"viscosity": 0.1})))[-1]
    moves, carried = np.abs(end.fluid.velocity).max(), end.series["force.floor.z"]
    print(f"\nsettled: u {moves:.1e} m/s, the floor carries {carried / weight - 1:+.1e} of the weight more")
    assert carried == pytest.approx(weight, rel=1e-4)
    assert moves < 1e-6


@pytest.mark.parametrize("cells", [(4, 4, 4), (1, 6, 3), (5, 1, 1), (9, 8, 7)])
@pytest.mark.parametrize("directions", ["", "x", "xy", "xyz"])
def test_cells_lose_exactly_the_volume_of_the_beads(cells, directions):
    """At walls, in edges and corners, one cell deep, and where the box repeats."""
    rng = np.random.default_rng(7)
    edge = [0.0, 1e-4, 0.5 * DIAMETER]
    near, far = rng.choice(edge, (2, 10, 3))
    places = np.concatenate([rng.uniform(0.0, BOX, (40, 3)), near, np.minimum(BOX - far, BOX * (1.0 - 1e-15))])
    particles, tables = {"position": [[0.5 * BOX] * 3]}, {"walls": [] if "z" in directions else [FLOOR]}
    if directions:
        tables["periodic"] = {"directions": list(directions), "lowest": [0] * 3, "highest": [BOX] * 3}
    flat = [axis for axis, n in zip("xyz", cells, strict=True) if n == 1 and axis not in directions]
    faces = {f"{end}{axis}": {"kind": "slip"} for axis in flat for end in "-+"}
    run = CoupledSimulation(scene(particles, 0.01, fluid={"cells": list(cells), "faces": faces}, **tables))
    sizes = rng.uniform(0.1, 0.3, len(places)) * DIAMETER
    cloud = cloud_of(run.fluid.grid, 1.5 * DIAMETER, None)
    void = cells_of(run.coupling.void_fraction(run.fluid, cloud, places, sizes), run.fluid.grid)
    taken = ((1.0 - void) * run.fluid.grid.volume).sum()
    assert run.coupling.clamped == 0
    assert taken == pytest.approx((4.0 / 3.0 * pi * sizes**3).sum(), rel=1e-12)


def test_volume_of_beads_beside_an_immersed_wall_falls_to_the_open_cells():
    """Cells wholly within a body take nothing while a bead has others near it."""
    block = {"shape": "box", "lowest": [0.006, -1, -1], "highest": [1, 1, 1], "particles": "outside"}
    walls = [FLOOR, {"name": "block", "immersed": True, "shapes": [block]}]
    run = CoupledSimulation(scene({"position": [[0.003] * 3]}, 0.01, walls=walls, fluid={"cells": [8, 4, 4]}))
    places, size = np.random.default_rng(8).uniform([0, 0, 0], [0.005, BOX, BOX], (30, 3)), np.full(30, 5e-4)
    cloud = cloud_of(run.fluid.grid, 1.5 * DIAMETER, 1.0 - run.fluid.immersed.share[3])
    taken = (1.0 - cells_of(run.coupling.void_fraction(run.fluid, cloud, places, size), run.fluid.grid)) * (
        run.fluid.grid.volume
    )
    assert taken.sum() == pytest.approx((4.0 / 3.0 * pi * size**3).sum(), rel=1e-12)
    assert taken[:, :, 4:].max() < 1e-12 * run.fluid.grid.volume
