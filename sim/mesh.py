"""Walls from STL files: signed distance to a closed mesh of triangles, put on a grid and kept between runs."""

import hashlib
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from sim.errors import InputError
from sim.gridded import BLOCK, FAR, STORED, Gridded, coefficients
from sim.triangles import ExactDistance, Mesh, library_version, read_stl

NODES_PER_DIAMETER = 8  # of the smallest particle, unless a scene says otherwise: see `spacing_for`
REACH = 0.55  # largest diameters from the surface up to which φ is stored: past the radius of any particle
MOST_BLOCKS = 4_000_000  # of the whole grid
MOST_STORED = 250_000  # blocks near the surface, 2 GB


def spacing_for(diameter: float) -> float:
    """Spacing h (m) at which φ is known to 1 % of this smallest diameter d (m), d/8, where walls are flat or convex.

    There the error at φ = r is of third order beside edges, second across them: 0.23 % of d measured at h = d/8 around
    a block, 0.95 % at d/4. In a concave edge φ has a kink that no smooth interpolation can follow: the error is h/4 at
    most, 3 % of d, and the edge is met as rounded by that.
    """
    return diameter / NODES_PER_DIAMETER


def gridded_mesh(field: str, mesh: Mesh, spacing: float, margin: float) -> Gridded:
    """Put the distance to a mesh on a grid, in blocks that come closer to the surface than the margin (m).

    Raises InputError where that would take more memory than a wall should.
    """
    origin = mesh.vertices.min(axis=0) - margin - 1.5 * spacing
    size = mesh.vertices.max(axis=0) + margin + 1.5 * spacing - origin
    counts = np.floor(size / (spacing * BLOCK)).astype(np.int64) + 1
    _refuse_more_than(MOST_BLOCKS, int(np.prod(counts)), field, spacing, mesh)
    exact = ExactDistance(mesh)
    corner = np.stack(np.unravel_index(np.arange(np.prod(counts)), tuple(counts)), axis=1) * BLOCK  # first nodes
    phi = exact(origin + (corner + 0.5 * (BLOCK - 1)) * spacing)
    half_diagonal = 0.5 * np.sqrt(3.0) * BLOCK * spacing
    near = np.abs(phi) <= margin + half_diagonal
    _refuse_more_than(MOST_STORED, int(near.sum()), field, spacing, mesh)
    blocks = np.stack([np.full(len(phi), FAR), np.sign(phi) * (np.abs(phi) - half_diagonal)], axis=1)
    blocks[near, 0] = np.arange(near.sum())
    wanted = np.arange(-2, STORED)  # a node more than is stored, for second differences
    local = np.stack(np.meshgrid(wanted, wanted, wanted, indexing="ij"), axis=-1).reshape(-1, 3)
    extent = counts * BLOCK + 4
    nodes = (corner[near][:, None] + local + 2) @ np.array([extent[1] * extent[2], extent[2], 1])
    unique, place = np.unique(nodes, return_inverse=True)
    index = np.stack(np.unravel_index(unique, tuple(extent)), axis=1) - 2
    values = exact(origin + index * spacing)[place.ravel()].reshape(-1, *[len(wanted)] * 3)
    return Gridded(origin, spacing, counts, margin, blocks, coefficients(values))


def _refuse_more_than(most: int, blocks: int, field: str, spacing: float, mesh: Mesh) -> None:
    if blocks > most:
        across = float(np.ptp(mesh.vertices, axis=0).max())
        raise InputError(
            f"{field}.resolution = {spacing:.3g} m: takes {blocks:.3g} blocks of {BLOCK}³ nodes (at most {most:.3g}) "
            f"for a mesh {across:.3g} m across; give scale = 1e-3 if its file is in mm, else use "
            f"{spacing * (blocks / most) ** 0.5:.2g} m or more, or build the wall of cylinders, boxes and cones"
        )


def _cache_file(key: str) -> Path:
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "suffice" / "sdf" / f"{key}.npz"


def _kept(path: Path) -> Gridded | None:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
            spacing, margin = float(kept["spacing"]), float(kept["margin"])
            return Gridded(kept["origin"], spacing, kept["counts"], margin, kept["blocks"], kept["spline"])
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None  # not there, or cut off: made again


def _keep(path: Path, grid: Gridded) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".npz", delete=False) as beside:
            np.savez(beside, allow_pickle=False, **grid._asdict())
        os.replace(beside.name, path)
    except OSError:
        return  # a read-only home: computed again in every run


def mesh_distance(field: str, file: str, scale: float, spacing: float, margin: float) -> Gridded:
    """Return the gridded distance to the mesh of an STL file, from the cache where it has been made before.

    The cache, `suffice/sdf` below XDG_CACHE_HOME, knows it by the file's bytes, scale, spacing, margin, this code and
    the version of the library. Raises InputError for a mesh that `read_stl` or `gridded_mesh` refuses.
    """
    mesh = read_stl(field, file, scale)
    digest = hashlib.sha256(Path(file).read_bytes())
    for source in ("mesh.py", "triangles.py", "gridded.py"):
        digest.update((Path(__file__).parent / source).read_bytes())
    digest.update(repr((scale, spacing, margin, library_version())).encode())
    path = _cache_file(digest.hexdigest())
    grid = _kept(path)
    if grid is None:
        grid = gridded_mesh(field, mesh, spacing, margin)
        _keep(path, grid)
    return grid
