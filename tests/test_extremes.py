"""Every law at its extremes: exact, within a gate, or refused with a message; `python tests/test_extremes.py` tells.

That command writes docs/extremes.md from what it measures; a test holds the table to these cases. Two threads are
needed for all of them (`NUMBA_NUM_THREADS`).
"""

import sys
from pathlib import Path

import numba
import pytest

sys.path.append(str(Path(__file__).parent))

import extremes_contact
import extremes_fluid
import extremes_particles
import extremes_reduced
import extremes_whole
from extremes_case import answer

TABLE = Path(__file__).parents[1] / "docs" / "extremes.md"
PARTS = (extremes_contact, extremes_particles, extremes_fluid, extremes_whole, extremes_reduced)
CASES = [case for part in PARTS for case in part.CASES]


@pytest.mark.physics
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.law}: {case.extreme}")
def test_every_law_is_exact_within_its_gate_or_refused_at_its_extremes(case):
    answer(case)


def test_the_table_in_the_docs_tells_these_cases():
    rows = [line.split(" | ")[:3] for line in TABLE.read_text().splitlines() if line.startswith("| ")][1:]
    assert rows == [[f"| {case.law}", case.extreme, case.outcome] for case in CASES]


def write_table() -> None:
    """Measure every case and write the table."""
    numba.set_num_threads(1)  # but where a case says otherwise
    about = (
        "Made by `python tests/test_extremes.py`, which fails where a case does not hold. *Exact* is to 1e-12 relative",
        "or to the bit; *within gate* gives relative error and gate; *refused* what the message says. Whole runs are",
        "beads in a stirred liquid, with walls, contacts and friction, compared with the same run in other units.",
    )
    lines = ["# Extremes", "", *about, "", "| law | extreme | outcome | figure or message |", "|---|---|---|---|"]
    for case in CASES:
        outcome, told = answer(case)
        lines.append(f"| {case.law} | {case.extreme} | {outcome} | {told} |")
    TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    write_table()
