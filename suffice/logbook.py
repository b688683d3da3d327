"""What a run tells about itself while it is made: its pace, its energies; the rest is in the simulation."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from time import perf_counter
from typing import Any

import numpy as np
from numba.core import event
from numpy.typing import NDArray
from pydantic import TypeAdapter

from sim import AnyRun, Simulation
from sim.fluid_side import FluidSide
from sim.guards import Nearest
from sim.state import Snapshot
from suffice.checkpoint_check import LARGEST
from suffice.summary import Clamp, Count, Energy, Guard, Lists, Outcome, Pace, Summary, Warnings
from suffice.summary_text import UNITS, clamp_text, energy_text, guard_name, guard_text
from suffice.warned import Counted, Warned
from suffice.wording import finite

MOVING = ("kinetic", "rotational", "elastic")
WARNINGS = "logbook.warnings"  # JSON as plain text, in the state
LOOKS = 2  # at every void fraction in a step of the fluid: where particles are, and where they will be
NEAR = 0.9  # of a limit, that a run should not come to
MOST_MISSED = 0.01  # of the energy put in; the built-in scenes miss less than a thousandth
HEARD = TypeAdapter(dict[str, tuple[Count, str]])  # warnings in the state: kind, how many, words of the first
FIGURES = ("seconds", "compiling", "put_in", "start", "moving", "potential", "residual", "largest", "largest_at")


class Logbook:
    """Sums up a run, from its beginning even where it was interrupted: `state` goes into the checkpoint."""

    def __init__(self) -> None:
        self.seconds = self.compiling = 0.0  # s, of stepping and writing; of compiling and loading kernels
        self.warned = Warned()  # of the parts of the run that came before
        self.put_in = 0.0  # J, most that start, walls, fluid and weight had given by any snapshot
        self.start = self.moving = self.potential = np.nan  # J, of the first snapshot: balance, motion, potential
        self.residual, self.largest, self.largest_at = 0.0, 0.0, 0.0  # J, of the last snapshot; largest; s, of that

    @contextmanager
    def timing(self) -> Iterator[None]:
        """Count the seconds of the block, those of compiling kernels, or of loading them, apart."""
        began, spent = perf_counter(), [0.0]
        try:
            with compiling_seconds() as spent:
                yield
        finally:
            self.compiling += sum(spent)
            self.seconds += perf_counter() - began - sum(spent)

    def see(self, now: Snapshot) -> None:
        """Take the energies of an output time."""
        if "energy.balance" not in now.series:
            return
        energy = {name.removeprefix("energy."): value for name, value in now.series.items()}
        moving, potential = sum(energy[name] for name in MOVING), energy["potential"]
        if np.isnan(self.start):
            self.start, self.moving, self.potential = energy["balance"], moving, potential
        work = max(energy["wall_work"], 0.0) + max(energy.get("fluid.work_on_particles", 0.0), 0.0)
        given = self.moving + work + max(self.potential - potential, 0.0)
        self.put_in, self.residual = max(self.put_in, given), energy["balance"] - self.start
        if abs(self.residual) > abs(self.largest):
            self.largest, self.largest_at = self.residual, now.time

    def energy(self) -> Energy | None:
        """Return what was put in and what is missing, None where no energies are counted."""
        if np.isnan(self.start):
            return None
        return Energy(
            put_in=self.put_in, residual=self.residual, largest_residual=self.largest, largest_at=self.largest_at
        )

    def state(self, warned: Mapping[str, Counted]) -> dict[str, NDArray[Any]]:
        """Return all that it needs to go on, as named arrays; warned: what this part of the run has warned of."""
        text = json.dumps({kind: list(found) for kind, found in self.all(warned).items()})
        figures = {f"logbook.{name}": np.asarray(getattr(self, name)) for name in FIGURES}
        return figures | {WARNINGS: np.asarray(np.bytes_(text.encode()))}

    def restore_(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from what `state` returned. Raises KeyError or ValueError where that is of another kind, or damaged."""
        for name in FIGURES:
            value = float(state[f"logbook.{name}"])
            if not (abs(value) <= LARGEST or (np.isnan(value) and np.isnan(getattr(Logbook(), name)))):
                raise ValueError(f"logbook.{name} is {value:g}")
            setattr(self, name, value)
        for kind, (count, first) in HEARD.validate_json(bytes(state[WARNINGS].item()), strict=True).items():
            self.warned.add(kind, first, count)

    def all(self, warned: Mapping[str, Counted]) -> Warned:
        """Return the warnings of this part of the run after those of the parts before."""
        found = Warned(self.warned)
        for kind, (count, first) in warned.items():
            found.add(kind, first, count)
        return found


@contextmanager
def compiling_seconds() -> Iterator[list[float]]:
    """Count the seconds of the block in which kernels are compiled, or loaded; they stand in the list at its end."""
    timer: Any = event.TimingListener  # numba has no types
    compiling, spent = timer(), list[float]()
    try:
        with event.install_listener("numba:compiler_lock", compiling):
            yield spent
    finally:
        spent.append(compiling.duration if compiling.done else 0.0)


def summed_up(run: AnyRun, logbook: Logbook, warned: Mapping[str, Counted], outcome: Outcome) -> Summary:
    """Return what a run tells at its end, or where it was stopped; warned: what its last part has warned of."""
    particles = isinstance(run, Simulation)
    fluid_steps = run.fluid_steps if isinstance(run, FluidSide) else None
    steps = run.step if particles else fluid_steps
    energy = logbook.energy()
    guards = {name: _guard(name, found) for name, found in sorted(run.guards.items())}
    clamps = _clamps(run)
    return Summary(
        outcome=outcome,
        time=run.time,
        steps=steps or 0,
        fluid_steps=fluid_steps,
        energy=energy,
        guards=guards,
        neighbours=_lists(run) if isinstance(run, Simulation) else None,
        clamps=clamps,
        warnings=_plain(logbook.all(warned), energy, guards, clamps),
        pace=_pace(run, logbook, steps or 0),
    )


def _pace(run: AnyRun, logbook: Logbook, steps: int) -> Pace:
    rate = 1.0 / logbook.seconds if logbook.seconds > 0.0 else 0.0
    cells = None if run.scene.fluid is None else prod(run.scene.fluid.cells)
    return Pace(
        seconds=logbook.seconds,
        compiling_seconds=logbook.compiling,
        steps_per_second=rate * steps,
        particle_steps_per_second=rate * steps * len(run.particles.radius) if isinstance(run, Simulation) else None,
        cell_steps_per_second=rate * steps * cells if cells and not isinstance(run, Simulation) else None,
        simulated_ms_per_minute=rate * run.time * 60e3,
    )


def _guard(name: str, found: Nearest) -> Guard:
    return Guard(largest=finite(found.value), at=found.time, limit=finite(found.limit), unit=UNITS[name])


def _lists(run: Simulation) -> Lists:
    return Lists(rebuilds=run.rebuilds, mean_steps=run.listed_step / run.rebuilds if run.rebuilds else None)


def _clamps(run: AnyRun) -> dict[str, Clamp]:
    """Return what was held at a bound: void fractions, of which the fluid looks at two in every cell of a step."""
    if not isinstance(run, FluidSide) or run.coupling is None or not run.coupling.two_way:
        return {}
    looks = LOOKS * prod(run.fluid.grid.cells) * run.fluid_steps
    return {"void fraction": Clamp(count=run.coupling.clamped, of=looks, bound=run.coupling.drag.least_void_fraction)}


def _plain(
    warned: Warned, energy: Energy | None, guards: Mapping[str, Guard], clamps: Mapping[str, Clamp]
) -> dict[str, Warnings]:
    """Return all warnings: those that were heard, and those that follow from the figures."""
    found = Warned(warned)
    if energy is not None and abs(energy.largest_residual) > MOST_MISSED * energy.put_in:
        found.add("energy does not balance", energy_text(energy))
    for name, clamp in clamps.items():
        if clamp.count:
            found.add(f"{name} at its bound", clamp_text(clamp), clamp.count)
    for name, guard in guards.items():
        if guard.share is not None and NEAR <= guard.share <= 1.0:
            found.add("near a limit", f"{guard_name(name)} {guard_text(name, guard)}")
    return {kind: Warnings(count=count, first=first) for kind, (count, first) in found.items()}
