"""What each omission saves and what it costs, beyond the scatter of the scene itself; and the cheapest that is allowed.

Differences are relative: (x − x̄) / |x̄| of a number, rms(x − x̄) / rms(x̄) of a profile with its bins weighed by their
volume, x̄ the mean over the n seeds of the reference. The floor of a difference is what a further seed would show,
s √(1 + 1/n) / |x̄|. Here s is the standard deviation over seeds, or, where it is larger, that over seeds of a part of
the time, over the square root of how many parts: few seeds may agree by chance. A difference above t floors, t of
Student at 95 % with n − 1 degrees of freedom, is taken for real; one in twenty of those that are none is so by chance.
"""

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np
from scipy.stats import t as student

from suffice.omissions_means import MEANINGS, Average, Means, Outcome
from suffice.refusal import Refusal
from suffice.wording import number, seconds_text

CONFIDENCE = 0.95


def compare_omissions(
    reference: Sequence[Outcome], variants: Sequence[Outcome], asked: Sequence[str], max_difference: float
) -> dict[str, Any]:
    """Hold variants against two or more runs of the scene itself that differ in their seed alone.

    asked: observables that matter, whose largest difference is the error of a variant; max_difference: of the error.
    The answer, plain types ready for JSON, holds `reference`, `observables` (mean and relative floor of each), `rows`
    (one per variant), `scatter_error` (the error of each seed against the others) and `choice`.
    Raises Refusal where an observable that is asked for is not known of the reference.
    """
    means = [outcome.means for outcome in reference if outcome.means is not None]
    assert len(means) == len(reference) > 1
    known = _known(means, reference[0], asked)
    centre = {name: _centre([m.observables[name] for m in means]) for name in known}
    floors = {name: _floor([m.observables[name] for m in means]) for name in known}
    seconds = [_seconds(outcome.cost or {}) for outcome in reference]
    factor = float(student.ppf(0.5 + 0.5 * CONFIDENCE, len(means) - 1))
    scene = _reference(reference, means, seconds)
    rows = [_row(outcome, centre, floors, factor, scene["seconds"]) for outcome in variants]
    rows = [row | _judged(row, floors, factor, asked, max_difference) for row in rows]
    scatter = _scatter(means, asked)
    return {
        "asked": list(asked),
        "max_difference": max_difference,
        "floors_to_be_real": factor,
        "window": list(means[0].window),
        "reference": scene,
        "observables": {
            name: {
                "text": MEANINGS.get(name, (MEANINGS["mixing"][0], ""))[0],
                "unit": MEANINGS.get(name, ("", "1"))[1],
                "profile": len(centre[name].values) > 1,
                "mean": _number(centre[name]),
                "floor": floors[name],
            }
            for name in known
        },
        "rows": _with_front(rows),
        "scatter_error": scatter,
        "choice": _choice(rows, asked, max_difference),
        "spectra": _spectra(reference, variants),
    }


def difference(value: Average, centre: Average) -> float | None:
    """Relative difference, signed for a number; None where the reference is zero or the bins are others."""
    if len(value.values) != len(centre.values):
        return None
    size = _norm(centre.values, centre.weights)
    if not size:
        return None
    miss = value.values - centre.values
    return float(miss[0]) / size if len(miss) == 1 else _norm(miss, centre.weights) / size


def _norm(values: Any, weights: Any) -> float:
    return float(np.sqrt(np.average(values**2, weights=weights)))


def _known(means: Sequence[Means], first: Outcome, asked: Sequence[str]) -> list[str]:
    """Names of observables that every run of the reference has. Raises Refusal for one asked for that is not."""
    known = [name for name in means[0].observables if all(name in m.observables for m in means)]
    order = [name for name in MEANINGS if name in known]
    known = [*order, *(name for name in known if name not in order)]
    for name in asked:
        if name not in known:
            raise Refusal(f"observables: {name!r} is not known of {first.name}; there are {', '.join(known)}")
    return known


def _centre(parts: Sequence[Average]) -> Average:
    values = np.mean([part.values for part in parts], axis=0)
    return Average(values, np.mean([part.weights for part in parts], axis=0), np.zeros((0, len(values))))


def _floor(parts: Sequence[Average]) -> float | None:
    """Relative difference that a further seed would show, s √(1 + 1/n) / |x̄|; None where the mean is zero."""
    centre, n = _centre(parts), len(parts)
    size = _norm(centre.values, centre.weights)
    spread = _norm(np.std([part.values for part in parts], axis=0, ddof=1), centre.weights)
    pieces = np.array([part.parts for part in parts])  # (n, parts, k)
    if pieces.shape[1]:
        within = np.sqrt(np.var(pieces, axis=0, ddof=1).mean(axis=0) / pieces.shape[1])
        spread = max(spread, _norm(within, centre.weights))
    return sqrt(1.0 + 1.0 / n) * spread / size if size else None


def _number(value: Average) -> float | None:
    return float(value.values[0]) if len(value.values) == 1 else None


def _seconds(cost: Mapping[str, Any]) -> float:
    """Seconds of computing that the whole run takes, without those in which the process waited for the machine.

    Of a resumed run that is the time of the steps done at one go, in proportion: it counts in full.
    """
    computing = min(cost["seconds"], cost["processor_seconds"])
    speed = cost["particle_steps_per_second"]
    return float(computing * (cost["n_particles"] * cost["steps"] / speed / cost["seconds"] if speed else 1.0))


def _costs(cost: Mapping[str, Any], means: Means) -> dict[str, Any]:
    seconds = _seconds(cost)
    terms = {name: seconds / cost["seconds"] * taken for name, taken in cost["seconds_of"].items() if taken}
    particle_steps = cost["n_particles"] * cost["steps"]
    return {
        "seconds": seconds,
        "seconds_of": {"contact and motion": max(seconds - sum(terms.values()), 0.0), **terms},
        "predicted_seconds": cost["predicted_seconds"],
        "waited": max(1.0 - cost["processor_seconds"] / cost["seconds"], 0.0),
        "particle_steps": particle_steps,
        "particle_steps_per_second": particle_steps / seconds,
        "time_step": cost["time_step"],
        "threads": cost["threads"],
        "bytes_per_snapshot": means.bytes_per_snapshot,
    }


def _reference(outcomes: Sequence[Outcome], means: Sequence[Means], seconds: Sequence[float]) -> dict[str, Any]:
    """Cost of the scene itself: of the seed that took the median time, and what each took."""
    middle = sorted(range(len(seconds)), key=lambda k: seconds[k])[(len(seconds) - 1) // 2]
    return {
        **_costs(outcomes[middle].cost or {}, means[middle]),
        "seconds_of_seeds": list(seconds),
        "feasibility": [dict(found.feasibility) for found in means],
    }


def _row(
    outcome: Outcome, centre: Mapping[str, Average], floors: Mapping[str, float | None], factor: float, whole: float
) -> dict[str, Any]:
    """Cost and differences of a variant; of a refused one, why."""
    row: dict[str, Any] = {"variant": outcome.name, "left_out": outcome.left_out, "refused": outcome.refused}
    if outcome.means is None or outcome.cost is None:
        return row
    own = outcome.means.observables
    differences = {name: difference(own[name], middle) if name in own else None for name, middle in centre.items()}
    return {
        **row,
        **_costs(outcome.cost, outcome.means),
        "relative_cost": _seconds(outcome.cost) / whole,
        "values": {name: _number(own[name]) for name in centre if name in own},
        "differences": differences,
        "floors": {name: _over(value, floors[name]) for name, value in differences.items()},
        "real": {name: _is_real(value, floors[name], factor) for name, value in differences.items()},
        "feasibility": dict(outcome.means.feasibility),
    }


def _over(value: float | None, floor: float | None) -> float | None:
    """Difference in floors; None where the reference does not scatter at all."""
    return None if value is None or not floor else value / floor


def _is_real(value: float | None, floor: float | None, factor: float) -> bool | None:
    """Tell whether a difference is above the noise; None where seeds that all agree, in whole modes, do not tell."""
    return None if value is None or not floor else abs(value) > factor * floor


def _judged(
    row: Mapping[str, Any], floors: Mapping[str, float | None], factor: float, asked: Sequence[str], limit: float
) -> dict[str, Any]:
    """Error of a row, whether it keeps the limit, and whether scatter could turn that."""
    if row["refused"] is not None:
        return {"error": None, "error_in": None, "missing": [], "keeps": False, "certain": True}
    found = {name: row["differences"][name] for name in asked}
    missing = [name for name, value in found.items() if value is None]
    sizes = {name: abs(value) for name, value in found.items() if value is not None}
    worst = max(sizes, key=lambda name: sizes[name], default=None)
    slack = {name: factor * (floors[name] or 0.0) for name in sizes}
    keeps = worst is not None and not missing and sizes[worst] <= limit
    sure = (
        all(sizes[name] + slack[name] <= limit for name in sizes)
        if keeps
        else bool(missing) or any(sizes[name] - slack[name] > limit for name in sizes)
    )
    error = None if worst is None or missing else sizes[worst]
    return {"error": error, "error_in": worst, "missing": missing, "keeps": keeps, "certain": sure}


def _scatter(means: Sequence[Means], asked: Sequence[str]) -> list[float]:
    """Error of each run of the reference, held against the mean of the others."""
    found = []
    for k, own in enumerate(means):
        others = [m for j, m in enumerate(means) if j != k]
        misses = [difference(own.observables[n], _centre([m.observables[n] for m in others])) for n in asked]
        found.append(max(abs(miss) for miss in misses if miss is not None))
    return found


def _with_front(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mark rows that no other undercuts in both cost and error; the reference itself costs 1 and errs by nothing."""
    points = [(1.0, 0.0), *((r["relative_cost"], r["error"]) for r in rows if r["error"] is not None)]

    def on_front(row: Mapping[str, Any]) -> bool:
        if row["error"] is None:
            return False
        own = (row["relative_cost"], row["error"])
        return not any(p != own and p[0] <= own[0] and p[1] <= own[1] for p in points)

    return [row | {"on_front": on_front(row)} for row in rows]


def _choice(rows: Sequence[Mapping[str, Any]], asked: Sequence[str], limit: float) -> dict[str, Any]:
    """Name the cheapest row that keeps the limit."""
    allowed = f"{', '.join(asked)} within {100 * limit:g} %"
    kept = [row for row in rows if row["keeps"] and row["relative_cost"] < 1.0]
    if not kept:
        sentence = f"no variant that is cheaper than the scene itself keeps {allowed}"
        return {"variant": None, "sentence": sentence}
    best = min(kept, key=lambda row: float(row["relative_cost"]))
    doubt = "" if best["certain"] else "; the scatter of the scene itself is too large to be sure of that"
    return {
        "variant": best["variant"],
        "sentence": f"{best['variant']} is the cheapest that keeps {allowed}: {seconds_text(best['seconds'])}, "
        f"{number(best['relative_cost'])} of the scene itself, for {number(100 * best['error'])} % of "
        f"{best['error_in']}{doubt}",
    }


def _spectra(reference: Sequence[Outcome], variants: Sequence[Outcome]) -> dict[str, Any]:
    """Power of impacts of pairs by energy, W in each bin, of every run; empty where they were not counted."""
    outcomes = [o for o in (*reference, *variants) if o.means is not None and "pairs" in o.means.spectra]
    if not outcomes or outcomes[0].means is None:
        return {}
    edges = outcomes[0].means.spectra["pairs"].energy
    runs = {o.name: o.means.spectra["pairs"].power.tolist() for o in outcomes if o.means is not None}
    return {"energy": edges.tolist(), "runs": runs}
