"""The windows through which ParaView looks into a run: `run.particles.vtkhdf` and `run.fluid.vtkhdf`.

A view holds the times and a few small arrays of its own. Points and fields are links, by relative name, to the
datasets of `run.h5`, so nothing is stored twice. A view is replaced whole, never edited: a reader that opens it at any
moment, or after the writer was killed, finds as many times as there are snapshots.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from suffice.door import disk_words
from suffice.quantities import QUANTITIES, Grid

VERTICES = "suffice/vertices"  # 0 … n in run.h5: both connectivity and offsets of one vertex per particle
ONCE = {"radius": "particles/radius", "id": "particles/id", "species": "particles/species"}

_POLYDATA_CELLS = ("Vertices", "Lines", "Polygons", "Strips")


def view_paths(run: Path) -> tuple[Path, Path]:
    """Return the paths of the particle view and of the fluid view that stand beside a run."""
    stem = run.stem if run.suffix in {".h5", ".hdf5"} else run.name
    return run.with_name(f"{stem}.particles.vtkhdf"), run.with_name(f"{stem}.fluid.vtkhdf")


def write_views(run: Path, times: NDArray[np.float64], n: int, variables: Sequence[str], grid: Grid | None) -> None:
    """Write the views of the first `len(times)` snapshots of a run of n particles, each beside and then renamed.

    `times` (snapshots,) in s. The view of the particles, if there are any, begins with the first snapshot. That of
    the fluid, if there is a `grid`, begins with the second: VTK takes a single step for none at all, and then expects
    fields without time.
    """
    particles, fluid = view_paths(run)
    if len(times) > 0 and "position" in variables:
        with _replacing(particles) as root:
            _fill_particles(root, run.name, times, n, [v for v in variables if not QUANTITIES[v].of_fluid])
    if len(times) > 1 and grid is not None:
        with _replacing(fluid) as root:
            _fill_fluid(root, run.name, times, [v for v in variables if QUANTITIES[v].of_fluid], grid)


def remove_views(run: Path) -> None:
    """Remove the views beside a run, which would show another run once it is replaced."""
    for path in view_paths(run):
        path.unlink(missing_ok=True)


@contextmanager
def _replacing(path: Path) -> Iterator[Any]:
    part = path.with_name(f"{path.name}.part")
    try:
        with h5py.File(part, "w") as file:
            yield file.create_group("VTKHDF")
        os.replace(part, path)
    except (OSError, RuntimeError) as error:  # HDF5's two names for a disk that is full
        part.unlink(missing_ok=True)
        raise OSError(
            f"view {path} cannot be written ({disk_words(error)}); make room, or its folder, and run it again"
        ) from None


def _fill_particles(root: Any, run: str, times: NDArray[np.float64], n: int, variables: Sequence[str]) -> None:
    """Temporal PolyData: one vertex per particle, its topology stored once, points and fields moving on by n a step."""
    _declare(root, "PolyData")
    root["NumberOfPoints"] = np.array([n])
    root["Points"] = h5py.ExternalLink(run, QUANTITIES["position"].dataset)
    for kind in _POLYDATA_CELLS:
        _fill_cells(root.create_group(kind), run, n if kind == "Vertices" else 0)

    zeros, starts = np.zeros(len(times), np.int64), n * np.arange(len(times))
    steps = _fill_steps(root, times)
    steps["NumberOfParts"] = np.ones(len(times), np.int64)
    steps["PartOffsets"] = zeros
    steps["PointOffsets"] = starts
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((len(times), len(_POLYDATA_CELLS)), np.int64)

    moving = {QUANTITIES[v].field: QUANTITIES[v].dataset for v in variables if v != "position"}
    for field, dataset in (moving | ONCE).items():
        root[f"PointData/{field}"] = h5py.ExternalLink(run, dataset)
        steps[f"PointDataOffsets/{field}"] = zeros if field in ONCE else starts


def _fill_cells(cells: Any, run: str, n: int) -> None:
    cells["NumberOfCells"] = cells["NumberOfConnectivityIds"] = np.array([n])
    if n:
        cells["Connectivity"] = cells["Offsets"] = h5py.ExternalLink(run, VERTICES)
    else:
        cells["Connectivity"], cells["Offsets"] = np.zeros(0, np.int64), np.zeros(1, np.int64)


def _fill_fluid(root: Any, run: str, times: NDArray[np.float64], variables: Sequence[str], grid: Grid) -> None:
    """Temporal ImageData: fields at cell centres, one (z, y, x) block a step."""
    _declare(root, "ImageData")
    cells_z, cells_y, cells_x = grid.shape
    root.attrs["WholeExtent"] = np.array([0, cells_x, 0, cells_y, 0, cells_z])
    root.attrs["Origin"] = np.array(grid.origin, np.float64)
    root.attrs["Spacing"] = np.array(grid.spacing, np.float64)
    root.attrs["Direction"] = np.eye(3).ravel()
    steps = _fill_steps(root, times)
    for quantity in (QUANTITIES[v] for v in variables):
        root[f"CellData/{quantity.field}"] = h5py.ExternalLink(run, quantity.dataset)
        steps[f"CellDataOffsets/{quantity.field}"] = np.arange(len(times))


def _declare(root: Any, kind: str) -> None:
    root.attrs["Version"] = np.array([2, 0])
    root.attrs.create("Type", kind.encode("ascii"), dtype=h5py.string_dtype("ascii", len(kind)))


def _fill_steps(root: Any, times: NDArray[np.float64]) -> Any:
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = len(times)
    steps["Values"] = times
    # VTK's reader crashes where a group of offsets is missing, even an empty one
    steps.create_group("PointDataOffsets")
    steps.create_group("CellDataOffsets")
    return steps
