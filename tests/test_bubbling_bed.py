"""A bed of beads that air blows at 1.7 times its fluidising speed bubbles and expands as measured (Khawaja 2015)."""

import tomllib

import numpy as np
import pytest

from sim import Scene, scene_text
from sim.coupled import CoupledSimulation

pytestmark = pytest.mark.physics

DURATION, FROM = 0.3, 0.18  # s; before `FROM` the bed settles, and its first bubbles rise


def test_bubbling_bed_expands_from_three_centimetres_to_five():
    """Height that 99 % of the beads are below, mean in time, within 15 %; the drop carries the bed's weight."""
    tables = tomllib.loads(scene_text("fluidised_bed"))
    tables["time"]["duration"] = DURATION
    run = CoupledSimulation(Scene.model_validate(tables))
    rows = []
    for n in range(run.snapshots):
        run.advance_to(n * run.steps_per_snapshot)
        series = run.series()
        rows.append([run.time, series["bed_height"], series["fluid.pressure_drop"], series["fluid.divergence"]])
    time, height, drop, divergence = np.array(rows).T
    weight = len(run.particles.radius) * np.pi / 6 * 1.2e-3**3 * (1000 - 1.13) * 9.81 / (0.0432 * 0.01)
    bubbling = time > FROM
    print(f"\nlowest {height[time < FROM].min() * 1e3:.1f} mm, then {height[bubbling].mean() * 1e3:.1f} ± "
          f"{height[bubbling].std() * 1e3:.1f} mm; pressure drop {drop[bubbling].mean() / weight:.2f} of the weight; "
          f"overlap {run.tally[:, 1].max():.3f} radii, clamped cells {run.coupling.clamped}")  # fmt: skip
    assert height[bubbling].mean() == pytest.approx(0.05, rel=0.15)
    assert height[time < FROM].min() == pytest.approx(0.03, rel=0.15)
    assert drop[bubbling].mean() == pytest.approx(weight, rel=0.15)  # 0.96 of it over half a second
    assert divergence.max() < 1e-3
