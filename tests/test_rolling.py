"""Resistance against rolling, against the motion of a rigid sphere on a plane."""

from math import atan, cos, pi, sin

import numpy as np
import pytest

from sim import Simulation, simulate

G, RADIUS, DENSITY, STIFFNESS = 9.81, 1e-3, 2500.0, 1e4
WEIGHT = DENSITY * 4 / 3 * pi * RADIUS**3 * G
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}
MODELS = ("constant", "elastic-plastic")


def on_a_plane(scene_of, rolling, speed, duration, slope=0.0, snapshots=100, friction=0.5):
    """A sphere at rest on a floor, or rolling over it without slip, down a slope (rad) where there is one."""
    sunk = WEIGHT * cos(slope) / STIFFNESS
    return scene_of(
        particles=[
            {"diameter": 2 * RADIUS, "density": DENSITY, "position": [[0, 0, RADIUS - sunk]],
             "velocity": [[speed, 0, 0]], "angular_velocity": [[0, speed / (RADIUS - sunk), 0]]}
        ],
        contact={"stiffness": STIFFNESS, "restitution": 0.9, "friction": friction, "rolling": rolling},
        gravity={"acceleration": [G * sin(slope), 0, -G * cos(slope)]},
        time={"duration": duration},
        output={"interval": duration / snapshots, "precision": "double"},
        walls=[FLOOR],
    )  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("friction", [0.01, 0.1])
def test_a_rolling_sphere_slows_down_by_five_sevenths_of_rolling_friction_times_g(scene_of, model, friction):
    """M = μ_r r m g against rolling without slip: (m + I/r²) du/dt = −M/r, so du/dt = −5/7 μ_r g."""
    speed = 0.1
    stops = speed / (5 / 7 * friction * G)
    scene = on_a_plane(scene_of, {"model": model, "friction": friction}, speed, 0.8 * stops)
    time, velocity = np.array([(s.time, s.velocity[0, 0]) for s in simulate(scene)]).T
    late = time > 0.2 * stops  # the elastic–plastic spring is wound up by then
    slope = np.polyfit(time[late], velocity[late], 1)[0]
    assert slope == pytest.approx(-5 / 7 * friction * G, rel=2e-3)


@pytest.mark.parametrize("model", MODELS)
def test_it_comes_to_rest_and_stays_there(scene_of, model):
    friction, speed = 0.1, 0.05
    stops = speed / (5 / 7 * friction * G)
    *_, last = simulate(on_a_plane(scene_of, {"model": model, "friction": friction}, speed, 3 * stops))
    assert abs(last.velocity[0, 0]) < 1e-5 * speed
    assert abs(last.angular_velocity[0, 1]) * RADIUS < 1e-5 * speed


@pytest.mark.parametrize(("share", "holds"), [(0.9, True), (1.1, False)])
def test_a_sphere_holds_on_a_slope_up_to_the_angle_whose_tangent_is_rolling_friction(scene_of, share, holds):
    friction = 0.2
    scene = on_a_plane(scene_of, {"friction": friction}, 0.0, 0.3, slope=atan(share * friction))
    *_, last = simulate(scene)
    travelled = last.position[0, 0]
    excess = 5 / 7 * G * cos(atan(share * friction)) * (share - 1.0) * friction
    if holds:
        assert travelled < 0.2 * RADIUS
        assert abs(last.velocity[0, 0]) < 1e-6
    else:
        assert travelled == pytest.approx(0.5 * excess * 0.3**2, rel=0.15)  # it must first unwind the spring


@pytest.mark.parametrize("model", MODELS)
def test_a_turning_drum_feels_the_moment_with_which_it_rolls_beads(scene_of, model):
    """ΔL_z = ∫ (T_z + Σ x m g_y) dt about the axis, spins included; and what the drum works is what the beads get."""
    interval, omega = 5e-4, 2 * pi
    rotation = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0}
    hollow = {"shape": "cylinder", "axis": [0, 0, 1], "radius": 20e-3, "particles": "inside"}
    position = [[0, -19e-3, 0], [2.2e-3, -18.87e-3, 0], [-2.2e-3, -18.87e-3, 0]]
    run = list(simulate(scene_of(
        particles=[{"diameter": 2 * RADIUS, "density": DENSITY, "position": position}],
        contact={"stiffness": STIFFNESS, "restitution": 0.5, "friction": 0.5,
                 "rolling": {"model": model, "friction": 0.5}},
        gravity={"acceleration": [0, -G, 0]},
        time={"duration": 0.05}, output={"interval": interval, "precision": "double"},
        walls=[{"name": "drum", "motion": rotation, "shapes": [hollow]}],
    )))  # fmt: skip
    mass = WEIGHT / G
    weight = np.array([-WEIGHT * s.position[:, 0].sum() for s in run])
    torque, power, balance = (
        np.array([s.series[name] for s in run]) for name in ("torque.drum.z", "power.drum", "energy.balance")
    )
    spun = [
        mass * np.cross(s.position, s.velocity)[:, 2].sum() + 0.4 * mass * RADIUS**2 * s.angular_velocity[:, 2].sum()
        for s in (run[0], run[-1])
    ]
    given = interval * (torque[1:] + 0.5 * (weight[1:] + weight[:-1])).sum()
    assert spun[1] - spun[0] == pytest.approx(given, abs=1e-4 * interval * np.abs(torque).sum())
    assert power == pytest.approx(omega * torque, rel=1e-9, abs=1e-15)
    assert np.ptp(balance) < 2e-3 * run[-1].series["energy.wall_work"]


@pytest.mark.parametrize("model", MODELS)
def test_rolling_moments_of_a_pair_keep_angular_momentum_and_account_for_the_energy(scene_of, model):
    radius, density = (1e-3, 4e-4), (2500.0, 7800.0)
    position = [[0, 0, 0], [0.9e-3, 0.6e-3, 0.95e-3]]
    velocity, spin = [[0.2, 0.1, 0.3], [-0.3, 0.2, -0.8]], [[300.0, -200, 100], [500, 900, -400]]
    tables = [
        {"diameter": 2 * r, "density": rho, "position": [x], "velocity": [v], "angular_velocity": [w]}
        for r, rho, x, v, w in zip(radius, density, position, velocity, spin, strict=True)
    ]
    contact = {"stiffness": 1e4, "restitution": 0.8, "friction": 0.4, "rolling": {"model": model, "friction": 0.3}}
    scene = scene_of(
        particles=tables, contact=contact, time={"duration": 4e-4},
        output={"interval": 1e-5, "precision": "double"},
    )  # fmt: skip
    mass = np.array([rho * 4 / 3 * pi * r**3 for r, rho in zip(radius, density, strict=True)])
    inertia = 0.4 * mass * np.square(radius)

    def angular(s):
        orbit = np.cross(s.position, mass[:, None] * s.velocity)
        return (orbit + inertia[:, None] * s.angular_velocity).sum(axis=0)

    first, *moments = simulate(scene)
    assert np.abs(moments[-1].angular_velocity - first.angular_velocity).max() > 10  # they did touch
    for moment in moments:
        np.testing.assert_allclose(angular(moment), angular(first), atol=1e-10 * np.abs(angular(first)).max())
    assert moments[-1].series["coordination"] == 0.0  # in the midst of a contact the ledger is off by truncation
    assert moments[-1].series["energy.balance"] == pytest.approx(first.series["energy.balance"], rel=2e-3)


def test_rolling_without_friction_is_refused(scene_of):
    with pytest.raises(ValueError, match="rolling resistance needs friction"):
        on_a_plane(scene_of, {"friction": 0.1}, 0.0, 0.1, friction=0.0)


def test_a_scene_without_rolling_keeps_no_rolling_springs(scene_of):
    with_rolling = Simulation(on_a_plane(scene_of, {"friction": 0.1}, 0.0, 0.1))
    without = Simulation(on_a_plane(scene_of, None, 0.0, 0.1))
    assert with_rolling.wall_spring.shape[1] == with_rolling.spring.shape[1] == 6
    assert without.wall_spring.shape[1] == without.spring.shape[1] == 3
