"""A run of a fluid without particles."""

from math import ceil

import numpy as np

from sim.assembly import walls_of
from sim.fluid_series import fluid_series
from sim.fluid_side import FluidSide
from sim.guards import Guards
from sim.scene import Scene
from sim.state import Particles, Snapshot
from sim.timestep import snapshots_in

TICKS = 720  # into which an output interval is divided, where the scene gives no step: many numbers divide it


class FlowSimulation(FluidSide):
    """State of a run between two steps of the fluid; its steps are what an output interval is divided into."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.walls, self.guards = scene, walls_of(scene), Guards()
        self._make_fluid(scene, self.walls)
        self.steps_per_snapshot = ceil(scene.output.interval / self.table.step - 1e-9) if self.table.step else TICKS
        self.dt = scene.output.interval / self.steps_per_snapshot
        self.snapshots, self.step = snapshots_in(scene), 0
        none, numbers = np.zeros((0, 3)), np.zeros(0, np.int64)
        self.particles = Particles(none, none, np.zeros(0), np.zeros(0), numbers, numbers, None)

    @property
    def time(self) -> float:
        """Time of the run, s."""
        return self.step * self.dt

    def advance_to(self, step: int) -> None:
        """Run to a step; raises LimitError where the fluid outruns its step."""
        while self.step < step:
            steps = self.substeps(step - self.step)
            end, left = (self.step + steps) * self.dt, steps * self.dt
            while left > 0.0:  # more than once where a tick is longer than the limits allow
                dt = left / max(1, ceil(left / self.wanted_step() * (1.0 - 1e-9)))
                left -= dt
                self._flow(end - left, dt)
            self.step += steps

    def _flow(self, time: float, dt: float) -> None:
        """Do one step of `dt` (s) to a time (s)."""
        self._place_bodies(time)
        self.fluid.step_(time, dt, None)
        self._check_courant(dt, time)
        self.fluid_steps += 1

    def term_seconds(self) -> dict[str, float]:
        """Return what parts of the run have taken so far, s."""
        return dict(self.fluid.seconds)

    def snapshot(self) -> Snapshot:
        """Return the present moment."""
        none = self.particles.position
        series = {name: float(value) for name, value in fluid_series(self).items()}
        return Snapshot(self.time, none, none, None, series, fluid=self.fields())
