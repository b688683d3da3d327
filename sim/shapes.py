"""Signed distance to the solids that walls are made of.

Parameters of all shapes stand in one array, a row each; rows are read in place, since a view of one costs more than
the distance.
"""

from math import hypot, sqrt

from sim.kernel import Array, inlined, kernel

PLANE, TUBE, CYLINDER, BOX, SPHERE, CAPSULE, TORUS, FUNNEL, FRUSTUM, SHELL = range(10)
COMBINATION, MESH = 10, 11  # these stand for more than a row of numbers: see sim/combination.py and sim/gridded.py
ON_AXIS = 1e-8  # of the height: nearer to the axis, the direction away from it is lost in rounding
PARAMETERS = 10  # numbers that describe any shape


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
    if distance <= ON_AXIS * abs(along):  # every direction is as good: take one that is perpendicular to the axis
        rx, ry, rz = (0.0, -p[s, 5], p[s, 4]) if abs(p[s, 3]) < 0.5 else (-p[s, 5], 0.0, p[s, 3])
        length = sqrt(rx * rx + ry * ry + rz * rz)
        return along, distance, rx / length, ry / length, rz / length
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
def axial_distance(
    p: Array, s: int, radial: float, axial: float, out: float, up: float, rx: float, ry: float, rz: float
) -> tuple[float, float, float, float]:
    """Length (m) of a vector in the plane through the axis p[3:6] and the point, and its direction.

    The vector has a part along the unit vector r away from the axis, and one along the axis; where it vanishes,
    `out` and `up`, of any length, stand for its direction.
    """
    length = sqrt(radial * radial + axial * axial)
    size = length
    if length == 0.0:
        radial, axial, size = out, up, sqrt(out * out + up * up)
    a, b = radial / size, axial / size
    return length, a * rx + b * p[s, 3], a * ry + b * p[s, 4], a * rz + b * p[s, 5]


@inlined
def sphere_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to a sphere of centre p[0:3] and radius p[s, 3], and the gradient."""
    dx, dy, dz = x - p[s, 0], y - p[s, 1], z - p[s, 2]
    distance = sqrt(dx * dx + dy * dy + dz * dz)
    if distance == 0.0:
        return -p[s, 3], 0.0, 0.0, 1.0
    return distance - p[s, 3], dx / distance, dy / distance, dz / distance


@inlined
def capsule_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to all points within p[s, 6] of a segment of half length p[s, 7], and the gradient."""
    along, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    beyond = along - min(max(along, -p[s, 7]), p[s, 7])
    d, nx, ny, nz = axial_distance(p, s, distance, beyond, 1.0, 0.0, rx, ry, rz)
    return d - p[s, 6], nx, ny, nz


@inlined
def torus_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to all points within p[s, 7] of a circle of radius p[s, 6] about the axis, and the gradient."""
    along, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    d, nx, ny, nz = axial_distance(p, s, distance - p[s, 6], along, 1.0, 0.0, rx, ry, rz)
    return d - p[s, 7], nx, ny, nz


@inlined
def funnel_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to the endless cone of radius p[s, 6] at −half, p[s, 7] at +half, half = p[s, 8], and the gradient.

    Exact within the cone, where it is a half plane in every plane through the axis; it has no end at its tip.
    """
    along, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    widening = 0.5 * (p[s, 7] - p[s, 6]) / p[s, 8]
    steep = 1.0 / sqrt(1.0 + widening * widening)  # cosine of the half angle
    d = (distance - 0.5 * (p[s, 6] + p[s, 7]) - widening * along) * steep
    a, b = steep, -widening * steep
    return d, a * rx + b * p[s, 3], a * ry + b * p[s, 4], a * rz + b * p[s, 5]


@inlined
def from_slant(p: Array, s: int, along: float, distance: float) -> tuple[float, float]:
    """Vector (radial, axial; m) from the nearest point of the lateral side, from (p[6], −half) to (p[7], +half)."""
    widens, rises = p[s, 7] - p[s, 6], 2.0 * p[s, 8]
    radial, axial = distance - p[s, 6], along + p[s, 8]
    at = min(max((radial * widens + axial * rises) / (widens * widens + rises * rises), 0.0), 1.0)
    return radial - at * widens, axial - at * rises


@inlined
def frustum_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to a truncated cone with flat ends, radii p[s, 6] at −half and p[s, 7] at +half, and the gradient."""
    along, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    half = p[s, 8]
    up, end = (1.0, p[s, 7]) if along >= 0.0 else (-1.0, p[s, 6])
    here = 0.5 * (p[s, 6] + p[s, 7]) + 0.5 * (p[s, 7] - p[s, 6]) * along / half
    radial, axial = from_slant(p, s, along, distance)
    over, beyond = distance - min(distance, end), along - up * half
    out, outward = 2.0 * half, p[s, 6] - p[s, 7]
    if over * over + beyond * beyond < radial * radial + axial * axial:
        radial, axial = over, beyond
        out, outward = 0.0, up
    if distance < here and abs(along) < half:
        d, nx, ny, nz = axial_distance(p, s, -radial, -axial, out, outward, rx, ry, rz)
        return -d, nx, ny, nz
    return axial_distance(p, s, radial, axial, out, outward, rx, ry, rz)


@inlined
def shell_distance(p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance to the thin lateral side of a truncated cone, positive on both of its sides, and the gradient.

    With a half length of zero it is a ring; and a disc where one of its radii is zero as well.
    """
    along, distance, rx, ry, rz = axial_frame(p, s, x, y, z)
    radial, axial = from_slant(p, s, along, distance)
    return axial_distance(p, s, radial, axial, -2.0 * p[s, 8], p[s, 7] - p[s, 6], rx, ry, rz)


@kernel
def rarer_distance(kind: int, p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Do the same as `signed_distance`, for shapes that are called instead of compiled into every loop."""
    if kind == SPHERE:
        return sphere_distance(p, s, x, y, z)
    if kind == CAPSULE:
        return capsule_distance(p, s, x, y, z)
    if kind == TORUS:
        return torus_distance(p, s, x, y, z)
    if kind == FUNNEL:
        return funnel_distance(p, s, x, y, z)
    if kind == FRUSTUM:
        return frustum_distance(p, s, x, y, z)
    return shell_distance(p, s, x, y, z)


@inlined
def signed_distance(kind: int, p: Array, s: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Distance φ of a point to a solid, negative inside (paper eq. (13)), and its gradient of length 1."""
    if kind == PLANE:
        return plane_distance(p, s, x, y, z)
    if kind == TUBE:
        return tube_distance(p, s, x, y, z)
    if kind == CYLINDER:
        return cylinder_distance(p, s, x, y, z)
    if kind == BOX:
        return box_distance(p, s, x, y, z)
    return rarer_distance(kind, p, s, x, y, z)
