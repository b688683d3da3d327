"""What every run with a fluid does: it chooses the fluid's step, does it, and shows the fluid."""

from math import ceil, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.borders import fastest_side
from sim.coupling import Coupling, cell_velocity
from sim.errors import InputError, LimitError
from sim.flow import FluidTable
from sim.fluid import Fluid
from sim.grid import cells_of, grid_of
from sim.guards import Guards
from sim.immersed import Immersed
from sim.kernel import Array
from sim.motion import Bodies, move_bodies
from sim.scene import Scene
from sim.shapes import SHELL
from sim.state import FluidFields
from sim.surface import wall_speed

COURANT = 0.35  # of the fluid's step that is chosen
LARGEST_COURANT = 1.0  # of any step
TRAVEL = 0.5  # cells that a particle or a wall may cross within a step of the fluid
MOST_STEPS = 1000  # of the particles within one of the fluid


class FluidLimit(NamedTuple):
    """The largest step of the fluid that one term allows."""

    term: str
    largest: float  # s


def check_solid(scene: Scene, walls: Bodies) -> None:
    """Refuse thin walls that should be immersed: no cell lies behind them (InputError)."""
    for b in walls.body[walls.kind == SHELL]:
        if scene.walls[b].immersed:
            raise InputError(
                f"walls.{b}.immersed = true: {scene.walls[b].name!r} has an open cylinder or cone, a thin wall that no "
                "cell lies behind; close its ends, or leave out immersed"
            )


def check_steps(table: FluidTable, dt: float) -> None:
    """Refuse steps of the fluid below the particles' `dt` (s), which could not be done (InputError)."""
    for name, asked in (("step", table.step), ("largest_step", table.largest_step)):
        if asked is not None and asked < dt * (1.0 - 1e-9):
            raise InputError(
                f"fluid.{name} = {asked:g} s: below the particles' step of {dt:.3g} s, and a step of the fluid is one "
                f"of theirs at least; give time.step = {asked:g} s too, or a longer fluid.{name}"
            )


class FluidSide:
    """The fluid of a run, in steps that are whole ones of the run's."""

    scene: Scene
    walls: Bodies | None
    dt: float  # s, step of the run
    step: int
    steps_per_snapshot: int
    guards: Guards
    coupling: Coupling | None = None

    def _make_fluid(self, scene: Scene, walls: Bodies | None) -> None:
        assert scene.fluid is not None  # whoever makes such a run has looked
        self.table: FluidTable = scene.fluid
        grid = grid_of(self.table, scene.repeats)
        immersed = None
        if walls is not None and any(wall.immersed for wall in scene.walls):
            check_solid(scene, walls)
            immersed = Immersed(walls, [wall.immersed for wall in scene.walls], grid)
        self.fluid = Fluid(self.table, grid, immersed, self.guards)
        self.fluid_steps = 0
        self.reported_fluid = np.zeros((len(scene.walls), 7))

    def velocities(self) -> Array:
        """Velocities (n, 3) of the particles, m/s."""
        return np.zeros((0, 3))

    def places(self) -> Array:
        """Positions (n, 3) of the particles, m."""
        return np.zeros((0, 3))

    def limits(self) -> list[FluidLimit]:
        """Return what bounds the next step of the fluid."""
        h = min(self.fluid.grid.spacing)
        moving = self.velocities()
        fastest = float(np.sqrt((moving**2).sum(axis=1).max())) if len(moving) else 0.0
        found = [
            FluidLimit("speed of the fluid (CFL)", _ratio(COURANT, self.fluid.courant(1.0))),
            FluidLimit("speed at the sides", _ratio(COURANT * h, fastest_side(self.table))),
            FluidLimit("speed of the particles", _ratio(TRAVEL * h, fastest)),
        ]
        if self.walls is not None and self.fluid.immersed is not None:
            corners = np.array(np.meshgrid(*zip(self.table.lowest, self.table.highest, strict=True))).reshape(3, -1).T
            found.append(FluidLimit("speed of the walls", _ratio(TRAVEL * h, wall_speed(self.walls, corners))))
        if self.coupling is not None and self.coupling.two_way:
            found.append(FluidLimit("exchange of momentum", float(self.coupling.time)))
            if self.scene.gravity is not None:
                fall = sqrt(h / max(float(np.linalg.norm(self.scene.gravity.acceleration)), 1e-300))
                found.append(FluidLimit("fall of the particles", fall))
        if self.fluid.last_step == 0.0:  # from the second on the speed reached tells
            slopes = zip(self.table.pressure_gradient, self.fluid.grid.spacing, strict=True)
            gain = sum(abs(slope) / width for slope, width in slopes) / self.table.density  # 1/s²
            found.append(FluidLimit("first step under fluid.pressure_gradient", sqrt(_ratio(COURANT, gain))))
        if self.table.largest_step is not None:
            found.append(FluidLimit("fluid.largest_step", self.table.largest_step))
        return found

    def wanted_step(self) -> float:
        """Return the next step of the fluid that the scene asks for, or the largest within the limits, s."""
        return self.table.step or min(limit.largest for limit in self.limits())

    def substeps(self, left: int) -> int:
        """Return the steps of the run within the next step of the fluid; whole ones make up the `left` ones."""
        wanted = self.wanted_step()
        most = max(1, int(min(wanted / self.dt * (1.0 + 1e-9), left if self.table.step else min(left, MOST_STEPS))))
        return ceil(left / ceil(left / most))

    def _place_bodies(self, time: float) -> None:
        """Put the bodies where they are at a time (s), for the fluid as well."""
        if self.walls is not None and self.fluid.immersed is not None and self.fluid.immersed.moves:
            move_bodies(self.walls, time)
            self.fluid.immersed.update_()

    def _check_courant(self, dt: float, time: float) -> None:
        """Stop where the fluid has crossed more than a cell in a step (LimitError)."""
        courant = self.fluid.courant(dt)
        self.guards.note_("courant", courant, LARGEST_COURANT, time)
        if not courant <= LARGEST_COURANT:
            raise LimitError(
                f"the fluid crosses {courant:.3g} cells in a step of {dt:.3g} s at t = {time:.6g} s "
                f"({self.fluid.fastest_place()}); {self._remedy(0.5 * dt / max(courant, 1e-300))}"
            )

    def _remedy(self, step: float) -> str:
        """Say what makes the fluid's steps no longer than `step` (s)."""
        if self.table.step is not None:
            return f"lower fluid.step to {step:.2g} s, or leave it out"
        if len(self.places()) and step < self.dt:
            return f"give time.step = {step:.2g} s: a step of the fluid is one of the particles at least"
        return f"give fluid.largest_step = {step:.2g} s"

    def fields(self) -> FluidFields:
        """Return the fluid at the centres of its cells."""
        grid = self.fluid.grid
        velocity = np.stack([cells_of(u, grid) for u in cell_velocity(self.fluid)], axis=-1)
        return FluidFields(
            velocity, cells_of(self.fluid.pressure, grid).copy(), cells_of(self.fluid.void_fraction, grid).copy()
        )

    def fluid_state(self) -> dict[str, NDArray[Any]]:
        """Return copies of all that the fluid's next step depends on, by name."""
        fluid, c = self.fluid, self.coupling
        state: dict[str, NDArray[Any]] = {f"fluid.{name}": getattr(fluid, name).copy() for name in STORED}
        state |= {"fluid.last_step": np.asarray(fluid.last_step)}
        state |= {"fluid.steps": np.asarray(self.fluid_steps), "fluid.reported": self.reported_fluid.copy()}
        if c is not None:
            state |= {f"coupling.{name}": np.array(getattr(c, name)) for name in EXCHANGED}
        return state

    def restore_fluid_(self, state: dict[str, NDArray[Any]]) -> None:
        """Put the fluid into a state that `fluid_state` returned; the run's time has been set."""
        for name in STORED:
            setattr(self.fluid, name, state[f"fluid.{name}"])
        self.fluid.last_step = float(state["fluid.last_step"])
        self.fluid_steps, self.reported_fluid = int(state["fluid.steps"]), state["fluid.reported"]
        if self.coupling is not None:
            for name in EXCHANGED:
                kept = state[f"coupling.{name}"]
                setattr(self.coupling, name, kept if kept.ndim else kept.item())
        self._place_bodies(self.step * self.dt)


STORED = ("velocity", "pressure", "void_fraction", "rate", "gradient", "mobility", "given", "spent")
EXCHANGED = ("owed", "impulse", "work", "clamped", "time")


def _ratio(most: float, per_second: float) -> float:
    return most / per_second if per_second > 0.0 else float("inf")
