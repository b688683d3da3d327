"""A run as it is read back: times, particles, snapshots, and the rows of each variable."""

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from suffice import layout
from suffice.hdf5_memory import names_in, open_hdf5
from suffice.quantities import AXES, QUANTITIES, Grid, component_names
from suffice.refusal import Refusal
from suffice.rows import Variable
from suffice.wording import number, seconds_text

UNEVEN = 1e-3  # of the interval: how far times written with six digits may lie from an even spacing


class Snapshot(NamedTuple):
    """What a run holds at one time, in s: every variable by name, in the stored precision."""

    time: float
    values: Mapping[str, NDArray[Any]]  # (n, 3) on particles, (z, y, x[, 3]) in cells


class Impacts(NamedTuple):
    """Impacts counted by their energy: edges of the bins in J, and how many a second since the snapshot before."""

    energy: NDArray[np.float64]  # (bins + 1,) J
    rate: NDArray[np.float64]  # (snapshots, 2, bins) 1/s, of pairs and with walls


class Run:
    """A run that stands on disk, of which only complete snapshots are seen: `with Run("run.h5") as run: run.times`.

    `times` (snapshots,) in s, `ids` and `species` (n,), `radius` (n,) in m, NaN where unknown, `grid` of the fluid or
    None. Nothing outside the file is opened. Raises `Refusal` when it is no run, or a damaged one.

    >>> with Run("run.h5") as run:
    ...     run.n_particles, run.n_snapshots, run.interval, run.variable("position.x").shape
    (24, 41, 0.001, (24, 41))
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._file = _open(self.path)
        self._size = os.fstat(self._file.id.get_vfd_handle()).st_size
        try:
            with _refusing_damage(self.path):
                self._check_version()
                self.times = self._read_times()
                self.n_snapshots = len(self.times)
                self.ids, self.radius, self.species = (
                    self._dataset(name)[()] for name in (layout.ID, layout.RADIUS, layout.SPECIES)
                )
                self.n_particles = len(self.ids)
                self._datasets = self._find_variables()
                self.grid = self._read_grid()
                self._check_shapes()
        except BaseException:
            self._file.close()
            raise

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of the stored quantities, vectors as a whole: `position`, `velocity` and so on."""
        return tuple(self._datasets)

    @cached_property
    def variables(self) -> list[str]:
        """The names of the scalar variables: `position.x`, `position.y` and so on."""
        return component_names(self._datasets)

    @cached_property
    def interval(self) -> float | None:
        """The dense snapshot interval Δt in s, or None when the snapshots are not evenly spaced or fewer than two."""
        if self.n_snapshots < 2:
            return None
        even, interval = np.linspace(self.times[0], self.times[-1], self.n_snapshots, retstep=True)
        # twelve digits leave out the round-off of the times: 0.001, not 0.0010000000000000002
        return float(f"{interval:.12g}") if np.abs(self.times - even).max() <= UNEVEN * interval else None

    @cached_property
    def series(self) -> dict[str, NDArray[np.float64]]:
        """The diagnostics over time by name, (snapshots,) each."""
        with _refusing_damage(self.path):
            return {
                name: self._dataset(f"{layout.SERIES}/{name}")[: self.n_snapshots]
                for name in self._names(layout.SERIES)
            }

    @cached_property
    def impacts(self) -> Impacts | None:
        """Impacts by their energy, or None where they were not counted."""
        with _refusing_damage(self.path):
            if layout.hard_node(self._file, layout.IMPACT_ENERGY) is None:
                return None
            rate = self._dataset(layout.IMPACT_RATE)[: self.n_snapshots]
            return Impacts(self._dataset(layout.IMPACT_ENERGY)[()], rate)

    @cached_property
    def provenance(self) -> dict[str, str]:
        """What made the run: scene, versions, seed … by name."""
        with _refusing_damage(self.path):
            texts = {name: self._dataset(f"{layout.PROVENANCE}/{name}")[()] for name in self._names(layout.PROVENANCE)}
            return {name: bytes(text).decode(errors="replace") for name, text in texts.items()}

    @cached_property
    def _units(self) -> dict[str, str]:
        """Units of this run that are not those of `QUANTITIES`, by variable; `import` writes them, a line each."""
        named = (line.partition(" ") for line in self.provenance.get("units", "").splitlines())
        return {name: unit for name, _, unit in named if unit}

    @cached_property
    def found(self) -> dict[str, Any]:
        """What `simulate` found on the way, as its --json writes it: `in_situ`, `kept`; empty until a run has ended."""
        with _refusing_damage(self.path):
            text = self.text(layout.FOUND)
            return dict(json.loads(text)) if text else {}

    def text(self, name: str) -> str:
        """Return a plain text by its name in `layout`, empty where there is none."""
        with _refusing_damage(self.path):
            found = layout.hard_node(self._file, name) is not None
            return bytes(self._dataset(name)[()]).decode() if found else ""

    def watched(self, name: str) -> Any:
        """Return a dataset of what was watched in a thinned run, by its name in `layout`. Raises `Refusal` for none."""
        return self._dataset(name)

    def variable(self, name: str) -> Variable:
        """Return a variable, `position.x` or the whole vector `position`, as rows of the snapshot matrix W.

        Raises `Refusal` naming the variables there are.
        """
        if name not in self._datasets and name not in self.variables:
            raise Refusal(f"{self.path} has no variable {name!r}; it has {', '.join(self.variables)}")
        vector, _, letter = name.rpartition(".")
        whole, axis = (name, None) if name in self._datasets else (vector, AXES.index(letter))
        quantity = QUANTITIES[whole]
        quantity = quantity._replace(unit=self._units.get(whole, quantity.unit))
        n = math.prod(self.grid.shape) if quantity.of_fluid and self.grid else self.n_particles
        return Variable(self._datasets[whole], quantity, axis, n, self.n_snapshots, self._check_length)

    def snapshot(self, k: int) -> Snapshot:
        """Return snapshot k, from 0 to n_snapshots − 1. Raises `IndexError` for any other."""
        if not 0 <= k < self.n_snapshots:
            raise IndexError(f"snapshot {k} of {self.n_snapshots}")
        at = {name: layout.index_of(QUANTITIES[name], k, self.n_particles) for name in self._datasets}
        with _refusing_damage(self.path):
            values = {name: self._datasets[name][at[name]] for name in at}
        self._check_length()
        return Snapshot(float(self.times[k]), values)

    def __repr__(self) -> str:
        from pod.facts import (
            facts_text,
        )  # here, for `pod` brings torch, and a run is opened without it in a tenth of a second

        return facts_text(f"run {self.path}", self._facts())

    def _repr_html_(self) -> str:
        from pod.facts import facts_html

        return facts_html(f"run {self.path}", self._facts())

    def _facts(self) -> dict[str, str]:
        """Return what a reader wants to know first, all in memory: a closed run still tells."""
        n, even = self.n_snapshots, self.n_snapshots < 2 or self.interval is not None
        diameter = 2.0 * float(self.radius.mean()) if self.n_particles else math.nan
        facts = {
            "particles": str(self.n_particles),
            "snapshots": f"{n}, from {self.times[0]:.6g} to {self.times[-1]:.6g} s" if n else "none",
            "interval": seconds_text(self.interval) if even else "uneven",
            "diameter": "unknown" if math.isnan(diameter) else f"{number(1e3 * diameter)} mm in the mean",
            "variables": ", ".join(self.variables),
        }
        if self.grid is not None:
            facts["fluid"] = f"{' × '.join(str(cells) for cells in reversed(self.grid.shape))} cells"
        return facts

    def digest(self) -> str:
        """Return what tells one run from another at the same place: the SHA-256 of times, origin and last snapshot."""
        digest = hashlib.sha256(self.times.tobytes() + json.dumps(self.provenance, sort_keys=True).encode())
        for values in self.snapshot(self.n_snapshots - 1).values.values() if self.n_snapshots else ():
            digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()

    def close(self) -> None:
        """Close the file; the variables taken from it can no longer be read."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check_length(self) -> None:
        """Refuse a file that has become shorter since it was opened: HDF5 reads zeros behind its end."""
        if os.fstat(self._file.id.get_vfd_handle()).st_size < self._size:
            raise Refusal(f"{self.path} was cut while it was read; make it again, or wait until it is copied")

    def _check_version(self) -> None:
        plan = layout.hard_node(self._file, layout.PLAN)
        if plan is None:
            raise Refusal(f"{self.path} is HDF5 but not a run; make one with `suffice simulate` or `suffice import`")
        if (version := int(plan[()])) > layout.VERSION:
            raise Refusal(
                f"{self.path} has layout version {version}, newer than {layout.VERSION}; update suffice to read it"
            )

    def _read_times(self) -> NDArray[np.float64]:
        times, complete = self._dataset(layout.TIME), int(self._dataset(layout.COUNTER)[()])
        if times.ndim != 1:
            raise Refusal(
                f"{self.path} is damaged: {layout.TIME} has shape {times.shape}, not one time each; make it again"
            )
        self._n_reserved = len(times)
        if not 0 <= complete <= self._n_reserved:
            raise Refusal(
                f"{self.path} is damaged: it counts {complete} snapshots of {self._n_reserved}; make it again"
            )
        counted: NDArray[np.float64] = times[:complete]
        if not (np.isfinite(counted).all() and (np.diff(counted) > 0).all()):
            raise Refusal(f"{self.path} is damaged: its times do not increase; make it again")
        return counted

    def _find_variables(self) -> dict[str, Any]:
        nodes = {name: layout.hard_node(self._file, quantity.dataset) for name, quantity in QUANTITIES.items()}
        return {name: node for name, node in nodes.items() if node is not None}

    def _read_grid(self) -> Grid | None:
        of_fluid = [dataset for name, dataset in self._datasets.items() if QUANTITIES[name].of_fluid]
        if not of_fluid:
            return None
        z, y, x = of_fluid[0].shape[1:4]
        return Grid((z, y, x), self._point(layout.ORIGIN), self._point(layout.SPACING))

    def _point(self, name: str) -> tuple[float, float, float]:
        x, y, z = self._dataset(name)[()].tolist()
        return x, y, z

    def _check_shapes(self) -> None:
        n = self.n_particles
        wanted: dict[str, tuple[int, ...]] = {layout.ID: (n,), layout.RADIUS: (n,), layout.SPECIES: (n,)}
        wanted |= {
            QUANTITIES[name].dataset: layout.shape_of(QUANTITIES[name], self._n_reserved, n, self.grid)
            for name in self._datasets
        }
        for name, shape in wanted.items():
            if (found := self._dataset(name).shape) != shape:
                raise Refusal(f"{self.path} is damaged: {name} has shape {found}, not {shape}; make it again")

    def _dataset(self, name: str) -> Any:
        node = layout.hard_node(self._file, name)
        if not isinstance(node, h5py.Dataset):
            raise Refusal(f"{self.path} is damaged: it has no dataset {name}; make it again")
        return node

    def _names(self, group: str) -> list[str]:
        node = layout.hard_node(self._file, group)
        return names_in(node) if isinstance(node, h5py.Group) else []


def _open(path: Path) -> h5py.File:
    if not path.is_file():
        raise Refusal(f"run {path} is {'a folder' if path.is_dir() else 'missing'}; name a file that holds a run")
    try:
        return open_hdf5(path)
    except (OSError, RuntimeError) as error:
        raise Refusal(
            f"{path} cannot be opened as a run ({error}); make it again, or check that it was copied whole"
        ) from None


@contextmanager
def _refusing_damage(path: Path) -> Iterator[None]:
    """Turn what HDF5 raises on broken metadata or blocks into one message."""
    try:
        yield
    except Refusal:
        raise
    except (OSError, RuntimeError, LookupError, ValueError, TypeError) as error:
        raise Refusal(f"{path} is damaged ({error}); make it again") from None
