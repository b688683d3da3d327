"""A program of its own that reads with VTK and hands on plain arrays.

VTK's readers trust their input: a file that is cut or made up can stop the process. So they run apart, with bounded
memory, and `vtk_process` takes their end for an answer. Every request is a line of JSON; every answer is a line of JSON
with the shapes of the arrays, and then their bytes.
"""

import json
import os
import re
import resource
import signal
import sys
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

READERS = {
    "legacy": ("vtkIOLegacy", "vtkDataSetReader"),
    "PolyData": ("vtkIOXML", "vtkXMLPolyDataReader"),
    "UnstructuredGrid": ("vtkIOXML", "vtkXMLUnstructuredGridReader"),
    "ImageData": ("vtkIOXML", "vtkXMLImageDataReader"),
}
NO_POINTS = "No points read!"  # what VTK warns of in a legacy file without particles
TEXT = 1  # VTK's number of a legacy file that is not binary
LINES_OF_HEAD = 4
# VTK's numbers of cell types: empty, vertex, poly-vertex; line, poly-line, triangle, strip, polygon, pixel, quad
HEXAHEDRON, VERTEX_CELLS, FLAT_CELLS = 12, (0, 1, 2), (3, 4, 5, 6, 7, 8, 9)


class BrokenFileError(Exception):
    """What VTK says is wrong with a file."""


def _vtk(module: str) -> Any:
    return import_module(f"vtkmodules.{module}")


def read_file(request: Any) -> list[Any]:
    """Read one file of legacy or XML VTK as one piece."""
    module, name = READERS[request["type"]]
    reader = getattr(_vtk(module), name)()
    reader.SetFileName(request["path"])
    if request["type"] == "legacy":
        for what in ("Scalars", "Vectors", "Fields", "Normals", "Tensors"):
            getattr(reader, f"ReadAll{what}On")()
    reader.Update()
    if reader.GetOutput() is None:
        raise BrokenFileError("it holds no dataset")
    if request["type"] == "legacy" and reader.GetFileType() == TEXT:
        check_text(request["path"], reader.GetOutput())
    return [("", reader.GetOutput())]


def check_text(path: str, data: Any) -> None:
    """Count the numbers of a legacy file: VTK takes those that are missing at its end for zeros, and says nothing."""
    counted, ends = 0, b""
    with open(path, "rb") as file:
        for i, line in enumerate(file):
            words, ends = line.split(), line[-1:]
            counted += len(words) if i >= LINES_OF_HEAD and words and _number(words[0]) and _number(words[-1]) else 0
    if ends.strip():
        raise BrokenFileError("it ends inside a number")
    if counted < (needed := _numbers_in(data)):
        raise BrokenFileError(f"it holds {counted} numbers of {needed}")


def _number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _numbers_in(data: Any) -> int:
    """Return how many numbers a dataset needs at least: coordinates, cells and arrays."""
    sides = (data.GetPointData(), data.GetCellData(), data.GetFieldData())
    arrays = [side.GetArray(i) for side in sides for i in range(side.GetNumberOfArrays())]
    needed = sum(array.GetNumberOfValues() for array in arrays if array is not None)
    if data.IsA("vtkPointSet"):
        needed += 3 * data.GetNumberOfPoints()
    kinds = ["Verts", "Lines", "Polys", "Strips"] if data.IsA("vtkPolyData") else []
    kinds += ["Cells"] if data.IsA("vtkUnstructuredGrid") else []
    for cells in (getattr(data, f"Get{kind}")() for kind in kinds):
        needed += cells.GetNumberOfCells() + cells.GetNumberOfConnectivityIds() if cells is not None else 0
    return int(needed)


@cache
def _case(path: str, decomposed: bool) -> Any:
    """Return the reader of a case, which keeps its mesh from one time to the next."""
    _vtk("vtkParallelCore")
    if decomposed:
        reader = _vtk("vtkIOParallel").vtkPOpenFOAMReader()
        reader.SetCaseType(reader.DECOMPOSED_CASE)
    else:
        reader = _vtk("vtkIOGeometry").vtkOpenFOAMReader()
    reader.SetFileName(path)
    reader.SkipZeroTimeOff()
    reader.CreateCellToPointOff()
    reader.AddDimensionsToArrayNamesOn()
    reader.UpdateInformation()
    return reader


def read_case(request: Any) -> tuple[list[Any], list[float]]:
    """Read an OpenFOAM case at a time, if one is asked for; return its cells, its clouds and all its times."""
    reader = _case(request["path"], request["decomposed"])
    known = reader.GetTimeValues()
    times = [known.GetValue(i) for i in range(known.GetNumberOfTuples())] if known else []
    if request.get("time") is None:
        return [], times
    reader.UpdateTimeStep(request["time"])  # now it knows what there is at that time
    for i in range(reader.GetNumberOfPatchArrays()):
        name = reader.GetPatchArrayName(i)
        reader.SetPatchArrayStatus(name, name == "internalMesh" or name.startswith("lagrangian/"))
    reader.EnableAllCellArrays()
    reader.EnableAllLagrangianArrays()
    reader.DisableAllPointArrays()
    reader.UpdateTimeStep(request["time"])
    return list(_leaves(reader.GetOutput(), "")), times


def _leaves(block: Any, name: str) -> Any:
    """Yield name and dataset of everything below a block."""
    if not hasattr(block, "GetNumberOfBlocks"):
        if block is not None:
            yield name, block
        return
    for i in range(block.GetNumberOfBlocks()):
        known = block.GetMetaData(i) if block.HasMetaData(i) else None
        below = known.Get(block.NAME()) if known is not None else None
        yield from _leaves(block.GetBlock(i), f"{name}/{below or i}")


def describe(name: str, data: Any, wanted: list[str] | None) -> tuple[Any, dict[str, Any]]:
    """Return what a dataset is, in plain types, and its arrays; of those with names only the wanted ones, or all."""
    arrays: dict[str, Any] = {}
    known: dict[str, list[str]] = {}
    for kind, side in (("point", data.GetPointData()), ("cell", data.GetCellData()), ("field", data.GetFieldData())):
        known[kind] = []
        for i in range(side.GetNumberOfArrays()):
            array = side.GetArray(i)
            if array is None or array.GetName() is None:
                continue
            known[kind].append(array.GetName())
            if kind == "field" or wanted is None or array.GetName() in wanted:
                arrays[f"{kind}:{array.GetName()}"] = _numbers(array)
    facts = {"name": name, "known": known, "points": data.GetNumberOfPoints(), "cells": data.GetNumberOfCells()}
    if data.IsA("vtkImageData"):
        facts |= {"kind": "image", "extent": data.GetExtent(), "origin": data.GetOrigin(), "spacing": data.GetSpacing()}
        facts["turned"] = not data.GetDirectionMatrix().IsIdentity()
        return facts, arrays
    if not data.IsA("vtkPointSet"):
        raise BrokenFileError(f"it holds {data.GetClassName()}, neither points nor cells of a uniform grid")
    facts["kind"] = _kind(data)
    points = data.GetPoints()
    arrays["points"] = np.zeros((0, 3)) if points is None else _numbers(points.GetData())
    if facts["kind"] == "cells":
        arrays |= _hexahedra(data)
    return facts, arrays


def _kind(data: Any) -> str:
    """Return whether points with cells are particles, walls (triangles, or lines between particles), or cells."""
    if data.IsA("vtkPolyData"):
        return "particles" if data.GetNumberOfCells() == data.GetNumberOfVerts() else "walls"
    kinds = data.GetDistinctCellTypesArray() if data.GetNumberOfCells() else None
    found = set() if kinds is None else {kinds.GetValue(i) for i in range(kinds.GetNumberOfValues())}
    if found <= set(VERTEX_CELLS):
        return "particles"
    return "walls" if found <= {*VERTEX_CELLS, *FLAT_CELLS} else "cells"


def _hexahedra(data: Any) -> dict[str, Any]:
    """Return the eight points of every cell, nothing where a cell is no hexahedron."""
    kinds = data.GetDistinctCellTypesArray() if data.IsA("vtkUnstructuredGrid") else None
    if kinds is None or [kinds.GetValue(i) for i in range(kinds.GetNumberOfValues())] != [HEXAHEDRON]:
        return {}
    return {"hexahedra": _numbers(data.GetCells().GetConnectivityArray()).reshape(-1, 8)}


def _numbers(array: Any) -> Any:
    return np.ascontiguousarray(_vtk("util.numpy_support").vtk_to_numpy(array))


def answer(request: Any) -> tuple[Any, list[Any]]:
    """Return the answer to one request and the arrays that follow it. Raises BrokenFileError."""
    said = _vtk("vtkCommonCore").vtkStringOutputWindow()
    said.SetInstance(said)
    times: list[float] = []
    if request["type"] == "OpenFOAM":
        datasets, times = read_case(request)
    else:
        datasets = read_file(request)
    if text := said.GetOutput().strip():
        lines = [re.sub(r"^vtk\w+ \(0x\w+\): ", "", line.strip()) for line in text.splitlines() if line.strip()]
        told = [line for line in lines if not line.startswith(("ERROR", "Warning"))] or lines
        if told != [NO_POINTS]:
            raise BrokenFileError(told[0][:200])
    pieces = [describe(name, data, request.get("wanted")) for name, data in datasets]
    heads = [
        facts | {"arrays": {key: [array.dtype.str, array.shape] for key, array in arrays.items()}}
        for facts, arrays in pieces
    ]
    return {"pieces": heads, "times": times}, [array for _, arrays in pieces for array in arrays.values()]


def limit_memory(size: int) -> None:
    """Let the process take no more bytes of address space than this, where the system can hold it to that."""
    if sys.platform == "linux":
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (size if most == resource.RLIM_INFINITY else min(size, most), most))


def main() -> None:
    """Answer requests until there are no more."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever VTK prints must not stand among the answers
    try:
        _vtk("vtkCommonCore")
    except ModuleNotFoundError:
        out.write(b'{"absent": true}\n')
        return
    for line in sys.stdin.buffer:
        request = json.loads(line)
        limit_memory(request["memory"])
        signal.alarm(request["seconds"])  # which ends the process: VTK may wait or turn in circles without end
        try:
            head, arrays = answer(request)
        except (BrokenFileError, MemoryError) as error:
            head, arrays = {"broken": str(error) or "it needs more memory than a file of its size may"}, []
        signal.alarm(0)
        out.write(json.dumps(head).encode() + b"\n")
        for array in arrays:
            out.write(array.data)
        out.flush()


if __name__ == "__main__":
    main()
