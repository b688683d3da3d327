"""What a snapshot says of the fluid beside its fields: forces on bodies, energies, pressure drop, height of the bed."""

import numpy as np

from sim.borders import OUTFLOW
from sim.flow import SIDES, Inflow
from sim.fluid_energy import TERMS, kinetic_energy
from sim.fluid_side import FluidSide
from sim.grid import cells_of
from sim.kernel import Array

HEIGHT = 0.99  # share of the particles that are below the height of a bed


def fluid_series(run: FluidSide) -> dict[str, float]:
    """Return the diagnostics of the fluid by name; forces, torques and powers are means since the last call."""
    fluid, coupling = run.fluid, run.coupling
    series = {"fluid.kinetic": kinetic_energy(fluid), "fluid.steps": float(run.fluid_steps)}
    series |= {f"fluid.work.{name}": value for name, value in zip(TERMS, fluid.spent, strict=True)}
    series["fluid.lost_at_bodies"] = float(fluid.given[:, 6].sum() - fluid.spent[TERMS.index("bodies")])
    series |= {"fluid.divergence": fluid.report.divergence, "fluid.imbalance": fluid.report.imbalance}
    series["fluid.least_void_fraction"] = float(cells_of(fluid.void_fraction, fluid.grid).min())
    if coupling is not None:
        series["fluid.work_on_particles"], series["fluid.slip_loss"] = coupling.work
        series["fluid.clamped"] = float(coupling.clamped)
    if (drop := pressure_drop(run)) is not None:
        series["fluid.pressure_drop"] = drop
    if run.scene.gravity is not None and run.scene.particles:
        series["bed_height"] = bed_height(run, run.places())
    return series | _forces(run)


def _forces(run: FluidSide) -> dict[str, float]:
    """Force (N), torque (N m) and power (W) of every immersed body on the fluid, means since the last call."""
    series: dict[str, float] = {}
    if run.fluid.immersed is None:
        return series
    given = (run.fluid.given - run.reported_fluid) / (run.dt * run.steps_per_snapshot)
    for b, table in enumerate(run.scene.walls):
        if table.immersed:
            series |= {f"fluid_force.{table.name}.{axis}": given[b, k] for k, axis in enumerate("xyz")}
            series |= {f"fluid_torque.{table.name}.{axis}": given[b, 3 + k] for k, axis in enumerate("xyz")}
            series[f"fluid_power.{table.name}"] = given[b, 6]
    run.reported_fluid = run.fluid.given.copy()
    return series


def pressure_drop(run: FluidSide) -> float | None:
    """Mean pressure (Pa) on the first side that fluid enters by, over that at the outflow, which is zero."""
    for s, side in enumerate(SIDES):
        face = run.table.faces.get(side)
        if not isinstance(face, Inflow) or OUTFLOW not in run.fluid.borders.kind:
            continue
        axis, inward = s // 2, 1 if s % 2 == 0 else -1
        cells = cells_of(run.fluid.pressure, run.fluid.grid)
        first = cells.take(0 if inward > 0 else -1, axis=2 - axis)
        second = cells.take(inward if inward > 0 else -2, axis=2 - axis)
        return float((1.5 * first - 0.5 * second).mean())
    return None


def bed_height(run: FluidSide, position: Array) -> float:
    """Height (m), against gravity and over the fluid's box, that 99 % of the particles' centres are below."""
    assert run.scene.gravity is not None
    gravity = np.array(run.scene.gravity.acceleration)
    up = -gravity / np.linalg.norm(gravity)
    corner = np.where(up > 0.0, run.table.lowest, run.table.highest)
    return float(np.quantile((position - corner) @ up, HEIGHT))
