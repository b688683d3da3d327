"""Tables of what was measured, as Markdown."""

import math
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np
from rule_truth import (
    RULES,
    SCORES,
    Case,
    Confusion,
    Judge,
    across_flows,
    area,
    best_threshold,
    breach,
    confusion,
    holds_energy,
    keeps_promise,
    keeps_promise_up_to_n_c,
    largest,
    recut,
    spline_keeps_promise,
    within_diameters,
)

KINDS = ("position", "velocity", "fluid")
TRUTHS: dict[str, Judge] = {
    "T1, ROM on n_lr modes within 1.10 of its promise": keeps_promise,
    "T1 at 1.05": lambda case: keeps_promise(case, 1.05),
    "T1 at 1.25": lambda case: keeps_promise(case, 1.25),
    "T2, the same on n_c modes within 1.25": keeps_promise_up_to_n_c,
    "T3, the snapshots hold the energy": holds_energy,
}
Groups = dict[tuple[str, str], list[Case]]


def kind_of(case: Case) -> str:
    """Tell position, velocity or fluid."""
    return str(case["variable"].partition(".")[0])


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(str(cell) for cell in line) + " |\n" for line in lines)


def of_variables(cases: Sequence[Case]) -> Groups:
    """Return the scans, one per run and variable."""
    groups: Groups = {}
    for case in cases:
        groups.setdefault((case["run"], case["variable"]), []).append(case)
    return groups


def counts(found: Confusion) -> list[str]:
    """Right, too strict, too lenient, and the balanced accuracy."""
    balanced = "–" if math.isnan(found.balanced) else f"{found.balanced:.2f}"
    return [f"{found.accepted} + {found.rejected}", str(found.strict), str(found.lenient), balanced]


def tried(cases: Sequence[Case], rule: Judge, truth: Judge = keeps_promise) -> Confusion:
    """Hold a rule against a truth."""
    return confusion([rule(case) for case in cases], [truth(case) for case in cases])


HEAD = ["right: accepted + rejected", "too strict", "too lenient", "balanced accuracy"]


def rules_table(cases: Sequence[Case]) -> str:
    """Every rule against T1."""
    return table(["rule", *HEAD], [[name, *counts(tried(cases, rule))] for name, rule in RULES.items()])


def truths_table(cases: Sequence[Case]) -> str:
    """Hold four rules against every truth."""
    positions = [case for case in cases if kind_of(case) == "position"]
    held = [(name, truth, cases) for name, truth in TRUTHS.items()]
    held.append(("T4, positions within 0.05 d", within_diameters, positions))
    rows = [
        [name, rule, *counts(tried(own, RULES[rule], truth))]
        for name, truth, own in held
        for rule in ("paper, K_f ≥ 2", "ours, verdict sufficient", "paper, K_f ≥ 1", "spline on n_lr modes")
    ]
    return table(["truth", "rule", *HEAD], rows)


def kinds_table(cases: Sequence[Case]) -> str:
    """Hold the paper's rule and two others against T1, by kind of variable."""
    rows = [
        [kind, rule, *counts(tried([case for case in cases if kind_of(case) == kind], RULES[rule]))]
        for kind in KINDS
        for rule in ("paper, K_f ≥ 2", "paper, K_f ≥ 1", "spline on n_lr modes")
    ]
    return table(["variable", "rule", *HEAD], rows)


def scores_table(cases: Sequence[Case]) -> str:
    """Every score: area under the ROC curve, best threshold, and how that does on flows it was not fitted to."""
    rows = []
    for name, score in SCORES.items():
        values, truth = [score(c) for c in cases], [keeps_promise(c) for c in cases]
        threshold, best = best_threshold(values, truth)
        elsewhere = across_flows(cases, score, keeps_promise)
        rows.append(
            [
                name,
                f"{area(values, truth):.3f}",
                f"{threshold:.4g}",
                f"{best:.2f}",
                f"{elsewhere.balanced:.2f}",
                elsewhere.strict,
                elsewhere.lenient,
            ]
        )
    return table(
        ["score", "ROC area", "best threshold", "balanced there", "on other flows", "too strict", "too lenient"], rows
    )


def surrogates_table(cases: Sequence[Case]) -> str:
    """T1 for each surrogate alone."""
    rows = []
    for name in dict.fromkeys(name for case in cases for name in case["errors"]):
        own = [case for case in cases if name in case["errors"]]
        truth = _truth_of(name)
        threshold, best = best_threshold([case["K_f"] or 0.0 for case in own], [truth(case) for case in own])
        rows.append(
            [
                name,
                len(own),
                sum(truth(case) for case in own),
                *counts(tried(own, RULES["paper, K_f ≥ 2"], truth))[1:3],
                f"{threshold:.2f}",
                f"{best:.2f}",
            ]
        )
    head = ["surrogate", "cases", "keep the promise", "K_f ≥ 2 too strict", "too lenient", "best K_f", "balanced there"]
    return table(head, rows)


def _truth_of(surrogate: str) -> Judge:
    return lambda case: keeps_promise(case, surrogate=surrogate)


def feasibility_table(cases: Sequence[Case]) -> str:
    """Other thresholds of K_f against T1, T2 and T3."""
    rows = []
    for limit in (0.75, 0.9, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0):
        rule = _at_least(limit)
        found = [tried(cases, rule, truth) for truth in (keeps_promise, keeps_promise_up_to_n_c, holds_energy)]
        rows.append([f"{limit:g}", *(f"{f.strict} / {f.lenient} / {f.balanced:.2f}" for f in found)])
        rows[-1] += shifts(cases, cases, limit)
    head = ["K_f ≥", "T1: strict / lenient / balanced", "T2", "T3", "chosen Δτ, median factor", "scans that choose"]
    return table(head, rows)


def _at_least(limit: float) -> Judge:
    return lambda case: (case["K_f"] or 0.0) >= limit


def thresholds_table(cases: Sequence[Case]) -> str:
    """Energy and R_c of the rule against a promise of the same energy, with the spline; particles only."""
    own = [case for case in cases if kind_of(case) != "fluid"]
    rows = []
    for energy in (0.99, 0.995, 0.999, 0.9995, 0.9999):
        for limit in (1.02, 1.05, 1.1, 1.2):
            cut = [recut(case, energy, limit) for case in own]
            values, truth = [case["K_f"] or 0.0 for case in cut], [spline_keeps_promise(case) for case in cut]
            threshold, best = best_threshold(values, truth)
            found = confusion([value >= 2 for value in values], truth)
            rows.append(
                [
                    f"{energy:g}",
                    f"{limit:g}",
                    sum(truth),
                    found.strict,
                    found.lenient,
                    f"{found.balanced:.2f}",
                    f"{area(values, truth):.3f}",
                    f"{threshold:.2f}",
                    f"{best:.2f}",
                    *shifts(own, cut),
                ]
            )
    head = ["energy", "R_c", "good", "strict at 2", "lenient at 2", "balanced at 2", "ROC area", "best K_f", "there"]
    return table([*head, "chosen Δτ, median factor", "scans that choose"], rows)


def shifts(before: Sequence[Case], after: Sequence[Case], limit: float = 2.0) -> list[str]:
    """By what factor the chosen Δτ moves, over the scans that choose one both times, and how many choose one."""
    factors, choosing = [], 0
    changed = of_variables(after)
    for key, own in of_variables(before).items():
        first, second = largest(own, _at_least(2.0)), largest(changed[key], _at_least(limit))
        choosing += second is not None
        if first and second:
            factors.append(second / first)
    return [f"{median(factors):.2f}" if factors else "–", str(choosing)]


def resolution_table(cases: Sequence[Case]) -> str:
    """Try R_a at n_c beside K_f."""
    rows = []
    for feasible in (1.0, 2.0):
        for limit in (1.05, 1.1, 1.25, 1.5, math.inf):
            found = tried(cases, _both(feasible, limit))
            rows.append([f"{feasible:g}", f"{limit:g}", *counts(found)])
    return table(["K_f ≥", "R_a ≤", *HEAD], rows)


def _both(feasible: float, limit: float) -> Judge:
    return lambda case: (case["K_f"] or 0.0) >= feasible and (case["R_a"] or math.inf) <= limit


def lenient_cases(cases: Sequence[Case], rule: str = "paper, K_f ≥ 2", truth: Judge = keeps_promise) -> str:
    """List the cases that a rule accepts although they are not good enough."""
    rows = [
        [
            case["run"],
            case["variable"],
            case["stride"],
            case["n_lr"],
            case["n_c"],
            f"{case['K_f']:.2f}",
            f"{case['R_a']:.2f}",
            f"{breach(case):.2f}",
            case["verdict"],
        ]
        for case in cases
        if RULES[rule](case) and not truth(case)
    ]
    return table(["run", "variable", "Δτ/Δt", "n_lr", "n_c", "K_f", "R_a", "E/E_train at n_lr", "our verdict"], rows)


def near_table(cases: Sequence[Case], low: float = 0.8, high: float = 1.25) -> str:
    """Spread E(s, n_lr)/E_train(n_lr) out where K_f lies in a band, to see whether one K_f is one error."""
    rows = []
    for centre in (0.5, 0.75, 1.0, 1.5, 2.0, 3.0):
        ratios = [breach(c) for c in cases if low * centre <= (c["K_f"] or 0.0) < high * centre]
        parts = np.quantile(ratios, [0.1, 0.5, 0.9], method="nearest") if ratios else [math.nan] * 3
        rows.append([f"{low * centre:.2g} to {high * centre:.2g}", len(ratios), *(f"{part:.2f}" for part in parts)])
    return table(["K_f", "cases", "10 % below", "median", "90 % below"], rows)


def sections(cases: Sequence[Case]) -> Iterator[tuple[str, str]]:
    """All tables with their titles."""
    build: dict[str, Callable[[Sequence[Case]], str]] = {
        "Rules against T1": rules_table,
        "By kind of variable": kinds_table,
        "Truths": truths_table,
        "Scores": scores_table,
        "Scores, positions only": lambda all_: scores_table([c for c in all_ if kind_of(c) == "position"]),
        "One K_f, one error?": near_table,
        "Thresholds of K_f": feasibility_table,
        "Thresholds of energy and R_c": thresholds_table,
        "Threshold of R_a": resolution_table,
        "Surrogates": surrogates_table,
        "Too lenient: K_f ≥ 2 against T1": lenient_cases,
        "Too lenient: K_f ≥ 1 against T1": lambda all_: lenient_cases(all_, "paper, K_f ≥ 1"),
    }
    for title, make in build.items():
        yield title, make(cases)
