"""The paper's experiment as data: verdicts, tables and curves, numbered as in the paper."""

from collections.abc import Mapping, Sequence
from typing import Any

from suffice.paper_differences import differences_of
from suffice.paper_tables import tables_of
from suffice.paper_trials import Found, trials_of
from suffice.paper_verdicts import verdicts_of


def paper_of(cases: Sequence[Found], variable: str) -> dict[str, Any]:
    """Gather what was found of the cases, calibration first; plain types, ready for JSON.

    `verdicts` (a sentence and its numbers for each case), `trials` (of each case, every trained variable and Δτ),
    `tables` ("1" to "7"), `figures` ("2": Lanczos ratio against steps, "6": coefficients over time, "7": errors over
    time; of each case; Figure 8 are the curves that `select` writes), `differences` (the paper's statements, ours, and
    why).
    """
    verdicts = verdicts_of(cases, variable)
    return {
        "variable": variable,
        "cases": [_case(found) for found in cases],
        "verdicts": verdicts,
        "trials": {found["name"]: trials_of(found) for found in cases},
        "tables": tables_of(cases, variable),
        "figures": {
            "2": {found["name"]: found["convergence"] for found in cases},
            "6": {found["name"]: found["coefficients"] for found in cases},
            "7": {found["name"]: found["history"] for found in cases},
        },
        "differences": differences_of(cases, verdicts, variable),
    }


def _case(found: Found) -> Mapping[str, Any]:
    return {key: found[key] for key in ("name", "scene", "run", "facts", "unit", "rom", "displacement")}
