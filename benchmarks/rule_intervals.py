"""Critical snapshot intervals: where K_f passes its threshold and where a ROM breaks its promise."""

import math
from collections.abc import Iterator, Sequence
from statistics import median

from rule_tables import RULES, kind_of, of_variables, table, tried
from rule_truth import PROMISE, Case, crossing, spline_breach


def at_feasibility(cases: Sequence[Case], limit: float) -> float:
    """Return the Δτ (s) at which K_f falls below a limit as Δτ grows."""
    return crossing([c["interval"] for c in cases], [limit / max(c["K_f"] or 0.0, 1e-3) for c in cases], 1.0)


def at_promise(cases: Sequence[Case]) -> float:
    """Return the Δτ (s) at which the ROM with a spline on n_lr modes breaks its promise (T1) as Δτ grows."""
    # an infinite breach, where n_lr is all modes, is as good as a large one
    return crossing([c["interval"] for c in cases], [min(spline_breach(c), 1e3) for c in cases], PROMISE)


def told(interval: float, unit: float) -> str:
    """Tell an interval in the flow's unit, and one beyond the scan as such."""
    return "coarser" if interval == math.inf else "finer" if interval == 0 else f"{interval * unit:.3g}"


def critical(cases: Sequence[Case]) -> tuple[float, float, float]:
    """Return the Δτ (s) of K_f = 2, of K_f = 1 and of the promise, of one variable."""
    return at_feasibility(cases, 2.0), at_feasibility(cases, 1.0), at_promise(cases)


def flows_table(cases: Sequence[Case], coarse: Sequence[Case]) -> str:
    """Hold the paper's rule against T1 for each run, with the critical Δτ of its positions in the flow's own unit."""
    rows = []
    scans = of_variables([*cases, *coarse])
    for run in dict.fromkeys(case["run"] for case in cases):
        own = [case for case in cases if case["run"] == run]
        found = tried(own, RULES["paper, K_f ≥ 2"])
        unit = own[0]["in_unit_of_flow"] / own[0]["interval"]
        axes = [" / ".join(told(x, unit) for x in critical(scans[run, f"position.{axis}"])) for axis in "xyz"]
        rows.append([run, own[0]["violence"], f"{found.accepted + found.rejected}", found.strict, found.lenient, *axes])
    return table(
        ["run", "violence", "right", "too strict", "too lenient", *(f"position.{axis}" for axis in "xyz")], rows
    )


def pairs(cases: Sequence[Case], coarse: Sequence[Case]) -> Iterator[tuple[Case, tuple[float, float, float]]]:
    """Return a case of each scan of a position or a fluid field, and its critical Δτ in dense intervals."""
    for own in of_variables([*cases, *coarse]).values():
        if kind_of(own[0]) != "velocity":
            dense = own[0]["interval"] / own[0]["stride"]
            two, one, true = critical(own)
            yield own[0], (two / dense, one / dense, true / dense)


def ratios_table(cases: Sequence[Case], coarse: Sequence[Case]) -> str:
    """Say how many times finer than needed a threshold of K_f asks for snapshots, where both lie within the scan."""
    found = [(case["flow"], values) for case, values in pairs(cases, coarse)]
    rows = []
    for flow in [*dict.fromkeys(flow for flow, _ in found), "all"]:
        own = [values for name, values in found if flow in (name, "all")]
        rows.append([flow, len(own), *(_spread([(v[k], v[2]) for v in own]) for k in (0, 1))])
    return table(["flow", "scans", "needed Δτ / Δτ at K_f = 2", "needed Δτ / Δτ at K_f = 1"], rows)


def _spread(both: Sequence[tuple[float, float]]) -> str:
    known = [true / asked for asked, true in both if 0 < asked < math.inf and 0 < true < math.inf]
    return f"{median(known):.2f} ({min(known):.2f} to {max(known):.2f}, {len(known)} scans)" if known else "–"
