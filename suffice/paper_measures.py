"""What the paper's figures need of a run beside verdicts: reduced order models trained on it, and their curves."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import Basis, SnapshotMatrix, lanczos_convergence, lanczos_pod
from pod import InputError as UnfitSnapshots
from selection.intervals import Subset
from suffice.compare import compare, subsets_between
from suffice.making import made
from suffice.one_step import rom_speed
from suffice.progress import Advance
from suffice.quantities import AXES
from suffice.reconstruction import Case, Reduced, projection_errors, reduce
from suffice.results import facts_of
from suffice.rom import Rom, components_of
from suffice.run import Run
from suffice.selecting import thresholds_of
from suffice.setting import setting_of
from suffice.variables import held, mean_diameter

Array = NDArray[np.float64]
Judged = Mapping[str, Any]  # a variable as `select` writes it

SHOWN = 4  # Δτ of which curves over time are drawn


class Wish(NamedTuple):
    """What is asked of both cases."""

    variable: str  # of the paper's tables
    trained: Sequence[str]  # variables of which surrogates are trained
    intervals: Sequence[float] | None  # Δτ, s
    surrogates: Sequence[str]  # the first is the ROM's
    seed: int


def measure_case(run: Run, wish: Wish, judged: Mapping[str, Judged], advance: Advance) -> dict[str, Any]:
    """Train the surrogates at every Δτ and draw the paper's curves; plain types, ready for JSON.

    judged: all variables as `select` writes them. `compare` is that of `suffice compare`, `convergence` how the Lanczos
    process of every variable goes at the finest Δτ (Figure 2), `coefficients` and `history` those of the wished
    variable over time at some Δτ (Figures 6 and 7), `one_step` how long a ROM of all positions takes for a snapshot,
    `displacement` how far a particle goes in one Δτ.
    Raises Refusal as `compare` does.
    """
    rom, subsets = wish.surrogates[0], subsets_between(run, wish.intervals)
    compared = compare(
        run, wish.trained, wish.intervals, wish.surrogates, precisions=[], seed=wish.seed, progress=advance
    )
    shown = _shown(subsets, judged[wish.variable]["chosen_interval"])
    values, positions = held(run, wish.variable), run.snapshot(0).values["position"]
    windows = [Case(values, None, run.times, s.training, np.arange(s.training[-1] + 1)) for s in shown]
    known = [reduce(window, thresholds_of(wish.variable).energy) for window in windows]
    candidates = {c["interval"]: c for c in judged[wish.variable]["candidates"]}
    modes = [modes_used(candidates[s.interval]) for s in shown]
    last = int(candidates[shown[-1].interval]["n_lr"])  # the last mode that is needed
    return {
        "facts": facts_of(run),
        "unit": run.variable(wish.variable).unit,
        "rom": rom,
        "compare": dict(compared),
        "one_step": [_one_step(run, s.interval, rom) for s in subsets],
        "bytes_of_positions": int(np.prod(positions.shape)) * positions.dtype.itemsize,
        "convergence": dict(_convergence(run, list(judged), subsets[-1])),
        "coefficients": _coefficients(rom, list(zip(shown, windows, known, modes, strict=True)), last),
        "history": [_history(s, window, one) for s, window, one in zip(shown, windows, known, strict=True)],
        "displacement": [_displacement(run, s) for s in subsets],
        "axis": _turning(run),
    }


def modes_used(candidate: Mapping[str, Any]) -> int:
    """Return the modes of the ROM: n_c, the most that are consistent, but no fewer than the n_lr that are needed."""
    return max(int(candidate["n_c"]), int(candidate["n_lr"]))


def _one_step(run: Run, interval: float, rom: str) -> dict[str, Any]:
    """Measure one step of a ROM of all positions on this processor; in a batch, as many as the run has."""
    model = Rom(components_of(run, interval, rom), device="cpu")
    one = model.empty(1)
    found = rom_speed(model, buffer=run.n_snapshots * one.numel() * one.element_size())
    return {
        "interval": interval,
        "n_modes": found.n_modes,
        "single_seconds": found.seconds,
        "batch_seconds": found.batch_seconds,
        "batch_size": found.batch_size,
        "threads": found.threads,
    }


def _shown(subsets: Sequence[Subset], chosen: float | None) -> list[Subset]:
    """Return the coarsest Δτ, the finest, the sufficient one if there is any, and one between."""
    wanted = {0, len(subsets) - 1}
    wanted |= {k for k, subset in enumerate(subsets) if subset.interval == chosen}
    for k in (len(subsets) // 2, len(subsets) // 4, 3 * len(subsets) // 4):
        if len(wanted) < SHOWN:
            wanted.add(k)
    return [subsets[k] for k in sorted(wanted)]


def _convergence(run: Run, names: Sequence[str], subset: Subset) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield for each variable the Lanczos ratio of its n_lr modes against steps; nothing of one that stands still."""
    for name in names:
        energy = thresholds_of(name).energy
        try:
            basis = lanczos_pod(SnapshotMatrix(held(run, name)).columns(subset.training), energy=energy)
        except UnfitSnapshots:
            continue
        found = lanczos_convergence(basis, energy=energy)
        curves = {curve: [float(x) for x in values] for curve, values in found._asdict().items()}
        yield name, {"modes": len(basis.values), "energy": energy, "interval": subset.interval, **curves}


def _coefficients(rom: str, cases: Sequence[tuple[Subset, Case, Reduced, int]], last: int) -> list[dict[str, Any]]:
    """Two coefficients over time, the first and that of mode `last`: the dense truth, and what ROMs predict.

    All on modes φ_k of the dense set: c_k(t) = φ_kᵀ(W(t) - W̄); of a ROM, Ŵ = W̄_r + Σ ĉ_i φ_i, that is
    φ_kᵀ(W̄_r - W̄) + Σ ĉ_i φ_kᵀφ_i.
    """
    dense_set = cases[0][1]
    matrix = SnapshotMatrix(dense_set.values)
    dense = lanczos_pod(matrix, modes=last)
    truth = dense.project(matrix)
    numbers = sorted({1, dense.modes.shape[1]})
    predicted = [_on_modes(dense, rom, *each) for each in cases]
    return [
        {
            "mode": k,
            "times": dense_set.times.tolist(),
            "truth": truth[:, k - 1].tolist(),
            "rms": float(np.sqrt(np.square(truth[:, k - 1]).mean())),
            "predicted": [
                {
                    "interval": subset.interval,
                    "modes": n,
                    "values": values[:, k - 1].tolist(),
                    "rmse": float(np.sqrt(np.square(values[:, k - 1] - truth[case.unseen, k - 1]).mean())),
                }
                for (subset, case, _, n), values in zip(cases, predicted, strict=True)
            ],
        }
        for k in numbers
    ]


def _on_modes(dense: Basis, rom: str, _subset: Subset, case: Case, reduced: Reduced, n: int) -> Array:
    """Project what a ROM on n modes predicts at the times of the window on the modes of the dense set, (times, p)."""
    surrogate = made(rom).fit(case.times[case.training], reduced.coefficients[case.training, :n])
    offset = (reduced.basis.mean - dense.mean) @ dense.modes
    return np.asarray(
        offset + surrogate.predict(case.times[case.unseen]) @ (reduced.basis.modes[:, :n].T @ dense.modes)
    )


def _history(subset: Subset, window: Case, reduced: Reduced) -> dict[str, Any]:
    """Error of projection on all modes at every dense time, training times among them (paper eqs. (33)-(34))."""
    errors = projection_errors(reduced, window, reduced.basis.modes.shape[1])
    return {
        "interval": subset.interval,
        "modes": reduced.basis.modes.shape[1],
        "times": window.times[window.unseen].tolist(),
        "error": errors.tolist(),
        "training": subset.training.tolist(),
        "mean_unseen": float(np.delete(errors, subset.training).mean()),
        "mean_training": float(errors[subset.training].mean()),
    }


def _displacement(run: Run, subset: Subset) -> dict[str, Any]:
    """Root mean square over particles of how far they go in one Δτ, in m and diameters; over ten pairs of snapshots."""
    pairs = list(zip(subset.training, subset.training[1:], strict=False))
    few = [pairs[k] for k in np.unique(np.linspace(0, len(pairs) - 1, 10).astype(int))]
    moves = [run.snapshot(int(b)).values["position"] - run.snapshot(int(a)).values["position"] for a, b in few]
    rms, diameter = float(np.sqrt(np.mean([np.square(move).sum(axis=1).mean() for move in moves]))), mean_diameter(run)
    return {"interval": subset.interval, "rms": rms, "diameters": None if diameter is None else rms / diameter}


def _turning(run: Run) -> str | None:
    """Name the axis that the rotor turns about; None where none turns, or not about x, y or z."""
    axis = setting_of(run).axis
    along = (
        [] if axis is None else [name for name, share in zip(AXES, axis.along, strict=True) if abs(share) > 1 - 1e-9]
    )
    return along[0] if along else None
