"""Manufactured flow through a given void fraction: the volume-averaged equations with every term at work.

ε = ε₀ + a sin(x − ct) cos y travels at speed c, and εu = c ε x̂ + ∇ × ψ ẑ, so that ∂ε/∂t + ∇·(εu) = 0. The force that
makes this velocity and a given pressure satisfy the momentum equation follows by computer algebra; it is given to the
fluid as the push of particles, beside a drag K (v − u) with the velocity itself as v. Steps go with the square of the
spacing.
"""

from math import pi

import numpy as np
import pytest
import sympy as sp

from sim.borders import fill_velocity_margins
from sim.flow import FluidTable
from sim.fluid import DIVERGENCE_TOLERANCE, Fluid
from sim.fluid_energy import Exchange
from sim.grid import cells_of, centres, face_points, faces_of, grid_of, zeros

BOX, DENSITY, VISCOSITY, PACE, DURATION = 2.0 * pi, 1.3, 0.1, 0.7, 0.4
x, y, t = sp.symbols("x y t")


def manufactured():
    """Return ε, velocity, pressure, drag K and push (all of x, y, t) as functions of arrays."""
    void = sp.Rational(3, 5) + sp.Rational(1, 4) * sp.sin(x - PACE * t) * sp.cos(y)
    stream = sp.Rational(1, 2) * sp.sin(x) * sp.sin(y) * sp.cos(t)
    u = [PACE + sp.diff(stream, y) / void, -sp.diff(stream, x) / void]
    p = sp.cos(x) * sp.sin(y) * (1 + t)
    drag = 4 * (1 + sp.sin(x) / 2)
    space = (x, y)
    assert sp.simplify(sp.diff(void, t) + sum(sp.diff(void * u[a], space[a]) for a in (0, 1))) == 0
    spread = sum(sp.diff(u[a], space[a]) for a in (0, 1))
    push = []
    for a in (0, 1):
        carried = sp.diff(u[a], t) + sum(u[b] * sp.diff(u[a], space[b]) for b in (0, 1))
        stress = [
            sp.diff(u[a], space[b]) + sp.diff(u[b], space[a]) - (sp.Rational(2, 3) * spread if a == b else 0)
            for b in (0, 1)
        ]
        rubbed = sum(sp.diff(VISCOSITY * void * stress[b], space[b]) for b in (0, 1))
        push.append(DENSITY * void * carried + void * sp.diff(p, space[a]) - rubbed + drag * u[a])
    return [sp.lambdify((x, y, t), f, "numpy", cse=True) for f in (void, u[0], u[1], p, drag, *push)]


class Manufactured:
    """The flow on a grid whose axes p and q are x and y."""

    def __init__(self, n, p):
        self.p, self.q = p, (p + 1) % 3
        cells = [1, 1, 1]
        cells[self.p] = cells[self.q] = n
        table = FluidTable(
            density=DENSITY, viscosity=VISCOSITY, lowest=(0, 0, 0), highest=(BOX,) * 3, cells=tuple(cells),
            convection="central",
        )  # fmt: skip
        self.fluid = Fluid(table, grid_of(table, (True, True, True)))
        self.void, *self.speed, self.pressure, self.drag, push_p, push_q = FUNCTIONS
        self.push = {self.p: push_p, self.q: push_q}
        self.fluid.void_fraction = self.in_cells(self.void, 0.0)
        for a, exact in self.speeds(0.0):
            faces_of(self.fluid.velocity[a], a, self.fluid.grid)[:] = exact
        fill_velocity_margins(self.fluid.velocity, self.fluid.frame, self.fluid.borders, True, True)

    def in_cells(self, function, time):
        z, y, x = np.meshgrid(*reversed(centres(self.fluid.grid)), indexing="ij")
        field, at = zeros(self.fluid.grid), (x, y, z)
        cells_of(field, self.fluid.grid)[:] = function(at[self.p], at[self.q], time)
        self.fluid.level_(field)
        return field

    def speeds(self, time):
        for a, speed in zip((self.p, self.q), self.speed, strict=True):
            at = face_points(a, self.fluid.grid)
            yield a, speed(at[self.p], at[self.q], time)

    def step_(self, time, dt):
        fluid = self.fluid
        ahead, push = self.in_cells(self.void, time), np.zeros((3, fluid.grid.size))
        for a, function in self.push.items():
            push[a] = self.in_cells(function, time)
        growth = (ahead - fluid.void_fraction) / dt
        fluid.step_(time, dt, Exchange(ahead, growth, self.in_cells(self.drag, time), push))
        left = np.abs(fluid.divergence(growth)).max()
        assert left <= 10.0 * DIVERGENCE_TOLERANCE * np.abs(fluid.velocity).max() / min(fluid.grid.spacing)

    def errors(self, time):
        speed = max(
            np.abs(faces_of(self.fluid.velocity[a], a, self.fluid.grid) - exact).max() for a, exact in self.speeds(time)
        )
        wrong = cells_of(self.fluid.pressure - self.in_cells(self.pressure, time), self.fluid.grid)
        return speed, np.abs(wrong - wrong.mean()).max()


FUNCTIONS = manufactured()


@pytest.mark.physics
@pytest.mark.parametrize("first", [0, 1, 2])
def test_velocity_and_pressure_converge_with_the_square_of_the_spacing_under_a_given_void_fraction(first):
    """Continuity holds in every cell at every step (asserted in each), velocity and pressure to order 1.8 at least."""
    found = []
    for n, steps in ((16, 8), (32, 32), (64, 128)) if first == 0 else ((16, 8), (32, 32)):
        flow = Manufactured(n, first)
        for k in range(steps):
            flow.step_((k + 1) * DURATION / steps, DURATION / steps)
        found.append(flow.errors(DURATION))
    for name, errors in zip(("u", "p"), np.transpose(found), strict=True):
        order = np.log2(errors[:-1] / errors[1:])
        print(f"\n{name} in {'xyz'[first]}{'xyz'[(first + 1) % 3]}: errors {errors}, order {order}")
        assert order[-1] >= 1.8


def test_uniform_stream_stays_uniform_whatever_the_void_fraction_that_it_carries():
    """ε travels with the stream: what it carries of itself is all that ε brings along."""
    flow = Manufactured(12, 0)
    flow.speed = [lambda x, *_: np.full_like(x, PACE), lambda x, *_: np.zeros_like(x)]
    fluid, dt = flow.fluid, 0.05
    for a, exact in flow.speeds(0.0):
        faces_of(fluid.velocity[a], a, fluid.grid)[:] = exact
    fill_velocity_margins(fluid.velocity, fluid.frame, fluid.borders, True, True)
    none = np.zeros((3, fluid.grid.size))
    for _ in range(4):
        # ∂ε/∂t as the scheme sees it, so that the stream itself has no divergence
        growth = zeros(fluid.grid)
        cells_of(growth, fluid.grid)[:] = -fluid.divergence(None)
        fluid.level_(growth)
        fluid.step_(0.0, dt, Exchange(fluid.void_fraction, growth, zeros(fluid.grid), none))
        for a, exact in flow.speeds(0.0):
            assert faces_of(fluid.velocity[a], a, fluid.grid) == pytest.approx(exact, abs=1e-12)
