"""Contacts, friction, falls and blows at their extremes."""

from math import inf, pi, sqrt

import numpy as np
from extremes_case import Case, scene

from sim import Simulation, simulate
from sim.state import Snapshot


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


def one_rebound() -> float:
    """Rebounds in steps of a fiftieth of the contact, stiffness over 8 decades: how far apart their restitutions."""
    errors = [head_on(10.0**p, restitution=0.6, speed=1.0, sizes=(2.0, 2.0)) for p in range(6, 15)]
    return max(errors) - min(errors)


def sticking(restitution: float) -> float:
    """Spheres meet aslant and never slide, k_t/k = η_t/η = 2/7: slip is to its spring what approach is to its own.

    Both are reversed with the same restitution e: slip afterwards is −e of that before. Largest error of either, over
    what it was before; angular momentum about the centre is asserted.
    """
    d, density, stiffness, normal, along = 2e-3, 2500.0, 1e12, 1.0, 2.0
    mass = density * pi / 6 * d**3
    contact = pi * sqrt(mass / 2 / stiffness)
    length = (12 if restitution < 0.1 else 2) * contact
    run = Simulation(
        scene(
            particles=[{"diameter": d, "density": density,
                        "position": [[0, 0, 0], [d + 0.1 * normal * contact, -0.1 * along * contact, 0]],
                        "velocity": [[normal / 2, -along / 2, 0], [-normal / 2, along / 2, 0]]}],
            contact={"stiffness": stiffness, "restitution": restitution, "friction": 10.0,
                     "tangential_stiffness_ratio": 2 / 7, "tangential_damping_ratio": 2 / 7},
            time={"duration": length, "step": contact / 400}, output={"interval": length, "precision": "double"},
        )
    )  # fmt: skip
    before = run.snapshot()
    run.advance_to(run.steps_per_snapshot)
    after = run.snapshot()

    def turning(s: Snapshot) -> float:
        own = 0.1 * mass * d**2 * s.angular_velocity[:, 2].sum()
        return float(own + mass * np.cross(s.position, s.velocity)[:, 2].sum())

    assert abs(turning(after) / turning(before) - 1.0) < 1e-9
    v, w = after.velocity, after.angular_velocity[:, 2]
    line = after.position[1] - after.position[0]
    n = line / np.linalg.norm(line)
    t = np.array([-n[1], n[0], 0.0])
    apart = float((v[1] - v[0]) @ n)
    slip = float((v[1] - v[0]) @ t) - d / 2 * float(w.sum())
    return max(abs(apart / normal - restitution), abs(slip / along + restitution))


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


def moments(duration: float, intervals: int) -> float:
    """A run of a free particle, as written: largest error of a time or of v t, over the duration."""
    step = duration / intervals / 2
    mass, speed = 2500.0 * pi / 6 * 1e-9, 1e-3 / duration
    table = scene(
        particles=[{"diameter": 1e-3, "density": 2500.0, "position": [[0, 0, 0]], "velocity": [speed, 0, 0]}],
        contact={"stiffness": 0.1 * mass * (pi / (50 * step)) ** 2},
        limits={"max_overlap": inf, "max_speed": 1e30},
        time={"duration": duration, "step": step},
        output={"interval": duration / intervals, "precision": "double"},
    )
    found = np.array([(s.time / duration, s.position[0, 0] / 1e-3) for s in simulate(table)])
    wanted = np.linspace(0.0, 1.0, intervals + 1)
    assert len(found) == len(wanted)
    return float(np.abs(found - wanted[:, None]).max())


def sliding(friction: float) -> float:
    """A sphere thrown along a floor: 5/7 of its speed is left when it rolls, whatever the friction.

    A damped spring, so that what is left of the twist in the contact dies away.
    """
    radius, density, speed, stiffness = 5e-4, 1e4, 0.1, 1e4
    weight = density * 4 / 3 * pi * radius**3 * 9.81
    duration = 0.0 if friction == 0.0 else 3.0 / 7 * speed / (friction * 9.81)
    duration = max(duration, 2e-3)
    run = Simulation(
        scene(
            particles=[{"diameter": 2 * radius, "density": density, "position": [[0, 0, radius - weight / stiffness]],
                        "velocity": [[speed, 0, 0]]}],
            contact={"stiffness": stiffness, "friction": friction, "restitution": 0.5},
            gravity={"acceleration": [0, 0, -9.81]},
            time={"duration": duration}, output={"interval": duration, "precision": "double"},
            walls=[{"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}],
        )
    )  # fmt: skip
    run.advance_to(run.steps_per_snapshot)
    left = 1.0 if friction == 0.0 else 5 / 7
    return abs(float(run.snapshot().velocity[0, 0]) / (left * speed) - 1.0)


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


CASES = [
    Case("contact", "restitution 1", head_on, 1e-4),
    Case("contact", "restitution 1e-3", lambda: head_on(restitution=1e-3), 5e-4),
    Case("contact", "restitution 0", lambda: head_on(restitution=0.0), says="greater than or equal to 0.001"),
    Case("contact", "restitution 1, aslant, sticking", lambda: sticking(1.0), 1e-4),
    Case("contact", "restitution 1e-3, aslant, sticking", lambda: sticking(1e-3), 2e-4),
    *(Case("contact", f"stiffness 1e{p} N/m", lambda p=p: head_on(10.0**p, speed=0.01), 1e-4) for p in range(0, 9, 2)),
    Case("contact", "stiffness over 8 decades: one rebound", one_rebound, 1e-6),
    Case("contact", "stiffness 1 N/m at 1 m/s", lambda: head_on(1.0), says="limits.max_speed"),
    Case("contact", "size ratio 10", lambda: head_on(sizes=(1e-3, 1e-2)), 1e-4),
    Case("contact", "density ratio 1e-3", lambda: head_on(density=(2.5, 2500.0)), 1e-4),
    Case("contact", "density ratio 1e4", lambda: head_on(density=(25000.0, 2.5)), 1e-4),
    Case("contact", "particles of 1 µm", lambda: head_on(sizes=(1e-6, 1e-6), stiffness=1.0), 1e-4),
    Case("contact", "particles of 10 m", lambda: head_on(sizes=(10.0, 10.0), stiffness=1e8), 1e-4),
    Case("friction", "coefficient 0", lambda: sliding(0.0)),
    Case("friction", "coefficient 10", lambda: sliding(10.0), 1e-4),
    Case("friction", "coefficient 10.1", lambda: sliding(10.1), says="less than or equal to 10"),
    Case("gravity", "time 1e-9 s", lambda: free_fall(1e-9)),
    Case("gravity", "time 1e4 s", lambda: free_fall(1e4)),
    Case("gravity", "one particle", lambda: free_fall(0.1)),
    Case("time", "1e-9 s, a snapshot every 1e-10 s", lambda: moments(1e-9, 10)),
    Case("time", "1e4 s, in 4 steps", lambda: moments(1e4, 2)),
    Case("rotor", "0 rpm", lambda: struck(0.0)),
    Case("rotor", "20,000 rpm", lambda: struck(20000.0), 5e-4),
]
