"""The fluid: volume-averaged Navier–Stokes equations of model A, and one step of them.

ρ ∂(εu)/∂t + ρ ∇·(εuu) = −ε∇p + ∇·(ετ) + K (v − u) + ε f and ∂ε/∂t + ∇·(εu) = 0 (paper eqs. (10), (11)), p without its
hydrostatic part ρ g·x. A step finds the velocity with the old pressure, implicit in viscosity, drag and walls, then the
pressure that makes it satisfy eq. (11).
"""

from time import perf_counter
from typing import NamedTuple

import numpy as np

from sim.borders import OUTFLOW, borders_of, close_, fill_level, fill_velocity_margins, set_inflow_
from sim.convection import fill_convection, fill_flux
from sim.errors import LimitError
from sim.flow import FluidTable
from sim.fluid_energy import TERMS, Exchange, account_
from sim.grid import Grid, along, cells_of, faces_of, frame_of
from sim.guards import Guards, in_tolerances
from sim.immersed import Immersed
from sim.kernel import Array
from sim.predictor import predict_, stiffness
from sim.pressure import PressureSolver
from sim.viscosity import fill_friction

VELOCITY_TOLERANCE = 1e-10  # of the largest velocity
DIVERGENCE_TOLERANCE = 1e-8  # of the largest velocity over the smallest spacing
WORST_MOMENTUM, WORST_CONTINUITY = 1e3, 10.0  # times these tolerances: what stops a run


class StepReport(NamedTuple):
    """What a step of the fluid cost and how well it holds eq. (11)."""

    viscous_iterations: int
    pressure_iterations: int
    divergence: float  # 1/s, largest |∂ε/∂t + ∇·(εu)|
    imbalance: float  # 1/s, mean that no pressure can remove


class Fluid:
    """State of the fluid and the arrays of its step."""

    def __init__(
        self, table: FluidTable, grid: Grid, immersed: Immersed | None = None, guards: Guards | None = None
    ) -> None:
        self.table, self.grid, self.immersed = table, grid, immersed
        self.guards = Guards() if guards is None else guards  # a run has its own
        self.frame, self.borders = frame_of(grid), borders_of(table, grid.periodic)
        self.first = np.array([[int(a == b and not grid.periodic[a]) for b in range(3)] for a in range(3)])
        self.velocity = np.zeros((3, grid.size))  # m/s, on faces
        self.pressure = np.zeros(grid.size)  # Pa
        self.void_fraction = np.ones(grid.size)
        self.convection = np.zeros((3, grid.size))  # m/s², of the step before
        self.last_step = 0.0  # s; 0: there was none
        self.rate = np.zeros((3, grid.size))  # m/s², −[∇·(εuu) − u ∇·(εu)] of this step
        self.carried = np.zeros((3, grid.size))  # N/m³, what the flow carries along
        self.flux, self.target = (np.zeros((3, grid.size)) for _ in range(2))
        self.mobility = np.zeros((3, grid.size))  # m³ s/kg
        self.gradient = np.zeros((3, grid.size))  # Pa/m, ∇p on faces
        self.friction = np.zeros((3, grid.size))  # N/m³, ∇·(ετ) on faces
        self.inside = np.zeros((3, grid.size), np.bool_)  # faces whose velocity is solved for
        for a in range(3):
            faces_of(self.inside[a], a, grid)[along(a, slice(0 if grid.periodic[a] else 1, -1))] = True
        self.solver = PressureSolver(grid.cells, grid.spacing, grid.periodic)
        self.spent = np.zeros(len(TERMS))  # J, work of every term of the momentum equation since the start
        bodies = 0 if immersed is None else len(immersed.immersed)
        self.given = np.zeros((bodies, 7))  # to the fluid: impulse, about the body's centre, work
        self.report = StepReport(0, 0, 0.0, 0.0)
        self.seconds = {"momentum": 0.0, "pressure": 0.0}
        self._start()

    def _start(self) -> None:
        for a in range(3):
            faces_of(self.velocity[a], a, self.grid)[:] = self.table.velocity[a]
        self._prescribe(0.0, self.void_fraction)
        fill_velocity_margins(self.velocity, self.frame, self.borders, True, True)

    def _prescribe(self, time: float, void: Array) -> None:
        """Set what is given of the velocity: nothing crosses walls, inflows have their speed."""
        for a in range(3):
            close_(self.velocity[a], a, self.borders, self.grid)
        set_inflow_(self.velocity, self.table, void, self.grid, time)

    def level_(self, field: Array) -> None:
        """Fill the margins of a field of cells."""
        for axis in range(3):
            fill_level(field, axis, self.frame, self.grid.periodic[axis])

    def repeat_(self, field: Array) -> None:
        """Fill the margins of a field of cells where the box repeats; beyond its sides there is nothing."""
        for axis in range(3):
            if self.grid.periodic[axis]:
                fill_level(field, axis, self.frame, True)

    def step_(self, time: float, dt: float, exchange: Exchange | None) -> None:
        """Advance by a step of `dt` (s) to a time (s); bodies stand where they will be at its end.

        Raises LimitError where the pressure does not converge.
        """
        began = perf_counter()
        void_before, before = self.void_fraction, self.velocity.copy()
        self._convect(dt)
        void = void_before if exchange is None else exchange.void_fraction
        self._fill_mobility(void, dt, exchange)
        self._fill_target(void, dt, exchange)
        self._prescribe(time, void)
        self._hold_walls()
        scale = float(np.abs(self.velocity).max())
        scale = max(scale, float(np.abs(self.target * self.mobility).max()))
        inside = np.where(self.inside, self.mobility, 0.0)
        diagonal = stiffness(void, self.table.viscosity, self.grid)
        found = predict_(
            self.velocity, self.target, inside, diagonal, lambda u, moving: self._rub(u, void, moving),
            VELOCITY_TOLERANCE * scale,
        )  # fmt: skip
        left = in_tolerances(found.error, VELOCITY_TOLERANCE * scale)
        self.guards.note_("momentum", left, WORST_MOMENTUM, time)
        if left > WORST_MOMENTUM:
            raise LimitError(
                f"velocity of the fluid has not converged at t = {time:.6g} s ({found.error:.3g} m/s after "
                f"{found.iterations} iterations); lower fluid.step or fluid.viscosity"
            )
        self.friction[:] = self._rub(self.velocity, void, True)
        self.void_fraction = void
        solved = perf_counter()
        self._project(time, None if exchange is None else exchange.growth, found.iterations)
        corrected = perf_counter()
        account_(self, before, dt, exchange)
        self.last_step = dt
        self.seconds["pressure"] += corrected - solved
        self.seconds["momentum"] += perf_counter() - began - (corrected - solved)

    def _convect(self, dt: float) -> None:
        """Fill what the flow carries along, ahead by half a step (Adams and Bashforth, second order)."""
        bounded = self.table.convection == "bounded"
        fill_flux(self.velocity, self.void_fraction, self.frame, self.flux)
        self.convection, self.rate = self.rate, self.convection  # `convection` is of the step before
        fill_convection(self.velocity, self.flux, self.frame, self.first, bounded, self.rate)
        ahead = 0.5 * dt / self.last_step if self.last_step else 0.0
        self.carried = self.table.density * ((1.0 + ahead) * self.rate - ahead * self.convection)

    def _rub(self, velocity: Array, void: Array, moving: bool) -> Array:
        """∇·(ετ) of a velocity whose margins are filled first, its sides moving as they do or at rest, N/m³."""
        fill_velocity_margins(velocity, self.frame, self.borders, moving, True)
        force = np.zeros_like(velocity)
        fill_friction(velocity, void, self.table.viscosity, self.frame, self.first, force)
        return force

    def _fill_mobility(self, void: Array, dt: float, exchange: Exchange | None) -> None:
        """Fill b on faces: 1/b = (ρε/Δt + K) / o + ε μ times the grip of walls; 0 where u is prescribed.

        o = min(2 − 2α, 1): a face is held for what is covered beyond its half. Whatever is held at all becomes rigid as
        Δt falls, and so a body ends at its surface then, not half a cell outside.
        """
        inertia = void * (self.table.density / dt)
        if exchange is not None:
            inertia = inertia + exchange.drag
        for a in range(3):
            faces = self.on_faces(inertia, a)
            if self.immersed is not None:
                open_share = np.minimum(2.0 - 2.0 * faces_of(self.immersed.share[a], a, self.grid), 1.0)
                grip = self.table.viscosity * self.on_faces(void, a) * faces_of(self.immersed.grip[a], a, self.grid)
                faces_of(self.mobility[a], a, self.grid)[:] = open_share / (faces + open_share * grip)
            else:
                faces_of(self.mobility[a], a, self.grid)[:] = 1.0 / faces
            close_(self.mobility[a], a, self.borders, self.grid)

    def on_faces(self, field: Array, a: int) -> Array:
        """Mean of the two cells beside every face of a component, (z, y, x), sides included."""
        s = self.grid.stride[a]
        return 0.5 * (faces_of(field, a, self.grid) + faces_of(np.roll(field, s), a, self.grid))

    def _fill_target(self, void: Array, dt: float, exchange: Exchange | None) -> None:
        """Fill t = (1/b − ρε/Δt − K) u_w + ρε (u/Δt + convection) − ε∇p + K v + ε f on faces, N/m³."""
        table = self.table
        for a in range(3):
            porous = self.on_faces(void, a)
            speed = faces_of(self.velocity[a], a, self.grid)
            target = faces_of(self.target[a], a, self.grid)
            slope = faces_of(self.gradient[a], a, self.grid)
            carried = faces_of(self.carried[a], a, self.grid)
            target[:] = table.density * porous * speed / dt + carried
            target -= porous * (slope + table.pressure_gradient[a])
            dragged = 0.0 if exchange is None else self.on_faces(exchange.drag, a)
            if exchange is not None:
                target += self.on_faces(exchange.push[a], a)
            if self.immersed is not None:
                mobility, wall = faces_of(self.mobility[a], a, self.grid), faces_of(self.immersed.wall[a], a, self.grid)
                held = np.divide(1.0, mobility, out=np.zeros_like(wall), where=mobility > 0.0)
                target += np.where(mobility > 0.0, (held - porous * (table.density / dt) - dragged) * wall, 0.0)

    def _hold_walls(self) -> None:
        """Give faces that lie wholly in a body its velocity."""
        if self.immersed is None:
            return
        for a in range(3):
            inside = self.immersed.share[a] >= 1.0
            self.velocity[a][inside] = self.immersed.wall[a][inside]

    def divergence(self, growth: Array | None) -> Array:
        """∂ε/∂t + ∇·(εu) in the cells, (z, y, x), 1/s (paper eq. (11))."""
        total = np.zeros(tuple(reversed(self.grid.cells)))
        for a in range(3):
            flux = self.on_faces(self.void_fraction, a) * faces_of(self.velocity[a], a, self.grid)
            total += np.diff(flux, axis=2 - a) / self.grid.spacing[a]
        return total if growth is None else total + cells_of(growth, self.grid)

    def _project(self, time: float, growth: Array | None, viscous: int) -> None:
        """Correct velocity and pressure so that eq. (11) holds: ∇·(ε² b ∇δp) = ∂ε/∂t + ∇·(εu)."""
        porous = [self.on_faces(self.void_fraction, a) for a in range(3)]
        mobile = [faces_of(self.mobility[a], a, self.grid) for a in range(3)]
        self.solver.set_coefficients(*(np.ascontiguousarray(e * e * b) for e, b in zip(porous, mobile, strict=True)))
        wanted = self.divergence(growth)
        scale = max(float(np.abs(self.velocity).max()) / min(self.grid.spacing), 1e-3 * float(np.abs(wanted).max()))
        change = np.zeros_like(wanted)
        solved = self.solver.solve_(change, wanted, DIVERGENCE_TOLERANCE * scale)
        left = in_tolerances(solved.residual, DIVERGENCE_TOLERANCE * scale)
        self.guards.note_("continuity", left, WORST_CONTINUITY, time)
        if left > WORST_CONTINUITY:
            raise LimitError(
                f"pressure of the fluid has not converged at t = {time:.6g} s: ∂ε/∂t + ∇·(εu) is still "
                f"{solved.residual:.3g} 1/s in a cell; lower fluid.step"
            )
        cells_of(self.pressure, self.grid)[:] += change
        padded = np.zeros(self.grid.size)
        cells_of(padded, self.grid)[:] = change
        for a in range(3):
            slope = self._slope(padded, a)
            faces_of(self.velocity[a], a, self.grid)[:] -= mobile[a] * porous[a] * slope
        fill_velocity_margins(self.velocity, self.frame, self.borders, True, False)
        self._fill_gradient()
        self.report = StepReport(viscous, solved.iterations, solved.residual, solved.imbalance)

    def _slope(self, pressure: Array, a: int) -> Array:
        """∂p/∂a on all faces of a component, (z, y, x); none through walls, and p = 0 at outflows."""
        self.level_(pressure)
        s = self.grid.stride[a]
        slope = (faces_of(pressure, a, self.grid) - faces_of(np.roll(pressure, s), a, self.grid)) / self.grid.spacing[a]
        for high, sign in ((0, 1.0), (1, -1.0)):
            if self.borders.kind[2 * a + high] == OUTFLOW:
                side = along(a, -1 if high else 0)
                slope[side] = sign * cells_of(pressure, self.grid)[side] * 2.0 / self.grid.spacing[a]
        return np.asarray(slope)

    def _fill_gradient(self) -> None:
        for a in range(3):
            faces_of(self.gradient[a], a, self.grid)[:] = self._slope(self.pressure, a)

    def fastest_place(self) -> str:
        """Say where the fluid is fastest."""
        speed = np.zeros(tuple(reversed(self.grid.cells)))
        for a, s in enumerate(self.grid.stride):
            speed += cells_of(0.5 * (self.velocity[a] + np.roll(self.velocity[a], -s)), self.grid) ** 2
        k, j, i = np.unravel_index(int(np.argmax(speed)), speed.shape)
        place = [low + (n + 0.5) * h for low, n, h in zip(self.grid.lowest, (i, j, k), self.grid.spacing, strict=True)]
        return f"fastest at ({', '.join(f'{x:.4g}' for x in place)}) m with {speed.max() ** 0.5:.3g} m/s"

    def courant(self, dt: float) -> float:
        """Largest Σ |u| Δt / h of any cell."""
        total = np.zeros(tuple(reversed(self.grid.cells)))
        for a in range(3):
            speed = np.abs(faces_of(self.velocity[a], a, self.grid))
            fastest = np.maximum(speed[along(a, slice(None, -1))], speed[along(a, slice(1, None))])
            total += fastest * dt / self.grid.spacing[a]
        return float(total.max())
