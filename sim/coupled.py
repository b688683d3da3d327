"""A run of particles in a fluid: a step of the fluid, then the particles' steps within it, in turn."""

from time import perf_counter

import numpy as np

from sim.coupling import Coupling
from sim.errors import InputError, LimitError
from sim.fluid_series import fluid_series
from sim.fluid_side import FluidSide, check_steps
from sim.kernel import Array
from sim.scene import Scene
from sim.simulation import Simulation
from sim.start import StartState
from sim.state import Snapshot
from sim.timestep import time_step


class CoupledSimulation(FluidSide, Simulation):
    """State of a run of particles in a fluid between two compiled calls."""

    def __init__(self, scene: Scene, start: StartState | None = None) -> None:
        if scene.fluid is not None:
            check_steps(scene.fluid, time_step(scene)[0])
        super().__init__(scene, start)
        self._make_fluid(scene, self.walls)
        if scene.drag is not None:
            self.coupling = Coupling(scene.drag, self.gravity, len(self.particles.radius))
        self.seconds |= {"exchange": 0.0, "immersed": 0.0}
        try:
            self._check_inside()
        except LimitError as error:  # before anything has run it is the scene that is at fault
            raise InputError(str(error)) from None
        if self.coupling is not None:
            self.coupling.start_(self.fluid, self.particles)

    def velocities(self) -> Array:
        """Velocities (n, 3) of the particles, m/s."""
        return self.particles.velocity

    def places(self) -> Array:
        """Positions (n, 3) of the particles, m."""
        return self.particles.position

    def advance_to(self, step: int) -> None:
        """Run to a step of the particles, in whole steps of the fluid.

        Raises LimitError as a dry run does, and where the fluid outruns its step or a particle leaves its box.
        """
        while self.step < step:
            steps = self.substeps(step - self.step)
            dt = steps * self.dt
            self._flow(dt, (self.step + steps) * self.dt)
            super().advance_to(self.step + steps)
            if self.coupling is not None and self.suspended is not None:
                self.coupling.settle_(self.particles, self.suspended, dt)

    def _flow(self, dt: float, time: float) -> None:
        """Do the fluid's step to a time, and set what it does to the particles."""
        began, inside = perf_counter(), sum(self.fluid.seconds.values())
        self._place_bodies(time)
        placed = perf_counter()
        self.fluid_steps += 1
        if self.coupling is None:
            self.fluid.step_(time, dt, None)
        else:
            self._check_inside()
            held = (self.wrench[: len(self.particles.radius), :3] != 0.0).any(axis=1)
            self.suspended = self.coupling.begin_(self.fluid, self.particles, held, dt, time, self.dt)
        self._check_courant(dt, time)
        inside = sum(self.fluid.seconds.values()) - inside
        self.seconds["immersed"] += placed - began
        self.seconds["exchange"] += perf_counter() - placed - inside

    def _check_inside(self) -> None:
        """Stop where a particle has left the fluid's box (LimitError)."""
        position = self.particles.position
        low, high = np.array(self.table.lowest), np.array(self.table.highest)
        aside = ~np.array(self.fluid.grid.periodic)
        outside = ((position < low) | (position > high))[:, aside].any(axis=1)
        if outside.any():
            box = f"from {list(self.table.lowest)} to {list(self.table.highest)} m"
            raise self._stopped(
                int(np.argmax(outside)), f"is outside the fluid's box, {box}", "enlarge fluid.lowest or fluid.highest"
            )

    def term_seconds(self) -> dict[str, float]:
        """Return what parts of the run have taken so far, s."""
        return self.seconds | self.fluid.seconds

    def steps_to_next_flow(self) -> int:
        """Return the steps that a step of the fluid spans now."""
        return self.substeps(self.steps_per_snapshot)

    def fluid_arrays(self) -> list[Array]:
        """Return the arrays of the fluid and of its bodies."""
        bodies = {} if self.fluid.immersed is None else vars(self.fluid.immersed)
        owned = [*vars(self.fluid).values(), *bodies.values()]
        return [rows for rows in owned if isinstance(rows, np.ndarray)]

    def snapshot(self) -> Snapshot:
        """Return the present moment, particles in the scene's order, and the fluid."""
        return super().snapshot()._replace(fluid=self.fields())

    def series(self) -> dict[str, float]:
        """Return the diagnostics of particles and of fluid at this moment."""
        series = super().series()
        if self.coupling is not None:  # what the fluid gave stands beside what the walls gave
            series["energy.balance"] -= float(self.coupling.work[0])
        return series | fluid_series(self)
