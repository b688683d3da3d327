"""Momentum, angular momentum and energy of particles that only touch each other."""

from math import log2, pi

import numpy as np
import pytest

from sim import Simulation


def totals(snapshot, mass, inertia):
    linear = mass[:, None] * snapshot.velocity
    angular = np.cross(snapshot.position, linear)
    if snapshot.angular_velocity is not None:
        angular = angular + inertia[:, None] * snapshot.angular_velocity
    return linear.sum(axis=0), angular.sum(axis=0), np.abs(linear).sum(), np.abs(angular).sum()


@pytest.mark.parametrize("restitution", [1.0, 0.6])
@pytest.mark.parametrize("friction", [0.2, 2.0])
def test_pair_of_unequal_spheres_keeps_momentum_and_angular_momentum(scene_of, restitution, friction):
    small, large = 1e-3, 3e-3
    scene = scene_of(
        particles=[
            {"diameter": small, "density": 6050.0, "position": [[0.0, 0.0, 0.0]], "velocity": [[0.7, 0.9, -0.2]],
             "angular_velocity": [[300.0, -50.0, 900.0]]},
            {"diameter": large, "density": 1500.0, "position": [[2.03e-3, 4e-4, -1e-4]], "velocity": [[-0.9, 0.1, 0.3]],
             "angular_velocity": [[-100.0, 250.0, 40.0]]},
        ],
        contact={"restitution": restitution, "friction": friction},
        time={"duration": 1.2e-4},
        output={"interval": 1.2e-4},
    )  # fmt: skip
    run = Simulation(scene)
    mass = np.array([6050.0 * pi * small**3 / 6, 1500.0 * pi * large**3 / 6])
    inertia = 0.4 * mass * np.array([small / 2, large / 2]) ** 2
    before = run.snapshot()
    run.advance_to(run.steps_per_snapshot)
    after = run.snapshot()
    assert np.abs(after.velocity - before.velocity).max() > 0.3  # they did collide
    p0, l0, p_scale, l_scale = totals(before, mass, inertia)
    p1, l1, _, _ = totals(after, mass, inertia)
    assert np.abs(p1 - p0).max() < 1e-12 * p_scale
    assert np.abs(l1 - l0).max() < 1e-10 * l_scale


def gas(scene_of, steps_per_contact, duration, seed):
    """64 elastic spheres in an elastic box; return the simulation at the end."""
    rng = np.random.default_rng(seed)
    sites = np.stack(np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij"), -1).reshape(-1, 3)
    mass = 2500 * pi * 1e-3**3 / 6
    contact = pi * np.sqrt(mass / 2 / 1e4)
    scene = scene_of(
        particles=[
            {"diameter": 1e-3, "density": 2500.0, "position": (1.5e-3 * sites + 1e-3).tolist(),
             "velocity": rng.normal(0.0, 1.0, (64, 3)).tolist()}
        ],
        time={"duration": duration, "step": contact / steps_per_contact},
        output={"interval": duration},
        walls=[{"name": "box", "shapes": [{"shape": "box", "lowest": [0, 0, 0], "highest": [6.5e-3] * 3,
                                           "particles": "inside"}]}],
    )  # fmt: skip
    return Simulation(scene)


def energy_drift(scene_of, steps_per_contact):
    """Root mean square, over gases, of the relative change of energy after some hundreds of collisions.

    The energy of the springs swings within every contact by (ω dt)²/8 of what it holds, which is no drift: the last
    samples are averaged.
    """
    drifts = []
    for seed in range(6):
        run = gas(scene_of, steps_per_contact, 0.005, seed)
        energies = []
        for k in range(21):
            run.advance_to(k * run.steps_per_snapshot // 20)
            now = run.ledger()[0]
            energies.append(now.kinetic + now.elastic)
        drifts.append(np.mean(energies[-5:]) / energies[0] - 1)
    return float(np.sqrt(np.mean(np.square(drifts))))


def test_conservative_gas_keeps_its_energy_and_better_with_the_square_of_the_step(scene_of):
    coarse, middle, fine = (energy_drift(scene_of, steps) for steps in (50, 100, 200))
    assert coarse < 2e-4
    assert middle < 3e-5
    assert log2(coarse / fine) / 2 > 1.7
