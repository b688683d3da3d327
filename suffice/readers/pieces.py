"""A snapshot made of datasets that VTK read: which array is what, and the particles and fields they give."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import QUANTITIES
from suffice.readers.names import CELLS, PARTICLES, find_ids, find_names
from suffice.readers.trajectory import Frame
from suffice.readers.uniform import Cells
from suffice.readers.vtk_process import Piece
from suffice.refusal import Refusal

KINEMATIC = "[m2/s2]"  # p/ρ, as incompressible solvers of OpenFOAM write it
KINEMATIC_NOTE = "pressure is p/ρ in m²/s², as incompressible solvers write it, not Pa"
NO_PARTICLES = np.zeros(0, np.int64)
PROCESSOR_BITS = 32  # id = processor · 2³² + number


class Chosen(NamedTuple):
    """Which arrays of a dataset are used, one or three for each thing, and which are not."""

    used: dict[str, tuple[str, ...]]
    ignored: list[str]

    @property
    def names(self) -> list[str]:
        """The arrays that are used, each once."""
        return list(dict.fromkeys(name for names in self.used.values() for name in names))


def choose(piece: Piece, mapped: Mapping[str, str], where: str) -> Chosen:
    """Decide which arrays of a dataset are what. Raises `Refusal` where particles have no id, or it is not clear."""
    of_particles = piece.facts["kind"] == "particles"
    known = list(dict.fromkeys(piece.facts["known"]["point" if of_particles else "cell"]))
    used = find_names(known, PARTICLES if of_particles else CELLS, mapped, where)
    if of_particles and "id" not in used:
        raise Refusal(
            f"{where}: its arrays are {', '.join(known) or 'none'}, and none is the id of the particles; write the "
            "ids, or say which array they are with --map id=NAME"
        )
    if of_particles:
        used["id"] = find_ids(known, *used["id"])
    if not of_particles and not used:
        raise Refusal(
            f"{where}: its arrays in cells are {', '.join(known) or 'none'}; say which is what with "
            "--map fluid.velocity=NAME, or leave the fluid out with --map fluid=none"
        )
    if "radius" in used:
        used.pop("diameter", None)
    taken = {name for names in used.values() for name in names}
    return Chosen(used, [name for name in known if name not in taken])


def variables_of(chosen: Chosen) -> list[str]:
    """Return the names of the quantities that a choice gives."""
    return [name for name in QUANTITIES if name in chosen.used]


def particles_of(piece: Piece, chosen: Chosen, where: str) -> Frame:
    """Return the particles of one dataset. Raises `Refusal` for ids that are no integers, or another shape."""
    value = {what: _joined(piece, "point", names, where) for what, names in chosen.used.items()}
    ids = value["id"]
    if len(chosen.used["id"]) > 1 and np.issubdtype(ids.dtype, np.integer):
        ids = (ids[:, 1].astype(np.int64) << PROCESSOR_BITS) + ids[:, 0]
    if ids.ndim != 1 or (ids != np.rint(ids)).any() or (np.abs(ids) > 2**62).any():
        raise Refusal(
            f"{where}: the ids of its particles are not integers; say which array they are with --map id=NAME"
        )
    values = {"position": np.asarray(piece.arrays["points"])}
    values |= {what: rows for what, rows in value.items() if what in QUANTITIES}
    for what, rows in values.items():
        if rows.shape != (len(ids), 3):
            raise Refusal(
                f"{where}: {what} has shape {rows.shape}, not ({len(ids)}, 3); say which array it is with --map"
            )
    radius = value["diameter"].astype(np.float64) / 2 if "diameter" in value else value.get("radius")
    species = value.get("species")
    return Frame(
        where,
        ids.astype(np.int64),
        {what: rows.astype(np.float64) for what, rows in values.items()},
        None if radius is None else _one_each(radius.astype(np.float64), ids, "radius", where),
        None if species is None else _one_each(species, ids, "species", where).astype(np.int64),
    )


def fields_of(piece: Piece, chosen: Chosen, cells: Cells, where: str) -> dict[str, NDArray[np.float64]]:
    """Return the fields of one dataset, (z, y, x[, 3]) each."""
    return {
        what: cells.field(what, _joined(piece, "cell", names, where), where)
        for what, names in chosen.used.items()
        if what in QUANTITIES
    }


def notes_of(chosen: Chosen) -> list[str]:
    """Return what the user should know about the arrays that were chosen."""
    called = [f"{what} from {' '.join(names)}" for what, names in chosen.used.items() if names != (what,)]
    notes = [", ".join(called)] if called else []
    if any(KINEMATIC in name for name in chosen.used.get("fluid.pressure", ())):
        notes.append(KINEMATIC_NOTE)
    return notes


def _joined(piece: Piece, side: str, names: tuple[str, ...], where: str) -> NDArray[Any]:
    missing = [name for name in names if f"{side}:{name}" not in piece.arrays]
    if missing:
        raise Refusal(f"{where} has no array {missing[0]}, which the first snapshot has; import snapshots that hold it")
    arrays = [piece.arrays[f"{side}:{name}"] for name in names]
    return arrays[0] if len(arrays) == 1 else np.column_stack(arrays)


def _one_each(values: NDArray[Any], ids: NDArray[Any], what: str, where: str) -> NDArray[Any]:
    if values.shape != ids.shape:
        raise Refusal(f"{where}: {what} has shape {values.shape}, not ({len(ids)},); say which array it is with --map")
    if not (finite := np.isfinite(values)).all():
        i = int(np.argmin(finite))
        raise Refusal(f"{where}: particle id {ids[i]:g} has {what} = {values[i]}, not a finite number; correct it")
    return values
