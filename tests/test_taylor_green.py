"""Vortices that keep their shape while viscosity stops them: Taylor and Green (1937), and the ABC flow in 3-D.

In a periodic box of length 2π, div u = 0 and Δu = −k² u with k² = 2 and 1, and the pressure balances all that is
carried along, so that u(t) = e^(−νk²t) u(0) exactly and the energy decays at 4ν and 2ν. Steps go with the square of the
spacing, so that the order in space is seen.
"""

from math import exp, pi

import numpy as np
import pytest

from sim.borders import fill_velocity_margins
from sim.flow import FluidTable
from sim.fluid import Fluid
from sim.fluid_energy import kinetic_energy
from sim.grid import cells_of, centres, face_points, faces_of, grid_of

BOX, VISCOSITY, DURATION = 2.0 * pi, 0.1, 1.0


def vortex(axis, drift=0.0, t=0.0):
    """Velocity of the 2-D vortex extruded along an axis, at a time, carried along at `drift` (m/s) across it."""
    p, q = (axis + 1) % 3, (axis + 2) % 3

    def speed(a, x):
        decay, px, qx = exp(-2.0 * VISCOSITY * t), x[p] - drift * t, x[q] - drift * t
        if a == p:
            return drift + decay * np.sin(px) * np.cos(qx)
        return drift - decay * np.cos(px) * np.sin(qx) if a == q else np.zeros_like(px)

    return speed


def abc(t=0.0, strengths=(1.0, 0.8, 0.6)):
    """Velocity of the flow of Arnold, Beltrami and Childress, whose vorticity is its velocity."""

    def speed(a, x):
        up, down = strengths[a], strengths[(a + 2) % 3]
        return exp(-VISCOSITY * t) * (up * np.sin(x[(a + 2) % 3]) + down * np.cos(x[(a + 1) % 3]))

    return speed


def started(cells, speed, convection="central"):
    table = FluidTable(
        density=1.0, viscosity=VISCOSITY, lowest=(0, 0, 0), highest=(BOX,) * 3, cells=cells, convection=convection
    )
    fluid = Fluid(table, grid_of(table, (True, True, True)))
    for a in range(3):
        faces_of(fluid.velocity[a], a, fluid.grid)[:] = speed(a, face_points(a, fluid.grid))
    fill_velocity_margins(fluid.velocity, fluid.frame, fluid.borders, True, True)
    return fluid


def run(fluid, steps, duration=DURATION):
    for k in range(steps):
        fluid.step_((k + 1) * duration / steps, duration / steps, None)


def worst(fluid, speed):
    """Largest error of any face, and the mean one, over the largest velocity."""
    exact = [speed(a, face_points(a, fluid.grid)) for a in range(3)]
    wrong = [np.abs(faces_of(fluid.velocity[a], a, fluid.grid) - exact[a]) for a in range(3)]
    largest = max(np.abs(e).max() for e in exact)
    return max(w.max() for w in wrong) / largest, np.mean([w.mean() for w in wrong]) / largest


def orders(errors):
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.physics
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_extruded_vortex_decays_at_four_nu_k_squared_with_second_order_along_every_axis(axis):
    velocity, energy = [], []
    for n, steps in ((16, 16), (32, 64)):
        cells = [n, n, n]
        cells[axis] = 1
        fluid = started(tuple(cells), vortex(axis))
        before = kinetic_energy(fluid)
        run(fluid, steps)
        velocity.append(worst(fluid, vortex(axis, t=DURATION))[0])
        energy.append(abs(kinetic_energy(fluid) / before / exp(-4.0 * VISCOSITY * DURATION) - 1.0))
    print(f"\nTaylor-Green {'xyz'[axis]}: u {velocity} order {orders(velocity)}; energy {energy} {orders(energy)}")
    assert velocity[-1] < 1e-3
    assert orders(velocity) == pytest.approx(2.0, abs=0.1)
    assert orders(energy) == pytest.approx(2.0, abs=0.1)


@pytest.mark.physics
def test_abc_flow_decays_at_two_nu_k_squared_with_second_order():
    velocity, energy = [], []
    for n, steps in ((8, 4), (16, 16), (32, 64)):
        fluid = started((n, n, n), abc())
        before = kinetic_energy(fluid)
        run(fluid, steps, 0.5)
        velocity.append(worst(fluid, abc(t=0.5))[0])
        energy.append(abs(kinetic_energy(fluid) / before / exp(-2.0 * VISCOSITY * 0.5) - 1.0))
    print(f"\nABC: u {velocity} order {orders(velocity)}; energy {energy} order {orders(energy)}")
    assert orders(velocity)[-1] == pytest.approx(2.0, abs=0.1)
    assert orders(energy)[-1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.physics
def test_pressure_of_the_vortex_is_that_of_bernoulli_with_second_order():
    errors = []
    for n, steps in ((16, 16), (32, 64)):
        fluid = started((n, n, 1), vortex(2))
        run(fluid, steps)
        x, y, _ = centres(fluid.grid)
        exact = 0.25 * exp(-4.0 * VISCOSITY * DURATION) * (np.cos(2 * x) + np.cos(2 * y)[:, None])
        found = cells_of(fluid.pressure, fluid.grid)[0]
        errors.append(np.abs(found - found.mean() - exact).max() / 0.5)
    print(f"\nTaylor-Green: p {errors} order {orders(errors)}")
    assert orders(errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.physics
@pytest.mark.parametrize(("convection", "most"), [("central", 2.1), ("bounded", 2.7)])
def test_vortex_that_drifts_decays_as_one_that_rests(convection, most):
    """What is carried along no longer balances by symmetry; the bounded scheme is second order in the mean."""
    errors = []
    for n, steps in ((16, 16), (32, 64), (64, 256)):
        fluid = started((n, n, 1), vortex(2, 1.0), convection)
        run(fluid, steps)
        errors.append(worst(fluid, vortex(2, 1.0, DURATION))[1])
    print(f"\ndrifting vortex, {convection}: mean |error| {errors} order {orders(errors)}")
    assert 1.9 <= orders(errors)[-1] <= most  # limiting steepens as well as it flattens, so errors may cancel


def test_undisturbed_stream_stays_what_it_is():
    fluid = started((6, 5, 4), lambda a, x: np.full_like(x[0], (0.3, -0.2, 0.1)[a]), "bounded")
    run(fluid, 5)
    assert worst(fluid, lambda a, x: np.full_like(x[0], (0.3, -0.2, 0.1)[a]))[0] < 1e-14
