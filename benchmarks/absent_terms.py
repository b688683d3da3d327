"""What friction and rolling cost a step, which a scene without them does not pay: `python benchmarks/absent_terms.py`.

The same bed of 900 pressed spheres with neither, with friction, and with both: least processor time of stretches of 150
steps, taken in turn.
"""

import time

import numpy as np

from sim import Scene, Simulation

N, D, STEPS, TURNS = 900, 1e-3, 150, 15
CASES = {"plain": {}, "friction": {"friction": 0.3}, "and rolling": {"friction": 0.3, "rolling": {"friction": 0.01}}}


def bed(**contact):
    """Spheres on a cubic lattice that repeats, each pressed against its neighbours by a hundredth of a radius."""
    places = np.stack(np.meshgrid(*[np.arange(k) for k in (10, 10, 9)], indexing="ij"), axis=-1).reshape(-1, 3)
    box = {"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [9.95 * D, 9.95 * D, 8.955 * D]}
    return Scene.model_validate(
        {
            "particles": [{"diameter": D, "density": 2500.0, "position": ((places + 0.5) * 0.995 * D).tolist()}],
            "contact": {"stiffness": 1e4, "restitution": 0.5, **contact},
            "time": {"duration": 0.1}, "output": {"interval": 0.1}, "periodic": box,
        }
    )  # fmt: skip


def seconds_of(run):
    """Advance by a stretch; return its processor time, s."""
    began = time.process_time()
    run.advance_to(run.step + STEPS)
    return time.process_time() - began


def main():
    runs = {name: Simulation(bed(**contact)) for name, contact in CASES.items()}
    for run in runs.values():
        run.advance_to(20)  # compiles
    turns = [[seconds_of(run) for run in runs.values()] for _ in range(TURNS)]
    taken = dict(zip(runs, np.min(turns, axis=0), strict=True))
    for name, seconds in taken.items():
        print(
            f"{name:<12} {1e9 * seconds / STEPS / N:5.0f} ns a particle and step, {seconds / taken['plain']:.2f} times"
        )


if __name__ == "__main__":
    main()
