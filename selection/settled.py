"""When a verdict on a growing run has settled: at which snapshots it is asked, and for how long it must have held."""

from collections.abc import Callable, Iterator, Sequence
from math import ceil

from selection.feasibility import FEWEST_SNAPSHOTS

COARSEST_STRIDE = 10  # dense intervals: the longest Δτ of the default scan
FINEST_STRIDE = 2  # dense intervals: the shortest Δτ of the default scan
FIRST_CHECK = FINEST_STRIDE * FEWEST_SNAPSHOTS  # snapshots; before it every verdict is undecidable
GROWTH = 1.1  # from one check to the next
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
    """Which Δτ of a variable have been sufficient for long enough without a break, and since when.

    A Δτ has settled once it was sufficient at every check while the number of snapshots doubled: K_f of a short window
    is a ratio of a few modes, and one more of either may lift it over its limit for a while.

    It is found by looking back from the check that asks, and only as far as the last failure. A Δτ that failed at a
    check is not looked at again before twice the next one, because it cannot have settled earlier; nor one that kept
    too few snapshots for any verdict where it would have to begin.
    counts: `checks` of the run; sufficient(stride, n): whether Δτ, in dense intervals, is so in the first n snapshots.
    """

    def __init__(self, counts: Sequence[int], sufficient: Callable[[int, int], bool], held: float = HELD) -> None:
        self.counts, self.held, self._ask = counts, held, sufficient
        self._known: dict[tuple[int, int], bool] = {}  # stride and check: whether it was sufficient

    def learn(self, stride: int, n: int, sufficient: bool) -> None:
        """Take the verdict of a check that is known already."""
        self._known[stride, n] = sufficient

    def any_settled(self, n: int) -> bool:
        """Tell whether any Δτ has settled by a check."""
        return next(self.all_settled(n), None) is not None

    def all_settled(self, n: int) -> Iterator[int]:
        """Yield every Δτ that has settled by a check, in dense intervals, coarse to fine."""
        return (stride for stride in range(COARSEST_STRIDE, FINEST_STRIDE - 1, -1) if self.settled(stride, n))

    def settled(self, stride: int, n: int, *, at_last: bool = False) -> bool:
        """Tell whether a Δτ has settled by a check; at_last: it will not be asked for again.

        The oldest check fails most often, so that is asked first then. Before, the newest that failed is looked for,
        because it rests the question longest.
        """
        first = max((c for c in self.counts if self.held * c <= n), default=None)
        if first is None or _too_few(stride, first):
            return False
        asked = [c for c in self._back_from(n) if c >= first]
        if not all(self._known.get((stride, c), True) for c in asked):
            return False
        return all(self._sufficient(stride, c) for c in (reversed(asked) if at_last else asked))

    def since(self, stride: int, n: int) -> int | None:
        """Return the first check of the unbroken series in which a Δτ is sufficient up to n; None if it is not at n."""
        first = None
        for c in self._back_from(n):
            if _too_few(stride, c) or not self._sufficient(stride, c):
                break
            first = c
        return first

    def _sufficient(self, stride: int, n: int) -> bool:
        if (stride, n) not in self._known:
            self._known[stride, n] = self._ask(stride, n)
        return self._known[stride, n]

    def _back_from(self, n: int) -> list[int]:
        return [c for c in reversed(self.counts) if c <= n]


def _too_few(stride: int, n: int) -> bool:
    """Tell whether a Δτ keeps too few of n snapshots for a verdict."""
    return n <= stride * (FEWEST_SNAPSHOTS - 1)
