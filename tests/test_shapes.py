"""Signed distance functions against geometry."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sim.shapes import (
    BOX,
    CAPSULE,
    CYLINDER,
    FRUSTUM,
    FUNNEL,
    PARAMETERS,
    PLANE,
    SHELL,
    SPHERE,
    TORUS,
    TUBE,
    signed_distance,
)

TILTED = np.array([1.0, 2.0, -2.0]) / 3.0
CENTRE = np.array([0.1, 0.0, 0.2])
AXIAL = [*CENTRE, *TILTED]


def row(*values):
    return np.array([*values, *[0.0] * (PARAMETERS - len(values))])


SHAPES = {
    "plane": (PLANE, row(0.1, 0.2, -0.1, *TILTED)),
    "tube": (TUBE, row(*AXIAL, 0.6)),
    "cylinder": (CYLINDER, row(*AXIAL, 0.5, 0.7)),
    "box": (BOX, row(0.1, -0.1, 0.2, 0.5, 0.4, 0.6)),
    "sphere": (SPHERE, row(*CENTRE, 0.7)),
    "capsule": (CAPSULE, row(*AXIAL, 0.4, 0.5)),
    "torus": (TORUS, row(*AXIAL, 0.7, 0.25)),
    "funnel": (FUNNEL, row(*AXIAL, 0.3, 0.8, 0.6)),
    "frustum": (FRUSTUM, row(*AXIAL, 0.3, 0.8, 0.6)),
    "narrowing frustum": (FRUSTUM, row(*AXIAL, 0.9, 0.2, 0.3)),
    "cone": (FRUSTUM, row(*AXIAL, 0.0, 0.8, 0.6)),
    "shell": (SHELL, row(*AXIAL, 0.3, 0.8, 0.6)),
    "disc": (SHELL, row(*AXIAL, 0.0, 0.8, 0.0)),
}
EXACT = [name for name in SHAPES if name != "funnel"]  # which has no end at its tip
SMOOTH = ("plane", "tube", "sphere", "capsule", "torus", "shell", "disc")  # no medial axis between point and surface


def distance(shape, point):
    kind, parameter = SHAPES[shape]
    return np.array(signed_distance(kind, parameter[None], 0, *point))


@pytest.mark.parametrize("shape", SHAPES)
def test_gradient_is_the_derivative_of_the_distance_and_of_length_one(shape):
    rng = np.random.default_rng(0)
    step = 1e-6
    checked = 0
    for point in rng.uniform(-1.5, 1.5, (200, 3)):
        _, *gradient = distance(shape, point)
        probes = [(distance(shape, point + step * e)[0], distance(shape, point - step * e)[0]) for e in np.eye(3)]
        numeric = np.array([(a - b) / (2 * step) for a, b in probes])
        assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-12)
        if np.linalg.norm(numeric) > 0.999999:  # elsewhere the point is on the medial axis, where φ has a kink
            np.testing.assert_allclose(gradient, numeric, atol=1e-8)
            checked += 1
    assert checked > 190


@pytest.mark.parametrize("shape", EXACT)
def test_following_the_gradient_by_the_distance_ends_on_the_surface(shape):
    rng = np.random.default_rng(1)
    for point in rng.uniform(-1.5, 1.5, (200, 3)):
        d, *gradient = distance(shape, point)
        assert distance(shape, point - d * np.array(gradient))[0] == pytest.approx(0.0, abs=1e-12)


def meridian(shape, n=4000):
    """Points (radius, height) along the outline of a body of revolution."""
    p, t = SHAPES[shape][1], np.linspace(0.0, 1.0, n)[:, None]
    if shape == "capsule":
        width, height = p[6], p[7]
        arc = np.hstack([width * np.cos(np.pi / 2 * t), height + width * np.sin(np.pi / 2 * t)])
        side = np.hstack([np.full_like(t, width), height * (2 * t - 1)])
        return np.vstack([arc, side, arc * [1, -1]])
    if shape == "torus":
        return np.hstack([p[6] + p[7] * np.cos(2 * np.pi * t), p[7] * np.sin(2 * np.pi * t)])
    if shape == "sphere":
        return p[3] * np.hstack([np.sin(np.pi * t), np.cos(np.pi * t)])
    low, high, half = (p[6], p[6], p[7]) if shape == "cylinder" else p[6:9]
    corners = [(0, -half), (low, -half), (high, half), (0, half)]
    sides = list(pairwise(corners))
    sides = sides[1:2] if shape in ("shell", "disc") else sides
    return np.vstack([(1 - t) * a + t * np.array(b) for a, b in sides])


ROUND = ["cylinder", "sphere", "capsule", "torus", "frustum", "narrowing frustum", "cone", "shell", "disc"]


@pytest.mark.parametrize("shape", ROUND)
def test_distance_is_that_to_the_nearest_of_many_points_of_the_surface(shape):
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (2000, 3))
    axis = TILTED if shape != "sphere" else np.array([0.0, 0.0, 1.0])
    along = (points - CENTRE) @ axis
    away = np.linalg.norm(points - CENTRE - along[:, None] * axis, axis=1)
    outline = meridian(shape)  # by symmetry the nearest point is in the plane through the axis and the point
    nearest, _ = cKDTree(outline).query(np.stack([away, along], axis=1))
    found = np.array([distance(shape, point)[0] for point in points])
    # half of the 1e-3 between neighbours on the outline of curvature 4, seen from a distance d: (5e-4)²/2 (1/d + 4)
    assert (nearest - np.abs(found) > -1e-12).all()
    assert (nearest - np.abs(found) < np.minimum(5e-4, 1.3e-7 * (1.0 / np.abs(found) + 4.0)) + 1e-12).all()


def inside(shape, offset):
    """Whether a point, seen from the centre, is in the solid, by its definition."""
    p = SHAPES[shape][1]
    if shape == "box":
        return (np.abs(offset) < p[3:6]).all()
    if shape == "sphere":
        return np.linalg.norm(offset) < p[3]
    along = offset @ p[3:6]
    away = np.linalg.norm(offset - along * p[3:6])
    if shape == "cylinder":
        return abs(along) < p[7] and away < p[6]
    if shape == "capsule":
        return np.hypot(away, max(abs(along) - p[7], 0.0)) < p[6]
    if shape == "torus":
        return np.hypot(away - p[6], along) < p[7]
    return abs(along) < p[8] and away < p[6] + (p[7] - p[6]) * (along / p[8] + 1) / 2


@pytest.mark.parametrize("shape", ["cylinder", "box", "sphere", "capsule", "torus", "frustum", "narrowing frustum"])
def test_distance_is_negative_exactly_inside(shape):
    for point in np.random.default_rng(3).uniform(-1.0, 1.0, (500, 3)):
        assert (distance(shape, point)[0] < 0) == inside(shape, point - SHAPES[shape][1][:3])


def test_within_an_endless_cone_the_distance_is_that_to_its_side():
    """Where the nearest point of the truncated cone is on its side, both have the same distance."""
    for point in np.random.default_rng(4).uniform(-0.6, 0.6, (500, 3)):
        d = distance("funnel", point)
        solid = distance("frustum", point)
        if solid[0] < 0 and abs(d[1:] - solid[1:]).max() < 1e-9:
            assert d[0] == pytest.approx(solid[0], abs=1e-12)
        elif solid[0] < 0:
            assert d[0] < solid[0]  # an end is nearer


def test_a_shell_is_a_wall_on_both_of_its_sides():
    inner, outer = (
        distance("shell", CENTRE + 0.05 * TILTED + out * np.array([2, -1, 0]) / np.sqrt(5)) for out in (0.4, 0.8)
    )
    assert inner[0] > 0
    assert outer[0] > 0
    np.testing.assert_allclose(inner[1:], -outer[1:], atol=1e-12)


@pytest.mark.parametrize("shape", ["tube", "cylinder", "capsule", "torus", "funnel", "frustum", "shell"])
def test_a_point_on_the_axis_has_a_normal(shape):
    for place in (0.0, 0.2, 2.0):
        _, *normal = distance(shape, CENTRE + place * TILTED)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        if shape == "tube":
            assert np.dot(normal, TILTED) == pytest.approx(0.0, abs=1e-15)


def test_a_point_at_the_centre_of_a_sphere_has_a_normal():
    d, *normal = distance("sphere", CENTRE)
    assert d == -0.7
    assert np.linalg.norm(normal) == 1.0
