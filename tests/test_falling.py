"""A sphere that falls on a floor and bounces: parabolas joined by a damped oscillation, all in closed form."""

from math import cos, exp, log, pi, sin, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from sim import simulate
from sim.law import contact_time

G, RADIUS, DENSITY, RELEASED = 9.81, 0.1, 2600.0, 0.5
MASS = DENSITY * 4 / 3 * pi * RADIUS**3
FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}


def dropped(scene_of, stiffness, restitution, duration, snapshots, steps_per_contact=50):
    """Release the sphere at rest; return times, heights of its centre and velocities."""
    step = contact_time(stiffness, restitution, MASS) / steps_per_contact
    scene = scene_of(
        particles=[{"diameter": 2 * RADIUS, "density": DENSITY, "position": [[0, 0, RELEASED]]}],
        contact={"stiffness": stiffness, "restitution": restitution},
        gravity={"acceleration": [0, 0, -G]},
        time={"duration": duration, "step": step},
        output={"interval": duration / snapshots, "precision": "double"},
        walls=[FLOOR],
    )
    return np.array([(s.time, s.position[0, 2], s.velocity[0, 2]) for s in simulate(scene)]).T


class Contact:
    """Spring, dashpot and weight from touching down at a speed to taking off: x'' + 2 β x' + ω² x = −g, x = z − r."""

    def __init__(self, stiffness, restitution, speed):
        omega = sqrt(stiffness / MASS)
        self.beta = -log(restitution) / sqrt(pi**2 + log(restitution) ** 2) * omega
        self.pace = sqrt(omega**2 - self.beta**2)
        self.sag = G / omega**2
        self.amplitude = (self.beta * self.sag - speed) / self.pace
        self.ends = brentq(self.height, 0.5 * pi / self.pace, 1.8 * pi / self.pace)
        self.take_off = float(self.velocity(self.ends))

    def height(self, t):
        """x(t), the centre's height over that of touching down."""
        return (
            np.exp(-self.beta * t) * (self.sag * np.cos(self.pace * t) + self.amplitude * np.sin(self.pace * t))
            - self.sag
        )

    def velocity(self, t):
        a, b = self.sag, self.amplitude
        swing = (b * self.pace - self.beta * a) * cos(self.pace * t) - (a * self.pace + self.beta * b) * sin(
            self.pace * t
        )
        return exp(-self.beta * t) * swing


def first_bounce(stiffness, restitution, time):
    """Height of the centre until the second touching down."""
    falls = sqrt(2 * (RELEASED - RADIUS) / G)
    contact = Contact(stiffness, restitution, G * falls)
    since = time - falls
    flies = since - contact.ends
    fall = RELEASED - 0.5 * G * time**2
    rise = RADIUS + contact.take_off * flies - 0.5 * G * flies**2
    return np.where(since < 0, fall, np.where(flies < 0, RADIUS + contact.height(since), rise))


def apexes(height, velocity):
    """Height z + v²/2g that each flight leads to, in the order of the flights."""
    rising = (height > RADIUS) & (velocity > 0)
    starts = np.flatnonzero(np.diff(rising.astype(int)) == 1) + 1
    return np.array([height[k] + velocity[k] ** 2 / (2 * G) for k in starts])


def expected_apexes(stiffness, restitution, bounces):
    """Apexes with contacts of finite duration, during which the weight acts too."""
    speed, found = sqrt(2 * G * (RELEASED - RADIUS)), []
    for _ in range(bounces):
        speed = Contact(stiffness, restitution, speed).take_off
        found.append(RADIUS + speed**2 / (2 * G))
    return np.array(found)


@pytest.mark.parametrize("stiffness", [1e5, 1e6, 1e7])
@pytest.mark.parametrize("restitution", [1.0, 0.8, 0.6])
def test_falling_sphere_bounces_as_the_damped_oscillator_says(scene_of, stiffness, restitution):
    """DEM01, to 0.2 % of the height: fifty steps per contact give restitution to 0.1 %, its square to twice that."""
    flight = sqrt(2 * (RELEASED - RADIUS) / G)
    duration = round(1.0 + 1.6 * restitution, 2) * flight  # ends within the second flight
    time, height, _ = dropped(scene_of, stiffness, restitution, duration, 400)
    worst = np.abs(height - first_bounce(stiffness, restitution, time)).max()
    print(f"\nDEM01 k {stiffness:g} N/m e {restitution}: {worst / RELEASED:.1e} of the height")
    assert worst < 2e-3 * RELEASED


@pytest.mark.parametrize("stiffness", [5e4, 5e5, 5e6])
def test_elastic_sphere_rises_to_where_it_was_released_eight_times(scene_of, stiffness):
    """DEM02 at e = 1: 0.05 % of the height at a hundred steps per contact; at fifty errors are four times larger."""
    _, height, velocity = dropped(scene_of, stiffness, 1.0, 8.6 if stiffness < 1e5 else 5.2, 800, 100)
    found = apexes(height, velocity)[:8]
    print(f"\nDEM02 k {stiffness:g} N/m: 1st {found[0] / RELEASED - 1:.1e}, 8th {found[7] / RELEASED - 1:.1e}")
    assert len(found) == 8
    assert np.abs(found / RELEASED - 1).max() < 5e-4


@pytest.mark.parametrize("restitution", [0.9, 0.7])
def test_bounces_fall_off_by_the_square_of_restitution_in_the_limit_of_stiff_contacts(scene_of, restitution):
    """DEM02 below e = 1. h_j = (h₀ − r) e^2j + r holds for k → ∞, where the weight does nothing while they touch."""
    bounces = 4
    limit = (RELEASED - RADIUS) * restitution ** (2 * np.arange(1, bounces + 1)) + RADIUS
    gaps = []
    for stiffness in (5e4, 5e5, 5e6):
        _, height, velocity = dropped(scene_of, stiffness, restitution, 2.6, 800, 100)
        found = apexes(height, velocity)[:bounces]
        exact = expected_apexes(stiffness, restitution, bounces)
        gaps.append(np.abs(found - limit).max())
        print(
            f"\nDEM02 e {restitution} k {stiffness:g} N/m: {np.abs(found / exact - 1).max():.1e} of the closed form, "
            f"{gaps[-1]:.1e} m from the limit"
        )
        assert np.abs(found / exact - 1).max() < 5e-4
    assert np.array(gaps[:-1]) / gaps[1:] == pytest.approx(sqrt(10), rel=0.1)  # a gap as long as a contact, 1/sqrt(k)
