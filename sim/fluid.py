"""The fluid: volume-averaged Navier–Stokes equations of model A, and one step of them.

ρ ∂(εu)/∂t + ρ ∇·(εuu) = −ε∇p + ∇·(ετ) + K (v − u) + ε f and ∂ε/∂t + ∇·(εu) = 0 (paper eqs. (10), (11)), p without its
hydrostatic part ρ g·x. A step finds the velocity with the old pressure, implicit in viscosity, drag and walls, then the
pressure that makes it satisfy eq. (11).
"""

from typing import NamedTuple

import numpy as np

from sim.borders import OUTFLOW, PERIODIC, borders_of, fill_level, fill_velocity_margins, set_inflow_
from sim.convection import fill_convection, fill_flux
from sim.errors import LimitError
from sim.flow import FluidTable
from sim.grid import Grid, cells_of, faces_of, frame_of
from sim.immersed import Immersed
from sim.kernel import Array
from sim.predictor import predict_, stiffness
from sim.pressure import PressureSolver
from sim.viscosity import fill_friction

VELOCITY_TOLERANCE = 1e-10  # of the largest velocity
DIVERGENCE_TOLERANCE = 1e-8  # of the largest velocity over the smallest spacing


class Exchange(NamedTuple):
    """What the particles do to the fluid within a step, in the cells (size,), margins filled."""

    void_fraction: Array  # at its end
    growth: Array  # 1/s, ∂ε/∂t over the step
    drag: Array  # kg/(m³ s), K
    push: Array  # (3, size) N/m³, K v and what is owed from before


class Spent(NamedTuple):
    """Work done on the fluid since the start, J; the sum is what its kinetic energy has gained, but for Δε."""

    bodies: float  # by immersed bodies
    friction: float  # by viscosity, and by sliding sides
    convection: float  # by the scheme of convection, and through the sides
    particles: float  # by drag
    pressure: float  # by the pressure gradient, that which is imposed included


class StepReport(NamedTuple):
    """What a step of the fluid cost and how well it holds eq. (11)."""

    viscous_iterations: int
    pressure_iterations: int
    divergence: float  # 1/s, largest |∂ε/∂t + ∇·(εu)|
    imbalance: float  # 1/s, mean that no pressure can remove


class Fluid:
    """State of the fluid and the arrays of its step."""

    def __init__(self, table: FluidTable, grid: Grid, immersed: Immersed | None = None) -> None:
        self.table, self.grid, self.immersed = table, grid, immersed
        self.frame, self.borders = frame_of(grid), borders_of(table, grid.periodic)
        self.first = np.array([[int(a == b and not grid.periodic[a]) for b in range(3)] for a in range(3)])
        self.velocity = np.zeros((3, grid.size))  # m/s, on faces
        self.pressure = np.zeros(grid.size)  # Pa
        self.void_fraction = np.ones(grid.size)
        self.convection = np.zeros((3, grid.size))  # m/s², of the step before
        self.last_step = 0.0  # s; 0: there was none
        self.flux, self.rate, self.target = (np.zeros((3, grid.size)) for _ in range(3))
        self.mobility = np.zeros((3, grid.size))  # m³ s/kg
        self.gradient = np.zeros((3, grid.size))  # Pa/m, ∇p on faces
        self.friction = np.zeros((3, grid.size))  # N/m³, ∇·(ετ) on faces
        self.inside = np.zeros((3, grid.size), np.bool_)  # faces whose velocity is solved for
        for a in range(3):
            across = [slice(None)] * 3
            across[2 - a] = slice(0 if grid.periodic[a] else 1, -1)
            faces_of(self.inside[a], a, grid)[tuple(across)] = True
        self.solver = PressureSolver(grid.cells, grid.spacing, grid.periodic)
        self.spent = Spent(0.0, 0.0, 0.0, 0.0, 0.0)
        bodies = 0 if immersed is None else len(immersed.immersed)
        self.given = np.zeros(
            (bodies, 7)
        )  # by each body to the fluid: impulse (N s), about its centre (N m s), work (J)
        self.report = StepReport(0, 0, 0.0, 0.0)
        self._start()

    def _start(self) -> None:
        for a in range(3):
            faces_of(self.velocity[a], a, self.grid)[:] = self.table.velocity[a]
        self._prescribe(0.0)
        fill_velocity_margins(self.velocity, self.frame, self.borders, True, True)

    def _prescribe(self, time: float) -> None:
        """Set what is given of the velocity: nothing crosses walls, inflows have their speed."""
        for a in range(3):
            faces = faces_of(self.velocity[a], a, self.grid)
            for high in (0, 1):
                if self.borders.kind[2 * a + high] not in (PERIODIC, OUTFLOW):
                    across = [slice(None)] * 3
                    across[2 - a] = slice(-1, None) if high else slice(0, 1)
                    faces[tuple(across)] = 0.0
        set_inflow_(self.velocity, self.table, self.grid, time)

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
        void_before, before = self.void_fraction, self.velocity.copy()
        fill_flux(self.velocity, void_before, self.frame, self.flux)
        fill_convection(self.velocity, self.flux, self.frame, self.first, self.table.convection == "bounded", self.rate)
        void = void_before if exchange is None else exchange.void_fraction
        self._fill_mobility(void, dt, exchange)
        self._fill_target(void, dt, exchange)
        self._prescribe(time)
        self._hold_walls()
        scale = float(np.abs(self.velocity).max()) + dt * float(np.abs(self.rate).max())
        scale = max(scale, float(np.abs(self.target * self.mobility).max()))
        inside = np.where(self.inside, self.mobility, 0.0)
        diagonal = stiffness(void, self.table.viscosity, self.grid)
        found = predict_(
            self.velocity, self.target, inside, diagonal, lambda u, moving: self._rub(u, void, moving),
            VELOCITY_TOLERANCE * scale,
        )  # fmt: skip
        if found.error > 1e3 * VELOCITY_TOLERANCE * scale:
            raise LimitError(
                f"velocity of the fluid has not converged at t = {time:.6g} s ({found.error:.3g} m/s after "
                f"{found.iterations} iterations); lower fluid.step or fluid.viscosity"
            )
        self.friction[:] = self._rub(self.velocity, void, True)
        self.void_fraction = void
        self._project(time, dt, None if exchange is None else exchange.growth, found.iterations)
        self._account(before, dt, exchange)
        self.convection, self.rate, self.last_step = self.rate, self.convection, dt

    def _rub(self, velocity: Array, void: Array, moving: bool) -> Array:
        """∇·(ετ) of a velocity whose margins are filled first, its sides moving as they do or at rest, N/m³."""
        fill_velocity_margins(velocity, self.frame, self.borders, moving, True)
        force = np.zeros_like(velocity)
        fill_friction(velocity, void, self.table.viscosity, self.frame, self.first, force)
        return force

    def _fill_mobility(self, void: Array, dt: float, exchange: Exchange | None) -> None:
        """Fill b = (1 − α) / (ρε/Δt + K) on faces, 0 where the velocity is prescribed."""
        inertia = void * (self.table.density / dt)
        if exchange is not None:
            inertia = inertia + exchange.drag
        for a in range(3):
            faces = self.on_faces(inertia, a)
            open_share = 1.0 if self.immersed is None else 1.0 - faces_of(self.immersed.share[a], a, self.grid)
            faces_of(self.mobility[a], a, self.grid)[:] = open_share / faces
            self._close(self.mobility[a], a)

    def _close(self, field: Array, a: int) -> None:
        """Set a field of faces to 0 on the sides that are walls or inflows."""
        faces = faces_of(field, a, self.grid)
        for high in (0, 1):
            if self.borders.kind[2 * a + high] not in (PERIODIC, OUTFLOW):
                across = [slice(None)] * 3
                across[2 - a] = slice(-1, None) if high else slice(0, 1)
                faces[tuple(across)] = 0.0

    def on_faces(self, field: Array, a: int) -> Array:
        """Mean of the two cells beside every face of a component, (z, y, x), sides included."""
        s = self.grid.stride[a]
        return 0.5 * (faces_of(field, a, self.grid) + faces_of(np.roll(field, s), a, self.grid))

    def _fill_target(self, void: Array, dt: float, exchange: Exchange | None) -> None:
        """Fill t = α u_w / b + ρε (u/Δt + convection) − ε∇p + K v + ε f on faces, N/m³."""
        table = self.table
        ahead = 1.0 + 0.5 * dt / self.last_step if self.last_step else 1.0  # Adams and Bashforth, second order
        for a in range(3):
            porous = self.on_faces(void, a)
            now, old = faces_of(self.rate[a], a, self.grid), faces_of(self.convection[a], a, self.grid)
            speed = faces_of(self.velocity[a], a, self.grid)
            target = faces_of(self.target[a], a, self.grid)
            slope = faces_of(self.gradient[a], a, self.grid)
            target[:] = table.density * (porous * speed / dt + ahead * now - (ahead - 1.0) * old)
            target -= porous * (slope + table.pressure_gradient[a])
            if exchange is not None:
                target += self.on_faces(exchange.push[a], a)
            if self.immersed is not None:
                mobility, wall = faces_of(self.mobility[a], a, self.grid), faces_of(self.immersed.wall[a], a, self.grid)
                target += np.divide(wall, mobility, out=np.zeros_like(wall), where=mobility > 0.0)

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

    def _project(self, time: float, dt: float, growth: Array | None, viscous: int) -> None:
        """Correct velocity and pressure so that eq. (11) holds: ∇·(ε² b ∇δp) = ∂ε/∂t + ∇·(εu)."""
        porous = [self.on_faces(self.void_fraction, a) for a in range(3)]
        mobile = [faces_of(self.mobility[a], a, self.grid) for a in range(3)]
        self.solver.set_coefficients(*(np.ascontiguousarray(e * e * b) for e, b in zip(porous, mobile, strict=True)))
        wanted = self.divergence(growth)
        scale = max(float(np.abs(self.velocity).max()) / min(self.grid.spacing), 1e-3 * float(np.abs(wanted).max()))
        change = np.zeros_like(wanted)
        solved = self.solver.solve_(change, wanted, DIVERGENCE_TOLERANCE * scale)
        if solved.residual > 10.0 * DIVERGENCE_TOLERANCE * scale:
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
                across: list[slice | int] = [slice(None)] * 3
                across[2 - a] = -1 if high else 0
                edge = cells_of(pressure, self.grid)[tuple(across)]
                slope[tuple(across)] = sign * edge * 2.0 / self.grid.spacing[a]
        return np.asarray(slope)

    def _fill_gradient(self) -> None:
        for a in range(3):
            faces_of(self.gradient[a], a, self.grid)[:] = self._slope(self.pressure, a)

    def _account(self, before: Array, dt: float, exchange: Exchange | None) -> None:
        """Count the work of every term in this step, at the mean of old and new velocity, and what bodies gave."""
        table, share = self.table, dt * self.grid.volume
        work = np.zeros(5)
        ahead = 1.0 + 0.5 * dt / self.last_step if self.last_step else 1.0
        for a in range(3):
            on = faces_of(self.velocity[a], a, self.grid)
            old, porous = faces_of(before[a], a, self.grid), self.on_faces(self.void_fraction, a)
            now, then = faces_of(self.rate[a], a, self.grid), faces_of(self.convection[a], a, self.grid)
            carried = table.density * (ahead * now - (ahead - 1.0) * then)
            rubbed = faces_of(self.friction[a], a, self.grid)
            pressed = -porous * (faces_of(self.gradient[a], a, self.grid) + table.pressure_gradient[a])
            dragged = np.zeros_like(on)
            if exchange is not None:
                dragged = self.on_faces(exchange.push[a], a) - self.on_faces(exchange.drag, a) * on
            middle = self._once(0.5 * (on + old), a)
            terms = [rubbed, carried, dragged, pressed]
            work[1:] += [share * float((middle * self._once(term, a)).sum()) for term in terms]
            if self.immersed is not None:
                held = table.density * porous * (on - old) / dt - carried - rubbed - pressed - dragged
                work[0] += share * float((middle * self._once(held * self._covered(a), a)).sum())
                self.immersed.tally_(a, held, share, self.given)
        self.spent = Spent(*(x + float(y) for x, y in zip(self.spent, work, strict=True)))

    def _covered(self, a: int) -> Array:
        """Whether a body covers any part of a face, 1 or 0."""
        assert self.immersed is not None
        return np.asarray(faces_of(self.immersed.share[a], a, self.grid) > 0.0, dtype=np.float64)

    def _once(self, faces: Array, a: int) -> Array:
        """Leave out faces that stand twice, and those on the sides, whose velocity is prescribed."""
        across = [slice(None)] * 3
        across[2 - a] = slice(None, -1) if self.grid.periodic[a] else slice(1, -1)
        return faces[tuple(across)]

    def kinetic_energy(self) -> float:
        """Σ ½ ρ ε u² V over the faces inside, J."""
        return sum(
            0.5 * self.table.density * self.grid.volume
            * float(self._once(self.on_faces(self.void_fraction, a) * faces_of(self.velocity[a], a, self.grid) ** 2, a).sum())
            for a in range(3)
        )  # fmt: skip

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
            low = [slice(None)] * 3
            high = [slice(None)] * 3
            low[2 - a], high[2 - a] = slice(None, -1), slice(1, None)
            total += np.maximum(speed[tuple(low)], speed[tuple(high)]) * dt / self.grid.spacing[a]
        return float(total.max())
