"""Somebody else's run, brought into `run.h5`."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice import layout
from suffice.lock import only_writer
from suffice.readers.arrays import read_hdf5, read_npz
from suffice.readers.clock import Clock, physical_times
from suffice.readers.dump import read_dump
from suffice.readers.hdf5 import MAGIC
from suffice.readers.jumps import Jumps
from suffice.readers.names import parse_map
from suffice.readers.openfoam import is_case, read_openfoam
from suffice.readers.pieces import KINEMATIC_NOTE
from suffice.readers.series import type_of
from suffice.readers.text import open_text
from suffice.readers.trajectory import Frame, Trajectory, followed
from suffice.readers.vtk_files import read_vtk
from suffice.readers.vtkhdf import is_vtkhdf
from suffice.refusal import Refusal
from suffice.store import RunWriter, check_place

ROOM = 500  # bytes for what is found while the snapshots are read

Reader = Callable[[Sequence[Path], Mapping[str, str]], Trajectory]
READERS: Mapping[str, Reader] = {
    "lammps": read_dump,
    "liggghts": read_dump,
    "vtk": read_vtk,
    "openfoam": read_openfoam,
    "npz": read_npz,
    "hdf5": read_hdf5,
}


class Imported(NamedTuple):
    """What an import made of a source."""

    path: Path
    n_snapshots: int
    n_particles: int
    times: NDArray[np.float64]  # (snapshots,) s
    variables: tuple[str, ...]
    ignored: tuple[str, ...]  # columns of the source that were left out
    notes: tuple[str, ...]  # how the source was understood
    warnings: tuple[str, ...]  # of the notes those that tell of something amiss


def import_run(
    sources: str | Path | Sequence[str | Path],
    output: str | Path,
    *,
    format: str | None = None,
    interval: float | None = None,
    timestep: float | None = None,
    diameter: float | None = None,
    maps: Sequence[str] = (),
    precision: Literal["single", "double"] = "single",
    progress: Callable[[int, int], None] | None = None,
) -> Imported:
    """Read one run from its files, in the order of time, and write it to `output`.

    The time of a snapshot is the source's own, its step × `timestep`, or 0, 1, 2 … × `interval`, in s. `diameter` in m
    is that of the particles where the source does not say it; a radius nobody says is NaN. `format` is a name of
    `READERS`, otherwise the content tells. `maps` say what the source calls things, such as `velocity=U.air`, or leave
    the fluid out, `fluid=none`. `progress` is called with (snapshots done, all). Memory is that of one snapshot.
    Raises `Refusal` with one message, and then leaves no output behind.
    """
    paths = [Path(source) for source in ([sources] if isinstance(sources, str | Path) else sources)]
    name = format or detect_format(paths)
    if name not in READERS:
        raise Refusal(f"--format {name} is not known; use {', '.join(READERS)}")
    for path in paths:
        if not path.exists():
            raise Refusal(f"source {path} is missing; check its name")
        if not path.is_file() and not path.is_dir():
            raise Refusal(f"source {path} is neither a file nor a folder; a device or a pipe has no end: name a file")
    trajectory = READERS[name](paths, parse_map(maps))
    clock = physical_times(trajectory.stamps, interval, timestep)
    notes = (*trajectory.notes, f"times from {clock.origin}")
    provenance = {
        "source": "\n".join(map(str, paths)),
        "format": name,
        "ignored": " ".join(trajectory.ignored),
        "notes": "\n".join(notes),
        "suffice": version("suffice"),
    }
    if KINEMATIC_NOTE in notes:
        provenance["units"] = "fluid.pressure m²/s²"
    check_place(Path(output))
    with only_writer(Path(output)):
        n, found = _write(trajectory, clock, Path(output), diameter, precision, provenance, progress or _silent)
    variables, ignored = tuple(trajectory.variables), tuple(trajectory.ignored)
    return Imported(Path(output), len(clock.times), n, clock.times, variables, ignored, (*notes, *found), tuple(found))


def detect_format(paths: Sequence[Path]) -> str:
    """Return the name in `READERS` of what the first file holds. Raises `Refusal` when it is none of them."""
    if not paths:
        raise Refusal("no source is named; give the files of one run")
    first = paths[0]
    if is_case(first):
        return "openfoam"
    with open_text(first) as text:
        start = text.block(1)[:80]
    if start.startswith(b"ITEM:"):
        return "lammps"
    if start.startswith(MAGIC[:4]):  # a line break is part of it
        return "vtk" if is_vtkhdf(first) else "hdf5"
    if start.startswith(b"PK"):
        return "npz"
    if type_of(first) is not None or first.suffix == ".series":
        return "vtk"
    if start[8:].startswith((b"DUMPATOM", b"DUMPCUSTOM")):
        raise Refusal(f"source {first} is a binary dump of LAMMPS; turn it into text with its tool binary2txt")
    problem = f"begins with {start[:40]!r}, which is no format suffice reads" if start else "is empty"
    raise Refusal(
        f"source {first} {problem}; give a LAMMPS or LIGGGHTS `dump custom`, VTK, a case of OpenFOAM, .npz or HDF5"
    )


def _write(
    trajectory: Trajectory,
    clock: Clock,
    output: Path,
    diameter: float | None,
    precision: Literal["single", "double"],
    provenance: Mapping[str, str],
    progress: Callable[[int, int], None],
) -> tuple[int, list[str]]:
    """Write all snapshots; return how many particles each has, and what was found on the way."""
    jumps, notes = Jumps(), provenance["notes"]
    with closing(trajectory.frames()) as read:  # also where the writing fails, nothing of the source stays open
        frames = followed(read)
        first = next(frames)
        n, n_snapshots = len(first.ids), len(clock.times)
        with RunWriter(
            output,
            ids=first.ids,
            radius=_radius(first, diameter),
            species=np.ones(n, np.int64) if first.species is None else first.species,
            n_snapshots=n_snapshots,
            variables=tuple(first.values),
            grid=trajectory.grid,
            provenance={**provenance, "notes": notes.ljust(len(notes) + ROOM)},
            precision=precision,
            beside=True,
        ) as run:
            for done, frame in enumerate(chain([first], frames)):
                if done:
                    progress(done, n_snapshots)
                jumps.see(frame)
                run.append(clock.times[done], frame.values)
            run.put(f"{layout.PROVENANCE}/notes", np.bytes_("\n".join([notes, *jumps.notes]).encode()))
    progress(n_snapshots, n_snapshots)
    return n, jumps.notes


def _silent(_done: int, _all: int) -> None:
    """Show no progress."""


def _radius(frame: Frame, diameter: float | None) -> NDArray[np.float64]:
    """Return the radius of every particle, (n,) m: the source's own, half of `diameter`, or NaN."""
    if diameter is not None and not (np.isfinite(diameter) and diameter > 0):
        raise Refusal(f"--diameter is {diameter:g} m; it must be a positive length in m")
    if frame.radius is None:
        return np.full(len(frame.ids), np.nan if diameter is None else diameter / 2)
    if not (frame.radius > 0).all():
        i = int(np.argmin(frame.radius))
        raise Refusal(f"{frame.where}: particle id {frame.ids[i]} has radius {frame.radius[i]:g} m, not a positive one")
    if diameter is not None and not np.allclose(2 * frame.radius, diameter, rtol=1e-5, atol=0):
        raise Refusal(
            f"--diameter is {diameter:g} m, but {frame.where} has diameters from {2 * frame.radius.min():g} to "
            f"{2 * frame.radius.max():g} m; leave --diameter out"
        )
    return frame.radius
