"""Warnings: each kind is said once when it comes up, counted, and kept for the report."""

from typing import Any, NamedTuple

MOST_KINDS, LONGEST = 20, 300  # of a stage; characters of a text: what is kept has a bounded room in a run
REST = "more kinds"


class Counted(NamedTuple):
    """Warnings of one kind: how many, and the words of the first."""

    times: int
    first: str


class Warned(dict[str, Counted]):
    """Warnings by their kind, a few words such as `void fraction at its floor`."""

    def add(self, kind: str, text: str, times: int = 1) -> bool:
        """Count a warning, and tell whether it is the first of its kind."""
        kind = kind if kind in self or len(self) < MOST_KINDS else REST
        known = self.get(kind)
        self[kind] = Counted(times, text[:LONGEST]) if known is None else known._replace(times=known.times + times)
        return known is None

    def plain(self) -> dict[str, dict[str, Any]]:
        """Return them in plain types, `count` and `first` of each kind."""
        return {kind: {"count": found.times, "first": found.first} for kind, found in self.items()}

    def taken(self) -> "Warned":
        """Return them, and forget them."""
        found = Warned(self)
        self.clear()
        return found

    @property
    def count(self) -> int:
        """How many there are of all kinds."""
        return sum(found.times for found in self.values())
