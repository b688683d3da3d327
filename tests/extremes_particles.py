"""How many particles there are, how densely they lie, and whether a run can be made again, at their extremes."""

from math import inf, pi, sqrt
from typing import Any

import numba
import numpy as np
import pytest
from extremes_case import Case, scene

from sim import Scene, Simulation, simulation_of
from sim.start import StartState


def packed(fraction: float, count: int = 40, threads: int = 1, seed: int = 1, **where: Any) -> tuple[Any, Any, float]:
    """Spheres of 1 mm in a cube that repeats, all at 0.01 m/s in x: positions before and after 20 steps, and s."""
    edge = (count * pi / 6 / fraction) ** (1 / 3) * 1e-3
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        run = Simulation(
            scene(
                seed=seed,
                particles=[{"diameter": 1e-3, "density": 2500.0, "velocity": [0.01, 0.0, 0.0]}
                           | (where or {"count": count})],
                contact={"restitution": 0.8, "friction": 0.3},
                periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [edge] * 3},
                time={"duration": 1e-3},
                output={"interval": 1e-3, "precision": "double"},
            )
        )  # fmt: skip
        first = run.snapshot().position.copy()
        run.advance_to(20)
        return first, run.snapshot().position.copy(), 20 * run.dt
    finally:
        numba.set_num_threads(before)


def drifting(fraction: float, count: int = 40, **where: Any) -> float:
    """Spheres that move alike never meet: largest departure of a path from v t, over v t."""
    count = len(where["position"]) if where else count
    first, last, time = packed(fraction, count, **where)
    assert len(last) == count
    edge = (count * pi / 6 / fraction) ** (1 / 3) * 1e-3
    way = (last - first + edge / 2) % edge - edge / 2
    return float(np.abs(way - [0.01 * time, 0.0, 0.0]).max() / (0.01 * time))


def lattice(fraction: float) -> float:
    """Spheres of 1 mm on a face-centred lattice of a volume fraction, which move alike."""
    a = (4 * pi / 6 / fraction) ** (1 / 3) * 1e-3
    corners = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), axis=-1).reshape(-1, 1, 3)
    cell = np.array([[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]) + 0.1
    return drifting(fraction, position=(a * (corners + cell)).reshape(-1, 3).tolist())


def as_many_as_said() -> float:
    """Ask for fewer spheres, as the refusal of 0.64 at random says: they fit, and move alike."""
    count = 40
    edge = (count * pi / 6 / 0.64) ** (1 / 3) * 1e-3
    with pytest.raises(ValueError, match="ask for fewer") as refusal:
        packed(0.64, count)
    fits = int(str(refusal.value).split("only about ")[1].split(" of ")[0])
    assert 0.4 * count < fits < count
    return drifting(fits * pi / 6 * 1e-9 / edge**3, count=fits)


def same_bits(threads: int) -> float:
    """Two runs of one seed: share of the numbers that differ in any bit."""
    if threads > numba.config.NUMBA_NUM_THREADS:
        pytest.skip(f"this machine allows {numba.config.NUMBA_NUM_THREADS} thread")
    return float((packed(0.3, 2000)[1] != packed(0.3, 2000, threads=threads)[1]).mean())


def other_seed() -> float:
    """Two seeds give two packings: share of the positions that are equal."""
    return float((packed(0.3, 200)[1] == packed(0.3, 200, seed=2)[1]).mean())


def no_particles(edge: float = 1e-2) -> float:
    """A flow without particles, in a box of this edge (m), is a flow: the liquid at rest stays at rest."""
    run = simulation_of(
        Scene.model_validate(
            {
                "fluid": {"density": 1e3, "viscosity": 1e-3, "lowest": [0, 0, 0], "highest": [edge] * 3,
                          "cells": [4, 4, 4]},
                "time": {"duration": 1e-3}, "output": {"interval": 1e-3},
            }
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    fluid = run.snapshot().fluid
    assert fluid is not None
    return float(np.abs(fluid.velocity).max())


def nothing_at_all() -> float:
    """Neither particles nor fluid."""
    Scene.model_validate({"time": {"duration": 1.0}, "output": {"interval": 0.1}})
    return inf


def too_many() -> float:
    """More particles than memory."""
    simulation_of(
        scene(
            particles=[{"diameter": 1e-3, "density": 2500.0, "count": 10**11}],
            filling={"lowest": [0, 0, 0], "highest": [1e3] * 3},
            time={"duration": 1.0}, output={"interval": 0.1},
        )
    )  # fmt: skip
    return inf


def half_a_million() -> tuple[float, str]:
    """Pairs of spheres on a lattice, every one aslant and at a speed of its own, meet and part.

    Largest error of a restitution, and of the energy that is left, m/2 Σ (V² + e² w²/4) with V the velocity of a pair
    and w its approach; momentum is asserted. The remark is on the memory of the arrays that the run holds.
    """
    side, d, stiffness, e, mass = 63, 1e-3, 1e4, 0.5, 2500.0 * pi / 6 * 1e-9
    n, spacing = side**3, 4 * d
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    approach, drift = rng.uniform(0.5, 1.5, n), rng.normal(scale=0.1, size=(n, 3))
    contact = sqrt(pi**2 + np.log(e) ** 2) * sqrt(mass / 2 / stiffness)
    centre = (np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * spacing
    half, rush = (d + 0.05 * contact) / 2 * axis, approach[:, None] / 2 * axis
    position, velocity = np.concatenate([centre - half, centre + half]), np.concatenate([drift + rush, drift - rush])
    length = 1.2 * contact
    run = Simulation(
        scene(
            particles=[{"diameter": d, "density": 2500.0, "count": 2 * n}],
            contact={"stiffness": stiffness, "restitution": e},
            periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [side * spacing] * 3},
            time={"duration": length}, output={"interval": length, "precision": "double"},
        ),
        StartState(position, velocity, None, np.full(2 * n, d / 2), np.zeros(2 * n, np.int64)),
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    after = run.snapshot()
    assert np.abs((after.velocity - velocity).sum(axis=0)).max() < 1e-12 * np.abs(velocity).sum()
    parting = ((after.velocity[n:] - after.velocity[:n]) * axis).sum(axis=1)
    left = mass * float((drift**2).sum() + e**2 * (approach**2).sum() / 4)
    errors = np.abs(parting / approach - e).max(), abs(after.series["energy.kinetic"] / left - 1.0)
    held = [x for part in (run.particles, run.listed, vars(run).values()) for x in part if isinstance(x, np.ndarray)]
    each = sum(x.nbytes for x in held) / (2 * n)
    return float(max(errors)), f"{2 * n:,} in {run.steps_per_snapshot} steps, arrays of {each:.0f} bytes each"


CASES = [
    Case("particles", "none, in a fluid", no_particles),
    Case("particles", "none, in a box of 1e-6 m", lambda: no_particles(1e-6)),
    Case("particles", "none, in a box of 1e3 m", lambda: no_particles(1e3)),
    Case("particles", "none, and no fluid", nothing_at_all, says="there are none, and no fluid either"),
    Case("particles", "500,000, each meets another", half_a_million, 3e-3),
    Case("particles", "1e11", too_many, says="this machine has"),
    Case("packing", "volume fraction 1e-6", lambda: drifting(1e-6), 1e-8),
    Case("packing", "volume fraction 0.4, at random", lambda: drifting(0.4), 1e-9),
    Case("packing", "volume fraction 0.64, at random", lambda: drifting(0.64), says="fit between the walls"),
    Case("packing", "as many as that refusal says", as_many_as_said, 1e-9),
    Case("packing", "volume fraction 0.64, on a lattice", lambda: lattice(0.64), 1e-9),
    Case("packing", "volume fraction 0.74, on a lattice", lambda: lattice(0.74), 1e-9),
    Case("determinism", "same seed, 1 thread", lambda: same_bits(1), 0.0),
    Case("determinism", "same seed, 2 threads", lambda: same_bits(2), 0.0),
    Case("determinism", "another seed", other_seed, 0.0),
]
