"""From the tables of walls to solids, in the frame of their body."""

from math import pi

import numpy as np

from sim.combination import LEAST, MOST, Combined, Solid, complement
from sim.errors import InputError
from sim.gridded import FAR, Gridded, gridded_parameters
from sim.kernel import Array
from sim.mesh import REACH, mesh_distance, spacing_for
from sim.motion import rotation_about
from sim.shapes import BOX, CAPSULE, CYLINDER, FRUSTUM, FUNNEL, MESH, PARAMETERS, PLANE, SHELL, SPHERE, TORUS, TUBE
from sim.vessel import (
    AnyShape,
    Box,
    Capsule,
    Combination,
    Cone,
    Cylinder,
    Mesh,
    Plane,
    Rotation,
    Sphere,
    WallTable,
)

OUTSIDE, INSIDE = 1.0, -1.0


def direction(field: str, vector: tuple[float, float, float]) -> Array:
    """Return the vector at length 1; InputError where it has none."""
    length = float(np.linalg.norm(vector))
    if not 0.0 < length < np.inf:
        raise InputError(f"{field} = {list(vector)}: has no direction; give a vector of finite, non-zero length")
    return np.array(vector) / length


class Meshes:
    """Gridded distances to the meshes of a scene, one after the other in two arrays."""

    def __init__(self, diameters: list[float]) -> None:
        self.spacing = spacing_for(min(diameters))
        self.margin = REACH * max(diameters)
        self.grids: list[Gridded] = []

    def add_(self, field: str, table: Mesh) -> Solid:
        """Put the mesh of a table beside the others and return its shape."""
        spacing = table.resolution or self.spacing
        grid = mesh_distance(field, table.file, table.scale, spacing, self.margin)
        first = sum(len(before.blocks) for before in self.grids)
        self.grids.append(grid)
        return _solid(MESH, *gridded_parameters(grid, first))

    def arrays(self) -> tuple[Array | None, Array | None]:
        """Return blocks (b, 2) and coefficients (stored, 10, 10, 10) of all meshes, or None where there is none."""
        if not self.grids:
            return None, None
        blocks, stored = [], 0
        for grid in self.grids:
            place = grid.blocks[:, 0]
            blocks.append(np.stack([np.where(place == FAR, FAR, place + stored), grid.blocks[:, 1]], axis=1))
            stored += len(grid.spline)
        return np.concatenate(blocks), np.concatenate([grid.spline for grid in self.grids])


def _solid(kind: int, *values: object, side: float = OUTSIDE) -> Solid:
    row = np.zeros(PARAMETERS)
    flat = np.concatenate([np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in values])
    row[: len(flat)] = flat
    return Solid(kind, row, side)


def _plane(point: Array, normal: Array) -> Solid:
    return _solid(PLANE, point, normal)


def _corners(field: str, box: Box) -> tuple[Array, Array]:
    lowest, highest = np.array(box.lowest), np.array(box.highest)
    if not (lowest < highest).all():
        raise InputError(
            f"{field}.highest = {list(box.highest)} m: must exceed lowest = {list(box.lowest)} m in every direction"
        )
    return lowest, highest


def _faces(field: str, box: Box) -> list[Solid]:
    """Return the planes that hold particles in a box."""
    lowest, highest = _corners(field, box)
    faces = []
    for axis, name in enumerate("xyz"):
        for sign, corner, inward in (("-", lowest, 1.0), ("+", highest, -1.0)):
            if f"{sign}{name}" not in box.open:
                faces.append(_plane(corner, inward * np.eye(3)[axis]))
    return faces


def _radii(field: str, shape: Cylinder | Cone) -> tuple[float, float]:
    if isinstance(shape, Cylinder):
        return shape.radius, shape.radius
    if min(shape.radii) < 0.0 or max(shape.radii) == 0.0:
        raise InputError(f"{field}.radii = {list(shape.radii)} m: must not be negative, nor both zero")
    return shape.radii


def _hollow(field: str, shape: Cylinder | Cone) -> list[Solid]:
    """Return the side and the ends that hold particles in a cylinder or a cone; thin walls where an end is open."""
    axis, centre, radii = direction(f"{field}.axis", shape.axis), np.array(shape.centre), _radii(field, shape)
    if shape.length is None:
        return [_solid(TUBE, centre, axis, radii[0], side=INSIDE)]
    half = 0.5 * shape.length
    ends = [(name, sign, radius) for name, sign, radius in (("-", -1.0, radii[0]), ("+", 1.0, radii[1])) if radius]
    if shape.open:
        closed = [(sign, radius) for name, sign, radius in ends if name not in shape.open]
        discs = [_solid(SHELL, centre + sign * half * axis, axis, 0.0, radius, 0.0) for sign, radius in closed]
        return [_solid(SHELL, centre, axis, *radii, half), *discs]
    caps = [_plane(centre + sign * half * axis, -sign * axis) for _, sign, _ in ends]
    if isinstance(shape, Cylinder):
        return [_solid(TUBE, centre, axis, shape.radius, side=INSIDE), *caps]
    return [_solid(FUNNEL, centre, axis, *radii, half, side=INSIDE), *caps]


def _copies(field: str, shape: AnyShape, motion: object) -> list[AnyShape]:
    if not isinstance(shape, Cylinder) or shape.copies == 1:
        return [shape]
    if not isinstance(motion, Rotation):
        raise InputError(f"{field}.copies = {shape.copies}: only a body with a rotation has an axis to copy about")
    axis, point = direction(f"{field}.motion.axis", motion.axis), np.array(motion.point)
    turned: list[AnyShape] = []
    for k in range(shape.copies):
        turn = np.zeros((3, 3))
        rotation_about(axis, 2.0 * pi * k / shape.copies, turn)
        centre = turn @ (np.array(shape.centre) - point) + point
        pointing = turn @ np.array(shape.axis)
        turned.append(shape.model_copy(update={"centre": tuple(centre), "axis": tuple(pointing), "copies": 1}))
    return turned


def _filled(field: str, shape: AnyShape, motion: object, meshes: Meshes) -> Solid | Combined:
    """Return a shape as one solid with the particles outside of it."""
    copies = _copies(field, shape, motion)
    if len(copies) > 1:
        return Combined(LEAST, [_filled(field, copy, motion, meshes) for copy in copies])
    if isinstance(shape, Combination):
        members = [_filled(f"{field}.of.{k}", member, motion, meshes) for k, member in enumerate(shape.of)]
        if shape.operation == "difference":
            members = [members[0], *map(complement, members[1:])]
        return Combined(LEAST if shape.operation == "union" else MOST, members)
    if isinstance(shape, Mesh):
        return meshes.add_(field, shape)
    return _primitive(field, shape)


def _primitive(field: str, shape: AnyShape) -> Solid:
    if isinstance(shape, Plane):
        return _plane(np.array(shape.point), direction(f"{field}.normal", shape.normal))
    if isinstance(shape, Box):
        lowest, highest = _corners(field, shape)
        return _solid(BOX, (lowest + highest) / 2, (highest - lowest) / 2)
    assert not isinstance(shape, Mesh | Combination)
    if isinstance(shape, Sphere):
        return _solid(SPHERE, shape.centre, shape.radius)
    frame = np.array(shape.centre), direction(f"{field}.axis", shape.axis)
    if isinstance(shape, Cylinder):
        if shape.length is None:
            return _solid(TUBE, *frame, shape.radius)
        return _solid(CYLINDER, *frame, shape.radius, shape.length / 2)
    if isinstance(shape, Cone):
        return _solid(FRUSTUM, *frame, *_radii(field, shape), shape.length / 2)
    if isinstance(shape, Capsule):
        return _solid(CAPSULE, *frame, shape.radius, shape.length / 2)
    if shape.tube_radius > shape.radius:
        raise InputError(
            f"{field}.tube_radius = {shape.tube_radius:g} m: leaves no hole; at most radius {shape.radius:g}"
        )
    return _solid(TORUS, *frame, shape.radius, shape.tube_radius)


def solids_of(index: int, table: WallTable, meshes: Meshes) -> list[Solid | Combined]:
    """Return the shapes of a body, each of which acts by itself, in its frame.

    Particles inside of a box, a cylinder or a cone are held by its faces one by one; any other shape is one solid.
    """
    solids: list[Solid | Combined] = []
    for k, shape in enumerate(table.shapes):
        field = f"walls.{index}.shapes.{k}"
        for copy in _copies(field, shape, table.motion):
            inside = not isinstance(copy, Plane) and copy.particles == "inside"
            if inside and isinstance(copy, Box):
                solids += _faces(field, copy)
            elif inside and isinstance(copy, Cylinder | Cone):
                solids += _hollow(field, copy)
            else:
                solid = _filled(field, copy, table.motion, meshes)
                solids.append(complement(solid) if inside else solid)
    return solids
