"""A run of particles in a fluid: what it loads, that it goes on bitwise, where it stops, and its energy."""

import subprocess
import sys

import numba
import numpy as np
import pytest

from sim import InputError, LimitError, Scene, parse_scene, scene_text, simulation_of
from sim.checkpoint import restore_, state_of
from sim.coupled import CoupledSimulation
from sim.flowing import FlowSimulation
from sim.kernel import most_threads
from suffice.store import Run

BOX = {"name": "box", "shapes": [{"shape": "box", "lowest": [0, 0, 0], "highest": [8e-3] * 3, "particles": "inside"}]}
PADDLE = {
    "name": "paddle", "immersed": True,
    "motion": {"kind": "rotation", "axis": [0, 0, 1], "point": [4e-3, 4e-3, 0], "rpm": 1200.0},
    "shapes": [{"shape": "capsule", "axis": [1, 0, 0], "centre": [4e-3, 4e-3, 4e-3], "radius": 1e-3, "length": 3e-3,
                "particles": "outside"}],
}  # fmt: skip
WATER = {"density": 998.2, "viscosity": 1e-3, "lowest": [0, 0, 0], "highest": [8e-3] * 3, "cells": [8, 8, 8]}


def stirred(fluid=None, drag=None, walls=(BOX, PADDLE), duration=4e-3, **tables):
    """Beads in a box of water with a paddle that turns."""
    return Scene.model_validate(
        {
            "particles": [{"diameter": 1e-3, "density": 2500.0, "count": 150}],
            "contact": {"stiffness": 1e3, "restitution": 0.9, "friction": 0.2},
            "gravity": {"acceleration": [0, 0, -9.81]},
            "time": {"duration": duration}, "output": {"interval": 1e-3, "precision": "double"},
            "fluid": WATER | (fluid or {}), "drag": {} if drag is None else drag, "walls": list(walls), "seed": 3,
        } | tables
    )  # fmt: skip


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert np.asarray(values).tobytes() == np.asarray(other[name]).tobytes(), name


def test_a_dry_scene_loads_no_code_of_the_fluid():
    code = (
        "import sys, sim\n"
        "run = sim.simulation_of(sim.parse_scene(sim.scene_text('shaken_box')))\n"
        "assert type(run) is sim.Simulation and run.suspended is None\n"
        "names = ('fluid', 'coupled', 'coupling', 'exchange', 'pressure', 'immersed', 'drag')\n"
        "wet = {f'sim.{name}' for name in names}\n"
        "assert not wet & set(sys.modules), wet & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_only_what_the_scene_asks_for_is_there():
    assert isinstance(simulation_of(stirred()), CoupledSimulation)
    one_way = simulation_of(stirred(drag={"coupling": "one-way"}))
    assert one_way.coupling.owed.size == 0
    none = simulation_of(stirred().model_copy(update={"drag": None}))
    assert none.coupling is None
    dry_walls = simulation_of(stirred(walls=(BOX, PADDLE | {"immersed": False})))
    assert dry_walls.fluid.immersed is None
    assert dry_walls.fluid.given.size == 0
    flow = simulation_of(parse_scene(scene_text("cavity")))
    assert isinstance(flow, FlowSimulation)
    assert len(flow.particles.radius) == 0


def test_one_way_leaves_no_trace_of_the_particles_in_the_fluid():
    run = simulation_of(stirred(drag={"coupling": "one-way"}, walls=(BOX,)))
    run.advance_to(run.steps_per_snapshot)
    assert (run.fluid.velocity == 0.0).all()
    assert (run.fluid.void_fraction == 1.0).all()


def test_a_restored_run_is_bitwise_the_run_itself():
    through = simulation_of(stirred())
    steps = through.steps_per_snapshot
    through.advance_to(steps)
    state = state_of(through)
    again = simulation_of(stirred())
    restore_(again, state)
    for run in (through, again):
        run.advance_to(3 * steps)
    assert_same(state_of(through), state_of(again))
    one, other = through.snapshot(), again.snapshot()
    assert one.series == other.series
    assert_same(one.fluid._asdict(), other.fluid._asdict())


@pytest.mark.physics
def test_a_mill_that_goes_on_on_another_number_of_threads_is_bitwise_the_mill_itself():
    """At the restart its pins have left faces that they held before, and beads of four chunks touch each other."""
    scene, before = parse_scene(scene_text("mini_mill")), numba.get_num_threads()
    through, again = simulation_of(scene), simulation_of(scene)
    steps = through.steps_per_snapshot
    try:
        numba.set_num_threads(1)
        through.advance_to(3 * steps)
        restore_(again, state_of(through))
        through.advance_to(5 * steps)
        numba.set_num_threads(min(2, most_threads()))
        again.advance_to(5 * steps)
    finally:
        numba.set_num_threads(before)
    assert_same(state_of(through), state_of(again))
    assert through.snapshot().series == again.snapshot().series


def test_two_threads_give_bitwise_what_one_gives():
    scene = parse_scene(scene_text("mini_mill"))
    states, before = [], numba.get_num_threads()
    try:
        for threads in (1, min(2, most_threads())):
            numba.set_num_threads(threads)
            run = simulation_of(scene)
            run.advance_to(500)
            states.append(state_of(run))
    finally:
        numba.set_num_threads(before)
    assert_same(*states)


def test_the_step_of_the_fluid_stays_within_its_limits():
    run = simulation_of(stirred())
    run.advance_to(run.steps_per_snapshot)
    least = min(limit.largest for limit in run.limits())
    assert run.substeps(10**6) * run.dt <= least * (1.0 + 1e-9)
    assert {"speed of the fluid (CFL)", "speed of the particles", "speed of the walls", "exchange of momentum"} <= {
        limit.term for limit in run.limits()
    }


def test_a_step_too_long_for_the_flow_stops_the_run_and_says_where():
    fast = PADDLE | {"motion": PADDLE["motion"] | {"rpm": 12000.0}}
    run = simulation_of(stirred(fluid={"step": 1e-3}, walls=(BOX, fast)))
    with pytest.raises(
        LimitError, match=r"crosses .* cells in a step of 0.001 s at t = .* s \(fastest at .*fluid.step"
    ):
        run.advance_to(run.steps_per_snapshot * 4)


@pytest.mark.parametrize("name", ["step", "largest_step"])
def test_a_step_of_the_fluid_below_that_of_the_particles_is_refused(name):
    with pytest.raises(InputError, match=rf"fluid.{name} = 1e-09 s: below the particles' step of .*time.step = 1e-09"):
        simulation_of(stirred(fluid={name: 1e-9}))


def test_a_particle_outside_the_box_of_the_fluid_is_named():
    with pytest.raises(InputError, match=r"particle \d+ is outside the fluid's box, .* enlarge fluid"):
        simulation_of(stirred(fluid={"highest": [8e-3, 8e-3, 4e-3]}))


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"fluid": None}, "drag: needs a fluid"),
        ({"fluid": None, "drag": None}, "walls.1.immersed = true: there is no fluid"),
        ({"fluid": {"faces": {"-x": {"kind": "inflow", "speed": 1.0}}}}, "what flows in must get out"),
        ({"fluid": {"cells": [0, 8, 8]}}, "at least one in every direction"),
        ({"particles": []}, "drag: needs a fluid and particles"),
        (
            {"periodic": {"directions": ["x"], "lowest": [0, 0, 0], "highest": [9e-3, 0, 0]}},
            "where the box repeats from 0.0 to 0.009 m",
        ),
    ],
)
def test_a_scene_that_makes_no_sense_is_refused(tables, words):
    wet = stirred().model_dump(exclude_unset=True)
    if tables.get("fluid"):
        tables = tables | {"fluid": wet["fluid"] | tables["fluid"]}
    with pytest.raises((InputError, ValueError), match=words):
        Scene.model_validate({name: value for name, value in (wet | tables).items() if value is not None})


def test_a_thin_wall_in_the_fluid_is_refused():
    cup = {"shape": "cylinder", "axis": [0, 0, 1], "centre": [4e-3] * 3, "radius": 3e-3, "length": 6e-3, "open": ["+"],
           "particles": "inside"}  # fmt: skip
    with pytest.raises(InputError, match=r"walls.1.immersed = true: 'cup' has an open cylinder"):
        simulation_of(stirred(walls=(BOX, {"name": "cup", "immersed": True, "shapes": [cup]})))


def test_a_deck_of_lammps_refuses_the_fluid_by_name(tmp_path, suffice):
    answer = suffice("simulate", "settling_sphere", "-o", tmp_path / "run.h5", "--engine", "lammps")
    assert answer.code == 2
    assert "fluid = a table" in answer.err
    assert "a LAMMPS deck cannot say it" in answer.err
    assert not list(tmp_path.iterdir())


def test_a_run_on_disk_holds_the_fluid_and_its_view_shows_it(tmp_path, suffice):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    path = tmp_path / "run.h5"
    answer = suffice("simulate", "mini_mill", "-o", path, "--until", "0.002", "--threads", "1")
    assert answer.code == 0, answer.err
    with Run(path) as run:
        assert {"fluid.velocity", "fluid.pressure", "fluid.void_fraction"} <= set(run.quantities)
        assert run.grid == ((10, 18, 18), (-0.01125, -0.01125, -0.006), pytest.approx((0.00125, 0.00125, 0.0012)))
        now = run.snapshot(2).values
        assert {"fluid_torque.rotor.z", "fluid.work.particles", "bed_height"} <= set(run.series)
        assert run.series["fluid_torque.rotor.z"][-1] > 0.0
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "run.fluid.vtkhdf"))
    reader.UpdateInformation()
    assert reader.UpdateTimeStep(0.002)
    cells = reader.GetOutputDataObject(0).GetCellData()
    shown = vtk_to_numpy(cells.GetArray("velocity")).reshape(10, 18, 18, 3)
    assert np.array_equal(shown, now["fluid.velocity"])
    assert np.array_equal(vtk_to_numpy(cells.GetArray("void_fraction")).ravel(), now["fluid.void_fraction"].ravel())


def balance(run, snapshots):
    """Work of the shaft, and what became of it (J) by name, from the first to the last of so many snapshots."""
    rows = []
    for k in range(snapshots):
        run.advance_to(k * run.steps_per_snapshot)
        rows.append(run.snapshot().series)
    first, last = rows[0], rows[-1]
    interval = run.dt * run.steps_per_snapshot
    powers = [name for name in first if name.startswith("fluid_power.")]
    shaft = last["energy.wall_work"] + interval * sum(row[name] for row in rows[1:] for name in powers)
    heat = {
        "contacts": last["energy.dissipated"], "slip": last["fluid.slip_loss"],
        "viscosity": -last["fluid.work.friction"], "scheme of convection": -last["fluid.work.convection"],
        "plastic impact at bodies": last["fluid.lost_at_bodies"],
    }  # fmt: skip
    energies = ("kinetic", "rotational", "potential", "elastic")
    kept = {name: last[f"energy.{name}"] - first[f"energy.{name}"] for name in energies}
    return shaft, heat, kept | {"kinetic, of the fluid": last["fluid.kinetic"] - first["fluid.kinetic"]}


@pytest.mark.physics
def test_a_small_wet_mill_runs_for_a_second_and_loses_no_bead():
    """Twenty turns of a paddle among beads; `suffice simulate mini_mill --until 1` does the same with 2000 of them."""
    walls = (BOX, PADDLE | {"shapes": [PADDLE["shapes"][0] | {"centre": [4e-3, 4e-3, 2.5e-3]}]})
    harder = {"stiffness": 4e3, "restitution": 0.9, "friction": 0.2}
    output = {"interval": 0.05, "precision": "double"}
    run = simulation_of(stirred(walls=walls, duration=1.0, contact=harder, output=output))
    assert run.snapshots == 21
    fastest, shaft = [], []
    for k in range(run.snapshots):
        run.advance_to(k * run.steps_per_snapshot)
        now = run.snapshot()
        assert len(now.position) == 150
        assert now.position.min() > 0.9 * 5e-4
        assert now.position.max() < 8e-3 - 0.9 * 5e-4
        fastest.append(np.linalg.norm(now.velocity, axis=1).max())
        shaft.append(now.series["energy.wall_work"])
    tip = 2 * np.pi * 20.0 * 2.5e-3  # m/s
    print(f"\n  {run.step} steps of the beads, {run.fluid_steps} of the fluid; fastest bead {max(fastest):.2f} m/s, "
          f"tip {tip:.2f} m/s; work of the shaft on the beads {1e3 * shaft[-1]:.2f} mJ")  # fmt: skip
    assert 0.1 * tip < np.median(fastest) < 3.0 * tip  # they are stirred all the time, and none takes off
    assert shaft[-1] > shaft[10] > 0.0
    assert run.coupling.clamped == 0


@pytest.mark.physics
def test_the_shaft_pays_for_heat_and_for_what_moves():
    run = simulation_of(parse_scene(scene_text("mini_mill")))
    shaft, heat, kept = balance(run, 41)
    spent = sum(heat.values()) + sum(kept.values())
    print(f"\n  work of the shaft {1e3 * shaft:.3f} mJ; heat and energy {1e3 * spent:.3f} mJ, {spent / shaft - 1:+.2%}")
    print("\n".join(f"    {name:<28} {1e3 * value:8.4f} mJ" for name, value in (heat | kept).items()))
    assert spent == pytest.approx(shaft, rel=0.03)
    assert min(heat.values()) > 0.0
    assert run.coupling.clamped == 0
