"""Sections of the report on the paper's experiment: verdict, tables, statements, and figures in their order."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from suffice.paper_figures import (
    coefficient_figure,
    convergence_figure,
    energies_figure,
    history_figure,
    promise_figure,
)
from suffice.paper_html import differences_html, symbols, table_html
from suffice.plots import Figure, consistency_figure, error_figure
from suffice.quantities import AXES
from suffice.section import Section
from suffice.verdicts import feasibility_table, table_legend
from suffice.winners import in_the_widest
from suffice.wording import escape, number, seconds_text, two_decimals

Results = Mapping[str, Any]
Named = Mapping[str, Mapping[str, Any]]  # results of each case by its name


def paper_sections(results: Results) -> list[Section]:
    """Return the sections of a study of cases, none for others.

    results["paper"]: as `paper_of` answers; results["cases"]: of each case what the report has of one run.
    """
    if not results.get("paper"):
        return []
    pictures = (make(results) for _, make in sorted(FIGURES.items()))
    return [
        _verdict(results["paper"]),
        _tables(results, "Feasibility and decision", "56", _all_variables(results)),
        _tables(results, "Training data and speed", "47"),
        Section("The paper and this study", differences_html(results["paper"]["differences"])),
        *(section for section in pictures if section is not None),
        _promises(results),
        _errors(results),
        _tables(results, "What was simulated", "123"),
    ]


def _verdict(paper: Results) -> Section:
    items = "".join(_item(verdict) for verdict in paper["verdicts"])
    text = (
        "R<sub>c</sub> of a ROM: its mean error at all testing times over that at the training times. Errors are root "
        "mean squares over particles, in particle diameters d where these are known, mean over the snapshots between "
        "those trained on."
    )
    return Section("Verdict", f'<ul class="verdicts">{items}</ul><p class="quiet">{text}</p>')


def _item(verdict: Mapping[str, Any]) -> str:
    """Say what is decided in a case, and for which variables no Δτ is enough; the rest is folded."""
    pill = _pill("sufficient" if verdict["sufficient"] else "insufficient")
    if verdict["verdict"] == "undecidable":
        pill += f" {_pill('undecidable')}"
    remarks = "".join(f"<li>{symbols(escape(remark))}</li>" for remark in verdict["remarks"])
    summary = "<summary>How sure that is, and what else there is</summary>"
    more = f'<details class="quiet">{summary}<ul>{remarks}</ul></details>'
    others = f'<div class="quiet">{_others(verdict["insufficient"])}</div>'
    return f"<li>{pill} {symbols(escape(verdict['sentence']))}{others}{more}</li>"


def _pill(verdict: str) -> str:
    return f'<span class="pill {verdict}">{verdict}</span>'


def _others(rows: Sequence[Mapping[str, Any]]) -> str:
    """Name the variables for which no Δτ suffices, components of a vector together, with their best K_f."""
    best: dict[str, list[float]] = {}
    for one in rows:
        vector, _, axis = one["variable"].rpartition(".")
        whole = axis in AXES and sum(two["variable"].startswith(f"{vector}.") for two in rows) == len(AXES)
        best.setdefault(vector if whole else one["variable"], []).append(one["K_f"] or 0.0)
    if not best:
        return ""
    names = ", ".join(f"{escape(name)} ({two_decimals(max(values))})" for name, values in best.items())
    return f"<b>Sufficient at no Δτ considered</b>, best K<sub>f</sub>: {names}."


def _tables(results: Results, title: str, numbers: str, below: str = "") -> Section:
    tables = results["paper"]["tables"]
    body = "".join(table_html(tables[number]) for number in numbers)
    return Section(f"{title} (Table{'s' if len(numbers) > 1 else ''} {_listed(numbers)})", body + below)


def _listed(numbers: str) -> str:
    return ", ".join(numbers[:-1]) + " and " + numbers[-1]


def _all_variables(results: Results) -> str:
    """Return K_f of all variables of both cases, folded."""
    tables = "".join(
        f"<h3>{escape(name)}</h3>{feasibility_table(case['select']['variables'])}"
        for name, case in _cases(results).items()
    )
    return (
        f"<details><summary>K<sub>f</sub> of every variable in both cases</summary>{table_legend()}{tables}</details>"
    )


def _cases(results: Results) -> Named:
    names = [case["name"] for case in results["paper"]["cases"]]
    return dict(zip(names, results["cases"], strict=True))


def _picked(names: Iterable[str]) -> dict[str, str]:
    return {name: name for name in names}


def _of_each_case(title: str, text: str, results: Results, draw: Callable[[str], Figure]) -> Section:
    """Return a section with a figure for each case. draw: from the name of a case."""
    names = list(_cases(results))
    figures = {name: draw(name) for name in names}
    return Section(title, f'<p class="quiet">{text}</p>', figures, {"case": _picked(names)})


def _lanczos(results: Results) -> Section:
    """Figure 2: energy against modes, and convergence of the Lanczos process, of every variable."""
    figures, paper = {}, results["paper"]
    for name, case in _cases(results).items():
        found = paper["figures"]["2"][name]
        finest = {variable: case["curves"][variable][f"{one['interval']:g}"] for variable, one in found.items()}
        ratios = {variable: curves["energy_ratio"] for variable, curves in finest.items()}
        figures[f"{name}|modes"] = energies_figure(ratios, [one["energy"] for one in found.values()])
        figures[f"{name}|steps"] = convergence_figure(found)
    text = (
        "Snapshots at the finest Δτ. Dashed: the energy that defines n<sub>lr</sub>, 0.999 of particles and 0.99 of "
        "the fluid. Against steps: what the n<sub>lr</sub> leading pairs hold of the exact total."
    )
    pickers = {"case": _picked(_cases(results)), "against": {"modes": "modes", "steps": "Lanczos steps"}}
    return Section("Figure 2: convergence of the Lanczos process", f'<p class="quiet">{text}</p>', figures, pickers)


def _coefficients(results: Results) -> Section:
    """Figure 6: coefficients over time, of the simulation and of ROMs: the first, and that of the last mode needed."""
    paper = results["paper"]
    unit, rom = paper["cases"][0]["unit"], escape(paper["cases"][0]["rom"])
    figures: dict[str, Figure] = {}
    shares = []
    for name, curves in paper["figures"]["6"].items():
        for one, which in zip(curves, ("first", "last"), strict=False):
            figures[f"{name}|{which}"] = coefficient_figure(one, unit)
            errors = (f"{number(p['rmse'] / one['rms'], 2)} at {seconds_text(p['interval'])}" for p in one["predicted"])
            shares.append(f"<li>{escape(name)}, c<sub>{one['mode']}</sub>: {', '.join(errors)}</li>")
    text = (
        f"{escape(paper['variable'])} on modes of all snapshots; ROM: {rom} on n<sub>c</sub> modes. The last is the "
        "n<sub>lr</sub>-th at the finest Δτ. Error of the ROM over the size of the coefficient:"
    )
    pickers = {"case": _picked(_cases(results)), "coefficient": {"first": "first", "last": "last needed"}}
    below = f'<ul class="quiet">{"".join(shares)}</ul>'
    return Section("Figure 6: first coefficient", f'<p class="quiet">{text}</p>{below}', figures, pickers)


def _history(results: Results) -> Section:
    """Figure 7: errors of projection on all modes over time."""
    paper = results["paper"]
    unit = paper["cases"][0]["unit"]
    diameters = {case["name"]: case["facts"]["diameter"] if unit == "m" else None for case in paper["cases"]}
    text = (
        f"{escape(paper['variable'])} projected on all modes: at training times nothing is left but rounding, and the "
        "band between shrinks with Δτ. A click in the legend hides a line."
    )
    return _of_each_case(
        "Figure 7: training and testing error over time", text, results,
        lambda name: history_figure(paper["figures"]["7"][name], unit, diameters[name]),
    )  # fmt: skip


def _consistency(results: Results) -> Section:
    """Figure 8: R_c(n) at each Δτ, of every variable of each case."""
    figures, cases = {}, _cases(results)
    for name, case in cases.items():
        for variable, judged in case["select"]["variables"].items():
            limit = judged["thresholds"]["consistency"]
            figures[f"{name}|{variable}"] = consistency_figure(case["curves"][variable], judged["candidates"], limit)
    text = (
        "Testing against training snapshots, projected on the same n modes. Dashed: 1.05. A line leaves it at "
        "n<sub>c</sub> (filled); n<sub>lr</sub> (open) modes are needed. <i>gaps alone</i>: unseen snapshots only."
    )
    pickers = {"case": _picked(cases), "variable": _variables(results)}
    return Section("Figure 8: consistency ratio R<sub>c</sub>(n)", f'<p class="quiet">{text}</p>', figures, pickers)


def _variables(results: Results) -> dict[str, str]:
    """Return the variables, that of the tables first."""
    first = results["paper"]["variable"]
    return _picked(dict.fromkeys([first, *results["cases"][0]["select"]["variables"]]))


def _promises(results: Results) -> Section:
    """Whether ROMs keep what K_f promises: those of all trained variables, cases and Δτ."""
    limits = next(iter(results["cases"][0]["select"]["variables"].values()))["thresholds"]
    text = (
        "Each mark is a ROM trained at one Δτ. Below the dashed level it is as consistent as the rule wants; right of "
        "the dashed line the rule accepts its Δτ, and no mark may be above there. K<sub>f</sub> ≥ 1 says by definition "
        "that projections on n<sub>lr</sub> modes are consistent: what a mark adds is that coefficients between the "
        "snapshots are regressed. From 1 to 2 the rule refuses for safety."
    )
    figure = promise_figure(results["paper"]["trials"], limits["consistency"], limits["feasibility"])
    return Section("What K<sub>f</sub> promises, and trained ROMs keep", f'<p class="quiet">{text}</p>', {"": figure})


def _errors(results: Results) -> Section:
    """Error of every surrogate against Δτ."""
    figures: dict[str, Figure] = {}
    names: dict[str, str] = {}
    for name, case in _cases(results).items():
        rows: Sequence[Mapping[str, Any]] = case["compare"]["rows"]
        for variable in dict.fromkeys(row["variable"] for row in rows):
            own = [row for row in in_the_widest(rows) if row["variable"] == variable and row["basis"] != "enriched"]
            figures[f"{name}|{variable}"] = error_figure(own)
            names[variable] = variable
    text = (
        "Mean over the snapshots between the training snapshots. Dashed: what projection leaves. Raw baselines "
        "interpolate the stored snapshots, without a model."
    )
    pickers = {"case": _picked(_cases(results)), "variable": names}
    return Section("Error of the trained surrogates", f'<p class="quiet">{text}</p>', figures, pickers)


def _picture(number: int) -> Callable[[Results], Section | None]:
    """Return the section of a figure in space, which is drawn where the runs are."""
    return lambda results: (results.get("pictures") or {}).get(number)


# the paper's figures by their numbers, which the page shows in this order; None where there is nothing to show
FIGURES: Mapping[int, Callable[[Results], Section | None]] = {
    1: _picture(1),
    2: _lanczos,
    3: _picture(3),
    4: _picture(4),
    5: _picture(5),
    6: _coefficients,
    7: _history,
    8: _consistency,
    9: _picture(9),
}
