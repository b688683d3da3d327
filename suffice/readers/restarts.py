"""Snapshots that a run wrote twice, because it was started again from before its end."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from suffice.readers.header import Header
from suffice.readers.trajectory import Frame, by_id
from suffice.refusal import Refusal

SAME = 1e-4  # of the extent of all particles: text of six digits differs by far less, another run by far more


class Place(NamedTuple):
    """Where a snapshot stands: in which file, and as which of its snapshots."""

    file: int
    number: int


class Restart(NamedTuple):
    """A snapshot with which a run was continued, and those from there on that are written again after it."""

    at: Place
    dropped: Sequence[Place]


def find_restarts(headers: Sequence[Sequence[Header]], names: Sequence[object]) -> list[Restart]:
    """Return where time goes back to a step that was written before; the snapshots that follow there count.

    Files stand in the order of their first step. A step back to one that was not written is left for others to judge.
    Raises `Refusal` where nothing would be left of what is written twice: those are no restarts, but parts or repeats.
    """
    kept: list[tuple[int, Place]] = []
    found = []
    for file, own in enumerate(headers):
        for number, header in enumerate(own):
            begin = bisect_left(kept, header.step, key=lambda each: each[0])
            if begin < len(kept) and kept[begin][0] == header.step:
                if not begin:
                    one, other = names[kept[0][1].file], names[file]
                    told = f"{one} holds" if one == other else f"{one} and {other} both hold"
                    raise Refusal(
                        f"{told} step {header.step} as the first one: give every snapshot once, in one file with all "
                        "its atoms (no % in the name of the dump), and one run at a time"
                    )
                found.append(Restart(Place(file, number), [place for _, place in kept[begin:]]))
                del kept[begin:]
            kept.append((header.step, Place(file, number)))
    return found


def restarted(frames: Iterable[tuple[Place, Frame]], restarts: Sequence[Restart]) -> Iterator[tuple[Place, Frame]]:
    """Yield all snapshots with their places, as they come.

    Raises `Refusal` where a run goes on from another state than the one it wrote at that step before.
    """
    begins = {restart.at: restart.dropped[0] for restart in restarts}
    held: dict[Place, Frame] = {}
    for place, frame in frames:
        if place in begins.values():
            held[place] = frame
        if place in begins and begins[place] in held:
            _check_same(held.pop(begins[place]), frame)
        yield place, frame


def _check_same(before: Frame, after: Frame) -> None:
    one, other = by_id(before), by_id(after)
    place, again = one.values["position"], other.values["position"]
    if not np.array_equal(one.ids, other.ids) or np.abs(place - again).max() > SAME * np.ptp(place, axis=0).max():
        raise Refusal(
            f"{before.where} and {after.where} are one step, and not the same particles in the same places; import the "
            "parts of one run, or one of them"
        )
