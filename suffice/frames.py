"""Positions over time in few bytes: 16-bit places in a box, differences between frames, deflated."""

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Places = NDArray[np.uint16]

STEPS = 2**16 - 1  # from one side of the box to the other
ORDER = 2  # differences in time of what is packed: of smooth motion the second are the smallest
LEVEL = 6


class Box(NamedTuple):
    """What places are counted in: position = lowest + quantum · place."""

    lowest: Array  # (3,) m
    quantum: float  # m


def box_of(positions: Sequence[Array], finest: float = 0.0) -> Box:
    """Return the box around positions (frames, n, 3) m, one quantum for all directions.

    quantum = longest edge / 65535, but no less than `finest` (m), below which nobody looks.
    """
    lowest = np.min([each.min(axis=(0, 1)) for each in positions], axis=0)
    highest = np.max([each.max(axis=(0, 1)) for each in positions], axis=0)
    quantum = max(float((highest - lowest).max()) / STEPS, finest)
    return Box(np.asarray(lowest, np.float64), quantum or 1.0)  # a single point has no edge


def placed(position: Array, box: Box) -> Places:
    """Return the places (frames, 3, n) of positions (frames, n, 3) m in the box, half a quantum off at most."""
    return np.rint((position - box.lowest) / box.quantum).astype(np.uint16).transpose(0, 2, 1)


def positions_at(places: Places, box: Box) -> Array:
    """Return positions (frames, n, 3) m of places (frames, 3, n)."""
    return np.asarray(box.lowest + box.quantum * places.transpose(0, 2, 1).astype(np.float64))


def pack(places: Places) -> bytes:
    """Return places (frames, …) as deflated (zlib) differences in time.

    Second differences modulo 2¹⁶, with nothing before the first frame, sign in the last bit (0, −1, 1, −2 … are 0, 1,
    2, 3 …), all low bytes before all high bytes.
    """
    change = places
    for _ in range(ORDER):
        change = np.diff(change, axis=0, prepend=np.zeros_like(change[:1]))
    signed = change.astype(np.int16)
    folded = ((signed << 1) ^ (signed >> 15)).astype(np.uint16)
    low, high = (folded & 255).astype(np.uint8), (folded >> 8).astype(np.uint8)
    return zlib.compress(low.tobytes() + high.tobytes(), LEVEL)


def unpack(data: bytes, shape: tuple[int, ...]) -> Places:
    """Return the places of this shape (frames, …) that `pack` has packed."""
    low, high = np.frombuffer(zlib.decompress(data), np.uint8).reshape(2, *shape).astype(np.uint16)
    folded = low | (high << 8)
    change = (folded >> 1) ^ (0 - (folded & 1)).astype(np.uint16)
    for _ in range(ORDER):
        change = np.cumsum(change, axis=0, dtype=np.uint16)
    return np.asarray(change)
