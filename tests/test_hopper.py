"""A hopper runs out at a constant rate, whatever is left in it."""

from math import pi, sqrt

import numpy as np
import pytest

from sim import parse_scene, scene_text, simulate


@pytest.mark.physics
def test_the_hopper_runs_out_at_a_constant_rate_of_the_size_that_beverloo_gives(capsys):
    """Beverloo: rate = 0.58 ρ_b √g (D − 1.4 d)^2.5, ρ_b of the bulk; from 25 to 75 % of the mass is through."""
    scene = parse_scene(scene_text("hopper"))
    grain, outlet = scene.particles[0], 2 * 0.007
    mass = grain.density * pi / 6 * grain.diameter**3
    moments = [(s.time, float((s.position[:, 2] < 0.0).sum()), len(s.position)) for s in simulate(scene)]
    time, through, n = np.array(moments).T
    steady = (through > 0.25 * n) & (through < 0.75 * n)
    rate, start = np.polyfit(time[steady], through[steady], 1)
    middle = len(time[steady]) // 2
    halves = [
        np.polyfit(time[steady][part], through[steady][part], 1)[0] for part in (slice(middle), slice(middle, None))
    ]
    beverloo = 0.58 * 0.6 * grain.density * sqrt(9.81) * (outlet - 1.4 * grain.diameter) ** 2.5
    with capsys.disabled():
        print(f"\n  {rate * mass * 1e3:.1f} g/s, Beverloo {beverloo * 1e3:.1f} g/s; halves {halves[1] / halves[0]:.3f}")
    scatter = np.abs(through[steady] - rate * time[steady] - start).max() / (0.5 * n[0])
    assert through[-1] > 0.9 * n[-1]
    assert halves[1] == pytest.approx(halves[0], rel=0.05)
    assert scatter < 0.02
    assert rate * mass == pytest.approx(beverloo, rel=0.35)
