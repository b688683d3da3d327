"""Answers on a run as a notebook shows them: what suffices, and what error costs."""

from collections.abc import Iterable, Mapping
from typing import Any

from selection import Candidate, Sweep
from selection.shown import feasibility_text
from selection.table import NONE, Cell, Table
from suffice.refusal import Refusal
from suffice.wording import bytes_text, escape, number, seconds_text

MARKS = {"sufficient": " ✓", "insufficient": "  ", "undecidable": " ?"}  # where there is no colour
COSTS = ("variable", "Δτ", "surrogate", "basis", "modes", "kept as", "RMSE", "unit", "diameters", "snapshot", "storage")

PARTS = ("rows", "bases", "left_out", "winners")  # of a comparison, one entry for a variable each


class Selection(dict[str, Sweep]):
    """The sweep of every variable by name; shows K_f per Δτ and variable, and what suffices."""

    def __repr__(self) -> str:
        return "\n".join([self._table(marked=True).text(), *self.sentences()])

    def _repr_html_(self) -> str:
        return self._table(marked=False).html() + _paragraphs(self.sentences())

    def sentences(self) -> list[str]:
        """Which Δτ suffices for each variable."""
        return [f"{name}: {found.sentence()}" for name, found in self.items()]

    def _table(self, *, marked: bool) -> Table:
        """K_f of every Δτ, coarse to fine; verdicts as colours, or as marks."""
        judged = [{c.interval: c for c in found.candidates} for found in self.values()]
        intervals = sorted({interval for own in judged for interval in own}, reverse=True)
        rows = [[Cell(f"{x:g}"), *(_feasibility(own.get(x), marked=marked) for own in judged)] for x in intervals]
        title = "K_f = n_c / n_lr" + (", ✓ sufficient, ? undecidable" if marked else ", coloured by verdict")
        return Table(title, ("Δτ (s)", *self), rows)


class Tradeoff(dict[str, Any]):
    """The answer of a comparison, plain types under names; shows the rows that no other beats in error and cost.

    >>> from suffice import Run, compare_run
    >>> with Run("run.h5") as run:
    ...     found = compare_run(run, ["position.x"], [0.004], ["spline", "linear"], precisions=[])
    >>> least = min(found.of("position.x").front(), key=lambda row: row["rmse"])
    >>> least["surrogate"]
    'spline'
    """

    def __repr__(self) -> str:
        return "\n".join([self._table().text(), *self.sentences()])

    def _repr_html_(self) -> str:
        return self._table().html() + _paragraphs(self.sentences())

    def of(self, variable: str) -> "Tradeoff":
        """Return the answer on one variable alone. Raises Refusal for one that was not compared."""
        known = list(dict.fromkeys(row["variable"] for row in self["rows"]))
        if variable not in known:
            raise Refusal(f"variable {variable!r} was not compared; there are {', '.join(known)}")
        parts = {part: [one for one in self[part] if one["variable"] == variable] for part in PARTS}
        choice = {name: found for name, found in self["choice"].items() if name == variable}
        return Tradeoff({**self, **parts, "choice": choice})

    def front(self) -> list[dict[str, Any]]:
        """Return the rows that no other of the same variable beats in error and in one of the costs."""
        return [row for row in self["rows"] if any(row["on_front"].values())]

    def sentences(self) -> list[str]:
        """With a limit, what keeps it for each variable; empty without one."""
        return [found["sentence"] for found in self["choice"].values()]

    def _table(self) -> Table:
        rows = self.front()
        title = (
            f"{len(rows)} of {len(self['rows'])} alternatives: no other errs less for no more time, or no more storage"
        )
        return Table(title, COSTS, [_costs(row) for row in rows])


def _feasibility(candidate: Candidate | None, *, marked: bool) -> Cell:
    if candidate is None:
        return Cell(NONE)
    text = feasibility_text(candidate) + (MARKS[candidate.verdict] if marked else "")
    return Cell(text, candidate.verdict, "; ".join(candidate.reasons), strong=candidate.sufficient)


def _costs(row: Mapping[str, Any]) -> list[Cell]:
    texts = (
        row["variable"],
        seconds_text(row["interval"]),
        row["surrogate"],
        row["basis"] or "snapshots",
        number(row["modes"]),
        row["precision"],
        number(row["rmse"]),
        row["unit"],
        number(row["rmse_diameters"]),
        seconds_text(row["single_seconds"]),
        bytes_text(row["storage_bytes"]),
    )
    return [Cell(text) for text in texts]


def _paragraphs(sentences: Iterable[str]) -> str:
    return "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)
