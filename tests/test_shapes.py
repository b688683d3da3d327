"""Signed distance functions against geometry."""

import numpy as np
import pytest

from sim.shapes import BOX, CYLINDER, PLANE, TUBE, signed_distance

TILTED = np.array([1.0, 2.0, -2.0]) / 3.0
SHAPES = {
    "plane": (PLANE, np.array([0.1, 0.2, -0.1, *TILTED, 0.0, 0.0])),
    "tube": (TUBE, np.array([0.1, 0.0, 0.2, *TILTED, 0.6, 0.0])),
    "cylinder": (CYLINDER, np.array([0.1, 0.0, 0.2, *TILTED, 0.5, 0.7])),
    "box": (BOX, np.array([0.1, -0.1, 0.2, 0.5, 0.4, 0.6, 0.0, 0.0])),
}


def distance(shape, point):
    kind, parameter = SHAPES[shape]
    return np.array(signed_distance(kind, parameter[None], 0, *point))


@pytest.mark.parametrize("shape", SHAPES)
def test_gradient_is_the_derivative_of_the_distance_and_of_length_one(shape):
    rng = np.random.default_rng(0)
    step = 1e-6
    for point in rng.uniform(-1.5, 1.5, (200, 3)):
        _, *gradient = distance(shape, point)
        probes = [(distance(shape, point + step * e)[0], distance(shape, point - step * e)[0]) for e in np.eye(3)]
        numeric = np.array([(a - b) / (2 * step) for a, b in probes])
        assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-12)
        if np.linalg.norm(numeric) > 0.999999:  # elsewhere the point is on the medial axis, where φ has a kink
            np.testing.assert_allclose(gradient, numeric, atol=1e-8)


@pytest.mark.parametrize("shape", SHAPES)
def test_following_the_gradient_by_the_distance_ends_on_the_surface(shape):
    rng = np.random.default_rng(1)
    for point in rng.uniform(-1.5, 1.5, (200, 3)):
        d, *gradient = distance(shape, point)
        if d > 0 or shape in ("plane", "tube"):
            assert distance(shape, point - d * np.array(gradient))[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("shape", ["cylinder", "box"])
def test_distance_is_negative_exactly_inside(shape):
    rng = np.random.default_rng(2)
    kind, p = SHAPES[shape]
    for point in rng.uniform(-1.0, 1.0, (500, 3)):
        offset = point - p[:3]
        if kind == BOX:
            inside = (np.abs(offset) < p[3:6]).all()
        else:
            along = offset @ p[3:6]
            inside = abs(along) < p[7] and np.linalg.norm(offset - along * p[3:6]) < p[6]
        assert (distance(shape, point)[0] < 0) == inside


def test_a_point_on_the_axis_of_a_cylinder_has_a_normal_across_it():
    _, *normal = distance("tube", [0.1, 0.0, 0.2])
    assert np.dot(normal, TILTED) == pytest.approx(0.0, abs=1e-15)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
