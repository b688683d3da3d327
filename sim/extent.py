"""How far a shape extends: the box around it."""

import numpy as np

from sim.kernel import Array
from sim.triangles import read_stl
from sim.vessel import AnyShape, Box, Capsule, Combination, Cone, Cylinder, Mesh, Plane, Torus

Extent = tuple[Array, Array]


def _around(axis: tuple[float, float, float], radius: float, half: float) -> Array:
    """Half sizes (m) of the box around a cylinder of this radius and half length about the origin."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.asarray(radius * np.sqrt(np.maximum(1.0 - unit**2, 0.0)) + half * np.abs(unit))


def _combined(shape: Combination) -> Extent | None:
    extents = [extent_of(member) for member in shape.of]
    if shape.operation == "difference":
        return extents[0]
    known = [extent for extent in extents if extent is not None]
    lowest, highest = [low for low, _ in known], [high for _, high in known]
    if shape.operation == "union":
        return (np.min(lowest, axis=0), np.max(highest, axis=0)) if len(known) == len(extents) else None
    return (np.max(lowest, axis=0), np.min(highest, axis=0)) if known else None


def extent_of(shape: AnyShape) -> Extent | None:
    """Return the corners (m) of a box around a shape, None for an endless one.

    The box is the smallest around a single shape; a combination may leave more room in its.
    """
    if isinstance(shape, Plane):
        return None
    if isinstance(shape, Box):
        return np.array(shape.lowest), np.array(shape.highest)
    if isinstance(shape, Combination):
        return _combined(shape)
    if isinstance(shape, Mesh):
        vertices = read_stl("walls", shape.file, shape.scale).vertices
        return vertices.min(axis=0), vertices.max(axis=0)
    if isinstance(shape, Cylinder):
        if shape.length is None:
            return None
        half = _around(shape.axis, shape.radius, shape.length / 2)
    elif isinstance(shape, Cone):
        half = _around(shape.axis, max(shape.radii), shape.length / 2)
    elif isinstance(shape, Capsule):
        half = _around(shape.axis, 0.0, shape.length / 2) + shape.radius
    elif isinstance(shape, Torus):
        half = _around(shape.axis, shape.radius, 0.0) + shape.tube_radius
    else:
        half = np.full(3, shape.radius)
    return np.array(shape.centre) - half, np.array(shape.centre) + half
