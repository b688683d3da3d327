"""From trained models to a run of what they predict."""

import json
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suffice.combined import load_models
from suffice.lock import only_writer
from suffice.model import Model
from suffice.progress import Reporter
from suffice.quantities import AXES, QUANTITIES, whole_of
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import RunWriter, check_place
from suffice.wording import seconds_text
from surrogates.surrogate import EDGE

MOST_TIMES = 1_000_000


def parse_times(text: str) -> NDArray[np.float64]:
    """Return the times (s) of 'first:last:step' or of a list with commas, increasing. Raises Refusal."""
    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            if not (step > 0.0 and last >= first and (last - first) / step < MOST_TIMES):
                raise ValueError
            return np.asarray(first + step * np.arange(int((last - first) / step + 1e-9) + 1), dtype=np.float64)
        times = np.array([float(part) for part in text.split(",")])
        if not (np.isfinite(times).all() and (np.diff(times) > 0.0).all()):
            raise ValueError
        return times
    except (ValueError, OverflowError):
        raise Refusal(
            f"--times {text!r}: not increasing times in s; give first:last:step such as 0:0.2:0.0005, or a list such "
            "as 0.0105,0.011"
        ) from None


def predict_run(
    folders: Sequence[Path], times: NDArray[np.float64], output: Path, beyond: bool, reporter: Reporter
) -> dict[str, Any]:
    """Write what models predict at these times (s) as a run that ParaView opens; return what was written.

    folders: models of whole vectors, or of all three components of one, of the same particles or cells, or models that
    combine such. Nothing is
    extrapolated unless `beyond`. Raises Refusal or surrogates.InputError before anything is written.
    """
    models = [model for folder in folders for model in load_models(folder)]
    parts = _quantities(models)
    check_place(output)
    _keep_runs(output)
    first = models[0]
    for model in models:
        model.surrogate.predict(times, beyond=beyond)  # refuses a time outside the window before a file is made
    done = 0
    with (
        only_writer(output),
        RunWriter(
            output,
            ids=first.particles["ids"],
            radius=first.particles["radius"],
            species=first.particles["species"],
            n_snapshots=len(times),
            provenance=_provenance(models, beyond),
            variables=list(parts),
            grid=next((model.grid for model in models if model.grid is not None), None),
            beside=True,
        ) as run,
        reporter.stage("predict", "snapshots") as advance,
    ):
        for some in np.array_split(times, max(len(times) // _batch(models), 1)):
            found = {name: _values(name, group, some, beyond) for name, group in parts.items()}
            for k, time in enumerate(some):
                run.append(float(time), {name: values[k] for name, values in found.items()})
                done += 1
                advance(done, len(times))
    outside = _outside(models, times)
    return {
        "run": str(output),
        "n_snapshots": len(times),
        "times": [float(times[0]), float(times[-1])],
        "variables": list(parts),
        "models": [str(folder) for folder in folders],
        "beyond_the_window": int(outside),
    }


def _keep_runs(output: Path) -> None:
    """Refuse to replace a run that was simulated or imported, perhaps the one that the models were trained on."""
    if not output.exists():
        return
    with Run(output) as run:
        if "predicted" not in run.provenance:
            raise Refusal(f"output {output} holds a run that no model predicted; choose another name or remove it")


def _quantities(models: Sequence[Model]) -> dict[str, list[Model]]:
    """Sort models by the quantity they predict: one of the whole, or one of each component."""
    found: dict[str, list[Model]] = {}
    for model in models:
        found.setdefault(whole_of(model.variable), []).append(model)
        if not np.array_equal(model.particles["ids"], models[0].particles["ids"]):
            raise Refusal("models are of different particles; give models that were trained on the same run")
    for name, group in found.items():
        given = [model.variable for model in group]
        wanted = [f"{name}.{axis}" for axis in AXES] if QUANTITIES[name].components > 1 else []
        if given != [name] and sorted(given) != wanted:
            raise Refusal(
                f"models of {', '.join(given)}: a run holds whole vectors; give one model of {name}, or one of each of "
                f"{', '.join(wanted)}"
            )
    if not any(name == "position" or QUANTITIES[name].of_fluid for name in found):
        raise Refusal(
            f"models of {', '.join(found)} alone: particles without positions cannot be shown; add a model of position"
        )
    return found


def _batch(models: Sequence[Model]) -> int:
    """How many snapshots are predicted at once: some tens of MB."""
    return max(2**22 // max(sum(len(model.mean) for model in models), 1), 1)


def _values(name: str, group: Sequence[Model], times: NDArray[np.float64], beyond: bool) -> NDArray[np.float64]:
    """Values of one quantity, (times, n, 3) on particles and (times, z, y, x[, 3]) in cells."""
    parts = [model.snapshots(times, beyond=beyond) for model in sorted(group, key=lambda model: model.variable)]
    values, quantity = (parts[0] if len(parts) == 1 else np.stack(parts, axis=-1)), QUANTITIES[name]
    grid = group[0].grid
    cells = grid.shape if grid is not None else (len(group[0].particles["ids"]),)
    return values.reshape(len(times), *cells, *((quantity.components,) if quantity.components > 1 else ()))


def _outside(models: Sequence[Model], times: NDArray[np.float64]) -> int:
    """Count the times outside the window of any model, but for rounding."""
    first, last = (max(m.surrogate.window_[0] for m in models), min(m.surrogate.window_[1] for m in models))
    slack = EDGE * models[0].surrogate.interval_
    return int(((times < first - slack) | (times > last + slack)).sum())


def _provenance(models: Sequence[Model], beyond: bool) -> dict[str, str]:
    """Say that nobody has simulated this."""
    first = models[0]
    window = f"{seconds_text(first.surrogate.window_[0])} to {seconds_text(first.surrogate.window_[1])}"
    return {
        "predicted": f"by {', '.join(map(_named, models))}, trained on {window}"
        + (", extrapolated beyond it where asked" if beyond else ""),
        "models": json.dumps([dict(model.card) for model in models]),
        "suffice": version("suffice"),
    }


def _named(model: Model) -> str:
    return f"{model.card['surrogate']}{' (derivative)' if model.moving else ''}"
