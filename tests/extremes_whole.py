"""Whole runs, beads in a stirred liquid with walls and contacts, in other units of length, time and mass."""

from functools import cache
from typing import Any

import numba
import numpy as np
import pytest
from extremes_case import Case, scene

from sim.coupled import CoupledSimulation


def stirred(
    length: float = 1.0, time: float = 1.0, mass: float = 1.0, threads: int = 1, **drag: Any
) -> CoupledSimulation:
    """Beads that fall and collide in a liquid whose lid slides, in a box of 2⁻¹⁰ m and for 2⁻⁷ s, in these units."""
    edge, speed, density = 2.0**-10 * length, length / time, mass / length**3
    table = scene(
        seed=3,
        particles=[{"diameter": 2.0**-13 * length, "density": 2500.0 * density, "count": 80,
                    "velocity": [0.01 * speed, 0.0, -0.05 * speed]}],
        contact={"stiffness": 0.5 * mass / time**2, "restitution": 0.8, "friction": 0.3},
        gravity={"acceleration": [0.0, 0.0, -9.81 * speed / time]},
        walls=[{"name": "box", "shapes": [{"shape": "box", "lowest": [0, 0, 0], "highest": [edge] * 3,
                                           "particles": "inside"}]}],
        time={"duration": 2.0**-7 * time}, output={"interval": 2.0**-8 * time, "precision": "double"},
        fluid={"density": 1000.0 * density, "viscosity": 1e-3 * density * length * speed, "lowest": [0, 0, 0],
               "highest": [edge] * 3, "cells": [4, 4, 4], "largest_step": 2.0**-13 * time,
               "faces": {"+z": {"kind": "wall", "velocity": [0.1 * speed, 0.0, 0.0]}}},
        drag={"law": "blended"} | drag,
    )  # fmt: skip
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        run = CoupledSimulation(table)
        run.advance_to(2 * run.steps_per_snapshot)
    finally:
        numba.set_num_threads(before)
    return run


def numbers(run: CoupledSimulation, length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> np.ndarray:
    """All that the run holds, in its own units."""
    speed, end, fluid = length / time, run.snapshot(), run.fields()
    assert end.series["fluid.steps"] > 60
    parts = (
        end.position / length, end.velocity / speed, end.angular_velocity * time, fluid.velocity / speed,
        fluid.pressure / (mass / length / time**2), fluid.void_fraction,
        end.series["energy.dissipated"] / (mass * speed**2),
    )  # fmt: skip
    return np.concatenate([np.ravel(part) for part in parts])


@cache
def in_si() -> np.ndarray:
    """The run in metres, seconds and kilograms, on one thread."""
    return numbers(stirred())


def alike(length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> tuple[float, str]:
    """The same dimensionless numbers make the same run, to the bit where units are powers of two: share that differ."""
    here, there = in_si(), numbers(stirred(length, time, mass), length, time, mass)
    return float((here != there).mean()), f"{len(here)} numbers"


def twice(threads: int) -> float:
    """Two coupled runs of one seed on one thread and on several: share of the numbers that differ in any bit."""
    if threads > numba.config.NUMBA_NUM_THREADS:
        pytest.skip(f"this machine allows {numba.config.NUMBA_NUM_THREADS} thread")
    return float((in_si() != numbers(stirred(threads=threads))).mean())


def crowded() -> float:
    """Beads that fall on each other past the least void fraction: impulses of both sides cancel, and it is counted."""
    run = stirred(least_void_fraction=0.85)
    c = run.coupling
    assert c.clamped > run.fluid_steps  # more than a cell in every step
    assert run.fields().void_fraction.min() == 0.85
    return float(np.abs(c.impulse[0] + c.impulse[1] + c.owed.sum(axis=0)).max() / np.abs(c.impulse).max())


CASES = [
    Case("whole run", "domain 1e-6 m (2⁻²⁰)", lambda: alike(length=2.0**-10), 0.0),
    Case("whole run", "domain 1e3 m (2¹⁰)", lambda: alike(length=2.0**20), 0.0),
    Case("whole run", "duration 1e-9 s (2⁻³⁰)", lambda: alike(time=2.0**-23), 0.0),
    Case("whole run", "duration 1e4 s (2¹³)", lambda: alike(time=2.0**20), 0.0),
    Case("whole run", "masses 2⁴⁰ ≈ 1e12 times as large", lambda: alike(mass=2.0**40), 0.0),
    Case("whole run", "void fraction at the floor", crowded),
    Case("whole run", "same seed, 1 thread", lambda: twice(1), 0.0),
    Case("whole run", "same seed, 2 threads", lambda: twice(2), 0.0),
]
