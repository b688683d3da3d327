"""From a scene to a run: a generator of snapshots."""

from collections.abc import Iterator
from math import prod
from typing import TYPE_CHECKING, TypeAlias

from sim.memory import OF_CELL, check_memory
from sim.scene import Scene
from sim.simulation import Simulation
from sim.start import StartState
from sim.state import Snapshot

if TYPE_CHECKING:
    from sim.flowing import FlowSimulation

AnyRun: TypeAlias = "Simulation | FlowSimulation"


def simulation_of(scene: Scene, start: StartState | None = None) -> AnyRun:
    """Return the run of a scene at its first moment; the fluid's code is loaded only where there is a fluid.

    Raises InputError for a scene that cannot start.
    """
    if scene.fluid is None:
        return Simulation(scene, start)
    check_memory("fluid.cells", prod(scene.fluid.cells), OF_CELL)
    if not scene.particles:
        from sim.flowing import FlowSimulation

        return FlowSimulation(scene)
    from sim.coupled import CoupledSimulation

    return CoupledSimulation(scene, start)


def simulate(scene: Scene) -> Iterator[Snapshot]:
    """Yield the snapshots of a scene, time zero first.

    Raises InputError for a scene that cannot start and LimitError for a limit violated on the way.

    >>> from sim import parse_scene
    >>> scene = parse_scene('''
    ... gravity = { acceleration = [0.0, 0.0, -9.81] }  # m/s²
    ... contact = { stiffness = 1e3, restitution = 0.8 }  # N/m
    ... time = { duration = 0.1 }  # s
    ... output = { interval = 0.05 }  # s
    ... [[particles]]
    ... diameter = 2e-3  # m
    ... density = 2500.0  # kg/m³
    ... position = [[0.0, 0.0, 0.0]]  # m
    ... ''')
    >>> [(snapshot.time, round(snapshot.position[0, 2].item(), 5)) for snapshot in simulate(scene)]  # z = -g t²/2
    [(0.0, 0.0), (0.05, -0.01226), (0.1, -0.04905)]
    """
    run = simulation_of(scene)
    for k in range(run.snapshots):
        run.advance_to(k * run.steps_per_snapshot)
        yield run.snapshot()
