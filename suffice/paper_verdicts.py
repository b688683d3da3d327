"""What an engineer decides from: which Δτ suffices in each case, and whether the rule kept its promise."""

from collections.abc import Sequence

from suffice.compare import CONSISTENCY
from suffice.paper_trials import Found, Row, calibrated, decided_interval, trial_at, trials_of
from suffice.player import sufficient_interval
from suffice.wording import bytes_text, number, plain_number, seconds_text, two_decimals


def verdicts_of(cases: Sequence[Found], variable: str) -> list[Row]:
    """Return for each case how the ROM trained at the Δτ decided upon does: a sentence, remarks and their numbers.

    `calibrated` is the least K_f from which on ROMs of the first case are consistent, None in the others.
    """
    found = []
    for k, case in enumerate(cases):
        interval, _ = decided_interval(case, variable)
        trial = trial_at(case, variable, interval)
        extra: Row = {
            "role": "validates" if k else "calibrates",
            "calibrated": None if k else calibrated(trials_of(case)),
            "insufficient": _insufficient(case),
            "interval_of_position": sufficient_interval(case),
        }
        trial |= extra
        found.append({**trial, "sentence": _sentence(trial, case["unit"]), "remarks": _remarks(trial, case["unit"])})
    return found


def _insufficient(found: Found) -> list[Row]:
    """Return the variables for which no Δτ suffices, with the best of each."""
    rows = []
    for name, judged in found["select"]["variables"].items():
        if judged["chosen_interval"] is None:
            best = max(judged["candidates"], key=lambda c: (c["K_f"] or 0.0, -c["interval"]))
            rows.append({"variable": name, "K_f": best["K_f"], "interval": best["interval"]})
    return rows


def _sentence(trial: Row, unit: str) -> str:
    """Say the decision, and what the ROM trained by it errs and saves."""
    K_f, interval = two_decimals(trial["K_f"]), seconds_text(trial["interval"])
    head = f"{trial['case']} ({trial['role']}): "
    if trial["sufficient"]:
        head += f"a snapshot every {interval} suffices for {trial['variable']}, K_f {K_f} ≥ 2"
    else:
        head += (
            f"no Δτ considered suffices for {trial['variable']}; K_f is {K_f} at the finest, {interval}, 2 is needed"
        )
    error = _error(trial, "n_c", unit)
    if error is None:
        return f"{head}; no ROM could be tried there."
    speed = (
        "" if trial["single_ratio"] is None else f", {plain_number(trial['single_ratio'])} times faster than the solver"
    )
    return f"{head}; the ROM trained there is off by {error} between its snapshots{speed}."


def _remarks(trial: Row, unit: str) -> list[str]:
    """Say whether the rule kept its promise, from where on it does, and what needs no model at all."""
    remarks = []
    if trial["R_rom_n_lr"] is not None:
        kept = "consistent" if trial["kept"] else "not consistent"
        few = f"on the n_lr = {trial['n_lr']} modes that are needed it errs by {_error(trial, 'n_lr', unit)}"
        remarks.append(f"That ROM is {kept}: {few}, R_c {trial['R_rom_n_lr']:.3f}, limit {CONSISTENCY:g}.")
    if trial["role"] == "calibrates":
        remarks.append(_calibration(trial["calibrated"]))
    raw = _error(trial, "raw", unit)
    if raw is not None:
        kept = f"{bytes_text(trial['storage_bytes_raw'])} are kept"
        kept += "" if trial["storage_bytes_n_c"] is None else f", {bytes_text(trial['storage_bytes_n_c'])} of the ROM"
        remarks.append(f"Without a model, the snapshots themselves interpolated ({trial['raw']}) err by {raw}; {kept}.")
    if trial["interval_of_position"] is not None:
        remarks.append(f"All components of position suffice every {seconds_text(trial['interval_of_position'])}.")
    if trial["verdict"] != ("sufficient" if trial["sufficient"] else "insufficient"):
        remarks.append(f"Our verdict: {trial['verdict']}, {'; '.join(trial['reasons'])}.")
    return remarks


def _error(trial: Row, modes: str, unit: str) -> str | None:
    """Write an error of a trial, in diameters where they are known; None where there is none."""
    for key, shown in ((f"rmse_diameters_{modes}", "d"), (f"rmse_{modes}", unit)):
        if trial[key] is not None:
            return f"{number(trial[key], 2)} {shown}"
    return None


def _calibration(found: Row | None) -> str:
    if found is None:
        return "Not even the ROM of the largest K_f is consistent: K_f ≥ 2 is not confirmed."
    least = f"{two_decimals(found['K_f'])} ({found['variable']} at {seconds_text(found['interval'])})"
    below = "below it not all are" if found["bounded"] else "there is none below"
    return f"Calibration: the ROMs of all trained variables are consistent from K_f {least} on; {below}."
