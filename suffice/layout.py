"""The plan of `run.h5`: which dataset holds what, and how large it is."""

import math
from typing import Any

import h5py

from suffice.hdf5_memory import bounded_memory
from suffice.quantities import Grid, Quantity
from suffice.refusal import Refusal

VERSION = 1  # of this plan
PLAN = "suffice/layout"  # the version a file was made by; without it, HDF5 is no run
COUNTER = "suffice/complete"  # snapshots that are complete; written last
TIME = "suffice/time"  # (steps,) s
SERIES = "suffice/series"  # diagnostics over time, (steps,) each
IMPACT_ENERGY = "suffice/impacts/energy"  # edges of the bins, (bins + 1,) J; absent where impacts are not counted
IMPACT_RATE = "suffice/impacts/rate"  # (steps, 2, bins) 1/s since the snapshot before, of pairs and with walls
PROVENANCE = "suffice/provenance"  # what made the run, one text each
FOUND = "suffice/in_situ/found"  # what watching and thinning found, JSON as plain text, empty until the run has ended
SUMMARY = "suffice/summary"  # what the run told when it ended or was stopped, JSON as plain text, empty until then
PACE = "suffice/pace"  # how fast that was, alike: no two runs of a scene have the same
WATCHED_TIME = "suffice/in_situ/time"  # (watched,) s, of a thinned run: the output times, of which some were kept
PRODUCTS = "suffice/in_situ/products"  # (watched, watched) (w_i - w_0)·(w_j - w_0) per variable of a thinned run
HISTORY = "suffice/in_situ/history"  # (watched, rows) of every variable watched, while a run that is thinned goes on
VERTICES = "suffice/vertices"  # 0 … n, connectivity and offsets of one vertex per particle, for the views
ID, RADIUS, SPECIES = "particles/id", "particles/radius", "particles/species"  # once per run, (n,)
ORIGIN, SPACING = "fluid/origin", "fluid/spacing"  # of the grid, (3,) m


def shape_of(quantity: Quantity, n_snapshots: int, n: int, grid: Grid | None) -> tuple[int, ...]:
    """Return the shape of its dataset: (steps·n, 3) on particles, (steps, z, y, x[, 3]) in cells."""
    vector = (quantity.components,) if quantity.components > 1 else ()
    if not quantity.of_fluid:
        return (n_snapshots * n, *vector)
    if grid is None:
        raise ValueError(f"{quantity.dataset} needs a grid")
    return (n_snapshots, *grid.shape, *vector)


def index_of(quantity: Quantity, k: int, n: int) -> slice | int:
    """Return where snapshot k lies along the first axis of the dataset."""
    return k if quantity.of_fluid else slice(k * n, (k + 1) * n)


def bytes_of(shapes: list[tuple[int, ...]], itemsize: int) -> int:
    """Return the bytes that datasets of these shapes take."""
    return itemsize * sum(math.prod(shape) for shape in shapes)


@bounded_memory()
def hard_node(file: Any, name: str) -> Any:
    """Return a group or dataset that lies in this file itself, or None where there is none.

    Raises `Refusal` where it leads out of the file by a link, a virtual dataset or external storage, or declares more
    numbers than the file holds: a file that came from elsewhere must not make us read other files, nor take memory
    that its own size does not foretell.
    """
    node = file
    for part in name.split("/"):
        if not isinstance(node, h5py.Group) or part not in node:
            return None
        if not isinstance(node.get(part, getlink=True), h5py.HardLink):
            raise Refusal(f"{file.filename}: {name} is a link; it must hold its own data: copy them into it")
        node = node[part]
    if isinstance(node, h5py.Dataset) and (node.is_virtual or node.external):
        raise Refusal(f"{file.filename}: {name} lies in another file; it must hold its own data: copy them into it")
    if isinstance(node, h5py.Dataset) and node.dtype.kind not in "fiuS":  # references, and lengths that HDF5 trusts
        raise Refusal(f"{file.filename}: {name} holds neither numbers nor plain text; make it again")
    if isinstance(node, h5py.Dataset) and not _held(node):
        raise Refusal(
            f"{file.filename}: {name} declares {node.shape} numbers, of which {node.id.get_storage_size()} bytes are "
            "in the file; make it again, or unpack it with `h5repack -f NONE`"
        )
    return node


def _held(node: h5py.Dataset) -> bool:
    """Tell whether all that a dataset declares is in the file, neither left out nor compressed."""
    stored = min(node.id.get_storage_size(), node.file.id.get_filesize())
    return node.shape is not None and node.nbytes <= stored
