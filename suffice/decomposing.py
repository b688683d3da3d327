"""From a run to a basis on disk."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from pod import SnapshotMatrix, lanczos_pod
from selection import InputError as UnfitIntervals
from selection import dense_interval
from selection.intervals import stride
from suffice.basis_file import card_of, check_place, write_basis
from suffice.refusal import Refusal
from suffice.run import Run


def decompose_run(
    source: Path,
    output: Path,
    variable: str,
    interval: float | None = None,
    energy: float | None = None,
    modes: int | None = None,
    tolerance: float | None = None,
) -> dict[str, Any]:
    """Find the modes of one variable of a run, write them, and return what is known about them in plain types.

    interval: Δτ in s of the snapshots used, default the dense one; energy, modes, tolerance: at most one of them, as
    for `pod.lanczos_pod`. Raises Refusal or pod.InputError for what cannot be used.
    """
    check_place(output)
    with Run(source) as run:
        rows = run.variable(variable)
        began = time.monotonic()
        try:
            step = 1 if interval is None else stride(interval, dense_interval(run.times), run.n_snapshots)
        except UnfitIntervals as error:
            raise Refusal(f"{source}: {error}") from None
        used = np.arange(0, run.n_snapshots, step)
        matrix = SnapshotMatrix(rows).columns(used)
        basis = lanczos_pod(matrix, energy=energy, modes=modes, tolerance=tolerance)
        made_from = {
            "run": str(source),
            "variable": variable,
            "unit": rows.unit,
            "interval": float(run.times[step] - run.times[0]) if run.n_snapshots > step else None,
            "n_snapshots": len(used),
            "seconds": round(time.monotonic() - began, 3),
        }
    card = card_of(basis, made_from)
    write_basis(output, basis, card)
    return card
