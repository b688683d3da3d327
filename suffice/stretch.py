"""A timed stretch of the solver: seconds of one snapshot interval, from some of its steps."""

from time import perf_counter
from typing import NamedTuple

import numba

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

    A piece is one step of the fluid and the particles' steps within it, as long as in a run that goes on to its next
    snapshot, so that fluid and particles have the shares that they have there. Nothing is written. The run stands
    where the stretch ends. Raises LimitError where a limit is violated on the way.
    """
    run.advance_to(run.step + 1)  # compiles
    goal = run.step + warm_up
    while run.step < goal:
        _piece(run, goal - run.step)
    first, begin, before = run.step, run.time, run.term_seconds()
    spent: list[tuple[float, int]] = []
    while run.step - first < steps:
        at = run.step
        began = perf_counter()
        _piece(run, run.steps_per_snapshot)
        spent.append((perf_counter() - began, run.step - at))
    total = sum(seconds for seconds, _ in spent)
    return Stretch(
        len(run.particles.radius), begin, run.time, run.step - first, len(spent),
        timing_of([seconds / count for seconds, count in spent]), total, run.steps_per_snapshot,
        run.dt * run.steps_per_snapshot, run.ledger()[1], numba.get_num_threads(),
        {name: seconds - before[name] for name, seconds in run.term_seconds().items()},
    )  # fmt: skip


def _piece(run: Simulation, most: int) -> None:
    """Advance by one step of the fluid, and in a dry run by a tenth of a snapshot interval; by no more than `most`."""
    whole = run.steps_to_next_flow() if run.scene.fluid else -(-run.steps_per_snapshot // 10)
    run.advance_to(run.step + min(whole, most))
