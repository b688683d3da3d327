"""A run as files of other formats, one of each kind for every snapshot."""

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import QUANTITIES
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.xml_vtk import write_fields, write_list, write_particles

DIGITS = 6  # of the number in a file's name


class Exported(NamedTuple):
    """What an export wrote."""

    folder: Path
    files: int
    bytes: int


def export_run(
    run: Run, folder: str | Path, format: str, progress: Callable[[int, int], None] | None = None
) -> Exported:
    """Write every snapshot of a run into a new folder; `format` is a name of `WRITERS`.

    The folder appears when all of it is written. Raises `Refusal` for another format, a folder that holds something, or
    one that cannot be made, and then leaves nothing behind.
    """
    if format not in WRITERS:
        raise Refusal(f"--format {format} is not known; use {' or '.join(WRITERS)}")
    if not run.n_snapshots:
        raise Refusal(f"{run.path} holds no snapshots; there is nothing to export")
    place = Path(folder)
    with _appearing(place) as part:
        lists = WRITERS[format](run, part, progress or _silent)
        for name, files in lists.items():
            write_list(part / name, files, run.times.tolist())
    written = list(place.iterdir())
    return Exported(place, len(written), sum(path.stat().st_size for path in written))


def _write_vtu(run: Run, part: Path, progress: Callable[[int, int], None]) -> dict[str, list[str]]:
    """Write particles as .vtu and fields as .vti; return the lists that name them."""
    lists: dict[str, list[str]] = {}
    for k in range(run.n_snapshots):
        time, values = float(run.times[k]), run.snapshot(k).values
        fields = {QUANTITIES[name].field: rows for name, rows in values.items() if QUANTITIES[name].of_fluid}
        if "position" in values:
            file = f"particles.{k:0{DIGITS}}.vtu"
            rows = {name: rows for name, rows in values.items() if not QUANTITIES[name].of_fluid and name != "position"}
            write_particles(part / file, time, values["position"], {**rows, **_once(run)})
            lists.setdefault("particles.pvd", []).append(file)
        if fields and run.grid is not None:
            file = f"fluid.{k:0{DIGITS}}.vti"
            write_fields(part / file, time, run.grid, fields)
            lists.setdefault("fluid.pvd", []).append(file)
        progress(k + 1, run.n_snapshots)
    return lists


def _write_npz(run: Run, part: Path, progress: Callable[[int, int], None]) -> dict[str, list[str]]:
    """Write every snapshot as one .npz with the names that `suffice import` reads."""
    grid = {} if run.grid is None else {"grid.origin": run.grid.origin, "grid.spacing": run.grid.spacing}
    for k in range(run.n_snapshots):
        arrays: dict[str, Any] = {**run.snapshot(k).values, **_once(run), **grid, "time": run.times[k]}
        np.savez(part / f"snapshot.{k:0{DIGITS}}.npz", **arrays)
        progress(k + 1, run.n_snapshots)
    return {}


def _once(run: Run) -> dict[str, NDArray[Any]]:
    """Return what is known of every particle once; a radius that nobody said is left out."""
    known = {"id": np.asarray(run.ids, np.int64), "species": np.asarray(run.species, np.int64)}
    return known | ({"radius": np.asarray(run.radius, float)} if np.isfinite(run.radius).all() else {})


Writer = Callable[[Run, Path, Callable[[int, int], None]], dict[str, list[str]]]
WRITERS: Mapping[str, Writer] = {"vtu": _write_vtu, "npz": _write_npz}


@contextmanager
def _appearing(place: Path) -> Iterator[Path]:
    """Give a folder beside, which takes its name when the block has ended well, and is removed otherwise."""
    if place.exists() and (not place.is_dir() or any(place.iterdir())):
        raise Refusal(f"output {place} exists and is not an empty folder; name another one, or remove it")
    part = place.with_name(f"{place.name}.part")
    try:
        part.mkdir()
    except FileExistsError:
        raise Refusal(f"{part} is left from an export that was killed, or goes on; remove it") from None
    except OSError as error:
        raise Refusal(f"output {place} cannot be made ({error}); name a folder in one you may write to") from None
    try:
        yield part
        os.replace(part, place)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def _silent(_done: int, _all: int) -> None:
    """Show no progress."""
