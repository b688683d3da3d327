"""Linear spring and dashpot: a binary contact has a closed form."""

from math import atan, exp, log, log2, pi, sin, sqrt

import numpy as np
import pytest

from sim import Simulation
from sim.contact import normal_contact
from sim.law import contact_law, contact_time

DIAMETER, DENSITY, STIFFNESS = 2e-3, 2500.0, 1e4
MASS = DENSITY * pi * DIAMETER**3 / 6
PHASES = np.linspace(0.0, 0.95, 8)  # where within a step the contact begins


def impact(scene_of, restitution, speed, steps_per_contact, with_wall, phase):
    """Run one head-on impact; return the simulation after it."""
    reduced = MASS if with_wall else MASS / 2
    dt = contact_time(STIFFNESS, restitution, reduced) / steps_per_contact
    steps = int(1.4 * steps_per_contact) + 8
    gap = (3.0 + phase) * speed * dt
    if with_wall:
        beads = {"position": [[0, 0, DIAMETER / 2 + gap]], "velocity": [[0, 0, -speed]]}
        walls = [{"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}]
    else:
        beads = {"position": [[0, 0, 0], [0, 0, DIAMETER + gap]], "velocity": [[0, 0, speed / 2], [0, 0, -speed / 2]]}
        walls = []
    scene = scene_of(
        particles=[{"diameter": DIAMETER, "density": DENSITY, **beads}],
        contact={"stiffness": STIFFNESS, "restitution": restitution},
        time={"duration": steps * dt, "step": dt},
        output={"interval": steps * dt},
        walls=walls,
    )
    return Simulation(scene)


def rebound(scene_of, restitution, speed, steps_per_contact, with_wall, phase):
    run = impact(scene_of, restitution, speed, steps_per_contact, with_wall, phase)
    run.advance_to(run.steps_per_snapshot)
    velocity = run.snapshot().velocity[:, 2]
    return (velocity[0] if with_wall else velocity[1] - velocity[0]) / speed


def worst_error(scene_of, restitution, steps_per_contact, with_wall):
    speeds = (0.5, 4.0)
    found = [
        rebound(scene_of, restitution, v, steps_per_contact, with_wall, p)
        for v, p in zip(speeds * 4, PHASES, strict=True)
    ]
    return max(abs(e / restitution - 1) for e in found)


@pytest.mark.parametrize("with_wall", [False, True], ids=["pair", "wall"])
@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.8, 0.7])
def test_rebound_has_the_restitution_asked_for_to_a_thousandth_at_fifty_steps(scene_of, restitution, with_wall):
    assert worst_error(scene_of, restitution, 50, with_wall) < 1e-3


@pytest.mark.parametrize("with_wall", [False, True], ids=["pair", "wall"])
@pytest.mark.parametrize("restitution", [0.7, 0.5, 0.3])
def test_rebound_has_the_restitution_asked_for_to_half_a_thousandth_at_two_hundred_steps(
    scene_of, restitution, with_wall
):
    assert worst_error(scene_of, restitution, 200, with_wall) < 5e-4


@pytest.mark.parametrize("restitution", [0.9, 0.7, 0.5])
def test_restitution_converges_at_second_order(scene_of, restitution, capsys):
    errors = [np.mean([abs(rebound(scene_of, restitution, 2.0, n, False, p) / restitution - 1) for p in PHASES])
              for n in (100, 200, 400)]  # fmt: skip
    order = log2(errors[0] / errors[2]) / 2
    with capsys.disabled():
        print(f"\n  restitution {restitution}: observed order {order:.2f}, error {errors[0]:.1e} at t_c/100")
    assert 1.7 < order < 3.0


@pytest.mark.parametrize("restitution", [1.0, 0.7, 0.3])
def test_contact_lasts_and_reaches_as_deep_as_the_closed_form_says(scene_of, restitution):
    speed = 2.0
    run = impact(scene_of, restitution, speed, 400, False, 0.5)
    w0 = sqrt(STIFFNESS / (MASS / 2))
    beta = -log(restitution) / sqrt(pi**2 + log(restitution) ** 2)
    wd = w0 * sqrt(1 - beta**2)
    turning = atan(wd / (beta * w0)) / wd if beta else pi / (2 * wd)
    deepest = speed / wd * exp(-beta * w0 * turning) * sin(wd * turning)
    overlap = []
    for step in range(1, run.steps_per_snapshot + 1):
        run.advance_to(step)
        heights = run.snapshot().position[:, 2]
        overlap.append(DIAMETER - (heights[1] - heights[0]))
    overlap = np.array(overlap)
    lasted = np.count_nonzero(overlap > 0) * run.dt
    # a step more or less in duration; the parabola through the deepest samples is flat to (π/400)²/2
    assert lasted == pytest.approx(contact_time(STIFFNESS, restitution, MASS / 2), abs=run.dt)
    assert overlap.max() == pytest.approx(deepest, rel=1e-4)


def test_restitution_of_one_needs_no_dashpot():
    assert contact_law(1e4, 1.0, 0.0).damping == 0.0


def test_damped_spring_is_attractive_at_the_end_as_paper_eq_4_says():
    law = contact_law(1e4, 0.5, 0.0)
    force = normal_contact(1e-9, 1.0, 1, MASS, law, 1e-9)[0]
    assert force < 0.0
