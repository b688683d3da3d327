"""When a verdict on a growing run has settled: at which snapshots it is asked, and for how long it must have held."""

from collections.abc import Iterable
from math import ceil

from selection.feasibility import FEWEST_SNAPSHOTS

FINEST_STRIDE = 2  # dense intervals: the shortest Δτ of the default scan
FIRST_CHECK = FINEST_STRIDE * FEWEST_SNAPSHOTS  # snapshots; before it every verdict is undecidable
GROWTH = 1.1  # from one check to the next, so that all of them cost about four times the last one
HELD = 2.0  # times the snapshots at which a Δτ was first found sufficient


def checks(most: int) -> list[int]:
    """Return the numbers of snapshots at which a run of `most` is judged: each 10 % above the one before, and the last.

    Counts and not seconds, so that the same run is judged at the same moments on every machine.
    """
    counts, n = [], FIRST_CHECK
    while n < most:
        counts.append(n)
        n = max(n + 1, ceil(GROWTH * n - 1e-9))
    return [*counts, most]


class Settling:
    """Since when each Δτ of a variable has been sufficient without a break.

    A Δτ has settled once it was sufficient at every check while the number of snapshots doubled: K_f of a short window
    is a ratio of a few modes, and one more of either may lift it over its limit for a while.
    """

    def __init__(self, since: dict[int, int] | None = None) -> None:
        self.since = dict(since or {})  # stride in dense intervals: snapshots at the first check of its unbroken series

    def note(self, n_snapshots: int, sufficient: Iterable[int]) -> None:
        """Note which strides (dense intervals) are sufficient at a check."""
        self.since = {stride: self.since.get(stride, n_snapshots) for stride in sufficient}

    def settled(self, n_snapshots: int) -> list[int]:
        """Return the strides that have settled by now, coarse to fine."""
        return sorted((s for s, first in self.since.items() if n_snapshots >= HELD * first), reverse=True)
