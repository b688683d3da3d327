"""What an engineer decides from: which Δτ suffices in each case, and whether the rule kept its promise."""

from collections.abc import Mapping, Sequence
from typing import Any

from suffice.compare import CONSISTENCY
from suffice.paper_measures import modes_used
from suffice.paper_tables import Found, Row, candidate_at, decided_interval, of_variable, one_step
from suffice.wording import number, seconds_text


def rom_row(found: Found, variable: str, interval: float, modes: int) -> Mapping[str, Any] | None:
    """Return the ROM on so many modes as `compare` writes it; None where it could not be fitted."""
    wanted = (variable, interval, found["rom"], "plain", modes)
    keys = ("variable", "interval", "surrogate", "basis", "modes")
    return next((row for row in found["compare"]["rows"] if tuple(row[key] for key in keys) == wanted), None)


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


def trial_of(found: Found, variable: str) -> Row:
    """Hold the decision of a case against the ROM that was trained afterwards.

    `kept` tells whether the ROM on n_lr modes is as consistent as the rule wants of projections, R_c up to 1.05.
    """
    interval, sufficient = decided_interval(found, variable)
    candidate = candidate_at(found, variable, interval)
    n_lr, n = int(candidate["n_lr"]), modes_used(candidate)
    rows = {name: rom_row(found, variable, interval, modes) for name, modes in (("n_lr", n_lr), ("n_c", n))}
    raw, ratio = raw_row(found, variable, interval), consistency_of_rom(found, variable, interval, n_lr)
    errors: Row = {}
    for name, row in (*rows.items(), ("raw", raw)):
        errors |= {f"rmse_{name}": row and row["rmse"], f"rmse_diameters_{name}": row and row["rmse_diameters"]}
    return {
        "case": found["name"],
        "variable": variable,
        "interval": interval,
        "sufficient": sufficient,
        "verdict": candidate["verdict"],
        "reasons": candidate["reasons"],
        "n_lr": n_lr,
        "n_c": candidate["n_c"],
        "K_f": candidate["K_f"],
        "modes": n,
        "rom": found["rom"],
        **errors,
        "raw": raw and raw["surrogate"],
        "R_rom_n_lr": ratio,
        "R_rom_n_c": consistency_of_rom(found, variable, interval, n),
        "kept": None if ratio is None else ratio <= CONSISTENCY,
        **one_step(found, interval),
    }


def verdicts_of(cases: Sequence[Found], variable: str) -> list[Row]:
    """Return one trial for each case, with the sentence that says it."""
    found = []
    for k, case in enumerate(cases):
        trial = trial_of(case, variable)
        role = "calibrates" if k == 0 else "validates"
        text = _sentence(trial, case["unit"], role)
        found.append({**trial, "role": role, "sentence": text, "insufficient": _insufficient(case)})
    return found


def _insufficient(found: Found) -> list[Row]:
    """Return the variables for which no Δτ suffices, with the best of each."""
    rows = []
    for name, judged in found["select"]["variables"].items():
        if judged["chosen_interval"] is None:
            best = max(judged["candidates"], key=lambda c: c["K_f"] or 0.0)
            rows.append({"variable": name, "K_f": best["K_f"], "interval": best["interval"]})
    return rows


def _sentence(trial: Row, unit: str, role: str) -> str:
    K_f, interval = number(trial["K_f"]), seconds_text(trial["interval"])
    head = f"{trial['case']} ({role}): "
    if not trial["sufficient"]:
        head += f"no Δτ considered suffices for {trial['variable']}; the finest, {interval}, has K_f {K_f}, 2 is needed"
    else:
        head += f"a snapshot every {interval} suffices for {trial['variable']} (K_f {K_f} ≥ 2)"
    return f"{head}; {_promise(trial)}{_errors(trial, unit)}{_speed(trial)}"


def _promise(trial: Row) -> str:
    if trial["R_rom_n_lr"] is None:
        return "no ROM could be tried"
    kept = "keeps" if trial["kept"] else "does not keep"
    return f"the ROM trained on them {kept} it (R_c {trial['R_rom_n_lr']:.3f} on n_lr modes, limit {CONSISTENCY:g})"


def _errors(trial: Row, unit: str) -> str:
    suffix, shown = ("_diameters", "d") if trial["rmse_diameters_n_c"] is not None else ("", unit)
    few, many = trial[f"rmse{suffix}_n_lr"], trial[f"rmse{suffix}_n_c"]
    if few is None or many is None:
        return ""
    return f", off by {number(few, 2)} {shown} on {trial['n_lr']} and {number(many, 2)} {shown} on {trial['modes']} modes"


def _speed(trial: Row) -> str:
    if trial["single_ratio"] is None:
        return ""
    batch = f" ({number(trial['batch_ratio'], 2)} in batch)" if trial["batch_ratio"] else ""
    return f", and gives a step {number(trial['single_ratio'], 2)} times faster than the solver{batch}"
