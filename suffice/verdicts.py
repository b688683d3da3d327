"""The verdict in words and as a table: which snapshot interval Δτ suffices for which variable."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from selection.resolution import KEPT_PROMISE
from suffice.wording import errors_text, escape, number, seconds_text, two_decimals

SYMBOL = re.compile(r"\b([A-Za-z])_([a-z]+|\d+)\b")  # K_f, R_a, n_lr, E_train, c_1
SUBSCRIPT = r"\1<sub>\2</sub>"
MOST_UNFOLDED = 3  # variables for which nothing suffices
VERDICTS = ("sufficient", "insufficient", "undecidable")


def verdict_items(variables: Mapping[str, Any]) -> str:
    """Say in a sentence what suffices for which variables, then one sentence for each, as HTML.

    variables: as `select` writes them, see design.md. Many for which nothing suffices are folded.
    """
    items = {name: _item(str(name), found) for name, found in variables.items()}
    refused = [name for name, found in variables.items() if found.get("chosen_interval") is None]
    chosen = "".join(item for name, item in items.items() if name not in refused)
    left = "".join(items[name] for name in refused)
    if len(refused) > MOST_UNFOLDED:
        summary = f"<summary>The {len(refused)} for which no Δτ considered suffices</summary>"
        folded = f'<details>{summary}<ul class="verdicts">{left}</ul></details>'
        return f'{_headline(variables)}<ul class="verdicts">{chosen}</ul>{folded}'
    return f'{_headline(variables)}<ul class="verdicts">{chosen}{left}</ul>'


def _headline(variables: Mapping[str, Any]) -> str:
    """Say which Δτ suffices for which variables by the paper's rule, and for which none does."""
    names: dict[float | None, list[str]] = {}
    for name, found in variables.items():
        names.setdefault(found.get("chosen_interval"), []).append(str(name))
    refused = names.pop(None, [])
    parts = [
        f"snapshots every <b>{seconds_text(interval)}</b> suffice for <b>{_listed(own)}</b>"
        for interval, own in sorted(names.items(), key=lambda pair: -float(pair[0] or 0.0))
    ]
    if refused:
        tried = {float(c["interval"]) for found in variables.values() for c in found.get("candidates") or []}
        span = f", {seconds_text(max(tried))} to {seconds_text(min(tried))}," if tried else ""
        parts.append(f"<b>no Δτ</b> considered{span} suffices for <b>{_listed(refused)}</b>")
    return f'<p class="headline">By the paper\'s rule {"; ".join(parts)}.</p>'


def _listed(names: Sequence[str]) -> str:
    """Name variables, a vector once where all its components are among them."""
    wholes = {name[:-2] for name in names if name.endswith(".x")}
    wholes = {whole for whole in wholes if {f"{whole}.y", f"{whole}.z"} <= set(names)}
    shown = dict.fromkeys(name[:-2] if name[:-2] in wholes else name for name in names)
    return ", ".join(map(escape, shown))


def deciding(found: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the candidate that the verdict rests on: the chosen one, else the one of largest K_f; None of none.

    Of several with that K_f, such as 0, it is the finest Δτ: it has most snapshots to tell by.
    """
    candidates: Sequence[Mapping[str, Any]] = found.get("candidates") or []
    chosen = found.get("chosen_interval")
    at = [candidate for candidate in candidates if chosen is not None and candidate["interval"] == chosen]
    return next(iter(at or sorted(candidates, key=lambda c: (-(c.get("K_f") or 0.0), c["interval"]))), None)


def promise_text(found: Mapping[str, Any]) -> str:
    """Say from which Δτ on a model on n_lr modes keeps what they promise; empty where it does at none.

    found: a variable as `select` writes it.
    """
    kept = [c for c in found.get("candidates") or [] if c.get("R_lr") is not None and c["R_lr"] <= KEPT_PROMISE]
    if not kept:
        return ""
    first = max(kept, key=lambda c: float(c["interval"]))
    interval, modes = seconds_text(first["interval"]), first["n_lr"]
    return f"a spline on n_lr = {modes} modes keeps what they promise at {interval} (R_lr {first['R_lr']:.2f})"


def _item(name: str, found: Mapping[str, Any]) -> str:
    shown = f'<span class="name">{escape(name)}</span>'
    candidate = deciding(found)
    if candidate is None:
        return f"<li>{shown}: no Δτ was considered.</li>"
    limit = number((found.get("thresholds") or {}).get("feasibility"))
    interval, K_f = seconds_text(candidate["interval"]), _feasibility(candidate)
    if found.get("chosen_interval") is not None:
        sentence = f"snapshots every <b>{interval}</b> suffice by the paper's rule, K<sub>f</sub> ≥ {limit}: {K_f}"
        if left := errors_text(candidate, str(found.get("unit") or "")):
            modes = f"{_count(candidate.get('n_lr'))} … {_count(candidate.get('n_c'))} modes"
            sentence += f"; at unseen times {modes} leave {escape(left)}"
    elif candidate.get("K_f") is None:
        sentence = "K<sub>f</sub> is <b>not defined at any Δτ considered</b>"
    else:
        sentence = f"<b>not sufficient at any Δτ considered</b>; the best is {K_f} at {interval}, {limit} is needed"
    if promise := promise_text(found):
        sentence += f"; {SYMBOL.sub(SUBSCRIPT, escape(promise))}"
    reasons = SYMBOL.sub(SUBSCRIPT, escape("; ".join(map(str, candidate.get("reasons") or []))))
    verdict = _pill(candidate.get("verdict"))
    return f'<li>{verdict} {shown}: {sentence}. <span class="quiet">Our verdict at {interval}: {reasons}.</span></li>'


def feasibility_table(variables: Mapping[str, Any]) -> str:
    """Tabulate K_f per Δτ and variable, as HTML: coloured by our verdict, framed where the paper's rule holds."""
    judged = {name: {c["interval"]: c for c in found.get("candidates") or []} for name, found in variables.items()}
    units = [str(found.get("unit") or "") for found in variables.values()]
    intervals = sorted({interval for own in judged.values() for interval in own}, reverse=True)
    head = "".join(f"<th>{_breakable(str(name))}</th>" for name in variables)
    body = "".join(
        f"<tr><th>{seconds_text(interval)}</th>{_cells([own.get(interval) for own in judged.values()], units)}</tr>"
        for interval in intervals
    )
    return f'<div class="scroll"><table class="kf"><tr><th>Δτ</th>{head}</tr>{body}</table></div>'


def _breakable(name: str) -> str:
    """Let a name break into lines after its dots and underscores."""
    return escape(name).replace(".", ".<wbr>").replace("_", "_<wbr>")


def table_legend() -> str:
    """Explain the colours and the frame of the table."""
    pills = " ".join(_pill(verdict) for verdict in VERDICTS)
    return (
        f'<p class="legend quiet"><span>Our verdict:</span> {pills} '
        '<span><span class="framed">framed ✓</span> sufficient by the paper\'s rule</span> '
        "<span>Small: n<sub>c</sub> / n<sub>lr</sub>, and the error at unseen times "
        "of n<sub>lr</sub> … n<sub>c</sub> modes, d in bead diameters</span></p>"
    )


def _cells(candidates: Sequence[Mapping[str, Any] | None], units: Sequence[str]) -> str:
    return "".join(_cell(candidate, unit) for candidate, unit in zip(candidates, units, strict=True))


def _cell(candidate: Mapping[str, Any] | None, unit: str) -> str:
    if candidate is None:
        return "<td>–</td>"
    verdict = candidate.get("verdict")
    style = f"{verdict if verdict in VERDICTS else ''}{' paper' if candidate.get('sufficient') else ''}"
    title = escape("; ".join(map(str, candidate.get("reasons") or [])))
    modes = f"{_count(candidate.get('n_c'))} / {_count(candidate.get('n_lr'))}"
    rule = " ✓" if candidate.get("sufficient") else ""
    K_f, left = two_decimals(candidate.get("K_f")), escape(errors_text(candidate, unit))
    unbroken = left.replace(" ", "\u00a0").replace("…\u00a0", "… ")  # a narrow cell breaks between the two errors
    errors = f"<small>{unbroken}</small>" if left else ""
    return f'<td class="{style}" title="{title}"><b>{K_f}</b><small>{modes}{rule}</small>{errors}</td>'


def _feasibility(candidate: Mapping[str, Any]) -> str:
    """Write K_f with its interval from resampling particles."""
    spread = candidate.get("K_f_interval")
    between = f" ({two_decimals(spread[0])} to {two_decimals(spread[1])} by resampling)" if spread else ""
    return f"K<sub>f</sub> {two_decimals(candidate.get('K_f'))}{between}"


def _pill(verdict: object) -> str:
    shown = str(verdict) if verdict in VERDICTS else "undecidable"
    return f'<span class="pill {shown}">{shown}</span>'


def _count(value: Any) -> str:
    return str(value) if isinstance(value, int) else "–"
