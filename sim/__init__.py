"""Particles in a vessel: the high-fidelity model that makes the snapshots (paper 2.1).

Read in this order: `scene` (what a scene may say), `runs` and `simulation` (the run), `verlet` (a step), `pairs` and
`walls` (the contact terms), `contact` (their law), `neighbors`, `shapes`, `combination`, `gridded` and `mesh` (distance
to walls), `motion`, `energy`. With a fluid: `flow` (what a scene may say of it), `coupled` (the run), `coupling` (drag
within a step), `exchange` (the kernel between particles and cells), `fluid` (its step), `convection`, `viscosity`,
`predictor`, `pressure`, `immersed`.
"""

from sim.errors import InputError, LimitError
from sim.reading import built_in_scenes, parse_scene, scene_text
from sim.runs import AnyRun, simulate, simulation_of
from sim.scene import Scene
from sim.simulation import Simulation
from sim.state import Snapshot

__all__ = [
    "AnyRun",
    "InputError",
    "LimitError",
    "Scene",
    "Simulation",
    "Snapshot",
    "built_in_scenes",
    "parse_scene",
    "scene_text",
    "simulate",
    "simulation_of",
]
