"""What a step of the solver costs in developed flow, against one at the start of a scene."""

from typing import NamedTuple

import numpy as np

from sim import Scene, simulation_of
from sim.simulation import Simulation
from sim.vessel import Oscillation, Rotation, WallTable
from suffice.rotor import fold_of
from suffice.run import Run
from suffice.setting import scene_of
from suffice.starting import read_start
from suffice.stretch import Stretch, timed_in_turn

SAME = 1e-4  # of a period, by which a moment may miss a whole number of them


class Developed(NamedTuple):
    """The same scene, timed over as many steps at its start and from a late moment of a run of it, in turn."""

    time: float  # s, of the moment
    start: Stretch
    late: Stretch

    @property
    def factor(self) -> float:
        """Cost of a step in developed flow over that of one at the start."""
        return (self.late.seconds / self.late.steps) / (self.start.seconds / self.start.steps)


def developed(run: Run) -> Developed | None:
    """Time the solver at the start of the scene that made a run, and from a late moment of it.

    None where the run holds no scene, or no such moment. The late run starts with the positions, velocities and spins
    of that moment. Its fluid is at rest then, and its contacts have forgotten how they slipped: a snapshot interval
    passes before it is timed.
    """
    scene, _ = scene_of(run)
    if scene is None or not scene.particles:
        return None
    time = late_moment(run, scene)
    if time is None:
        return None
    tables = scene.model_dump() | {"start": {"run": str(run.path), "time": time}}
    late_scene = Scene.model_validate(tables)
    first, second = (_simulation(one) for one in (scene, late_scene))
    most = max(int(0.9 * first.steps_per_snapshot), 1)  # the first step of the fluid is none of them
    return Developed(time, *timed_in_turn([(first, 1), (second, second.steps_per_snapshot)], most))


def _simulation(scene: Scene) -> Simulation:
    simulation = simulation_of(scene, read_start(scene))
    assert isinstance(simulation, Simulation)  # it has particles
    return simulation


def late_moment(run: Run, scene: Scene) -> float | None:
    """Return the time (s) of the last snapshot at which all that moves stands as at time zero; None without one."""
    stands = run.times > 0.0
    for wall in scene.walls:
        if (period := _period(wall)) is not None:
            turns = run.times / period
            stands &= np.abs(turns - np.round(turns)) < SAME
    return float(run.times[stands][-1]) if stands.any() else None


def _period(wall: WallTable) -> float | None:
    """Time (s) after which a wall stands as before; None for one that always does."""
    motion = wall.motion
    if isinstance(motion, Rotation):
        return abs(60.0 / (motion.rpm * fold)) if motion.rpm and (fold := fold_of(wall, motion)) else None
    if isinstance(motion, Oscillation):
        return 1.0 / motion.frequency
    return None if motion is None else np.inf  # what is carried away never comes back
