"""Drag, and particles in a fluid, at their extremes."""

from math import inf, pi

import numpy as np
from extremes_case import Case, scene
from scipy.optimize import brentq

from sim.coupled import CoupledSimulation
from sim.drag import BLENDED, DRAG_LAWS, ERGUN_WEN_YU, drag_coefficient

WATER, GRAVITY, DIAMETER = 1e3, 9.81, 1e-3


def drag(re: float) -> float:
    """C_D Re of a lone sphere against Schiller and Naumann's 24 (1 + 0.15 Re^0.687), and 0.44 Re beyond Re 1000."""
    d, rho, mu = 1e-3, 1.2, 1.8e-5
    kappa = drag_coefficient(ERGUN_WEN_YU, re * mu / (rho * d), d, 1.0, rho, mu)
    wanted = 24 * (1 + 0.15 * re**0.687) if re <= 1000 else 0.44 * re
    return abs(kappa * 8 / (pi * d * mu) / wanted - 1.0)


def viscous(viscosity: float) -> float:
    """Stokes' law, 3π μ d, at rest: relative error."""
    kappa = drag_coefficient(ERGUN_WEN_YU, 0.0, DIAMETER, 1.0, WATER, viscosity)
    return abs(kappa / (3 * pi * viscosity * DIAMETER) - 1.0)


def without_slip(void: float) -> float:
    """F/|u − v| of every law as the slip vanishes, and at 0, against the viscous part of its formula."""
    mu, volume = 1e-3, pi / 6 * DIAMETER**3
    lone, packed = 18 * mu / DIAMETER**2, 150 * mu * (1 - void) / (void * DIAMETER**2)
    wen_yu = lone * void**-2.65
    wanted = {
        "ergun-wen-yu": packed if void <= 0.8 else wen_yu,
        "blended": packed if void <= 0.75 else wen_yu,
        "di-felice": lone * 4.8**2 / 24 * void ** (1.0 - 3.7),
    }
    errors = [
        drag_coefficient(law, slip, DIAMETER, void, WATER, mu) / (volume * wanted[name]) - 1.0
        for name, law in DRAG_LAWS.items()
        for slip in (0.0, 1e-30)
    ]
    return float(np.abs(errors).max())


def fast_and_crowded(void: float) -> float:
    """Drag of every law at 10 m/s, where inertia is all: against 1.75 ρ |u − v| V/d, and 0.33 ρ |u − v| ε^−1.65 V/d."""
    slip, volume = 10.0, pi / 6 * DIAMETER**3
    packed, lone = 1.75 * WATER * slip / DIAMETER, 0.33 * WATER * slip / DIAMETER * void**-1.65
    wanted = packed if void <= 0.75 else lone
    laws = (DRAG_LAWS["ergun-wen-yu"], BLENDED)
    return max(abs(drag_coefficient(law, slip, DIAMETER, void, WATER, 1e-9) / (volume * wanted) - 1.0) for law in laws)


def handed_over() -> float:
    """Blended drag where Ergun hands over to Wen and Yu: jump within 1e-12 of void fraction."""
    low, high = (drag_coefficient(BLENDED, 0.1, DIAMETER, 0.8 + x, WATER, 1e-3) for x in (0.0, 1e-12))
    return abs(high / low - 1.0)


def terminal_speed(ratio: float, viscosity: float) -> float:
    """Speed (m/s) at which the drag of a lone sphere carries its weight less buoyancy."""
    weight = abs(ratio - 1.0) * WATER * GRAVITY * pi / 6 * DIAMETER**3

    def surplus(v: float) -> float:
        return float(drag_coefficient(ERGUN_WEN_YU, v, DIAMETER, 1.0, WATER, viscosity)) * v - weight

    return float(brentq(surplus, 0.0, 1e3, xtol=1e-300, rtol=1e-14))


def settling(ratio: float, viscosity: float = 1e-3, steps: int = 50) -> float:
    """A sphere let go in a liquid at rest, one-way, in steps of the fluid: its final speed, and no overshoot."""
    speed = terminal_speed(ratio, viscosity)
    duration = 15 * speed / (GRAVITY * abs(1.0 - 1.0 / ratio))
    edge, step = 30 * max(speed * duration, DIAMETER), duration / (2 * steps)
    mass = ratio * WATER * pi / 6 * DIAMETER**3
    run = CoupledSimulation(
        scene(
            particles=[{"diameter": DIAMETER, "density": ratio * WATER, "position": [[edge / 2] * 3]}],
            contact={"stiffness": 0.1 * mass * (pi / (50 * step)) ** 2},  # nothing is touched
            gravity={"acceleration": [0.0, 0.0, -GRAVITY]},
            time={"duration": duration, "step": step},
            limits={"max_overlap": inf, "max_speed": 1e30},
            output={"interval": duration / steps, "precision": "double"},
            fluid={"density": WATER, "viscosity": viscosity, "lowest": [0, 0, 0], "highest": [edge] * 3,
                   "cells": [3, 3, 3], "step": duration / steps},
            drag={"coupling": "one-way"},
        )
    )  # fmt: skip
    found = []
    for k in range(1, steps + 1):
        run.advance_to(k * run.steps_per_snapshot)
        found.append(abs(float(run.particles.velocity[0, 2])) / speed)
    return max(abs(found[-1] - 1.0), max(found) - 1.0)


def lattice_in(edge: float, cells: int, shift: float = 0.37) -> list[list[float]]:
    """One place in every cell of an edge (m)."""
    at = np.stack(np.meshgrid(*[np.arange(float(cells))] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return ((at + shift) * edge).tolist()


def cloud(ratio: float, viscosity: float = 1e-3) -> float:
    """Spheres in every cell of a box that repeats, two-way, their excess weight carried by a pressure gradient.

    Void fraction and velocities are the same everywhere: the slip is that at which κ |u − v| = V ε |ρ_p − ρ_f| g, and
    the momentum of both together stays zero.
    """
    share, cells, volume = 0.1, 3, pi / 6 * DIAMETER**3
    edge, void = (volume / share) ** (1 / 3), 1.0 - share
    excess = (ratio - 1.0) * WATER * GRAVITY

    def surplus(slip: float) -> float:
        kappa = float(drag_coefficient(BLENDED, slip, DIAMETER, void, WATER, viscosity))
        return kappa * slip - volume * void * abs(excess)

    slip = float(brentq(surplus, 0.0, 1e3, xtol=1e-300, rtol=1e-14))
    inertia = 1.0 / (1.0 / (ratio * WATER * share) + 1.0 / (WATER * void))  # of slip, kg/m³
    duration = 12 * slip * inertia / (share * void * abs(excess))
    steps = max(60, 2 * int(slip * duration / edge))
    step = duration / (2 * steps)
    mass = ratio * WATER * volume
    run = CoupledSimulation(
        scene(
            particles=[{"diameter": DIAMETER, "density": ratio * WATER, "position": lattice_in(edge, cells)}],
            contact={"stiffness": 0.1 * mass * (pi / (50 * step)) ** 2},
            gravity={"acceleration": [0.0, 0.0, -GRAVITY]},
            periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [cells * edge] * 3},
            time={"duration": duration, "step": step},
            limits={"max_overlap": inf, "max_speed": 1e30},
            output={"interval": duration, "precision": "double"},
            fluid={"density": WATER, "viscosity": viscosity, "lowest": [0, 0, 0], "highest": [cells * edge] * 3,
                   "cells": [cells] * 3, "step": duration / steps, "pressure_gradient": [0.0, 0.0, -share * excess]},
            drag={"law": "blended"},
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    particles, fluid = run.particles.velocity[:, 2], run.fields().velocity[..., 2]
    momentum = (share * ratio * particles.mean() + void * fluid.mean()) / (share * ratio * np.abs(particles).mean())
    return max(abs(float(abs(particles.mean() - fluid.mean()) / slip - 1.0)), abs(float(momentum)))


def at_rest_together(speed: float, coupling: str) -> float:
    """Spheres and fluid that move alike: no force, nothing lost; largest change of a velocity, over the speed or 1."""
    edge, cells = 2e-3, 3
    run = CoupledSimulation(
        scene(
            particles=[{"diameter": DIAMETER, "density": 2500.0, "position": lattice_in(edge, cells),
                        "velocity": [speed, 0.0, 0.0]}],
            contact={"stiffness": 1e3},
            periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [cells * edge] * 3},
            time={"duration": 1e-3}, output={"interval": 1e-3, "precision": "double"},
            fluid={"density": WATER, "viscosity": 1e-3, "lowest": [0, 0, 0], "highest": [cells * edge] * 3,
                   "cells": [cells] * 3, "velocity": [speed, 0.0, 0.0]},
            drag={"coupling": coupling},
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    along = np.array([speed, 0.0, 0.0])
    changes = np.abs(run.particles.velocity - along).max(), np.abs(run.fields().velocity - along).max()
    scale, mass = speed or 1.0, 2500.0 * pi / 6 * DIAMETER**3
    forced = np.abs(run.coupling.impulse).max() / (mass * scale), np.abs(run.coupling.work).max() / (mass * scale**2)
    return float(max(*changes, *(cells**3 * x for x in forced))) / scale


def at_the_floor() -> float:
    """Flow through fixed spheres denser than the least void fraction: n κ(u, ε_least) u V = −ε_least dp/dx V, steady.

    A face-centred lattice with smaller spheres in its octahedral and tetrahedral holes, void fraction 0.19, in cells
    of the lattice's own edge: every cell is alike.
    """
    edge, cells, least, viscosity, pressure = 1.42e-3, 3, 0.2, 1e-3, 1e5
    face = [[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]
    octahedral = [[0.5, 0.5, 0.5], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]
    tetrahedral = [[x, y, z] for x in (0.25, 0.75) for y in (0.25, 0.75) for z in (0.25, 0.75)]
    large = edge / 2**0.5
    sizes = {"large": large, "middle": edge - large, "small": edge * 3**0.5 / 2 - large}
    sites = {"large": face, "middle": octahedral, "small": tetrahedral}
    origins = np.array(lattice_in(edge, cells, 0.1)).reshape(-1, 1, 3)
    beads = [
        {"name": name, "diameter": 0.999 * sizes[name], "density": 2500.0, "fixed": True,
         "position": (origins + edge * np.array(sites[name])).reshape(-1, 3).tolist()}
        for name in sizes
    ]  # fmt: skip

    def surplus(u: float) -> float:
        drag = sum(
            len(sites[name]) * float(drag_coefficient(ERGUN_WEN_YU, u, 0.999 * d, least, WATER, viscosity)) * u
            for name, d in sizes.items()
        )
        return drag - least * pressure * edge**3

    speed = float(brentq(surplus, 0.0, 10.0, xtol=1e-300, rtol=1e-14))
    duration = 30 * speed * WATER / pressure
    run = CoupledSimulation(
        scene(
            particles=beads,
            periodic={"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [cells * edge] * 3},
            time={"duration": duration, "step": duration / 1000}, output={"interval": duration, "precision": "double"},
            contact={"stiffness": 1e-3}, limits={"max_overlap": inf},
            fluid={"density": WATER, "viscosity": viscosity, "lowest": [0, 0, 0], "highest": [cells * edge] * 3,
                   "cells": [cells] * 3, "pressure_gradient": [-pressure, 0.0, 0.0], "step": duration / 100},
            drag={"least_void_fraction": least},
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    assert run.coupling.clamped >= run.fluid_steps * cells**3  # every cell, every step
    return float(np.abs(run.fields().velocity[..., 0] / speed - 1.0).max())


CASES = [
    *(Case("drag", f"Re_p 1e{p}", lambda p=p: drag(10.0**p)) for p in (-8, -3, 0, 2, 6)),
    *(Case("drag", f"viscosity {mu:g} Pa s", lambda mu=mu: viscous(mu)) for mu in (1e-6, 1e-3, 1.0, 1e3)),
    *(Case("drag", f"void fraction {e:g}, slip 0", lambda e=e: without_slip(e)) for e in (0.2, 1.0)),
    *(Case("drag", f"void fraction {e:g}, slip 10 m/s", lambda e=e: fast_and_crowded(e), 1e-7) for e in (0.2, 1.0)),
    Case("drag", "void fraction 0.8, blended", handed_over, 1e-10),
    *(Case("settling", f"viscosity {mu:g} Pa s", lambda mu=mu: settling(2.5, mu), 1e-6) for mu in (1e-6, 1e-3, 1, 1e3)),
    *(Case("settling", f"density ratio {r:g}", lambda r=r: settling(r), 1e-6) for r in (1e-3, 0.5, 1e4)),
    Case("settling", "density ratio 1e-3, Re_p 2e5", lambda: settling(1e-3, 1e-6), 1e-6),
    Case("cloud, two-way", "slip 0, at rest", lambda: at_rest_together(0.0, "two-way"), 0.0),
    Case("cloud, one-way", "slip 0, both at 1 m/s", lambda: at_rest_together(1.0, "one-way"), 1e-10),
    *(Case("cloud, two-way", f"viscosity {mu:g} Pa s", lambda mu=mu: cloud(2.5, mu), 1e-5) for mu in (1e-6, 1, 1e3)),
    Case("cloud, two-way", "density ratio 1e4", lambda: cloud(1e4), 1e-5),
    Case("cloud, two-way", "density ratio 0.5", lambda: cloud(0.5), 1e-5),
    Case("cloud, two-way", "density ratio 1e-3", lambda: cloud(1e-3), says="is too light for a fluid of 1000 kg/m³"),
    Case("bed, two-way", "void fraction at the floor", at_the_floor, 1e-8),
]
