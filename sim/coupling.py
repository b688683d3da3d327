"""Drag between particles and fluid within a step of the fluid, implicit in the velocities of both.

The fluid's step sees the particles through K = Σ κ w / V_cell. A particle that touches nothing will follow the fluid
within the step, by m dv/dt = κ (u' − v) + m a with the fluid's new velocity u' and a of weight, buoyancy and pressure:
drag gives it m (1 − e^(−λΔt)) (u' − v̂), v̂ = v + a (Δt/(1 − e^(−λΔt)) − 1/λ), λ = κ/m, and takes that from the fluid,
so that slip decays without overshoot. One that others hold acts with all of κ. Then the particles sub-step with the new
velocity and pressure. What they gained by drag is what the fluid owes; where that differs from what its step assumed,
the rest enters its next step, so that both sides agree to round-off in the sum (Newton's third law).
"""

import numpy as np
from numpy.typing import NDArray

from sim.drag import DRAG_LAWS, fill_coefficients
from sim.errors import LimitError
from sim.exchange import Cloud, cloud_of, interpolate_, spread_
from sim.flow import Drag
from sim.fluid import Fluid
from sim.fluid_energy import Exchange
from sim.grid import along, cells_of, faces_of
from sim.kernel import Array, Vector
from sim.state import Particles, mass
from sim.suspended import Suspended, suspended_in

LARGEST_ANSWER = 2.0  # of particles to the pressure that a change of their velocity calls up; see `check_light`
SPARSE = 0.7  # void fraction above which drag alone may hold light particles to the fluid
VOID, SQUARE = 6, 7  # columns of ε and of the mean u² among what a particle sees of the fluid; u and ∇p are before


class Coupling:
    """Exchange of momentum and volume between particles and fluid."""

    def __init__(self, drag: Drag, gravity: Vector | None, n: int) -> None:
        self.drag, self.gravity = drag, np.array(gravity or (0.0, 0.0, 0.0))
        self.two_way = drag.coupling == "two-way"
        # N s, by rank in the scene: drag that the fluid has not yet received
        self.owed = np.zeros((n if self.two_way else 0, 3))
        self.impulse = np.zeros((2, 3))  # N s: by drag on the particles; on the fluid and on its sides
        self.work = np.zeros(2)  # J: of the fluid on the particles; turned into heat by slip
        self.clamped = 0  # void fractions below the least one, of all steps
        self.time = np.inf  # s, mean of the times in which slip would decay on the side of fluid and of particles

    def start_(self, fluid: Fluid, p: Particles) -> None:
        """Let the fluid know where the particles are before any step: a first snapshot shows them, too."""
        if self.two_way:
            fluid.void_fraction = self.void_fraction(fluid, self._cloud(fluid, p), p.position, p.radius)
            self.clamped = 0

    def _cloud(self, fluid: Fluid, p: Particles) -> Cloud:
        openness = None if fluid.immersed is None else 1.0 - fluid.immersed.share[3]
        return cloud_of(fluid.grid, 2.0 * self.drag.kernel * float(p.radius.max()), openness)

    def begin_(
        self, fluid: Fluid, p: Particles, held: NDArray[np.bool_], dt: float, time: float, particle_step: float
    ) -> Suspended:
        """Do the fluid's step of `dt` (s) to a time (s), and return what it does to the particles.

        `held` (n,) tells which of them touch something now; they will do steps of `particle_step` (s).
        """
        cloud = self._cloud(fluid, p)
        if self.two_way:
            fluid.void_fraction = self.void_fraction(fluid, cloud, p.position, p.radius)
        seen = self._seen(fluid, cloud, p)
        fall, coefficient = self._lift(fluid, p, seen) + self.gravity, np.empty(len(p.radius))
        fill_coefficients(
            DRAG_LAWS[self.drag.law], p.velocity, p.radius, seen[:, :3].copy(), seen[:, VOID].copy(),
            fluid.table.density, fluid.table.viscosity, fall, np.where(held, 0.0, p.inverse_mass), dt, coefficient,
        )  # fmt: skip
        assumed = np.zeros_like(p.position)
        if not self.two_way:
            fluid.step_(time, dt, None)
            seen = self._seen(fluid, cloud, p)
        else:
            pace = coefficient * p.inverse_mass * dt
            check_light(fluid, p, seen[:, VOID], following(pace)[0], time)
            share, lead = following(np.where(held, 0.0, pace))
            target, acting = p.velocity + dt * (lead[:, None] * fall), share * coefficient
            exchange = self._exchange(fluid, cloud, p, acting, target, dt)
            fluid.step_(time, dt, exchange)
            seen = self._seen(fluid, cloud, p)
            assumed = dt * acting[:, None] * (seen[:, :3] - target)
            self.impulse[1] += received(fluid, exchange, dt)
            self.owed[:] = 0.0
        lift = self._lift(fluid, p, seen)
        return suspended_in(
            coefficient, p.inverse_mass, p.velocity, seen[:, :3].copy(), seen[:, SQUARE].copy(), lift, particle_step,
            assumed,
        )  # fmt: skip

    def settle_(self, p: Particles, suspended: Suspended, dt: float) -> None:
        """Count what the particles received within the fluid's step of `dt` (s), and what the fluid still owes."""
        s, weight = suspended, mass(p)
        gained = weight[:, None] * s.given[:, :3]
        slip = s.fluid_velocity - p.velocity
        fixed = p.inverse_mass == 0.0
        gained[fixed] = (dt * s.coefficient[:, None] * slip)[fixed]
        self.impulse[0] += gained.sum(axis=0)
        if self.two_way:
            self.owed[p.id] = s.assumed - gained
        self.work[0] += float(weight @ s.given[:, 3])
        end = s.square + (p.velocity * (p.velocity - 2.0 * s.fluid_velocity)).sum(axis=1)
        self.work[1] += 0.5 * dt * float(s.coefficient @ (s.slip_square + end))

    def void_fraction(self, fluid: Fluid, cloud: Cloud, position: Array, radius: Array) -> Array:
        """Share of every cell (size,) that particles at these places (n, 3) m leave to the fluid, margins filled.

        ε = 1 − Σ V_p w / V_cell, but not below the least one; `clamped` counts the cells where it would be.
        """
        field = np.zeros((1, fluid.grid.size))
        spread_(cloud, position, (4.0 / 3.0 * np.pi * radius**3)[:, None], field)
        void = 1.0 - field[0] / fluid.grid.volume
        least = self.drag.least_void_fraction
        self.clamped += int((cells_of(void, fluid.grid) < least).sum())
        void = np.asarray(np.maximum(void, least))
        fluid.level_(void)
        return void

    def _exchange(self, fluid: Fluid, cloud: Cloud, p: Particles, acting: Array, target: Array, dt: float) -> Exchange:
        """Spread what the particles do to the fluid in its step, with what it is still owed, and where they will be."""
        given = np.column_stack([acting, acting[:, None] * target + self.owed[p.id] / dt])
        field = np.zeros((4, fluid.grid.size))
        spread_(cloud, p.position, given, field)
        field /= fluid.grid.volume
        for rows in field:
            fluid.repeat_(rows)
        ahead = self.void_fraction(fluid, cloud, p.position + dt * p.velocity, p.radius)
        self._set_time(fluid, p, acting, field[0])
        return Exchange(ahead, (ahead - fluid.void_fraction) / dt, field[0], field[1:])

    def _set_time(self, fluid: Fluid, p: Particles, acting: Array, drag: Array) -> None:
        """Set the geometric mean of the shortest times in which slip would decay, 1/λ and ρε/K."""
        fluid_rate = float((drag / (fluid.table.density * fluid.void_fraction)).max())
        rate = float((acting * p.inverse_mass).max()) if len(acting) else 0.0
        self.time = 1.0 / np.sqrt(fluid_rate * rate) if fluid_rate * rate > 0.0 else np.inf

    def _seen(self, fluid: Fluid, cloud: Cloud, p: Particles) -> Array:
        """Velocity, ∇p, void fraction and square velocity of the fluid at the particles, (n, 8)."""
        scalars = np.stack([fluid.void_fraction, cell_square(fluid)])
        fields = np.concatenate([cell_velocity(fluid), cell_gradient(fluid), scalars])
        seen = np.empty((len(p.radius), SQUARE + 1))
        interpolate_(cloud, p.position, fields, seen)
        return seen

    def _lift(self, fluid: Fluid, p: Particles, seen: Array) -> Array:
        """Acceleration (m/s²) of every particle by buoyancy and by the pressure gradient, (n, 3)."""
        force = -(seen[:, 3:6] + np.array(fluid.table.pressure_gradient)) - fluid.table.density * self.gravity
        return np.asarray((4.0 / 3.0 * np.pi * p.radius**3 * p.inverse_mass)[:, None] * force)


def following(pace: Array) -> tuple[Array, Array]:
    """Share of its drag with which a particle of pace λ Δt (n,) acts, (1 − e^(−λΔt))/(λΔt), and of Δt that it leads.

    The lead 1/(1 − e^(−λΔt)) − 1/(λΔt) is half a step where the pace is slow; particles of no pace do not move.
    """
    slow = pace < 1e-4
    x = np.where(slow, 1.0, pace)
    share = np.where(slow, 1.0 - 0.5 * pace, -np.expm1(-x) / x)
    return share, np.where(pace > 0.0, np.where(slow, 0.5 + pace / 12.0, (1.0 - share) / (share * x)), 0.0)


def lightness(fluid: Fluid, p: Particles) -> Array:
    """Density of the fluid over that of every particle, (n,); 0 of those that are fixed."""
    return np.asarray(fluid.table.density * 4.0 / 3.0 * np.pi * p.radius**3 * p.inverse_mass)


def check_light(fluid: Fluid, p: Particles, void: Array, share: Array, time: float) -> None:
    """Stop where particles are too light for a pressure that lags by a step (LimitError).

    A change w of their velocity calls up the pressure gradient ρ_f (1 − ε)/ε w/Δt one step later, which changes it by
    q w, q = (1 − ε)/ε ρ_f/ρ_p. The kernel smooths that by half: beyond q = 2 it grows from step to step, unless drag
    leaves little of it (share s of a step) among few particles.
    """
    if max(fluid.grid.cells) == 1:
        return  # one cell has no pressure gradient
    light = lightness(fluid, p)
    answer = light * (1.0 - void) / void * np.where(void < SPARSE, 1.0, share)
    worst = int(np.argmax(answer))
    if answer[worst] > LARGEST_ANSWER:
        there, density = fluid.table.density, fluid.table.density / light[worst]
        raise LimitError(
            f"particle {p.id[worst]} of {density:.4g} kg/m³ is too light for a fluid of {there:.4g} kg/m³ at a void "
            f"fraction of {void[worst]:.3g} (t = {time:.6g} s): without its added mass, which is not modelled, its "
            f"velocity would grow from step to step; give it {density * answer[worst] / LARGEST_ANSWER:.3g} kg/m³ at "
            'least, take fewer particles, or set drag.coupling = "one-way"'
        )


def cell_velocity(fluid: Fluid) -> Array:
    """Velocity at the centres of the cells, the mean of two faces, (3, size), m/s."""
    pairs = zip(fluid.velocity, fluid.grid.stride, strict=True)
    return np.stack([0.5 * (u + np.roll(u, -s)) for u, s in pairs])


def cell_square(fluid: Fluid) -> Array:
    """Mean |u|² of a cell's faces, (size,), m²/s²: what slip is lost between faces and particle counts, too."""
    pairs = zip(fluid.velocity, fluid.grid.stride, strict=True)
    return np.asarray(sum(0.5 * (u**2 + np.roll(u, -s) ** 2) for u, s in pairs))


def cell_gradient(fluid: Fluid) -> Array:
    """∇p at the centres of the cells, the mean of the faces that are open, (3, size), Pa/m."""
    gradient = np.zeros_like(fluid.gradient)
    for a, s in enumerate(fluid.grid.stride):
        share = 1.0 if fluid.immersed is None else 1.0 - fluid.immersed.share[a]
        weight = np.where(fluid.mobility[a] > 0.0, share, 0.0)
        total = weight + np.roll(weight, -s)
        sloped = weight * fluid.gradient[a]
        np.divide(sloped + np.roll(sloped, -s), total, out=gradient[a], where=total > 0.0)
    return gradient


def received(fluid: Fluid, exchange: Exchange, dt: float) -> Array:
    """Impulse (N s) that fluid and sides got from the particles in its last step: Σ (K v − K u) V Δt over the faces."""
    total = np.zeros(3)
    for a in range(3):
        drag, push = fluid.on_faces(exchange.drag, a), fluid.on_faces(exchange.push[a], a)
        force = push - drag * faces_of(fluid.velocity[a], a, fluid.grid)
        once = along(a, slice(None, fluid.grid.cells[a] + (not fluid.grid.periodic[a])))
        total[a] = force[once].sum() * fluid.grid.volume * dt
    return total
