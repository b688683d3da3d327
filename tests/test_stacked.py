"""Two spheres on each other, squeezed between two walls, against an independent solver of the same equations."""

from math import log, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim import simulate

G, RADIUS, STIFFNESS, CEILING = 9.81, 5e-4, 1e3, 1.8e-3
DENSITY = (20_000.0, 10_000.0)
MASS = np.array(DENSITY) * 4 / 3 * pi * RADIUS**3
START = (0.45e-3, 1.35e-3)
WALLS = [
    {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 1, 0]}]},
    {"name": "ceiling", "shapes": [{"shape": "plane", "point": [0, CEILING, 0], "normal": [0, -1, 0]}]},
]


def reference(restitution, times):
    """Heights (2, times) of the two centres, by an implicit Runge–Kutta method of fifth order."""
    damping = -2 * log(restitution) * sqrt(STIFFNESS / (log(restitution) ** 2 + pi**2))
    between = MASS[0] * MASS[1] / MASS.sum()

    def load(overlap, parting, reduced):
        return (STIFFNESS * overlap - damping * sqrt(reduced) * parting) * (overlap > 0)

    def rate(_, y):
        floor = load(RADIUS - y[0], y[2], MASS[0])
        pair = load(2 * RADIUS - (y[1] - y[0]), y[3] - y[2], between)
        ceiling = load(y[1] + RADIUS - CEILING, -y[3], MASS[1])
        return [y[2], y[3], (floor - pair) / MASS[0] - G, (pair - ceiling) / MASS[1] - G]

    start = [*START, 0.0, 0.0]
    solved = solve_ivp(rate, (0, times[-1]), start, "Radau", times, rtol=1e-9, atol=1e-13, max_step=1e-6)
    return solved.y[:2]


@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.7, 0.5])
def test_squeezed_stack_moves_as_the_reference_solver_says(scene_of, restitution):
    """DEM03, to 0.02 % of the height: a tenth of the gate of the case, four times what truncation gives at e = 1."""
    scene = scene_of(
        particles=[
            {"diameter": 2 * RADIUS, "density": density, "position": [[0, height, 0]]}
            for density, height in zip(DENSITY, START, strict=True)
        ],
        contact={"stiffness": STIFFNESS, "restitution": restitution},
        gravity={"acceleration": [0, -G, 0]},
        time={"duration": 1e-3},
        output={"interval": 1e-5, "precision": "double"},
        walls=WALLS,
    )
    moments = list(simulate(scene))
    times = np.array([s.time for s in moments])
    heights = np.array([s.position[:, 1] for s in moments]).T
    worst = np.abs(heights / reference(restitution, times) - 1).max()
    print(f"\nDEM03 e {restitution}: {worst:.1e}")
    assert np.ptp(heights, axis=1).min() > 0.03 * RADIUS  # they do move
    assert worst < 2e-4
