"""What particles are on a grid: nothing is lost, and what is uniform among them is uniform there."""

import numpy as np
import pytest

from sim import Scene, parse_scene, scene_text, simulation_of
from sim.grid import cells_of
from suffice.fields import Densities, Eulerian
from suffice.progress import Reporter
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.simulating import simulate_to
from suffice.store import RunWriter
from suffice.watching import grid_of_file


@pytest.fixture
def mill(tmp_path):
    """The grid of the small mill with its walls, and 1500 beads somewhere in its box."""
    text = scene_text("mini_mill")
    grid = grid_of_file(parse_scene(text))
    z, y, x = grid.shape
    n, path = 1500, tmp_path / "mill.h5"
    particles = {"ids": np.arange(n), "radius": np.linspace(3e-4, 5e-4, n), "species": np.zeros(n, int)}
    rng = np.random.default_rng(0)
    low, high = np.array([-0.01, -0.01, -0.006]), np.array([0.01, 0.01, 0.006])
    position, velocity = low + (high - low) * rng.uniform(size=(n, 3)), rng.normal(size=(n, 3))
    names = ("position", "velocity", "fluid.velocity", "fluid.pressure")
    with RunWriter(
        path, **particles, n_snapshots=1, variables=names, grid=grid, provenance={"scene": text}, precision="double"
    ) as run:
        fluid = {"fluid.velocity": np.ones((z, y, x, 3)), "fluid.pressure": rng.normal(7.0, 1.0, size=(z, y, x))}
        run.append(0.0031, {"position": position, "velocity": velocity, **fluid})
    with Run(path) as run:
        yield Eulerian(run), position, velocity


def test_no_volume_momentum_or_energy_of_the_beads_is_lost_between_cells_and_behind_walls(mill):
    eulerian, _, velocity = mill
    found, cell = eulerian.at(0), eulerian.grid.volume
    assert found.solid.sum() * cell == pytest.approx(eulerian.volume.sum(), rel=1e-13)
    momentum = (eulerian.volume[:, None] * velocity).sum(axis=0)
    scale = (eulerian.volume[:, None] * np.abs(velocity)).sum()
    np.testing.assert_allclose(found.solid_flux.sum(axis=(0, 1, 2)) * cell, momentum, rtol=0, atol=1e-14 * scale)
    energy = float(eulerian.volume @ (velocity**2).sum(axis=1))
    assert found.solid_square.sum() * cell == pytest.approx(energy, rel=1e-13)


def test_beads_that_all_move_alike_have_that_velocity_in_every_cell_and_no_temperature(mill):
    eulerian, position, _ = mill
    u = np.array([3.0, -2.0, 0.5])
    share = eulerian._share(0.0)
    amounts = eulerian.spread(position, np.tile(u, (len(position), 1)), share)
    found = densities(amounts)
    held = found.solid > 0.0
    assert 0.3 < held.mean() < 1.0
    np.testing.assert_allclose(found.solid_velocity[held], np.tile(u, (held.sum(), 1)), rtol=1e-12)
    assert found.granular_temperature[held].max() <= 1e-12 * (u @ u)
    assert np.isnan(found.solid_velocity[~held]).all()
    assert np.isnan(found.granular_temperature[~held]).all()
    assert (found.solid_flux[~held] == 0.0).all()


def densities(amounts):
    return Densities(amounts[..., 0], amounts[..., 1:4], amounts[..., 4], *[np.zeros(0)] * 3)


def test_a_gas_of_one_temperature_has_it_in_every_cell_whatever_its_stream(mill):
    eulerian, position, _ = mill
    rng = np.random.default_rng(2)
    sigma, total = 0.3, 0.0
    for _ in range(60):  # as many snapshots, averaged before the ratio is taken
        total = total + eulerian.spread(position, np.array([2.0, 0.0, 1.0]) + sigma * rng.normal(size=position.shape))
    found = densities(total / 60)
    full = found.solid > 0.2 * found.solid.max()
    # 180 numbers or more in a cell: their variance scatters by 10 % and is 1/60 too small
    assert found.granular_temperature[full].mean() == pytest.approx(sigma**2, rel=0.03)
    assert found.granular_temperature[full].std() < 0.1 * sigma**2


def test_fluid_behind_walls_does_not_count_and_pressure_has_no_level(mill):
    eulerian, _, _ = mill
    found = eulerian.at(0)
    corner = (0, 0, 0)  # of the box, outside of the cylinder
    assert (found.fluid_flux[corner] == 0.0).all()
    assert found.pressure[corner] == 0.0
    assert found.pressure.sum() == pytest.approx(0.0, abs=1e-9)
    inside = found.solid == 0.0
    open_flux = found.fluid_flux[inside & (found.fluid_flux[..., 0] > 0.0)]
    assert open_flux.max() == pytest.approx(1.0)  # clear fluid at 1 m/s


def test_the_solid_is_what_the_solver_itself_put_into_the_cells():
    scene = Scene.model_validate(
        parse_scene(scene_text("mini_mill")).model_dump()
        | {"time": {"duration": 1e-4}, "output": {"interval": 1e-4, "precision": "double"}}
    )
    run = simulation_of(scene)
    cloud_of_solver = run.coupling.void_fraction
    from sim.exchange import cloud_of

    cloud = cloud_of(run.fluid.grid, 2.0 * scene.drag.kernel * 5e-4, 1.0 - run.fluid.immersed.share[3])
    void = cloud_of_solver(run.fluid, cloud, run.particles.position, run.particles.radius)
    eulerian = Eulerian.__new__(Eulerian)
    eulerian.grid, eulerian.half_width = run.fluid.grid, 2.0 * scene.drag.kernel * 5e-4
    eulerian.volume = 4.0 / 3.0 * np.pi * run.particles.radius**3
    ours = eulerian.spread(run.particles.position, run.particles.velocity, run.fluid.immersed.share[3])
    np.testing.assert_allclose(1.0 - ours[..., 0], cells_of(void, run.fluid.grid), rtol=0, atol=1e-14)


def test_a_run_without_fluid_or_scene_has_no_fields(tmp_path, write_run):
    says = r"dry.h5 has no fluid.velocity, fluid.pressure; fields on a grid"
    with Run(write_run(tmp_path / "dry.h5", n_snapshots=2)) as run, pytest.raises(Refusal, match=says):
        Eulerian(run)


def test_a_run_that_does_not_say_its_scene_has_no_fields(tmp_path):
    path, n = tmp_path / "run.h5", 2
    particles = {"ids": np.arange(n), "radius": np.full(n, 1e-3), "species": np.zeros(n, int)}
    names = ("position", "velocity", "fluid.velocity", "fluid.pressure")
    grid = Grid((2, 2, 2), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    with RunWriter(path, **particles, n_snapshots=1, variables=names, grid=grid, provenance={}) as run:
        still = {"position": np.zeros((n, 3)), "velocity": np.zeros((n, 3))}
        run.append(0.0, {**still, "fluid.velocity": np.zeros((2, 2, 2, 3)), "fluid.pressure": np.zeros((2, 2, 2))})
    with Run(path) as run, pytest.raises(Refusal, match="does not say which scene made it; use a run of"):
        Eulerian(run)


@pytest.mark.physics
def test_the_void_fraction_that_a_run_stores_is_that_of_its_beads(tmp_path):
    path = tmp_path / "run.h5"
    simulate_to(scene_text("mini_mill"), "mini_mill", path, Reporter(as_json=True), until=0.004)
    with Run(path) as run:
        first, last = (Eulerian(run).at(k) for k in (0, run.n_snapshots - 1))
    np.testing.assert_allclose(first.void_fraction, np.maximum(1.0 - first.solid, 0.2), atol=1e-6)
    # later the solver's is of where it expected the beads at the end of its step: who collides on the way is elsewhere
    apart = last.void_fraction - np.maximum(1.0 - last.solid, 0.2)
    assert np.sqrt((apart**2).mean()) < 0.03 * last.solid.std()
