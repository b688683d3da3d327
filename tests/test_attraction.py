"""Contacts that never attract rebound with the same restitution, by more damping."""

from math import exp

import numpy as np
import pytest

from sim import Simulation
from sim.contact import APART, LEAVING, TOUCHING, normal_contact
from sim.law import contact_law, contact_time, damping_ratio, rebound

STIFFNESS, DIAMETER, DENSITY = 1e4, 2e-3, 2500.0
MASS = DENSITY * np.pi * DIAMETER**3 / 6


def measured(scene_of, restitution, steps_per_contact, speed, phase):
    dt = contact_time(STIFFNESS, max(restitution, 0.3), MASS / 2) / steps_per_contact
    gap = (3.0 + phase) * speed * dt
    steps = 12 * steps_per_contact
    scene = scene_of(
        particles=[
            {"diameter": DIAMETER, "density": DENSITY, "position": [[0, 0, 0], [0, 0, DIAMETER + gap]],
             "velocity": [[0, 0, speed / 2], [0, 0, -speed / 2]]}
        ],
        contact={"stiffness": STIFFNESS, "restitution": restitution, "attraction": False},
        time={"duration": steps * dt, "step": dt},
        output={"interval": steps * dt},
    )  # fmt: skip
    run = Simulation(scene)
    run.advance_to(steps)
    velocity = run.snapshot().velocity[:, 2]
    return (velocity[1] - velocity[0]) / speed


@pytest.mark.parametrize(("restitution", "steps", "gate"), [(0.9, 50, 1e-3), (0.7, 50, 1e-3), (0.3, 200, 5e-4)])
def test_rebound_has_the_restitution_asked_for(scene_of, restitution, steps, gate):
    errors = [measured(scene_of, restitution, steps, v, p) / restitution - 1 for v in (0.5, 4.0) for p in (0.1, 0.6)]
    assert max(map(abs, errors)) < gate


def test_pairs_that_almost_stick_converge_to_their_restitution(scene_of):
    errors = [abs(measured(scene_of, 0.02, steps, 1.0, 0.3) / 0.02 - 1) for steps in (400, 800)]
    assert errors[1] < 0.02
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.5, 0.135, 0.02, 1e-3])
def test_damping_ratio_inverts_the_closed_form(restitution):
    assert rebound(damping_ratio(restitution, attracts=False)) == pytest.approx(restitution, rel=1e-9)


def test_critical_damping_rebounds_with_the_square_of_one_over_e_and_the_branches_meet_there():
    assert rebound(1.0) == exp(-2.0)
    assert rebound(1.0 - 1e-5) == pytest.approx(exp(-2.0), rel=1e-4)
    assert rebound(1.0 + 1e-5) == pytest.approx(exp(-2.0), rel=1e-4)


def test_force_never_attracts_whatever_the_speed_and_the_phase():
    attracting, repelling = contact_law(1e4, 0.3), contact_law(1e4, 0.3, attracts=False)
    loads = []
    for phase in (APART, TOUCHING, LEAVING):
        for speed in np.linspace(-5, 5, 41):
            for overlap in (1e-8, 1e-6, 1e-4):
                case = (overlap, speed, phase, 1e-6)
                loads.append(normal_contact(*case, attracting, 1e-6)[0])
                assert normal_contact(*case, repelling, 1e-6)[0] >= 0.0
    assert min(loads) < 0.0
