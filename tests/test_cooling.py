"""A granular gas left to itself cools as Haff's law says."""

from math import pi, sqrt

import numpy as np
import pytest

from sim import simulate

D, DENSITY, STIFFNESS, SPEED, SIDES = 1e-3, 2500.0, 1e4, 1.0, 8


def gas(scene_of, restitution, solid_fraction, duration):
    """SIDES³ spheres from the sites of a lattice, velocities normally distributed, in a box that repeats."""
    rng = np.random.default_rng(7)
    side = SIDES * D * (pi / 6 / solid_fraction) ** (1 / 3)
    sites = np.stack(np.meshgrid(*[np.arange(SIDES)] * 3), axis=-1).reshape(-1, 3) * side / SIDES
    velocity = rng.normal(0.0, SPEED, sites.shape)
    velocity -= velocity.mean(axis=0)
    return scene_of(
        particles=[{"diameter": D, "density": DENSITY, "position": sites.tolist(), "velocity": velocity.tolist()}],
        contact={"stiffness": STIFFNESS, "restitution": restitution},
        periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [side] * 3},
        time={"duration": duration},
        output={"interval": duration / 100, "precision": "double"},
    )


def haff_time(restitution, solid_fraction, temperature):
    """τ = 2 / (ω₀ √T₀), ω₀ = 4/3 n d² g₀ √π (1 − e²), with the g₀ of Carnahan and Starling at contact, s."""
    number = solid_fraction / (pi * D**3 / 6)
    neighbours = (1 - solid_fraction / 2) / (1 - solid_fraction) ** 3
    rate = 4 / 3 * number * D**2 * neighbours * sqrt(pi) * (1 - restitution**2)
    return 2 / (rate * sqrt(temperature))


@pytest.mark.physics
@pytest.mark.parametrize(("restitution", "solid_fraction"), [(0.9, 0.1), (0.9, 0.2), (0.95, 0.2)])
def test_square_root_of_temperature_falls_as_one_over_time_at_the_rate_of_haff(scene_of, restitution, solid_fraction):
    """T = T₀ / (1 + t/τ)²: 1/√T is a line of slope 1/(τ √T₀)."""
    theory = haff_time(restitution, solid_fraction, SPEED**2)
    moments = list(simulate(gas(scene_of, restitution, solid_fraction, 5 * theory)))
    time = np.array([s.time for s in moments])
    inverse = np.array([1 / sqrt(np.mean(s.velocity**2)) for s in moments])
    (slope, first), (rest, *_), *_ = np.polyfit(time, inverse, 1, full=True)
    straight = 1 - rest / np.sum((inverse - inverse.mean()) ** 2)
    tau = first / slope
    drift = np.abs(moments[-1].velocity.mean(axis=0)).max() / SPEED
    print(f"\nHaff e {restitution} φ {solid_fraction}: R² {straight:.5f}, τ/theory {tau / theory:.3f}, "
          f"T₀/T {(inverse[-1] / inverse[0]) ** 2:.1f}, mean velocity {drift:.0e}")  # fmt: skip
    assert straight > 0.998
    assert tau / theory == pytest.approx(1.0, abs=0.1)  # 4 % for the contact time, 5 % of a mean free time, and chance
    assert drift < 1e-12
