"""Closed surfaces of triangles: read from STL files, checked, and how far a point is from them."""

from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim.errors import InputError
from sim.kernel import Array, Indices

AT_ONCE = 500_000  # points whose distance is asked for together


class Mesh(NamedTuple):
    """Triangles of a closed surface, counter-clockwise seen from outside."""

    vertices: Array  # (v, 3) m
    triangles: Indices  # (t, 3)


def _vtk(module: str) -> Any:
    """Return a module of VTK, imported when a mesh is read: it takes a second, and is an extra."""
    return import_module(f"vtkmodules.{module}")


def library_version() -> str:
    """Version of the library that reads meshes and measures distances."""
    return str(_vtk("vtkCommonCore").vtkVersion().GetVTKVersion())


def read_stl(field: str, file: str, scale: float) -> Mesh:
    """Read a mesh, its coordinates times a scale.

    Raises InputError where there is no such file, no reader is installed, or the surface is not closed.
    """
    if not Path(file).is_file():
        raise InputError(
            f"{field}.file = {file!r}: no such file in {Path.cwd()}; give a path from there, or a full one"
        )
    try:
        numpy_of, reader = _vtk("util.numpy_support").vtk_to_numpy, _vtk("vtkIOGeometry").vtkSTLReader()
    except ModuleNotFoundError:
        raise InputError(f"{field}.file = {file!r}: to read a mesh, `pip install vtk`") from None
    reader.SetFileName(file)
    warns = reader.GetGlobalWarningDisplay()
    reader.SetGlobalWarningDisplay(0)  # what is wrong with the file is said below
    reader.Update()
    reader.SetGlobalWarningDisplay(warns)
    found = reader.GetOutput()
    if not found.GetNumberOfCells():
        raise InputError(f"{field}.file = {file!r}: holds no triangles; give an STL file, ASCII or binary")
    vertices = numpy_of(found.GetPoints().GetData()).astype(np.float64) * scale
    triangles = numpy_of(found.GetPolys().GetConnectivityArray()).astype(np.int64).reshape(-1, 3)
    return closed(f"{field}.file = {file!r}", Mesh(vertices, triangles))


def closed(field: str, mesh: Mesh) -> Mesh:
    """Return the mesh with its triangles seen counter-clockwise from outside, those without an area left out.

    Raises InputError where an edge does not belong to two triangles, or where two triangles disagree on their outside.
    """
    a, b, c = mesh.triangles.T
    triangles = mesh.triangles[(a != b) & (b != c) & (c != a)]
    ways = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    _, shared = np.unique(np.sort(ways, axis=1), axis=0, return_counts=True)
    wrong = {"open edges": int((shared == 1).sum()), "edges of more than two triangles": int((shared > 2).sum())}
    if any(wrong.values()):
        said = " and ".join(f"{count} {name}" for name, count in wrong.items() if count)
        raise InputError(f"{field}: has {said}, so it does not enclose a solid; close the mesh where it was made")
    twice = len(ways) - len(np.unique(ways, axis=0))
    if twice:
        raise InputError(
            f"{field}: at {twice} edges two triangles disagree on which side is outside; unify the normals"
        )
    corners = mesh.vertices[triangles]
    volume = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    return Mesh(mesh.vertices, triangles if volume > 0.0 else triangles[:, ::-1].copy())


class ExactDistance:
    """Signed distance to the triangles themselves, by the pseudonormal of the nearest face, edge or corner."""

    def __init__(self, mesh: Mesh) -> None:
        to_vtk, model = _vtk("util.numpy_support"), _vtk("vtkCommonDataModel")
        points, cells, surface = _vtk("vtkCommonCore").vtkPoints(), model.vtkCellArray(), model.vtkPolyData()
        points.SetData(to_vtk.numpy_to_vtk(mesh.vertices, deep=1))
        cells.SetData(3, to_vtk.numpy_to_vtkIdTypeArray(mesh.triangles.ravel(), deep=1))
        surface.SetPoints(points)
        surface.SetPolys(cells)
        self._function = _vtk("vtkFiltersCore").vtkImplicitPolyDataDistance()
        self._function.SetInput(surface)

    def __call__(self, points: Array) -> Array:
        """Distance of points (n, 3) m, shape (n,) m, negative inside."""
        convert, distance = _vtk("util.numpy_support"), np.zeros(len(points))
        for start in range(0, len(points), AT_ONCE):
            some = np.ascontiguousarray(points[start : start + AT_ONCE])
            found = _vtk("vtkCommonCore").vtkDoubleArray()
            self._function.EvaluateFunction(convert.numpy_to_vtk(some, deep=1), found)
            distance[start : start + AT_ONCE] = convert.vtk_to_numpy(found)
        return distance
