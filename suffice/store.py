"""A run on disk, `run.h5`: every snapshot that is counted is complete, whatever becomes of the program that writes it.

All datasets are allocated in full when the file is made; a snapshot is written, brought to the disk and only then
counted. So a killed writer leaves a file that opens, holding all it had counted.
"""

import os
import shutil
import time as clock
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import EllipsisType, TracebackType
from typing import Any, Literal, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike

from suffice import layout
from suffice.door import disk_words, naming
from suffice.hdf5_memory import open_hdf5
from suffice.quantities import QUANTITIES, Grid
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.views import remove_views, write_views

__all__ = ["Run", "RunWriter", "check_place"]

SECONDS_BETWEEN_VIEWS = 1.0
ROOM = 1 << 16  # bytes: a run without particles takes a quarter
Reserved = dict[str, tuple[tuple[int, ...], np.dtype[Any]]]  # shape and type of datasets by their names in the file
DTYPES: dict[str, np.dtype[Any]] = {"single": np.dtype(np.float32), "double": np.dtype(np.float64)}


class RunWriter:
    """Write a run snapshot by snapshot: `with RunWriter(path, ...) as run: run.append(time, {"position": x, ...})`.

    `ids`, `radius` (m) and `species` are (n,) and fixed for the run; `variables` are names of `QUANTITIES`, those of
    the fluid need a `grid`. `series` names the diagnostics over time, `provenance` says what made the run, and
    `impact_energy` (bins + 1,) in J are the bins of impacts where these are counted; `reserved` are more datasets to be
    `put` later. Fewer snapshots than `n_snapshots` may be appended.

    The file stands at its name from the first moment, and stays after a failure; with `beside=True` it appears only
    when the block ends without one, and nothing is left otherwise. A run that stood there is replaced. Raises `Refusal`
    where the file cannot be made.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        ids: ArrayLike,
        radius: ArrayLike,
        species: ArrayLike,
        n_snapshots: int,
        provenance: Mapping[str, str],
        variables: Sequence[str] = ("position", "velocity", "angular_velocity"),
        grid: Grid | None = None,
        precision: Literal["single", "double"] = "single",
        series: Sequence[str] = (),
        impact_energy: ArrayLike | None = None,
        beside: bool = False,
        reserved: Reserved | None = None,
    ) -> None:
        self.path = Path(path)
        self.variables = tuple(variables)
        self.n_complete = 0
        self._once = {
            layout.ID: np.asarray(ids, np.int64),
            layout.RADIUS: np.asarray(radius, float),
            layout.SPECIES: np.asarray(species),
        }
        self._n, self._grid, self._beside = len(self._once[layout.ID]), grid, beside
        self._bins = None if impact_energy is None else np.asarray(impact_energy, float)
        self._next_view = -np.inf
        shapes = {name: layout.shape_of(QUANTITIES[name], n_snapshots, self._n, grid) for name in self.variables}
        check_place(self.path, layout.bytes_of(list(shapes.values()), DTYPES[precision].itemsize))
        self._part = self.path.with_name(f"{self.path.name}.part")
        self._times = np.zeros(n_snapshots)
        self._file = _create(self._part)
        try:
            self._allocate(shapes, DTYPES[precision], series, provenance)
            for name, (shape, dtype) in (reserved or {}).items():
                self.reserve(name, shape, dtype)
                if not shape:  # HDF5 gives a scalar its place when it is written first
                    self._file[name][()] = np.zeros((), dtype)[()]
            self.sync()
            if not beside:
                self._publish()
        except (OSError, RuntimeError) as error:  # HDF5's two names for a disk that is full
            self._discard()
            raise _unwritable(self.path, error) from None
        except BaseException:
            self._discard()
            raise

    @classmethod
    def resume(cls, path: str | Path, n_complete: int) -> Self:
        """Open a run again to append after its first `n_complete` snapshots; later ones are forgotten.

        Raises `Refusal` when it is no run, or holds fewer.
        """
        with Run(path) as past:
            if not 0 <= n_complete <= past.n_snapshots:
                raise Refusal(f"{path} holds {past.n_snapshots} snapshots, not {n_complete}; start the run anew")
            _ = past.series, past.impacts, past.found, past.provenance  # HDF5 meets every group where it is bounded
            self = cls.__new__(cls)
            self.path, self._grid, self._n, self._beside = Path(path), past.grid, past.n_particles, False
            self.variables, self.n_complete, self._next_view = past.quantities, n_complete, -np.inf
            self._part = self.path.with_name(f"{self.path.name}.part")
        self._file = h5py.File(path, "r+", locking=False)
        self._times = self._file[layout.TIME][()]
        self._file[layout.COUNTER][()] = n_complete
        self._bins = self._file[layout.IMPACT_ENERGY][()] if layout.IMPACT_ENERGY in self._file else None
        return self

    def append(
        self,
        time: float,
        values: Mapping[str, ArrayLike],
        series: Mapping[str, float] | None = None,
        impacts: ArrayLike | None = None,
    ) -> None:
        """Write the next snapshot, at `time` in s, bring it to the disk, then count it.

        `values` holds every variable: (n, 3) on particles, (z, y, x[, 3]) in cells; `impacts` (2, bins) are in 1/s.
        Raises `ValueError` when one is missing or does not fit, when time does not increase, or when all snapshots have
        been written; `OSError` when the disk is full.
        """
        k = self.n_complete
        self._check(time, values, series or {})
        with naming(self.path):
            self._write(k, time, values, series or {}, impacts)
        if not self._beside and clock.monotonic() >= self._next_view:
            self._write_views()

    def _write(
        self, k: int, time: float, values: Mapping[str, Any], series: Mapping[str, float], impacts: Any
    ) -> None:  # fmt: skip
        if self._bins is not None:
            self._file[layout.IMPACT_RATE][k] = np.zeros((2, len(self._bins) - 1)) if impacts is None else impacts
        for name in self.variables:
            quantity = QUANTITIES[name]
            self._file[quantity.dataset][layout.index_of(quantity, k, self._n)] = values[name]
        for diagnostic, value in series.items():
            self._file[f"{layout.SERIES}/{diagnostic}"][k] = value
        self._file[layout.TIME][k] = self._times[k] = time
        if not self._beside:  # nobody sees a file written beside before it is whole
            self.sync()
        self._file[layout.COUNTER][()] = self.n_complete = k + 1
        self._file.flush()

    def put(self, name: str, values: ArrayLike, at: int | EllipsisType = ...) -> None:
        """Write into a dataset that was reserved; on the disk with the next snapshot, or when the run is closed."""
        with naming(self.path):
            self._file[name][at] = values

    def sync(self) -> None:
        """Bring all that was written to the disk."""
        self._file.flush()
        os.fsync(self._file.id.get_vfd_handle())

    def close(self) -> None:
        """Finish the run: what was appended stays, and the views show all of it."""
        if self._file:
            with naming(self.path):
                self.sync()
                self._file.close()
            if self._beside:
                self._publish()
            self._write_views()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        elif self._beside:
            self._discard()
        else:
            with suppress(OSError, RuntimeError):  # the first failure is the one to tell
                self.close()

    def _allocate(
        self,
        shapes: Mapping[str, tuple[int, ...]],
        dtype: np.dtype[Any],
        series: Sequence[str],
        provenance: Mapping[str, str],
    ) -> None:
        suffice = self._file.create_group("suffice")
        self._file[layout.PLAN], self._file[layout.COUNTER] = np.int64(layout.VERSION), np.int64(0)
        self.reserve(layout.TIME, self._times.shape, self._times.dtype)
        suffice.create_group("series")
        for diagnostic in series:
            self.reserve(f"{layout.SERIES}/{diagnostic}", self._times.shape, self._times.dtype)
        if self._bins is not None:
            self._file[layout.IMPACT_ENERGY] = self._bins
            self.reserve(layout.IMPACT_RATE, (len(self._times), 2, len(self._bins) - 1), self._times.dtype)
        suffice.create_group("provenance")
        for what, text in provenance.items():
            self._file[f"{layout.PROVENANCE}/{what}"] = np.bytes_(text.encode())
        for name, array in self._once.items():
            self._file[name] = array
        self._file[layout.VERTICES] = np.arange(self._n + 1)
        if self._grid is not None:
            self._file[layout.ORIGIN], self._file[layout.SPACING] = (
                np.array(self._grid.origin),
                np.array(self._grid.spacing),
            )
        for name, shape in shapes.items():
            self.reserve(QUANTITIES[name].dataset, shape, dtype)

    def reserve(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        """Allocate a contiguous dataset before the first snapshot: one that grows, or comes late, is lost by a kill."""
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        self._file.create_dataset(name, shape, dtype, dcpl=plan)

    def _check(self, time: float, values: Mapping[str, ArrayLike], series: Mapping[str, float]) -> None:
        k = self.n_complete
        if k == len(self._times):
            raise ValueError(f"all {k} snapshots have been written")
        if not (np.isfinite(time) and (k == 0 or time > self._times[k - 1])):
            raise ValueError(f"time {time} s does not follow {self._times[k - 1]} s")
        if set(values) != set(self.variables):
            raise ValueError(f"the run stores {sorted(self.variables)}, not {sorted(values)}")
        if set(series) != set(self._file[layout.SERIES]):
            raise ValueError(f"the run stores the series {sorted(self._file[layout.SERIES])}, not {sorted(series)}")
        for name in self.variables:
            quantity = QUANTITIES[name]
            shape = layout.shape_of(quantity, 1, self._n, self._grid)[1 if quantity.of_fluid else 0 :]
            if np.shape(values[name]) != shape:
                raise ValueError(f"{name} has shape {np.shape(values[name])}, not {shape}")

    def _publish(self) -> None:
        remove_views(self.path)
        os.replace(self._part, self.path)

    def _discard(self) -> None:
        with suppress(OSError, RuntimeError):
            self._file.close()
        self._part.unlink(missing_ok=True)

    def _write_views(self) -> None:
        write_views(self.path, self._times[: self.n_complete], self._n, self.variables, self._grid)
        self._next_view = clock.monotonic() + SECONDS_BETWEEN_VIEWS


def _create(part: Path) -> h5py.File:
    try:
        with part.open("wb") as file:  # HDF5 can crash when it closes a file that has no room for what it keeps itself
            os.posix_fallocate(file.fileno(), 0, ROOM)
        # without a lock, ParaView can look into the run while it is written
        return h5py.File(part, "w", locking=False)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise _unwritable(part.with_suffix(""), error) from None


def _unwritable(path: Path, error: Exception) -> Refusal:
    return Refusal(
        f"output {path} cannot be written ({disk_words(error)}); choose a folder you may write to, on a disk with room"
    )


def _holds_run(path: Path) -> bool:
    """Tell a run, which may be replaced, from any other file; a pipe would not be read to its end."""
    if not path.is_file():
        return False
    try:
        with open_hdf5(path, locking=False) as file:
            return layout.hard_node(file, layout.PLAN) is not None
    except (OSError, RuntimeError, LookupError, ValueError, TypeError, Refusal):  # what HDF5 raises on broken content
        return False


def check_place(path: Path, needed: int = 0) -> None:
    """Refuse an output that is a folder, that somebody else's file stands at, or whose bytes do not fit on the disk."""
    if not path.parent.is_dir():
        raise Refusal(f"output {path}: there is no folder {path.parent}; make it first")
    if path.is_dir():
        raise Refusal(f"output {path} is a folder; name a file, for example {path / 'run.h5'}")
    if path.exists() and not _holds_run(path):
        raise Refusal(f"output {path} exists and is not a run; choose another name or remove it")
    free = shutil.disk_usage(path.parent).free
    if needed > free:
        raise Refusal(
            f"output {path} needs {needed / 1e9:.2f} GB and its disk has {free / 1e9:.2f} GB free; "
            "store fewer variables or snapshots, or choose another disk"
        )
