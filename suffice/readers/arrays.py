"""Runs that stand in named arrays: .npz of numpy, or HDF5 of any code with a mapping of its datasets.

| array | shape | |
|---|---|---|
| `position`, `velocity`, `angular_velocity` | (snapshots, n, 3) | m, m/s, rad/s |
| `time` | (snapshots,) | s |
| `id`, `species` | (n,) or (snapshots, n) | integers |
| `radius` or `diameter` | (n,), (snapshots, n) or one number | m |
| `fluid.velocity`, `fluid.pressure`, `fluid.void_fraction` | (snapshots, z, y, x[, 3]) | m/s, Pa, 1 |
| `grid.origin`, `grid.spacing` | (3,) | m |

Several .npz hold a snapshot each: the same without the first axis, `time` a number. So do the groups of an HDF5 file
where a name with `*` is mapped to each thing (`datasets`).
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import QUANTITIES, Grid
from suffice.readers.clock import Stamps
from suffice.readers.datasets import Datasets
from suffice.readers.npz import Member, Npz
from suffice.readers.trajectory import Frame
from suffice.refusal import Refusal

EACH = ("id", "species", "radius", "diameter")
NAMES = (*QUANTITIES, *EACH, "time", "grid.origin", "grid.spacing")
NO_MEMBER = Member((), np.dtype(float))


class Arrays(Protocol):
    """Named arrays, of which not all need fit into memory."""

    @property
    def names(self) -> list[str]:
        """The names there are."""

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of an array."""

    def whole(self, name: str) -> NDArray[Any]:
        """Return an array."""

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Yield an array along its first axis."""


def read_npz(sources: Sequence[Path], mapped: Mapping[str, str]) -> "ArrayRun":
    """Return the run in one .npz, or in several that hold a snapshot each. Raises `Refusal` for anything else."""
    one = Npz(sources[0]) if len(sources) == 1 else None
    alone = one is not None and len(one.members.get(mapped.get("position", "position"), NO_MEMBER).shape) == 2
    arrays: Arrays = NpzSeries(sources) if one is None or alone else one
    return ArrayRun(str(sources[0].parent if one is None else sources[0]), arrays, _named(arrays, mapped))


def read_hdf5(sources: Sequence[Path], mapped: Mapping[str, str]) -> "ArrayRun":
    """Return the run in one HDF5 file, its datasets by their names or as mapped. Raises `Refusal` for anything else."""
    if len(sources) > 1:
        raise Refusal(f"{len(sources)} HDF5 files are named; give one that holds all snapshots")
    arrays = Datasets(sources[0])
    names = _named(arrays, mapped)
    arrays.check_together(names.values())
    return ArrayRun(str(sources[0]), arrays, names)


def _named(arrays: Arrays, mapped: Mapping[str, str]) -> dict[str, str]:
    """Return what is called how: by the mapping, or by the names above. Raises `Refusal` for a name that is not one."""
    for name in mapped:
        if name not in NAMES:
            raise Refusal(f"--map {name}: arrays hold {', '.join(NAMES)}; use one of these")
    return {name: mapped.get(name, name) for name in NAMES if name in mapped or name in arrays.names}


class ArrayRun:
    """A run in named arrays. Raises `Refusal` where a shape does not fit, or neither particles nor fields are there."""

    def __init__(self, where: str, arrays: Arrays, names: Mapping[str, str]) -> None:
        self.where, self.arrays, self.names = where, arrays, names  # what -> how the source calls it
        self.variables = [name for name in QUANTITIES if name in names]
        if not self.variables or ("position" not in names and any(not QUANTITIES[v].of_fluid for v in self.variables)):
            raise Refusal(
                f"{where} has no array position (snapshots, particles, 3), it has {', '.join(arrays.names[:12])}; "
                "say which one it is with --map position=NAME; in HDF5 with a group for each snapshot NAME is /*/..."
            )
        first = self._shape(self.variables[0])
        self._n = first[0] if first else 0
        self._particles = first[1] if "position" in names and len(first) == 3 else 0
        self.grid = self._read_grid()
        self._check_shapes()
        times = arrays.whole(names["time"]).astype(float).reshape(-1) if "time" in names else None
        self.stamps = Stamps(self._n, None, times, f"array {names.get('time')}")

    @property
    def ignored(self) -> list[str]:
        """Arrays that are not read."""
        return [name for name in self.arrays.names if name not in self.names.values()]

    @property
    def notes(self) -> list[str]:
        """How the arrays were understood."""
        nameless = "position" in self.names and "id" not in self.names
        unnamed = ["no ids: particle i is row i of every snapshot"] if nameless else []
        called = [f"{what} from {name}" for what, name in self.names.items() if name != what]
        return ["SI units taken", *unnamed, *([", ".join(called)] if called else [])]

    def frames(self) -> Generator[Frame, None, None]:
        """Read the snapshots in the order of time, holding one in memory."""
        streams = {name: self.arrays.rows(self.names[name]) for name in self.variables}
        streams |= {name: self._each(name) for name in EACH if name in self.names}
        for k in range(self._n):
            rows = {name: next(stream) for name, stream in streams.items()}
            yield self._frame(f"{self.where} snapshot {k}", rows)

    def _frame(self, where: str, rows: Mapping[str, NDArray[Any]]) -> Frame:
        ids = rows.get("id", np.arange(self._particles))
        for name in ("id", "species"):
            if name in rows and (rows[name] != np.rint(rows[name])).any():
                raise Refusal(f"{where}: {name} holds numbers that are no integers; say which array it is with --map")
        radius = rows["diameter"] / 2 if "diameter" in rows else rows.get("radius")
        species = rows.get("species")
        return Frame(
            where,
            ids.astype(np.int64),
            {name: rows[name].astype(np.float64) for name in self.variables},
            None if radius is None else radius.astype(float),
            None if species is None else species.astype(np.int64),
        )

    def _each(self, name: str) -> Iterator[NDArray[Any]]:
        """Yield one value for each particle, snapshot by snapshot."""
        shape = self._shape(name)
        if shape == (self._n, self._particles):
            return self.arrays.rows(self.names[name])
        return repeat(np.broadcast_to(self.arrays.whole(self.names[name]), (self._particles,)))

    def _shape(self, name: str) -> tuple[int, ...]:
        return self.arrays.shape(self.names[name])

    def _read_grid(self) -> Grid | None:
        of_fluid = [name for name in self.variables if QUANTITIES[name].of_fluid]
        if not of_fluid:
            return None
        if not {"grid.origin", "grid.spacing"} <= set(self.names):
            raise Refusal(f"{self.where} has fields of a fluid but no grid.origin and grid.spacing (3,) in m; add them")
        if len(shape := self._shape(of_fluid[0])) < 4:
            raise Refusal(f"{self.where}: {of_fluid[0]} has shape {shape}, not (snapshots, z, y, x); write it so")
        origin, spacing = (
            self.arrays.whole(self.names[f"grid.{what}"]).astype(float) for what in ("origin", "spacing")
        )
        if origin.shape != (3,) or spacing.shape != (3,) or not (np.isfinite(origin).all() and (spacing > 0).all()):
            raise Refusal(
                f"{self.where}: grid.origin and grid.spacing are x, y, z in m, spacing positive; correct them"
            )
        return Grid((shape[1], shape[2], shape[3]), tuple(origin.tolist()), tuple(spacing.tolist()))

    def _check_shapes(self) -> None:
        n, particles = self._n, self._particles
        cells = self.grid.shape if self.grid else ()
        wanted: dict[str, list[tuple[int, ...]]] = {name: [(n, particles), (particles,)] for name in EACH[:2]}
        wanted |= {name: [(n, particles), (particles,), ()] for name in EACH[2:]}
        for name, quantity in QUANTITIES.items():
            vector = (quantity.components,) if quantity.components > 1 else ()
            wanted[name] = [(n, *(cells if quantity.of_fluid else (particles,)), *vector)]
        wanted["time"] = [(n,)]
        for name in self.names:
            if name in wanted and self._shape(name) not in wanted[name]:
                told = " or ".join(map(str, wanted[name]))
                raise Refusal(f"{self.where}: {self.names[name]} has shape {self._shape(name)}, {name} needs {told}")
        if n < 1 or ("position" in self.names and particles < 1):
            raise Refusal(f"{self.where} holds {n} snapshots of {particles} particles; give one that holds some")


class NpzSeries:
    """Several .npz with a snapshot each, as if their arrays were stacked along a first axis, in the order of time."""

    def __init__(self, paths: Sequence[Path]) -> None:
        files = [Npz(path) for path in paths]
        self._once = ("grid.origin", "grid.spacing")
        if all("time" in file.names and file.shape("time") in ((), (1,)) for file in files):
            files.sort(key=lambda file: float(file.whole("time").reshape(-1)[0]))
        self._files, self.names = files, files[0].names
        for file in files:
            if [(name, file.shape(name)) for name in sorted(file.names)] != [
                (name, files[0].shape(name)) for name in sorted(self.names)
            ]:
                raise Refusal(
                    f"{file.path} does not hold the arrays of {files[0].path} in the same shapes; every snapshot must "
                    "hold the same particles: import those that do"
                )

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of the stacked array."""
        own = self._files[0].shape(name)
        return own if name in self._once else (len(self._files), *(() if name == "time" and own == (1,) else own))

    def whole(self, name: str) -> NDArray[Any]:
        """Return the stacked array."""
        if name in self._once:
            return self._files[0].whole(name)
        return np.stack([file.whole(name) for file in self._files]).reshape(self.shape(name))

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Yield the array of each file."""
        return (file.whole(name) for file in self._files)
