"""Particles in a vessel: the high-fidelity model that makes the snapshots (paper 2.1).

Read in this order: `scene` (what a scene may say), `simulation` (the run), `verlet` (a step), `pairs` and `walls`
(the contact terms), `contact` (their law), `neighbors`, `shapes`, `combination`, `gridded` and `mesh` (distance to
walls), `motion`, `energy`.
"""

from sim.errors import InputError, LimitError
from sim.reading import built_in_scenes, parse_scene, scene_text
from sim.scene import Scene
from sim.simulation import Simulation, simulate
from sim.state import Snapshot

__all__ = [
    "InputError",
    "LimitError",
    "Scene",
    "Simulation",
    "Snapshot",
    "built_in_scenes",
    "parse_scene",
    "scene_text",
    "simulate",
]
