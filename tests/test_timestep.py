"""The time step against the closed forms of the linear spring."""

from math import log, pi, sqrt

import numpy as np
import pytest

from sim import InputError
from sim.timestep import particle_mass, snapshots_in, steps_between, time_limits, time_step

BEAD = {"diameter": 1e-3, "density": 2500.0, "position": [[0.0, 0.0, 1e-2]]}
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}
CONTACT = {"stiffness": 1e3, "restitution": 0.9}
MASS = 2500.0 * pi * 1e-9 / 6.0


def times(duration=1e-2, interval=1e-3, **others):
    return {"time": {"duration": duration, **others}, "output": {"interval": interval}}


def half_period(k, restitution, reduced_mass):
    """Half a damped period of the spring, from its angular frequency sqrt(k/m − (η/2m)²)."""
    damping = -2 * log(restitution) * sqrt(k * reduced_mass / (log(restitution) ** 2 + pi**2))
    return pi / sqrt(k / reduced_mass - (damping / (2 * reduced_mass)) ** 2)


def test_a_sphere_weighs_its_volume_times_its_density(scene_of):
    scene = scene_of(particles=[BEAD], **times())
    assert particle_mass(scene.particles[0]) == pytest.approx(MASS, rel=1e-14)


@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.5])
def test_the_default_step_is_a_fiftieth_of_the_shortest_contact(scene_of, restitution):
    scene = scene_of(particles=[BEAD], contact={"stiffness": 1e3, "restitution": restitution}, **times())
    dt, steps = time_step(scene)
    longest = half_period(1e3, restitution, MASS / 2) / 50
    assert dt <= longest
    assert steps == int(np.ceil(1e-3 / longest))  # no shorter than snapshots at whole steps ask for


def test_friction_binds_as_its_spring_swings_faster(scene_of):
    # 2/7 of the reduced mass swings on k_t: sqrt(3.5) times faster than the normal spring at e = 1, k_t = k
    scene = scene_of(particles=[BEAD], contact={"stiffness": 1e3, "restitution": 1.0, "friction": 0.3}, **times())
    normal, tangential, dashpot = time_limits(scene)
    assert normal.largest / tangential.largest == pytest.approx(sqrt(3.5), rel=1e-12)
    assert "tangential" in tangential.term
    assert dashpot.largest == np.inf  # e = 1: there is none


@pytest.mark.parametrize("restitution", [0.9, 0.05])
def test_a_strong_tangential_dashpot_binds_at_the_step_that_its_lag_makes_unstable(scene_of, restitution):
    # v' = −(7/2) η v / m* by half a step's old velocity is stable up to (7/2) η Δt / m* = 1/2
    friction = {"stiffness": 1e3, "restitution": restitution, "friction": 0.3}
    *_, dashpot = time_limits(scene_of(particles=[BEAD], contact=friction, **times()))
    eta = -2 * log(restitution) * sqrt(1e3 * MASS / 2 / (log(restitution) ** 2 + pi**2))
    assert dashpot.largest == pytest.approx(MASS / 2 / (7 * eta), rel=1e-12)


def test_the_lightest_particle_and_the_stiffest_wall_bind(scene_of):
    light = BEAD | {"density": 100.0, "position": [[1e-2, 0.0, 1e-2]]}
    stiff = {"stiffness": 1e5, "restitution": 1.0}
    scene = scene_of(particles=[BEAD, light], contact=CONTACT, walls=[FLOOR], wall_contact=stiff, **times())
    pair, wall = time_limits(scene)
    m = MASS * 100.0 / 2500.0
    assert pair.advised == pytest.approx(half_period(1e3, 0.9, m / 2) / 50, rel=1e-12)
    assert wall.advised == pytest.approx(half_period(1e5, 1.0, m) / 50, rel=1e-12)  # the wall has no mass to share
    assert time_step(scene)[0] <= wall.advised


@pytest.mark.parametrize(("restitution", "fewest"), [(0.95, 20), (0.9, 20), (0.89, 50), (0.3, 50)])
def test_a_step_at_the_limit_passes_and_one_above_is_refused(scene_of, restitution, fewest):
    contact = {"stiffness": 1e3, "restitution": restitution}
    limit = half_period(1e3, restitution, MASS / 2) / fewest
    dt, _ = time_step(scene_of(particles=[BEAD], contact=contact, **times(step=limit)))
    assert dt <= limit
    with pytest.raises(InputError, match=r"time\.step = .* s: above the limit of .* s .* normal .*1000 N/m.* lower"):
        time_step(scene_of(particles=[BEAD], contact=contact, **times(step=1.01 * limit)))


def test_the_message_names_the_stiffness_of_the_contact_that_binds(scene_of):
    stiff = {"stiffness": 1e5, "restitution": 1.0}
    scene = scene_of(particles=[BEAD], contact=CONTACT, walls=[FLOOR], wall_contact=stiff, **times(step=5e-5))
    with pytest.raises(InputError, match=r"contact with walls, normal spring \(stiffness 100000 N/m\)"):
        time_step(scene)


def test_snapshots_fall_on_whole_steps(scene_of):
    scene = scene_of(particles=[BEAD], contact=CONTACT, **times(interval=1e-3, step=3.3e-6))
    dt, steps = time_step(scene)
    assert dt <= 3.3e-6
    assert dt * steps == pytest.approx(1e-3, rel=1e-15)


def test_an_interval_of_whole_steps_is_not_shortened_by_rounding():
    for steps in (1, 3, 7, 999, 123_457):
        assert steps_between(steps * 1.1e-6, 1.1e-6) == steps
    assert steps_between(1.0, 0.3) == 4
    assert steps_between(1e-7, 1.0) == 1


def test_a_run_counts_its_first_moment_and_every_whole_interval(scene_of):
    for duration, count in ((0.2, 201), (0.003, 4), (0.001, 2)):
        assert snapshots_in(scene_of(particles=[BEAD], **times(duration=duration))) == count
    with pytest.raises(InputError, match=r"output\.interval = 0\.001 s: longer than time\.duration = 0\.0009 s"):
        snapshots_in(scene_of(particles=[BEAD], **times(duration=9e-4)))
    with pytest.raises(InputError, match=r"0\.0025 s: not a multiple of output\.interval .* use 0\.002 or 0\.003 s"):
        snapshots_in(scene_of(particles=[BEAD], **times(duration=2.5e-3)))
