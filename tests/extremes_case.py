"""A law at an extreme, and what came out of it."""

from collections.abc import Callable
from math import inf
from typing import Any, NamedTuple

from sim import LimitError, Scene

EXACT, GATE, REFUSED = "exact", "within gate", "refused"
ROUNDING = 1e-12  # relative: what counts as exact


class Case(NamedTuple):
    """A law at an extreme; `measure` returns a relative error (or that and a remark), or raises the refusal."""

    law: str
    extreme: str
    measure: Callable[[], float | tuple[float, str]]
    gate: float = ROUNDING  # largest relative error
    says: str = ""  # of a refusal

    @property
    def outcome(self) -> str:
        """What must come out."""
        return REFUSED if self.says else EXACT if self.gate <= ROUNDING else GATE


def scene(**tables: Any) -> Scene:
    """Elastic contacts without an overlap limit, changed by the tables given."""
    contact = {"stiffness": 1e4, "restitution": 1.0} | tables.pop("contact", {})
    return Scene.model_validate({"contact": contact, "limits": {"max_overlap": inf}} | tables)


def answer(case: Case) -> tuple[str, str]:
    """Return the outcome of a case, and the figure or message that tells it; fails where it does not hold."""
    try:
        found = case.measure()
    except (ValueError, LimitError) as refusal:  # InputError, Refusal and pydantic's are ValueErrors
        said = str(refusal)
        assert case.says, said
        assert case.says in said, said
        return REFUSED, f"… {case.says} …"
    error, remark = found if isinstance(found, tuple) else (found, "")
    assert not case.says, f"not refused; error {error:g}"
    assert error <= case.gate, f"relative error {error:.3g}, gate {case.gate:g}"
    figure = f"{error:.1e} ≤ {case.gate:g}" if case.outcome == GATE else ""
    return case.outcome, "; ".join(filter(None, (figure, remark)))
