"""Every law at its extremes: exact, within a gate, or refused with a message; `python tests/test_extremes.py` tells.

That command writes docs/extremes.md from what it measures; a test holds the table to these cases.
"""

from collections.abc import Callable
from math import inf, pi
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from pod import SnapshotMatrix, lanczos_pod
from sim import LimitError, Scene, Simulation, simulation_of
from sim.drag import BLENDED, DRAG_LAWS, ERGUN_WEN_YU, drag_coefficient
from suffice.run import Run
from suffice.store import RunWriter
from surrogates import SURROGATES

TABLE = Path(__file__).parents[1] / "docs" / "extremes.md"
EXACT, GATE, REFUSED = "exact", "within gate", "refused"
ROUNDING = 1e-12  # relative: what counts as exact


class Case(NamedTuple):
    """A law at an extreme; `measure` returns a relative error, or raises the refusal."""

    law: str
    extreme: str
    measure: Callable[[], float]
    gate: float = ROUNDING  # largest relative error
    says: str = ""  # of a refusal

    @property
    def outcome(self) -> str:
        """What must come out."""
        return REFUSED if self.says else EXACT if self.gate <= ROUNDING else GATE


def scene(**tables: Any) -> Scene:
    """Elastic contacts without an overlap limit, changed by the tables given."""
    contact = {"stiffness": 1e4, "restitution": 1.0} | tables.pop("contact", {})
    return Scene.model_validate({"contact": contact, "limits": {"max_overlap": inf}} | tables)


def head_on(
    stiffness: float = 1e4,
    restitution: float = 1.0,
    sizes: tuple[float, float] = (2e-3, 2e-3),
    density: tuple[float, float] = (2500.0, 2500.0),
    speed: float = 1.0,
    friction: float = 0.0,
) -> float:
    """Two spheres meet: relative error of the restitution found."""
    mass = [rho * pi / 6 * d**3 for rho, d in zip(density, sizes, strict=True)]
    contact = pi * (mass[0] * mass[1] / (mass[0] + mass[1]) / stiffness) ** 0.5
    reach = sum(sizes) / 2
    starts = (0.0, reach + 0.2 * speed * contact)
    beads = [
        {"name": name, "diameter": d, "density": rho, "position": [[z, 0.0, 0.0]], "velocity": [[v, 0.0, 0.0]]}
        for name, d, rho, z, v in zip("ab", sizes, density, starts, (speed, 0.0), strict=True)
    ]  # fmt: skip
    length = (12 if restitution < 0.1 else 3) * contact
    run = Simulation(
        scene(
            particles=beads,
            contact={"stiffness": stiffness, "restitution": restitution, "friction": friction},
            time={"duration": length},
            output={"interval": length, "precision": "double"},
        )
    )
    run.advance_to(run.steps_per_snapshot)
    velocity = run.snapshot().velocity[:, 0]
    momentum = abs(np.dot(mass, velocity) / (mass[0] * speed) - 1.0)
    assert momentum < 1e-12
    return abs(float(velocity[1] - velocity[0]) / speed - restitution)


def free_fall(duration: float) -> float:
    """Fall of one particle from rest in a thousand steps: relative error of g t²/2."""
    mass, fall, step = 2500.0 * pi / 6 * 1e-9, 9.81, duration / 1000
    run = Simulation(
        scene(
            particles=[{"diameter": 1e-3, "density": 2500.0, "position": [[0.0, 0.0, 0.0]]}],
            contact={"stiffness": 0.1 * mass * (pi / (50 * step)) ** 2},  # nothing is touched
            gravity={"acceleration": [0.0, 0.0, -fall]},
            time={"duration": duration, "step": step},
            limits={"max_overlap": inf, "max_speed": 1e30},
            output={"interval": duration, "precision": "double"},
        )
    )
    run.advance_to(run.steps_per_snapshot)
    return abs(float(run.snapshot().position[0, 2]) / (-0.5 * fall * duration**2) - 1.0)


def sliding(friction: float) -> float:
    """A sphere thrown along a floor: 5/7 of its speed is left when it rolls, whatever the friction."""
    radius, density, speed, stiffness = 5e-4, 1e4, 0.1, 1e4
    weight = density * 4 / 3 * pi * radius**3 * 9.81
    duration = 0.0 if friction == 0.0 else 3.0 / 7 * speed / (friction * 9.81)
    duration = max(duration, 2e-3)
    run = Simulation(
        scene(
            particles=[{"diameter": 2 * radius, "density": density, "position": [[0, 0, radius - weight / stiffness]],
                        "velocity": [[speed, 0, 0]]}],
            contact={"stiffness": stiffness, "friction": friction},
            gravity={"acceleration": [0, 0, -9.81]},
            time={"duration": duration}, output={"interval": duration, "precision": "double"},
            walls=[{"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}],
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    left = 1.0 if friction == 0.0 else 5 / 7
    return abs(float(run.snapshot().velocity[0, 0]) / (left * speed) - 1.0)


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


def drifting(fraction: float, **where: Any) -> float:
    """Spheres that move alike never meet: largest departure of a path from v t, over v t."""
    count = len(where["position"]) if where else 40
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


def struck(rpm: float) -> float:
    """A rod that turns about z strikes a bead at rest, 20 mm off the axis: it leaves at twice the rod's speed there."""
    speed, gap = rpm * pi / 30 * 0.02, 1e-5
    mass = 2500.0 * pi / 6 * 1e-9
    contact = pi * (mass / 1e8) ** 0.5
    duration = 4 * contact + (gap / speed if speed else 0.0)
    run = Simulation(
        scene(
            particles=[{"diameter": 1e-3, "density": 2500.0, "position": [[0.02, 2.5e-3 + gap, 0.0]]}],
            contact={"stiffness": 1e8},
            time={"duration": duration}, output={"interval": duration, "precision": "double"},
            walls=[{"name": "rotor", "motion": {"kind": "rotation", "axis": [0, 0, 1], "point": [0, 0, 0], "rpm": rpm},
                    "shapes": [{"shape": "cylinder", "axis": [1, 0, 0], "centre": [0.02, 0, 0], "radius": 0.002,
                                "length": 0.02, "particles": "outside"}]}],
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    left = float(np.linalg.norm(run.snapshot().velocity[0]))
    return left if rpm == 0.0 else abs(left / (2 * speed) - 1.0)


def drag(re: float) -> float:
    """C_D Re of a lone sphere against Schiller and Naumann's 24 (1 + 0.15 Re^0.687), and 0.44 Re beyond Re 1000."""
    d, rho, mu = 1e-3, 1.2, 1.8e-5
    kappa = drag_coefficient(ERGUN_WEN_YU, re * mu / (rho * d), d, 1.0, rho, mu)
    wanted = 24 * (1 + 0.15 * re**0.687) if re <= 1000 else 0.44 * re
    return abs(kappa * 8 / (pi * d * mu) / wanted - 1.0)


def viscous(viscosity: float) -> float:
    """Stokes' law, 3π μ d, at rest: relative error."""
    kappa = drag_coefficient(ERGUN_WEN_YU, 0.0, 1e-3, 1.0, 1e3, viscosity)
    return abs(kappa / (3 * pi * viscosity * 1e-3) - 1.0)


def crowded(void: float) -> float:
    """Drag of every law at a void fraction, from a slip of exactly 0 to 10 m/s: finite and positive."""
    found = [drag_coefficient(law, u, 1e-3, void, 1e3, 1e-3) for law in DRAG_LAWS.values() for u in (0.0, 1e-9, 10.0)]
    return 0.0 if np.isfinite(found).all() and min(found) > 0.0 else inf


def handed_over() -> float:
    """Blended drag where Ergun hands over to Wen and Yu: jump within 1e-12 of void fraction."""
    low, high = (drag_coefficient(BLENDED, 0.1, 1e-3, 0.8 + x, 1e3, 1e-3) for x in (0.0, 1e-12))
    return abs(high / low - 1.0)


def spectrum(decades: float, scale: float = 1.0) -> float:
    """Snapshots whose 20 singular values fall over so many decades: relative error of the first five eigenvalues."""
    rng = np.random.default_rng(0)
    left = np.linalg.qr(rng.normal(size=(400, 20)))[0]
    right = rng.normal(size=(60, 20))
    right = np.linalg.qr(right - right.mean(axis=0))[0]
    sigma = scale * 10.0 ** -np.linspace(0.0, decades, 20)
    basis = lanczos_pod(SnapshotMatrix((left * sigma) @ right.T), modes=5)
    return float(np.max(np.abs(basis.values * 60 / sigma[:5] ** 2 - 1.0)))


def coefficients(scale: float) -> float:
    """A spline through coefficients of a scale: relative error between the snapshots of a sine."""
    times = np.linspace(0.0, 1.0, 201)
    found = SURROGATES["spline"]().fit(times, scale * np.sin(6 * times)[:, None]).predict([0.3333])
    return abs(float(found[0, 0]) / (scale * np.sin(6 * 0.3333)) - 1.0)


def stored(precision: str) -> float:
    """Positions written and read back in a precision: largest relative error."""
    position = np.random.default_rng(0).uniform(1.0, 2.0, (50, 3))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        with RunWriter(path, ids=np.arange(50), radius=np.full(50, 0.1), species=np.zeros(50), n_snapshots=1,
                       provenance={}, variables=("position",), precision=precision) as run:  # fmt: skip
            run.append(0.0, {"position": position})
        with Run(path) as back:
            return float(np.max(np.abs(back.snapshot(0).values["position"] / position - 1.0)))


def many_snapshots(count: int) -> float:
    """Write a run of so many snapshots and read it back, all times and the last positions."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        with RunWriter(path, ids=[0], radius=[0.1], species=[0], n_snapshots=count, provenance={},
                       variables=("position",), precision="double", beside=True) as run:  # fmt: skip
            for k in range(count):
                run.append(1e-3 * k, {"position": np.full((1, 3), float(k))})
        with Run(path) as back:
            lost = count - back.n_snapshots + abs(float(back.variable("position.x")[0:1][0, -1]) - (count - 1))
            return lost + float(np.abs(back.times - 1e-3 * np.arange(count)).max())


CASES = [
    Case("contact", "restitution 1", head_on, 1e-4),
    Case("contact", "restitution 1e-3", lambda: head_on(restitution=1e-3), 5e-4),
    Case("contact", "restitution 0", lambda: head_on(restitution=0.0), says="greater than or equal to 0.001"),
    *(Case("contact", f"stiffness 1e{p} N/m", lambda p=p: head_on(10.0**p, speed=0.01), 1e-4) for p in (0, 2, 4, 6, 8)),
    Case("contact", "stiffness 1 N/m at 1 m/s", lambda: head_on(1.0), says="limits.max_speed"),
    Case("contact", "size ratio 10", lambda: head_on(sizes=(1e-3, 1e-2)), 1e-4),
    Case("contact", "density ratio 1e-3", lambda: head_on(density=(2.5, 2500.0)), 1e-4),
    Case("contact", "density ratio 1e4", lambda: head_on(density=(25000.0, 2.5)), 1e-4),
    Case("contact", "particles of 1 µm", lambda: head_on(sizes=(1e-6, 1e-6), stiffness=1.0), 1e-4),
    Case("contact", "particles of 10 m", lambda: head_on(sizes=(10.0, 10.0), stiffness=1e8), 1e-4),
    Case("friction", "coefficient 0", lambda: sliding(0.0)),
    Case("friction", "coefficient 10", lambda: sliding(10.0), 3e-2),
    Case("friction", "coefficient 10.1", lambda: sliding(10.1), says="less than or equal to 10"),
    Case("gravity", "time 1e-9 s", lambda: free_fall(1e-9), 1e-9),
    Case("gravity", "time 1e4 s", lambda: free_fall(1e4), 1e-9),
    Case("gravity", "one particle", lambda: free_fall(0.1), 1e-9),
    Case("particles", "none, in a fluid", no_particles),
    Case("particles", "none, in a box of 1e-6 m", lambda: no_particles(1e-6)),
    Case("particles", "none, in a box of 1e3 m", lambda: no_particles(1e3)),
    Case("particles", "none, and no fluid", nothing_at_all, says="there are none, and no fluid either"),
    Case("particles", "1e11", too_many, says="this machine has"),
    Case("packing", "volume fraction 1e-6", lambda: drifting(1e-6), 1e-8),
    Case("packing", "volume fraction 0.4, at random", lambda: drifting(0.4), 1e-9),
    Case("packing", "volume fraction 0.64, at random", lambda: drifting(0.64), says="fit between the walls"),
    Case("packing", "volume fraction 0.64, on a lattice", lambda: lattice(0.64), 1e-9),
    Case("packing", "volume fraction 0.74, on a lattice", lambda: lattice(0.74), 1e-9),
    Case("determinism", "same seed, 1 thread", lambda: same_bits(1), 0.0),
    Case("determinism", "same seed, 2 threads", lambda: same_bits(2), 0.0),
    Case("determinism", "another seed", other_seed, 0.0),
    Case("rotor", "0 rpm", lambda: struck(0.0)),
    Case("rotor", "20,000 rpm", lambda: struck(20000.0), 3e-2),
    *(Case("drag", f"Re_p 1e{p}", lambda p=p: drag(10.0**p), 1e-9) for p in (-8, -3, 0, 2, 6)),
    *(Case("drag", f"viscosity {mu:g} Pa s", lambda mu=mu: viscous(mu)) for mu in (1e-6, 1e-3, 1.0, 1e3)),
    Case("drag", "void fraction 0.2, slip 0 to 10 m/s", lambda: crowded(0.2)),
    Case("drag", "void fraction 1, slip 0 to 10 m/s", lambda: crowded(1.0)),
    Case("drag", "void fraction 0.8, blended", handed_over, 1e-9),
    Case("POD", "flat spectrum", lambda: spectrum(0.0), 1e-10),
    Case("POD", "singular values over 8 decades", lambda: spectrum(8.0), 1e-8),
    Case("POD", "singular values over 16 decades", lambda: spectrum(16.0), 1e-6),
    Case("POD", "snapshots of 1e-12 m", lambda: spectrum(2.0, 1e-12), 1e-10),
    Case("POD", "snapshots of 1e12 m", lambda: spectrum(2.0, 1e12), 1e-10),
    Case("surrogate", "coefficients of 1e-12", lambda: coefficients(1e-12), 1e-6),
    Case("surrogate", "coefficients of 1e12", lambda: coefficients(1e12), 1e-6),
    Case("run", "single precision", lambda: stored("single"), 6e-8),
    Case("run", "double precision", lambda: stored("double"), 0.0),
    Case("run", "5,000 snapshots", lambda: many_snapshots(5000)),
]


def answer(case: Case) -> tuple[str, str]:
    """Return the outcome of a case, and the figure or message that tells it."""
    try:
        error = case.measure()
    except (ValueError, LimitError) as refusal:  # InputError, Refusal and pydantic's are ValueErrors
        said = str(refusal)
        assert case.says, said
        assert case.says in said, said
        return REFUSED, f"… {case.says} …"
    assert not case.says, f"not refused; error {error:g}"
    assert error <= case.gate, f"relative error {error:.3g}, gate {case.gate:g}"
    return case.outcome, f"{error:.1e} ≤ {case.gate:g}" if case.outcome == GATE else ""


@pytest.mark.physics
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.law}: {case.extreme}")
def test_every_law_is_exact_within_its_gate_or_refused_at_its_extremes(case):
    answer(case)


def test_the_table_in_the_docs_tells_these_cases():
    rows = [line.split(" | ")[:3] for line in TABLE.read_text().splitlines() if line.startswith("| ")][1:]
    assert rows == [[f"| {case.law}", case.extreme, case.outcome] for case in CASES]


def write_table() -> None:
    """Measure every case and write the table."""
    about = (
        "Made by `python tests/test_extremes.py`, which fails where a case does not hold. *Exact* is to 1e-12 relative",
        "or to the bit; *within gate* gives relative error and gate; *refused* what the message says.",
    )
    lines = ["# Extremes", "", *about, "", "| law | extreme | outcome | figure or message |", "|---|---|---|---|"]
    for case in CASES:
        outcome, told = answer(case)
        lines.append(f"| {case.law} | {case.extreme} | {outcome} | {told} |")
    TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    write_table()
