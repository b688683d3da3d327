"""From a run to a basis on disk."""

import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import (
    ALONE,
    Basis,
    Ranks,
    RowSource,
    SnapshotMatrix,
    enriched_pod,
    grown_gram,
    lanczos_convergence,
    lanczos_pod,
)
from pod import InputError as UnfitSnapshots
from selection import InputError as UnfitIntervals
from selection import dense_interval
from selection.intervals import stride
from suffice.basis_file import card_of, check_place, read_card, read_gram, write_basis
from suffice.lock import only_writer
from suffice.progress import Advance, Reporter
from suffice.refusal import Refusal
from suffice.report import write_report
from suffice.rows import Counted, Variable
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.uneven import unfit


class Wanted(NamedTuple):
    """What a basis is made of and how far it goes; at most one of energy, modes, tolerance and error."""

    variable: str
    interval: float | None = None  # s, Δτ of the snapshots used; default the dense one
    energy: float | None = None
    modes: int | None = None
    tolerance: float | None = None
    error: float | None = None
    route: str | None = None
    append: bool = False  # use the inner products that stand in the basis to be replaced, and keep them in the new one
    velocities: bool = False  # enrich positions by velocities
    plot: Path | None = None  # page that shows how the Lanczos ratio converged


def decompose_run(
    source: Path, output: Path, wanted: Wanted, ranks: Ranks = ALONE, reporter: Reporter | None = None
) -> dict[str, Any]:
    """Find the modes of one variable of a run, write them, and return what is known about them in plain types.

    Of several ranks each reads its own rows, and the first one writes, and shows how many of its own it has read.
    Raises Refusal or pod.InputError for what cannot be used, and pod.LostRankError.
    """
    check_place(output)
    with Run(source) as run, only_writer(output) if ranks.rank == 0 else nullcontext():
        if reporter is None or ranks.rank > 0:
            return _decompose(run, output, wanted, ranks)
        with reporter.stage("decompose", "rows") as advance:
            return _decompose(run, output, wanted, ranks, advance)


def _decompose(run: Run, output: Path, wanted: Wanted, ranks: Ranks, advance: Advance | None = None) -> dict[str, Any]:
    """Find and write the modes of an open run into a file that nobody else writes."""
    rows = run.variable(wanted.variable)
    source = rows if advance is None else Counted(rows, _share(rows, ranks), advance)
    began = time.monotonic()
    used = _snapshots(run, wanted.interval)
    card: dict[str, Any] = {
        "run": str(run.path),
        "variable": wanted.variable,
        "unit": rows.unit,
        "interval": None if run.interval is None else run.interval * int(used[1] - used[0]),
        "n_snapshots": len(used),
        "n_rows": rows.shape[0],
        "ranks": ranks.size,
    }
    gram, energy = None, thresholds_of(wanted.variable).energy
    if wanted.velocities:
        basis, more = _enriched(run, source, wanted, used, ranks)
        card |= more
    else:
        matrix = SnapshotMatrix(source, ranks=ranks).columns(used)
        if wanted.append:
            gram, card["snapshots_known"] = _grown(matrix, output, card)
        basis = lanczos_pod(
            matrix, energy=wanted.energy, modes=wanted.modes, tolerance=wanted.tolerance, error=wanted.error,
            reconstructable=energy, route=wanted.route, gram=gram,
        )  # fmt: skip
    seconds = round(time.monotonic() - began, 3)
    card = card_of(basis, {**card, "seconds": seconds, "thresholds": {"energy": energy}})
    write_basis(output, basis, card, ranks, gram)
    if wanted.plot is not None and ranks.rank == 0:
        about = {key: card[key] for key in ("run", "n_rows", "n_snapshots", "lanczos_steps", "route", "reason")}
        curves = {"convergence": {wanted.variable: _convergence(basis, energy)}, "provenance": about}
        write_report({"study": f"{wanted.variable} of {run.path.name}", **curves}, wanted.plot)
    return card


def _convergence(basis: Basis, energy: float) -> dict[str, Any]:
    """Return how the Lanczos ratio converged with the steps, in plain types (the paper's Figure 2)."""
    found = lanczos_convergence(basis, energy=energy)
    curves = {name: [float(x) for x in values] for name, values in found._asdict().items()}
    return {"modes": len(basis.values), **curves}


def _snapshots(run: Run, interval: float | None) -> NDArray[np.intp]:
    try:
        step = 1 if interval is None else stride(interval, dense_interval(run.times), run.n_snapshots)
    except UnfitIntervals as error:
        raise unfit(run, error) from None
    return np.arange(0, run.n_snapshots, step)


def _grown(matrix: SnapshotMatrix, output: Path, card: dict[str, Any]) -> tuple[NDArray[np.float64], int]:
    """Inner products of all snapshots, from those in the basis that stands at the output, and how many those were."""
    past, known = read_card(output), read_gram(output)
    if past is None or known is None:
        return matrix.gram(), 0
    for name in ("run", "variable", "interval", "n_rows"):
        if past.get(name) != card[name]:
            raise Refusal(
                f"--append: {output} was made with {name} {past.get(name)}, now it is {card[name]}; choose another "
                "output, or leave --append out"
            )
    if len(known) > matrix.shape[1]:
        raise Refusal(
            f"--append: {output} was made of {len(known)} snapshots, {past['run']} has {matrix.shape[1]} at this Δτ; "
            "choose another output, or leave --append out"
        )
    try:
        return grown_gram(matrix, known), len(known)
    except UnfitSnapshots as error:
        raise Refusal(f"--append: {output}: {error}; choose another output, or leave --append out") from None


def _share(rows: Variable, ranks: Ranks) -> int:
    own = ranks.share(rows.shape[0], rows.rows_per_particle)
    return len(range(own.start, own.stop))


def _enriched(
    run: Run, positions: RowSource, wanted: Wanted, used: NDArray[np.intp], ranks: Ranks
) -> tuple[Basis, dict[str, Any]]:
    """Basis of positions and velocities, and what its weight was chosen from."""
    name = wanted.variable.replace("position", "velocity")
    if name == wanted.variable or wanted.interval is None or wanted.append:
        raise Refusal(
            f"--velocities with --variable {wanted.variable}: enriches a position at a coarser --interval, without "
            "--append; for example --variable position --interval with twice the dense one"
        )
    if any(x is not None for x in (wanted.energy, wanted.tolerance, wanted.error, wanted.route)):
        raise Refusal("--velocities: the number of modes is given by --modes alone, default one per snapshot")
    interval = float(run.times[used[1]] - run.times[used[0]])
    found = enriched_pod(positions, run.variable(name), used.tolist(), interval, modes=wanted.modes, ranks=ranks)
    errors = {f"{weight:g}": float(error) for weight, error in zip(found.weights, found.errors, strict=True)}
    return found.basis, {"velocity_weight": found.weight, "held_out_rmse": errors}
