"""The report of a study: one page that needs nothing but a browser."""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from plotly.offline import get_plotlyjs

from suffice.beyond_section import beyond_section
from suffice.door import write_text
from suffice.omissions_section import omissions_section
from suffice.one_step_section import one_step_section
from suffice.paper_section import paper_sections
from suffice.player_section import player_section
from suffice.plots import (
    consistency_figure,
    error_figure,
    lanczos_figure,
    ledger_figure,
    spectrum_figure,
    stages_figure,
)
from suffice.refusal import Refusal
from suffice.section import Section
from suffice.told_section import told_section
from suffice.tradeoff_section import tradeoff_section
from suffice.unseen_section import unseen_section
from suffice.verdicts import feasibility_table, table_legend, verdict_items
from suffice.winners import in_the_widest
from suffice.wording import escape, number, seconds_text
from suffice.worth import observables_section, winners_section

Results = Mapping[str, Any]

# the page may run what is in it and load nothing from anywhere
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
LONG = 120  # characters; a longer text of the provenance is folded


def write_report(results: Results, path: str | Path) -> None:
    """Write the results of a study as one HTML page, beside and renamed.

    results: `study`, `run`, `select` (as `select --json` writes it), `curves` {variable: {Δτ: curves}}, `spectrum`
    {variable: {Δτ: I(p)}}, `convergence` {variable: curves against steps, and `modes`}, `compare` (as
    `compare` answers, with a list of what `compare_beyond` does in `beyond`), `observables` (a list, as
    `compare_observables` answers), `unseen` (as `compare_unseen`), `omissions` (as `compare_omissions`), `paper` (as
    `paper_of`) with `cases` (a list, of each case what there is of these), `one_step` (as `full_size.measure`),
    `player` (a `Player`), `stages`, `told` (summaries of runs by name), `series` with its `times`, `provenance`; any
    may be missing, its section is then left out. Everything shown is escaped; the page loads nothing.
    Raises `Refusal` when the page cannot be written.
    """
    page, target = render(results), Path(path)
    try:
        write_text(target, page)
    except OSError as error:
        raise Refusal(f"report {target} cannot be written ({error}); name a file in a folder that exists") from None


def render(results: Results) -> str:
    """Return the page as HTML."""
    parts = (
        _verdict,
        _feasibility,
        _player,
        _consistency,
        _spectrum,
        _convergence,
        _error,
        winners_section,
        observables_section,
        tradeoff_section,
        beyond_section,
        unseen_section,
        omissions_section,
        one_step_section,
        _ledger,
        told_section,
        _stages,
        _provenance,
    )
    sections = [*paper_sections(results), *(section for part in parts if (section := part(results)) is not None)]
    figures = {f"panel{i}": section.figures for i, section in enumerate(sections)}
    scripts = ["report.js", *dict.fromkeys(name for section in sections for name in section.scripts)]
    study = escape(str(results.get("study") or "a run"))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>How much data suffices: {study}</title>"
        f"<style>{_of_page('report.css')}</style></head>\n"
        f"<body><header><h1>How much data suffices: {study}</h1>{_facts(results)}</header>\n"
        f"<main>{''.join(_html(section, f'panel{i}') for i, section in enumerate(sections))}</main>\n"
        "<noscript><p>The figures need JavaScript; the tables do not.</p></noscript>"
        f"<script>{get_plotlyjs()}</script>\n"
        f'<script type="application/json" id="figures">{_json(figures)}</script>\n'
        f"{''.join(_script(name) for name in scripts)}</body></html>\n"
    )


def _of_page(name: str) -> str:
    return (files("suffice") / "page" / name).read_text(encoding="utf-8")


def _script(name: str) -> str:
    return f"<script>{_of_page(name)}</script>"


def _json(value: Any) -> str:
    """Return JSON that no text in it can break out of: `<` never appears."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _html(section: Section, panel: str) -> str:
    # their order is that of the figures' keys
    pickers = "".join(_picker(name, options) for name, options in section.pickers.items())
    label = escape(re.sub("<[^>]*>", "", section.title))
    figure = f'<div class="panel" id="{panel}" role="figure" aria-label="{label}"></div>' if section.figures else ""
    title = f"<h2>{section.title}</h2>" if section.title else ""
    return (
        f"<section>{title}{section.body}"
        f"{f'<div class=picks>{pickers}</div>' if pickers else ''}{figure}{section.below}</section>\n"
    )


def _picker(name: str, options: Mapping[str, str]) -> str:
    shown = "".join(f'<option value="{escape(value)}">{escape(text)}</option>' for value, text in options.items())
    hidden = " hidden" if len(options) == 1 else ""
    return f'<label{hidden}>{name} <select name="{name}">{shown}</select></label>'


def _facts(results: Results) -> str:
    run = results.get("run") or {}
    shown: Mapping[str, tuple[str, Callable[[Any], str]]] = {
        "n_particles": ("particles", str),
        "diameter": ("diameter", lambda value: f"{number(1e3 * value)} mm"),
        "n_snapshots": ("snapshots", str),
        "interval": ("dense interval", seconds_text),
        "duration": ("duration", seconds_text),
        "path": ("run", str),
    }
    items = [
        f"<li><span class=quiet>{title}</span> <b>{escape(text(run[key]))}</b></li>"
        for key, (title, text) in shown.items()
        if run.get(key) is not None
    ]
    return f'<ul class="facts">{"".join(items)}</ul>' if items else ""


def _verdict(results: Results) -> Section | None:
    variables = (results.get("select") or {}).get("variables")
    return Section("Verdict", verdict_items(variables)) if variables else None


def _player(results: Results) -> Section | None:
    section, cases = player_section(results), (results.get("paper") or {}).get("cases")
    if section is None or not cases:
        return section
    return section._replace(title=f"{section.title}, {escape(cases[-1]['name'])}")


def _feasibility(results: Results) -> Section | None:
    variables = (results.get("select") or {}).get("variables")
    if not variables:
        return None
    title = "Feasibility index K<sub>f</sub> = n<sub>c</sub> / n<sub>lr</sub>"
    return Section(title, table_legend() + feasibility_table(variables))


def _consistency(results: Results) -> Section | None:
    curves = results.get("curves")
    if not curves:
        return None
    judged = (results.get("select") or {}).get("variables") or {}
    figures = {}
    for name, by_interval in curves.items():
        found = judged.get(name) or {}
        limit = (found.get("thresholds") or {}).get("consistency", 1.05)
        figures[name] = consistency_figure(by_interval, found.get("candidates") or [], limit)
    text = (
        "Unseen snapshots against training snapshots, both projected on the same n modes. Dashed: the limit. "
        "A line leaves it at n<sub>c</sub> (filled); n<sub>lr</sub> (open) modes are needed. "
        "<i>gaps alone</i> in the legend shows the ratio over unseen snapshots only."
    )
    return Section("Consistency R<sub>c</sub>(n)", _quiet(text), figures, _variable_picker(figures))


def _spectrum(results: Results) -> Section | None:
    curves, spectrum = results.get("curves") or {}, results.get("spectrum")
    if not spectrum:
        own = {
            name: {dt: c["energy_ratio"] for dt, c in by.items() if "energy_ratio" in c} for name, by in curves.items()
        }
        spectrum = {name: by for name, by in own.items() if by}
    if not spectrum:
        return None
    judged = (results.get("select") or {}).get("variables") or {}
    energy = {name: (found.get("thresholds") or {}).get("energy", 0.999) for name, found in judged.items()}
    figures = {name: spectrum_figure(ratios, energy.get(name, 0.999)) for name, ratios in spectrum.items()}
    text = "Share of the energy that p modes leave out. Dashed: the share that defines n<sub>lr</sub>."
    return Section("Spectrum", _quiet(text), figures, _variable_picker(figures))


def _convergence(results: Results) -> Section | None:
    found = results.get("convergence")
    if not found:
        return None
    figures = {name: lanczos_figure(curve, curve["modes"]) for name, curve in found.items()}
    text = (
        "Energy that the leading Ritz pairs hold after k steps. Of the sum of all Ritz values, which is not yet the "
        "total, they hold more: with few steps that ratio promises too much."
    )
    return Section("Convergence of the Lanczos process", _quiet(text), figures, _variable_picker(figures))


def _error(results: Results) -> Section | None:
    by_variable = _rows_by_variable(results)
    if not by_variable:
        return None
    figures = {name: error_figure(_of_positions_alone(rows)) for name, rows in by_variable.items()}
    text = (
        "Root mean square over particles, mean over the snapshots between the training snapshots (kind: in time). "
        "Dashed: what projection on the modes leaves, which no surrogate of these modes can undercut. "
        "Raw baselines interpolate the stored snapshots themselves, without a model."
    )
    return Section("Error against Δτ", _quiet(text), figures, _variable_picker(figures))


def _ledger(results: Results) -> Section | None:
    series = results.get("series") or {}
    figure = ledger_figure(series)
    if figure is None:
        return None
    givers = "the walls and of the fluid on them" if series.get("fluid_work") else "the walls"
    text = f"What the particles have and have lost, less the work of {givers}, must balance: dashed, ideally zero."
    return Section("Energy ledger", _quiet(text), {"": figure})


def _stages(results: Results) -> Section | None:
    stages: Sequence[Mapping[str, Any]] = results.get("stages") or []
    return Section("Cost of each stage", "", {"": stages_figure(stages)}) if stages else None


def _provenance(results: Results) -> Section | None:
    provenance = {name: value for name, value in (results.get("provenance") or {}).items() if value not in ("", None)}
    if not provenance:
        return None
    items = "".join(f"<dt>{escape(str(name))}</dt><dd>{_folded(value)}</dd>" for name, value in provenance.items())
    return Section("Provenance", f"<dl>{items}</dl>")


def _quiet(text: str) -> str:
    return f'<p class="quiet">{text}</p>'


def _folded(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    if len(text) <= LONG and "\n" not in text.strip():
        return escape(text)
    return f"<details><summary>{len(text.splitlines())} lines</summary><pre>{escape(text)}</pre></details>"


def _variable_picker(names: Iterable[str]) -> dict[str, Mapping[str, str]]:
    return {"variable": {name: name for name in names}}


def _of_positions_alone(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return what is kept in the precision of the run, without the modes of positions and velocities."""
    return [row for row in in_the_widest(rows) if row.get("basis") != "enriched"]


def _rows_by_variable(results: Results) -> dict[str, list[Mapping[str, Any]]]:
    by_variable: dict[str, list[Mapping[str, Any]]] = {}
    for row in (results.get("compare") or {}).get("rows") or []:
        by_variable.setdefault(row["variable"], []).append(row)
    return by_variable
