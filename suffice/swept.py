"""How far from its axis a turning body reaches: the radius that a rotor sweeps."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from sim.extent import extent_of
from sim.triangles import read_stl
from sim.vessel import AnyShape, Box, Capsule, Combination, Cone, Cylinder, Mesh, Plane, Rotation, Sphere, WallTable

Array = NDArray[np.float64]
RIM = 720  # points on a rim: its farthest point is found within 1e-5 of its radius


def swept_radius(wall: WallTable) -> float | None:
    """Return the largest distance from its axis, in m, of the solids of a turning body that particles are outside of.

    None where the body does not turn, has no such solid, or one without an end. A combination may reach less far than
    is said: a union reaches as far as its farthest member, an intersection at most as far as its nearest.
    """
    moves = wall.motion
    if not isinstance(moves, Rotation):
        return None
    solids = [shape for shape in wall.shapes if not isinstance(shape, Plane) and shape.particles == "outside"]
    point, axis = np.array(moves.point), np.array(moves.axis) / np.linalg.norm(moves.axis)
    reach = max((_reach(shape, point, axis) for shape in solids), default=inf)
    return reach if np.isfinite(reach) else None


def distance_from(point: Array, axis: Array, place: Array) -> Array:
    """Distance of each place (n, 3) from the axis through a point along a unit vector, (n,) m."""
    arm = place - point
    arm = arm - np.outer(arm @ axis, axis)
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", arm, arm)))


def _reach(shape: AnyShape, point: Array, axis: Array) -> float:
    if isinstance(shape, Combination):
        members = [_reach(member, point, axis) for member in shape.of]
        return {"union": max(members), "intersection": min(members), "difference": members[0]}[shape.operation]
    if isinstance(shape, Plane):
        return inf
    if isinstance(shape, Cylinder) and shape.length is None:
        along = np.array(shape.axis) / np.linalg.norm(shape.axis)
        parallel = float(np.linalg.norm(np.cross(along, axis))) < 1e-9
        centre = float(distance_from(point, axis, np.array([shape.centre]))[0])
        return centre + shape.radius if parallel else inf
    corners, margin = _outline(shape)
    return float(distance_from(point, axis, corners).max()) + margin


def _outline(shape: AnyShape) -> tuple[Array, float]:
    """Points (k, 3) m and a distance around them that reach as far as the shape does."""
    if isinstance(shape, Mesh):
        return read_stl("walls", shape.file, shape.scale).vertices.reshape(-1, 3), 0.0
    if isinstance(shape, Box):
        low, high = extent_of(shape) or (np.zeros(3), np.zeros(3))
        return np.array(
            [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)]
        ), 0.0
    assert not isinstance(shape, Plane | Combination)
    centre = np.array(shape.centre)
    if isinstance(shape, Sphere):
        return centre[None], shape.radius
    along = np.array(shape.axis) / np.linalg.norm(shape.axis)
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length * along
        return np.array([centre - half, centre + half]), shape.radius
    if isinstance(shape, Cylinder | Cone):
        ends = (shape.radius, shape.radius) if isinstance(shape, Cylinder) else shape.radii
        half = 0.5 * (shape.length or 0.0) * along
        return np.concatenate([_rim(centre - half, along, ends[0]), _rim(centre + half, along, ends[1])]), 0.0
    return _rim(centre, along, shape.radius), shape.tube_radius


def _rim(centre: Array, along: Array, radius: float) -> Array:
    """Points (RIM, 3) m of a circle about a unit vector."""
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    angle = 2.0 * np.pi * np.arange(RIM) / RIM
    return np.asarray(
        centre + radius * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), np.cross(along, first)))
    )
