"""A timed stretch of the solver: seconds of one snapshot interval, from some of its steps."""

from collections.abc import Sequence
from time import perf_counter
from typing import NamedTuple

import numba

from sim.coupled import CoupledSimulation
from sim.simulation import Simulation
from suffice.one_step import Timing, timing_of


class Stretch(NamedTuple):
    """What the solver took for some steps, and so takes for a snapshot interval."""

    beads: int
    begin: float  # s, time of the run at which it was measured
    end: float
    steps: int  # of the particles, measured; whole steps of the fluid
    pieces: int  # each one step of the fluid, where there is one, and the particles' steps within it
    step: Timing  # s, of one step of the particles, its share of the fluid included; over the pieces
    seconds: float  # of all measured steps
    steps_per_interval: int
    interval: float  # s, between snapshots of the run
    contacts: float  # mean number of contacts of a particle at the end
    threads: int
    seconds_of: dict[str, float]  # s, parts of `seconds`; contacts, motion and walls are the rest

    @property
    def interval_seconds(self) -> float:
        """Seconds of one snapshot interval: its steps times the mean of a measured one."""
        return self.steps_per_interval * self.seconds / self.steps

    @property
    def share(self) -> float:
        """Share of a snapshot interval that was measured."""
        return self.steps / self.steps_per_interval


def timed_stretch(run: Simulation, warm_up: int, steps: int) -> Stretch:
    """Advance a run by at least `warm_up` and then at least `steps` steps of the particles, and time the latter.

    Pieces are those of a run that nobody watches: one step of the fluid and the particles' steps within it, so that
    fluid and particles have the shares that they have there. The first one compiles what is not compiled yet and is
    never timed. Nothing is written. The run stands where the stretch ends.
    Raises LimitError where a limit is violated on the way.
    """
    return timed_in_turn([(run, warm_up)], steps)[0]


def timed_in_turn(runs: Sequence[tuple[Simulation, int]], steps: int) -> list[Stretch]:
    """Time a stretch of each of several runs, given with its warm-up, piece by piece in turn.

    What else the machine does meanwhile then falls on all of them alike.
    """
    clocks = [_Clock(run, warm_up) for run, warm_up in runs]
    while waiting := [clock for clock in clocks if clock.steps < steps]:
        for clock in waiting:
            clock.time_piece()
    return [clock.stretch() for clock in clocks]


class _Clock:
    """What pieces of a run have taken since it was warm."""

    def __init__(self, run: Simulation, warm_up: int) -> None:
        goal = run.step + max(warm_up, 1)
        while run.step < goal:
            _piece(run)
        self.run, self.first, self.begin, self.before = run, run.step, run.time, run.term_seconds()
        self.spent: list[tuple[float, int]] = []

    @property
    def steps(self) -> int:
        return self.run.step - self.first

    def time_piece(self) -> None:
        at = self.run.step
        began = perf_counter()
        _piece(self.run)
        self.spent.append((perf_counter() - began, self.run.step - at))

    def stretch(self) -> Stretch:
        run = self.run
        return Stretch(
            len(run.particles.radius), self.begin, run.time, self.steps, len(self.spent),
            timing_of([seconds / count for seconds, count in self.spent]), sum(seconds for seconds, _ in self.spent),
            run.steps_per_snapshot, run.dt * run.steps_per_snapshot, run.ledger()[1], numba.get_num_threads(),
            {name: seconds - self.before[name] for name, seconds in run.term_seconds().items()},
        )  # fmt: skip


def _piece(run: Simulation) -> None:
    """Advance by the next step of the fluid on the way to the next snapshot, in a dry run by a tenth of that way."""
    left = run.steps_per_snapshot - run.step % run.steps_per_snapshot
    tenth = -(-run.steps_per_snapshot // 10)
    run.advance_to(run.step + (run.substeps(left) if isinstance(run, CoupledSimulation) else min(tenth, left)))
