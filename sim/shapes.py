"""Signed distance to the solids that walls are made of.

Parameters of all shapes stand in one array, a row each; rows are read in place, since a view of one costs more than
the distance.
"""

from math import hypot, sqrt

from sim.kernel import Array, inlined

PLANE, TUBE, CYLINDER, BOX = range(4)
PARAMETERS = 8  # numbers that describe any shape


@inlined
def plane_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Height over the plane through p[0:3] with normal p[3:6], and the gradient."""
    height = (x - p[s, 0]) * p[s, 3] + (y - p[s, 1]) * p[s, 4] + (z - p[s, 2]) * p[s, 5]
    return height, p[s, 3], p[s, 4], p[s, 5]


@inlined
def axial_frame(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float, float]:
    """Place along the axis p[3:6] through p[0:3], distance from it, and the unit vector away from it."""
    dx, dy, dz = x - p[s, 0], y - p[s, 1], z - p[s, 2]
    along = dx * p[s, 3] + dy * p[s, 4] + dz * p[s, 5]
    rx, ry, rz = dx - along * p[s, 3], dy - along * p[s, 4], dz - along * p[s, 5]
    distance = sqrt(rx * rx + ry * ry + rz * rz)
    if distance == 0.0:  # on the axis every direction is as good: take one that is perpendicular to it
        rx, ry, rz = (0.0, -p[s, 5], p[s, 4]) if abs(p[s, 3]) < 0.5 else (-p[s, 5], 0.0, p[s, 3])
        length = sqrt(rx * rx + ry * ry + rz * rz)
        return along, 0.0, rx / length, ry / length, rz / length
    return along, distance, rx / distance, ry / distance, rz / distance


@inlined
def tube_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to an endless cylinder of radius p[s, 6], and the gradient."""
    _, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    return distance - p[s, 6], rx, ry, rz


@inlined
def cylinder_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to a capped cylinder of radius p[s, 6] and half length p[s, 7], and the gradient."""
    along, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    up = 1.0 if along >= 0.0 else -1.0
    beyond_side, beyond_cap = distance - p[s, 6], abs(along) - p[s, 7]
    if beyond_side > 0.0 and beyond_cap > 0.0:
        length = hypot(beyond_side, beyond_cap)
        radial, axial = beyond_side / length, up * beyond_cap / length
        return length, radial * rx + axial * p[s, 3], radial * ry + axial * p[s, 4], radial * rz + axial * p[s, 5]
    if beyond_side > beyond_cap:
        return beyond_side, rx, ry, rz
    return beyond_cap, up * p[s, 3], up * p[s, 4], up * p[s, 5]


@inlined
def box_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to a box of centre p[0:3] and half sizes p[3:6], edges along the axes, and the gradient."""
    qx, qy, qz = abs(x - p[s, 0]) - p[s, 3], abs(y - p[s, 1]) - p[s, 4], abs(z - p[s, 2]) - p[s, 5]
    ux = 1.0 if x >= p[s, 0] else -1.0
    uy = 1.0 if y >= p[s, 1] else -1.0
    uz = 1.0 if z >= p[s, 2] else -1.0
    ox, oy, oz = max(qx, 0.0), max(qy, 0.0), max(qz, 0.0)
    length = sqrt(ox * ox + oy * oy + oz * oz)
    if length > 0.0:
        return length, ux * ox / length, uy * oy / length, uz * oz / length
    if qx >= qy and qx >= qz:
        return qx, ux, 0.0, 0.0
    if qy >= qz:
        return qy, 0.0, uy, 0.0
    return qz, 0.0, 0.0, uz


@inlined
def signed_distance(kind: int, p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance φ of a point to a solid, negative inside (paper eq. (13)), and its gradient of length 1."""
    if kind == PLANE:
        return plane_distance(p, s, x, y, z)
    if kind == TUBE:
        return tube_distance(p, s, x, y, z)
    if kind == CYLINDER:
        return cylinder_distance(p, s, x, y, z)
    return box_distance(p, s, x, y, z)
