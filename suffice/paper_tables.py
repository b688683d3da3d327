"""The paper's tables as data: numbered as there, captions in our words, rows with stable keys."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sim import Scene, parse_scene
from suffice.paper_setup import Property, beside, properties, setup
from suffice.paper_trials import Found, Row, candidate_at, decided_interval, of_variable, one_step, trial_at

Columns = dict[str, tuple[str, str]]  # key: title and unit

CAPTIONS = {
    "1": "Properties of particles and fluid, and conditions of the calculation",
    "2": "Setup of the two cases",
    "3": "Snapshot intervals Δτ considered",
    "4": "Training data of positions, and time for one step of {dense} at each Δτ: solver and ROM ({name})",
    "5": "Feasibility index K_f at each Δτ ({name}, {variable})",
    "6": "Decision of sufficient training data by projections alone, coarse to fine ({name}, {variable})",
    "7": "Time for one step of {dense} with training data sufficient for {variable}: solver and ROM",
}
INTERVAL = ("Δτ", "s")
CONSIDERED: Columns = {
    "interval": INTERVAL,
    "dense_intervals": ("testing intervals", ""),
    "n_snapshots": ("snapshots", ""),
    "share": ("share of all", ""),
}
TRAINING: Columns = {
    "interval": INTERVAL,
    "n_snapshots": ("snapshots", ""),
    "density": ("density", "1/s"),
    "bytes": ("training data", "B"),
}
STEP: Columns = {
    "modes_of_positions": ("modes", ""),
    "solver_seconds": ("solver", "s"),
    "single_seconds": ("ROM", "s"),
    "single_ratio": ("times faster", ""),
    "batch_seconds": ("ROM in batch", "s"),
    "batch_ratio": ("times faster", ""),
}
FEASIBILITY: Columns = {
    "interval": INTERVAL,
    "n_lr": ("n_lr", ""),
    "n_c": ("n_c", ""),
    "K_f": ("K_f", ""),
    "K_f_low": ("from", ""),
    "K_f_high": ("to", ""),
    "sufficient": ("K_f ≥ 2", ""),
    "verdict": ("our verdict", ""),
}
TRIED: Columns = {"R_rom_n_lr": ("R_c of the ROM", ""), "rmse_diameters_n_c": ("its error", "d")}
DECIDED: Columns = {
    "case": ("case", ""),
    "interval": INTERVAL,
    "sufficient": ("sufficient", ""),
    "n_snapshots": ("snapshots", ""),
    "bytes": ("training data", "B"),
}


def tables_of(cases: Sequence[Found], variable: str) -> dict[str, Any]:
    """Return Tables 1 to 7 under their numbers; the first case calibrates, the last validates.

    Each has `number`, `caption`, `columns` (key: title and unit) and `rows`.
    """
    first, last = cases[0], cases[-1]
    judged = of_variable(first, variable)["candidates"]
    parts = {
        "1": (_of_cases(cases), _beside(cases, properties)),
        "2": (_of_cases(cases), _beside(cases, setup)),
        "3": (CONSIDERED, [_considered(first, c) for c in judged]),
        "4": (TRAINING | STEP, [_training(first, c) | one_step(first, c["interval"]) for c in judged]),
        "5": (FEASIBILITY | TRIED, [_tried(first, variable, c) for c in judged]),
        "6": (FEASIBILITY, scanned(last, variable)),
        "7": (DECIDED | STEP, [_decided(found, variable) for found in cases]),
    }
    dense = f"{1e3 * first['select']['dense_interval']:g} ms"
    names = {"4": first, "5": first, "6": last}
    return {
        number: {
            "number": int(number),
            "caption": CAPTIONS[number].format(
                dense=dense, variable=variable, name=names.get(number, first)["name"]
            ),
            "columns": {key: {"title": title, "unit": unit} for key, (title, unit) in columns.items()},
            "rows": rows,
        }
        for number, (columns, rows) in parts.items()
    }  # fmt: skip


def scanned(found: Found, variable: str) -> list[Row]:
    """Return the Δτ that the decision looks at, coarse to fine up to the first that suffices."""
    rows = []
    for candidate in of_variable(found, variable)["candidates"]:
        rows.append(_feasibility(found, variable, candidate))
        if candidate["sufficient"]:
            break
    return rows


def _of_cases(cases: Sequence[Found]) -> Columns:
    own = {_key(found): (f"{found['name']} ({found['scene']})", "") for found in cases}
    return {"property": ("property", ""), "unit": ("unit", ""), **own}


def _key(found: Found) -> str:
    return str(found["name"]).lower().replace(" ", "_")


def _beside(cases: Sequence[Found], listed: Callable[[Scene, Mapping[str, Any]], list[Property]]) -> list[Row]:
    lists = [listed(parse_scene(found["text"], found["scene"]), found["cost"]) for found in cases]
    return beside([_key(found) for found in cases], lists)


def _considered(found: Found, candidate: Mapping[str, Any]) -> Row:
    interval = candidate["interval"]
    return {
        "interval": interval,
        "n_snapshots": candidate["n_snapshots"],
        "share": candidate["n_snapshots"] / found["facts"]["n_snapshots"],
        "dense_intervals": round(interval / found["select"]["dense_interval"]),
    }


def _training(found: Found, candidate: Mapping[str, Any]) -> Row:
    return {
        "interval": candidate["interval"],
        "n_snapshots": candidate["n_snapshots"],
        "bytes": candidate["n_snapshots"] * found["bytes_of_positions"],
        "density": 1.0 / candidate["interval"],
    }


def _feasibility(found: Found, variable: str, candidate: Mapping[str, Any]) -> Row:
    low, high = candidate["K_f_interval"] or (None, None)
    others = {
        name: next((c["K_f"] for c in judged["candidates"] if c["interval"] == candidate["interval"]), None)
        for name, judged in found["select"]["variables"].items()
        if name != variable
    }
    own = {key: candidate[key] for key in ("interval", "n_lr", "n_c", "K_f", "sufficient", "verdict", "reasons")}
    return {**own, "K_f_low": low, "K_f_high": high, "K_f_of_others": others}


def _tried(found: Found, variable: str, candidate: Mapping[str, Any]) -> Row:
    """Return the same with how the ROM does that was trained afterwards, on n_lr and on n_c modes."""
    trial = trial_at(found, variable, candidate["interval"])
    kept = {key: trial[key] for key in trial if key.startswith(("R_rom", "rmse"))}
    return {**_feasibility(found, variable, candidate), **kept}


def _decided(found: Found, variable: str) -> Row:
    interval, sufficient = decided_interval(found, variable)
    training = _training(found, candidate_at(found, variable, interval))
    return {"case": found["name"], "sufficient": sufficient, **training, **one_step(found, interval)}
