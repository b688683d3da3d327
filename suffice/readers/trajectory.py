"""The particles of one snapshot, the same and in the same order as in every other."""

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from suffice.quantities import QUANTITIES, Grid
from suffice.readers.clock import Stamps
from suffice.refusal import Refusal


class Frame(NamedTuple):
    """One snapshot as its source holds it, in SI units."""

    where: str  # how to find it in the source, for messages
    ids: NDArray[np.int64]  # (n,)
    values: Mapping[str, NDArray[np.float64]]  # (n, 3) on particles, (z, y, x[, 3]) in cells
    radius: NDArray[np.float64] | None  # (n,) m
    species: NDArray[np.int64] | None  # (n,)


class Trajectory(Protocol):
    """What a reader gives: how many snapshots there are and when, then the snapshots themselves, one at a time."""

    @property
    def stamps(self) -> Stamps:
        """How many snapshots there are, and what the source says of their time."""

    @property
    def grid(self) -> Grid | None:
        """The cells of its fluid, where there is one."""

    @property
    def variables(self) -> Sequence[str]:
        """What it knows of every particle in every snapshot, names of `QUANTITIES`."""

    @property
    def ignored(self) -> Sequence[str]:
        """Columns or fields of the source that are not used."""

    @property
    def notes(self) -> Sequence[str]:
        """What the user should know about how the source was understood."""

    def frames(self) -> Generator[Frame, None, None]:
        """Read the snapshots in the order of time, holding one in memory."""


def followed(frames: Iterable[Frame]) -> Iterator[Frame]:
    """Give every snapshot its particles in ascending id, the same ones with the same radius in each.

    Raises `Refusal` naming the first particle that is twice in a snapshot, lost, new, or of another radius, and the
    first value that is not finite; and where a snapshot does not hold what the first one does.
    """
    first: Frame | None = None
    for frame in map(by_id, frames):
        first = first or frame
        if set(frame.values) != set(first.values):
            raise Refusal(
                f"{frame.where} holds {', '.join(frame.values)}, but {first.where} {', '.join(first.values)}; "
                "import snapshots that hold the same"
            )
        if "position" in frame.values and not len(frame.ids):
            raise Refusal(f"{frame.where} holds no particles; leave snapshots without particles out")
        _check_finite(frame)
        if not np.array_equal(frame.ids, first.ids):
            raise Refusal(_difference(frame, first))
        if frame.radius is not None and first.radius is not None and not np.array_equal(frame.radius, first.radius):
            i = int(np.argmax(frame.radius != first.radius))
            raise Refusal(
                f"{frame.where}: particle id {frame.ids[i]} has radius {frame.radius[i]:g} m, but "
                f"{first.radius[i]:g} m at {first.where}; import snapshots in which radii stay"
            )
        yield frame


def by_id(frame: Frame) -> Frame:
    """Return a snapshot with its particles in ascending id. Raises `Refusal` naming one that is there twice."""
    order = np.argsort(frame.ids, kind="stable")
    ids = frame.ids[order]
    if (twice := np.flatnonzero(ids[1:] == ids[:-1])).size:
        raise Refusal(f"{frame.where}: particle id {ids[twice[0]]} stands there twice; every particle needs its own id")
    return Frame(
        frame.where,
        ids,
        {name: rows if QUANTITIES[name].of_fluid else rows[order] for name, rows in frame.values.items()},
        None if frame.radius is None else frame.radius[order],
        None if frame.species is None else frame.species[order],
    )


def _check_finite(frame: Frame) -> None:
    for name, rows in frame.values.items():
        if not (finite := np.isfinite(rows)).all():
            worst = int(np.argmin(finite.reshape(-1)))
            row = worst // (rows.shape[-1] if rows.ndim in (2, 4) else 1)
            which = f"cell {row}" if QUANTITIES[name].of_fluid else f"particle id {frame.ids[row]}"
            raise Refusal(
                f"{frame.where}: {which} has {name} = {rows.reshape(-1)[worst]}, not a finite number; correct it, or "
                "leave that snapshot out"
            )


def _difference(frame: Frame, first: Frame) -> str:
    lost, new = np.setdiff1d(first.ids, frame.ids), np.setdiff1d(frame.ids, first.ids)
    if lost.size:
        return (
            f"{frame.where}: particle id {lost[0]} is missing ({lost.size} of {first.ids.size} lost since "
            f"{first.where}); every snapshot must hold the same particles: import those before, or dump those that stay"
        )
    return (
        f"{frame.where}: particle id {new[0]} is new ({new.size} more than at {first.where}); "
        "every snapshot must hold the same particles: import those after the last insertion"
    )
