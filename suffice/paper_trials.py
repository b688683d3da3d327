"""What was found of a case, asked for by variable and Δτ, and the ROM that was trained there, tried."""

from collections.abc import Mapping, Sequence
from typing import Any

from suffice.compare import CONSISTENCY
from suffice.paper_measures import modes_used

Row = dict[str, Any]
Found = Mapping[str, Any]  # all that was found of a case


def of_variable(found: Found, variable: str) -> Mapping[str, Any]:
    """Return a variable of a case as `select` writes it."""
    judged: Mapping[str, Any] = found["select"]["variables"][variable]
    return judged


def candidate_at(found: Found, variable: str, interval: float) -> Mapping[str, Any]:
    """Return what `select` says of a variable at a Δτ (s)."""
    return next(c for c in of_variable(found, variable)["candidates"] if c["interval"] == interval)


def decided_interval(found: Found, variable: str) -> tuple[float, bool]:
    """Return the sufficient Δτ (s), or the finest considered, and whether it is sufficient by the paper's rule."""
    judged = of_variable(found, variable)
    chosen = judged["chosen_interval"]
    return (judged["candidates"][-1]["interval"], False) if chosen is None else (chosen, True)


def solver_seconds(found: Found) -> float | None:
    """Return what the solver needs for one dense interval, s; None where it was not measured.

    By the speed of the session that finished the run: a run that was resumed counts the steps of that one alone.
    """
    cost, dense = found["cost"], found["select"]["dense_interval"]
    speed = cost["particle_steps_per_second"]
    return cost["n_particles"] * dense / cost["time_step"] / speed if speed else None


def one_step(found: Found, interval: float) -> Row:
    """Return what solver and ROM need for one step at a Δτ (s), and their ratios; None where one is unknown."""
    solver = solver_seconds(found)
    known: Mapping[str, Any] = next((one for one in found["one_step"] if one["interval"] == interval), {})
    step: Row = {"modes_of_positions": known.get("n_modes"), "solver_seconds": solver}
    step["rom_threads"] = known.get("threads")
    for kind in ("single", "batch"):
        seconds = known.get(f"{kind}_seconds")
        step[f"{kind}_seconds"] = seconds
        step[f"{kind}_ratio"] = None if not seconds or solver is None else solver / seconds
    return step


def rom_row(found: Found, variable: str, interval: float, modes: int) -> Mapping[str, Any] | None:
    """Return the ROM on so many modes as `compare` writes it; None where it could not be fitted."""
    wanted = (variable, interval, found["rom"], "plain", modes)
    keys = ("variable", "interval", "surrogate", "basis", "modes")
    return next((row for row in found["compare"]["rows"] if tuple(row[key] for key in keys) == wanted), None)


def levels_of(found: Found, variable: str, interval: float) -> tuple[int, int]:
    """Return the numbers of modes of the ROM, n_lr and n_c but no fewer, as `compare` has them from its own projection.

    `select` has them from inner products, and may differ by one where R_c all but meets its limit. Where nothing was
    decomposed, those of `select`.
    """
    place = (variable, interval, "plain")
    bases = found["compare"]["bases"]
    base = next((one for one in bases if (one["variable"], one["interval"], one["basis"]) == place), None)
    if base is None:
        candidate = candidate_at(found, variable, interval)
        return int(candidate["n_lr"]), modes_used(candidate)
    few = int(base["n_lr"] or base["modes"])
    return few, max(int(base["n_c"]), few)


def raw_row(found: Found, variable: str, interval: float) -> Mapping[str, Any] | None:
    """Return the best interpolation of the stored snapshots without a model; None where none was tried."""
    places = [row for row in found["compare"]["rows"] if (row["variable"], row["interval"]) == (variable, interval)]
    return min((row for row in places if row["modes"] is None), key=lambda row: float(row["rmse"]), default=None)


def consistency_of_rom(found: Found, variable: str, interval: float, modes: int) -> float | None:
    """R_c of the ROM itself: mean error at all testing times over mean error at the training times.

    With g the share of unseen testing times, R = 1 + g (E_unseen / E_train - 1): at training times the ROM passes
    through the coefficients, so that it errs by what projection leaves. None where it is unknown.
    """
    row = rom_row(found, variable, interval, modes)
    train = found["curves"][variable][f"{interval:g}"]["E_train"]
    if row is None or modes >= len(train) or not train[modes]:
        return None
    m, dense = row["n_snapshots"], found["select"]["dense_interval"]
    testing = round((m - 1) * interval / dense) + 1
    return float(1.0 + (testing - m) / testing * (row["rmse"] / train[modes] - 1.0))


def trial_at(found: Found, variable: str, interval: float) -> Row:
    """Hold what `select` says of a Δτ (s) against the ROM that was trained there afterwards.

    `kept` tells whether the ROM on n_lr modes is as consistent as the rule wants of projections, R_c up to 1.05.
    """
    candidate = candidate_at(found, variable, interval)
    few, many = levels_of(found, variable, interval)
    rows = {name: rom_row(found, variable, interval, modes) for name, modes in (("n_lr", few), ("n_c", many))}
    raw, ratio = raw_row(found, variable, interval), consistency_of_rom(found, variable, interval, few)
    errors: Row = {}
    for name, row in (*rows.items(), ("raw", raw)):
        for key in ("rmse", "rmse_diameters", "storage_bytes"):
            errors[f"{key}_{name}"] = row and row[key]
    return {
        "case": found["name"],
        "variable": variable,
        "interval": interval,
        "sufficient": candidate["sufficient"],
        "verdict": candidate["verdict"],
        "reasons": candidate["reasons"],
        "n_lr": candidate["n_lr"],
        "n_c": candidate["n_c"],
        "K_f": candidate["K_f"],
        "modes": many,
        "rom": found["rom"],
        **errors,
        "raw": raw and raw["surrogate"],
        "R_rom_n_lr": ratio,
        "R_rom_n_c": consistency_of_rom(found, variable, interval, many),
        "kept": None if ratio is None else ratio <= CONSISTENCY,
        **one_step(found, interval),
    }


def trials_of(found: Found) -> list[Row]:
    """Return a trial for every variable of which surrogates were trained, at every Δτ."""
    trained = dict.fromkeys(row["variable"] for row in found["compare"]["rows"])
    places = [(name, c["interval"]) for name in trained for c in of_variable(found, name)["candidates"]]
    return [trial_at(found, name, interval) for name, interval in places]


def calibrated(trials: Sequence[Row]) -> Row | None:
    """Return the least K_f of all from which on every ROM is consistent; None where that of the largest is not.

    Its variable and Δτ (s) stand beside it, and `bounded`: whether there was one below that is not consistent.
    """
    known = [trial for trial in trials if trial["K_f"] is not None and trial["kept"] is not None]
    least, bounded = None, False
    for trial in sorted(known, key=lambda trial: (-float(trial["K_f"]), bool(trial["kept"]))):
        if not trial["kept"]:
            bounded = True
            break
        least = trial
    # of equal K_f, one that is not consistent counts against all
    return (
        None if least is None else {key: least[key] for key in ("K_f", "variable", "interval")} | {"bounded": bounded}
    )
