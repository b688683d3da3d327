"""Fixed beads on a lattice resist a stream as Ergun's equation says, at the void fraction and height of the bed."""

import tomllib

import numpy as np
import pytest

from sim import Scene, scene_text
from sim.coupled import CoupledSimulation

pytestmark = pytest.mark.physics

DIAMETER, DENSITY, VISCOSITY = 1e-3, 10.0, 1.5e-3


def ergun(void, speed):
    """−dp/dz (Pa/m) at a superficial speed (m/s)."""
    viscous = 150 * VISCOSITY * (1 - void) ** 2 / void**3 * speed / DIAMETER**2
    return viscous + 1.75 * DENSITY * (1 - void) / void**3 * speed**2 / DIAMETER


def bed(speed, copies=(1, 1, 1), **drag):
    """The built-in scene at a speed (m/s), repeated along x, y and z, at its end."""
    tables = tomllib.loads(scene_text("packed_bed"))
    fluid, particles = tables["fluid"], tables["particles"][0]
    size, layers = np.array(fluid["highest"]), 40 * copies[1]
    spacing = size[1] / 60
    counts = (copies[0], copies[1] + 1, copies[2])
    shifts = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 1, 3)
    period = [size[0], 39 * spacing, size[2]]  # 39 layers bring the lattice back to itself
    column = np.array(particles["position"])
    rows = (column + shifts * period).reshape(-1, 3)
    rows = rows[np.unique(np.round(rows / 1e-6).astype(int), axis=0, return_index=True)[1]]
    particles["position"] = rows[rows[:, 1] < (10 + layers) * spacing].tolist()
    cells = [copies[0], 20 + layers, copies[2]]
    fluid["highest"] = [size[0] * copies[0], spacing * cells[1], size[2] * copies[2]]
    fluid |= {"cells": cells, "velocity": [0, speed, 0]}
    fluid["faces"]["-y"]["speed"] = speed
    tables["periodic"]["highest"] = fluid["highest"]
    tables["drag"] |= drag
    run = CoupledSimulation(Scene.model_validate(tables))
    run.advance_to((run.snapshots - 1) * run.steps_per_snapshot)
    return run


def profiles(run):
    """Mean pressure (Pa) and void fraction of every layer of cells, and their height (m)."""
    fields = run.snapshot().fluid
    return fields.pressure.mean(axis=(0, 2)), fields.void_fraction.mean(axis=(0, 2)), run.fluid.grid.spacing[1]


def measured(run):
    """Pressure drop (Pa) from clear fluid to clear fluid, void fraction within the bed, and its height (m)."""
    pressure, void, h = profiles(run)
    assert void[:6] == pytest.approx(1)
    assert void[-6:] == pytest.approx(1)
    middle = len(void) // 2
    within = void[middle - 10 : middle + 10]
    assert np.ptp(within) < 1e-6
    return pressure[4] - pressure[-5], within.mean(), (1 - void).sum() * h / (1 - within.mean())


@pytest.mark.parametrize("speed", [0.002, 0.01, 0.02])
def test_pressure_drop_of_a_packed_bed_is_that_of_ergun(speed):
    """2 % of the whole drop. The faces at both ends are half in the bed: of 40 layers the last two count for 1.4."""
    run = bed(speed)
    drop, void, height = measured(run)
    solid = len(run.particles.radius) * np.pi / 6 * DIAMETER**3
    area = run.table.highest[0] * run.table.highest[2]
    error = drop / (ergun(void, speed) * height) - 1
    print(
        f"\n{speed} m/s: void fraction {void:.6f}, height {height * 1e3:.3f} mm, {drop:.2f} Pa, {error:+.2%} of Ergun"
    )
    assert solid == pytest.approx((1 - void) * area * height, rel=1e-9)
    assert error == pytest.approx(0, abs=0.02)
    assert run.series()["fluid.pressure_drop"] == pytest.approx(drop, rel=1e-4)


@pytest.mark.parametrize("speed", [0.002, 0.02])
def test_pressure_falls_within_the_bed_as_ergun_says(speed):
    """Between two planes in it, to 0.01 %."""
    pressure, void, h = profiles(bed(speed))
    slope = (pressure[20] - pressure[40]) / (20 * h)
    assert slope == pytest.approx(ergun(void[30], speed), rel=1e-4)


def test_ends_of_a_bed_count_the_less_the_higher_it_is():
    errors = []
    for copies in (1, 2, 4):
        drop, void, height = measured(bed(0.01, (1, copies, 1)))
        errors.append(drop / (ergun(void, 0.01) * height) - 1)
    print("\nbeds of 40, 80 and 160 layers:", " ".join(f"{error:+.2%}" for error in errors))
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.02)
    assert errors[2] == pytest.approx(errors[0] / 4, rel=0.02)


def test_bed_of_ten_thousand_beads_is_sixty_three_columns_side_by_side():
    """250 beads in a layer and 40 layers, an area of π (13.85 mm)²; 9 × 7 columns of 160 beads."""
    small, large = bed(0.01), bed(0.01, (9, 1, 7))
    drop, void, height = measured(large)
    print(f"\n{len(large.particles.radius)} beads: {drop:.3f} Pa over {height * 1e3:.2f} mm, void fraction {void:.6f}")
    assert drop == pytest.approx(measured(small)[0], rel=1e-6)


def test_wide_kernel_thins_out_the_ends_of_a_bed_and_nothing_else():
    """Averaged over three diameters the bed has no sharp ends, and loses a tenth of its drop there."""
    pressure, void, h = profiles(bed(0.01, (1, 2, 1), kernel=1.5))
    slope = (pressure[45] - pressure[55]) / (10 * h)
    whole = pressure[2] - pressure[-3]
    height = (1 - void).sum() * h / (1 - void[50])
    print(f"\nkernel of 1.5 diameters: {slope / ergun(void[50], 0.01) - 1:+.1e} of the slope within, "
          f"{height - whole / ergun(void[50], 0.01):.2e} m of the height lost at the ends")  # fmt: skip
    assert slope == pytest.approx(ergun(void[50], 0.01), rel=1e-3)
    assert whole < ergun(void[50], 0.01) * height
