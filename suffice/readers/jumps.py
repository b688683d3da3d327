"""Particles that jump across a periodic face, in sources that do not say that they have one."""

import numpy as np
from numpy.typing import NDArray

from suffice.readers.trajectory import Frame

FAR = 0.5  # of the extent of all particles: who goes so far from one snapshot to the next was moved to the other side


class Jumps:
    """Watches positions from snapshot to snapshot; two of them are held."""

    def __init__(self) -> None:
        self.count = 0
        self._first = ""
        self._last: NDArray[np.float64] | None = None

    def see(self, frame: Frame) -> None:
        """Count what jumped since the snapshot before."""
        position = frame.values.get("position")
        if position is None:
            return
        if self._last is not None:
            extent = np.maximum(np.ptp(position, axis=0), np.ptp(self._last, axis=0))
            far = np.abs(position - self._last) > FAR * extent
            if len(position) > 1 and far.any():
                particle, axis = np.argwhere(far)[0]
                self._first = self._first or f"first id {frame.ids[particle]} along {'xyz'[axis]} to {frame.where}"
                self.count += int(far.sum())
        self._last = position

    @property
    def notes(self) -> list[str]:
        """What the user should know; nothing where none jumped."""
        if not self.count:
            return []
        return [
            f"{self.count} times a particle jumps by over half of the extent of all, {self._first[:200]}: unwrap "
            "positions at periodic faces, or write snapshots more often"
        ]
