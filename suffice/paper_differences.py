"""Statements of the paper beside what was measured here, each with the reason why they differ or agree."""

from collections.abc import Sequence
from typing import NamedTuple

from suffice.paper_trials import Found, Row, candidate_at, decided_interval, solver_seconds
from suffice.wording import number, plain_number, seconds_text, threads_text, two_decimals

PAPER_PARTICLES = 500_000
PAPER_INTERVAL = 0.004  # s, chosen for Case 2
PAPER_SPEED = 1500.0  # ROM against solver, for one step, "over"
VISIBLE = 0.05  # of a coefficient's size: less is not seen in a figure of its history


class Difference(NamedTuple):
    """One statement."""

    statement: str
    paper: str
    here: str
    why: str


def differences_of(cases: Sequence[Found], verdicts: Sequence[Row], variable: str) -> list[Row]:
    """Return the paper's statements and ours. cases: calibration first, validation last; verdicts: of the same."""
    last, trial = cases[-1], verdicts[-1]
    found = [
        _particles(last),
        _interval(last, variable),
        _threshold(verdicts),
        _speed(last, trial),
        _energy(last, variable),
        _axes(cases[0], variable),
        _coefficient(cases[0]),
    ]
    return [one._asdict() for one in found if one is not None]


def _particles(found: Found) -> Difference:
    n, duration = found["facts"]["n_particles"], found["facts"]["duration"]
    step = solver_seconds(found)
    why = "of the same order"
    if step is not None and n < PAPER_PARTICLES:
        whole = step * duration / found["select"]["dense_interval"]
        longer = whole * PAPER_PARTICLES / n
        why = (
            f"{seconds_text(duration)} of {n:,} particles took {seconds_text(whole)} on "
            f"{threads_text(found['cost']['threads'])}; {PAPER_PARTICLES:,} would take {longer / 3600:.3g} h by the "
            "number of particles alone"
        )
    return Difference("particles in each case", f"{PAPER_PARTICLES:,}", f"{n:,}", why)


def _interval(found: Found, variable: str) -> Difference:
    interval, sufficient = decided_interval(found, variable)
    here = seconds_text(interval) if sufficient else f"none down to {seconds_text(interval)}"
    moved = {seconds_text(one["interval"]): one["diameters"] for one in found["displacement"]}
    diameters = next((one["diameters"] for one in found["displacement"] if one["interval"] == interval), None)
    paths = f"here a particle goes {number(diameters, 2)} d (rms) in {seconds_text(interval)}"
    at_paper = moved.get(seconds_text(PAPER_INTERVAL))
    if at_paper is not None and interval != PAPER_INTERVAL:
        paths += f" and {number(at_paper, 2)} d in {seconds_text(PAPER_INTERVAL)}"
    same = sufficient and interval == PAPER_INTERVAL
    why = f"{'the same' if same else 'how dense is enough depends on how fast all moves'}; {paths}"
    return Difference(f"Δτ decided for {found['name']}, {variable}", seconds_text(PAPER_INTERVAL), here, why)


def _threshold(verdicts: Sequence[Row]) -> Difference:
    kept = [f"{one['case']}: {_kept(one)}" for one in verdicts]
    why = (
        "kept: R_c of the trained ROM itself on n_lr modes, with coefficients regressed and not projected, is at most "
        f"1.05{_since(verdicts[0]['calibrated'])}"
    )
    return Difference("K_f ≥ 2 guarantees consistent dynamics", "yes, by inspection", "; ".join(kept), why)


def _since(found: Row | None) -> str:
    if found is None:
        return "; in the first case it is not even at the largest K_f"
    least = f"{two_decimals(found['K_f'])} on ({found['variable']} at {seconds_text(found['interval'])})"
    end = "" if found["bounded"] else ", the least there is"
    return f"; in the first case every trained ROM keeps it from K_f {least}{end}"


def _kept(trial: Row) -> str:
    if trial["kept"] is None:
        return "not tried"
    word = "kept" if trial["kept"] else "not kept"
    need = "" if trial["sufficient"] else f", but K_f is only {two_decimals(trial['K_f'])}"
    return f"{word} at {seconds_text(trial['interval'])} (R_c {trial['R_rom_n_lr']:.3f}{need})"


def _speed(found: Found, trial: Row) -> Difference:
    cost, dense, n = found["cost"], found["select"]["dense_interval"], found["facts"]["n_particles"]
    single, batch = trial["single_ratio"], trial["batch_ratio"]
    here = f"{plain_number(single)} single, {plain_number(batch)} in batch"
    steps, modes = round(dense / cost["time_step"]), trial["modes_of_positions"] or []
    why = (
        f"solver: {steps} steps of {n:,} particles, {seconds_text(trial['solver_seconds'])} on "
        f"{threads_text(cost['threads'])}; ROM, on {trial['rom_threads']}: "
        f"{' + '.join(map(str, modes))} modes of {n:,} rows, {seconds_text(trial['single_seconds'])} single and "
        f"{seconds_text(trial['batch_seconds'])} in batch. Both grow with the particles, so the ratio is one of steps "
        "and modes, and of the code and processor on either side, which are not the paper's"
    )
    return Difference("times faster, one step", f"over {PAPER_SPEED:g}", here, why)


def _energy(found: Found, variable: str) -> Difference:
    interval, _ = decided_interval(found, variable)
    candidate = candidate_at(found, variable, interval)
    exact, paper = candidate["n_lr"], candidate["n_lr_paper"]
    why = (
        "the paper divides by the eigenvalues found by Lanczos, taken here as the leading 80 %; we divide by the exact "
        f"total: {'the same here' if exact == paper else 'more modes are needed, K_f is lower'}"
    )
    where = f"n_lr of {found['name']} at {seconds_text(interval)}"
    return Difference(where, f"{paper} by its denominator", f"{exact} by the exact total", why)


def _coefficient(found: Found) -> Difference:
    """Hold Figure 6 against the paper's: how far the coarsest ROM is off, in the first and in the last coefficient."""
    coarsest = [(one["mode"], one["predicted"][0], one["rms"]) for one in found["coefficients"]]
    shares = [(k, predicted["rmse"] / rms) for k, predicted, rms in coarsest if rms]
    interval = seconds_text(coarsest[0][1]["interval"])
    here = ", ".join(f"c_{k}: {100 * share:.2g} %" for k, share in shares)
    why = "as in the paper"
    if shares and max(share for _, share in shares) < VISIBLE:
        why = (
            "even the last coefficient that is needed is slow enough for this Δτ: what coarse snapshots lose is not in "
            "the coefficients but in what their modes leave out (Figures 5 and 7)"
        )
    return Difference(f"coefficients of the ROM at {interval}, {found['name']}", "visibly off", f"off by {here}", why)


def _axes(found: Found, variable: str) -> Difference | None:
    """Compare how many modes the components of a vector need; None where the variable is no component."""
    vector = variable.rpartition(".")[0]
    names = [name for name in found["select"]["variables"] if vector and name.rpartition(".")[0] == vector]
    if len(names) < 3:
        return None
    interval, _ = decided_interval(found, variable)
    counts = {name.rpartition(".")[2]: candidate_at(found, name, interval)["n_lr"] for name in names}
    slowest = max(counts, key=lambda axis: int(counts[axis]))
    here = ", ".join(f"{axis}: {count}" for axis, count in counts.items())
    text = f"modes that {vector} needs (n_lr at {seconds_text(interval)}, {found['name']})"
    paper = "x more than y, as many as z by symmetry"
    turned = found.get("axis")
    where = "" if turned is None else f"; the rotor turns about {turned}"
    alike = "as in the paper" if slowest == "x" else "so the directions that are alike are others than the paper's"
    why = f"{slowest} needs most here{where}, {alike}"
    return Difference(text, paper, here, why)
