"""How candidates are shown to whoever works with them in a notebook or a terminal."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from selection.table import NONE, Cell, Table, number

if TYPE_CHECKING:
    from selection.candidate import Candidate

HEADS = ("Δτ (s)", "snapshots", "n_lr", "n_c", "K_f", "K_f_interval", "rule", "R_a", "R_lr", "error_n_lr", "error_n_c")


def table_of(title: str, candidates: Sequence["Candidate"]) -> Table:
    """One row for each Δτ, coarse to fine: `rule` is the paper's K_f ≥ 2, `verdict` ours; errors in the unit of W."""
    return Table(title, (*HEADS, "verdict"), [_row(candidate) for candidate in candidates])


def feasibility_text(candidate: "Candidate") -> str:
    """K_f with two decimals, as the report writes it."""
    return NONE if candidate.K_f is None else f"{candidate.K_f:.2f}"


def chosen_text(candidates: Sequence["Candidate"], chosen_interval: float | None, limit: float) -> str:
    """Say which Δτ the paper's rule chooses, or how far the best one is from it."""
    known = [candidate for candidate in candidates if candidate.K_f is not None]
    if not known:
        return f"K_f is not defined at any Δτ considered: {'; '.join(candidates[0].reasons)}"
    chosen = next((c for c in known if c.interval == chosen_interval), None)
    if chosen is None:
        best = max(known, key=lambda c: (c.K_f or 0.0, -c.interval))
        return f"no Δτ considered suffices: K_f is {feasibility_text(best)} at most, at {best.interval:g} s"
    doubt = "" if chosen.verdict == "sufficient" else f"; but {chosen.verdict}: {'; '.join(chosen.reasons)}"
    return f"Δτ = {chosen.interval:g} s suffices: K_f {feasibility_text(chosen)} ≥ {limit:g}{doubt}"


def _row(candidate: "Candidate") -> list[Cell]:
    spread = candidate.K_f_interval
    return [
        Cell(f"{candidate.interval:g}"),
        *(Cell(str(count)) for count in (candidate.n_snapshots, candidate.n_lr, candidate.n_c)),
        Cell(feasibility_text(candidate), strong=candidate.sufficient),
        Cell(NONE if spread is None else f"{spread[0]:.2f} … {spread[1]:.2f}"),
        Cell("✓" if candidate.sufficient else NONE),
        Cell(number(candidate.R_a)),
        Cell(number(candidate.R_lr)),
        *(Cell(number(error)) for error in (candidate.error_n_lr, candidate.error_n_c)),
        Cell(candidate.verdict, candidate.verdict, "; ".join(candidate.reasons)),
    ]
