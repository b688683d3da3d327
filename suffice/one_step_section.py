"""Section of the report: one step of the solver and of the model at full size."""

from collections.abc import Mapping
from typing import Any

from suffice.section import Section
from suffice.wording import bytes_text, escape, number, seconds_text, threads_text

Answer = Mapping[str, Any]
SHOWN = {"single": "one snapshot alone", "batch": "each of many"}


def one_step_section(results: Mapping[str, Any]) -> Section | None:
    """Show seconds of one snapshot interval of the solver, of one snapshot of the model, and their ratio.

    results["one_step"]: as `full_size.measure` answers; None where nothing was timed.
    """
    answer = results.get("one_step")
    if not answer:
        return None
    body = f'<ul class="verdicts"><li>{escape(str(answer["sentence"]))}</li></ul>{_table(answer)}'
    notes = "".join(f"<li>{note}</li>" for note in (_solver_note(answer), *_late_note(answer), *_model_notes(answer)))
    return Section("One step at full size", body, below=f'<ul class="quiet">{notes}</ul>')


def _table(answer: Answer) -> str:
    """Tabulate what one step takes and how much faster the model is, beside goals and the paper's statement."""
    solver = answer["solver"]
    step, steps = solver["step"], solver["steps_per_interval"]
    spread = f"{seconds_text(steps * step['low'])} to {seconds_text(steps * step['high'])}"
    rows = [_row(["solver, one interval", seconds_text(solver["interval_seconds"]), spread, "1", "", ""])]
    rows += _model_rows(answer, "model", answer)
    if answer["gpu"]:
        rows += _model_rows(answer, f"model on {escape(str(answer['gpu']['rom']['device']))}", answer["gpu"])
    titles = ("seconds", "quartiles", "times faster", "goal", "paper")
    head = "".join(f'<th class="number">{title}</th>' for title in titles)
    return (
        f'<div class="scroll"><table class="plain"><tr><th>{solver["beads"]:,} beads</th>{head}</tr>{"".join(rows)}'
        f'</table></div><p class="quiet">The paper states {escape(str(answer["paper"]))}.</p>'
    )


def _model_rows(answer: Answer, who: str, measured: Answer) -> list[str]:
    """Rows of a model on one device: alone and in batch, in the memory of the host."""
    rom, ratio, rows = measured["rom"], measured["ratio"], []
    fetch = rom["fetch"]["seconds"] if rom["fetch"] else 0.0
    for name, words in SHOWN.items():
        timing, (low, high) = rom[name], ratio[f"{name}_range"]
        cells = [
            f"{who}, {words}",
            seconds_text(timing["seconds"] + fetch),
            f"{seconds_text(timing['low'] + fetch)} to {seconds_text(timing['high'] + fetch)}",
            f"<b>{ratio[name]:,.0f}</b> ({low:,.0f} to {high:,.0f})",
            f"{answer['goals'][name]:,.0f} {_pill(ratio[f'{name}_reached'])}",
            "over 1500" if name == "single" else "–",
        ]
        rows.append(_row(cells))
    return rows


def _row(texts: list[str]) -> str:
    first, *others = texts
    return f"<tr><td>{first}</td>{''.join(f'<td class=number>{text}</td>' for text in others)}</tr>"


def _pill(reached: bool) -> str:
    style, text = ("sufficient", "reached") if reached else ("insufficient", "missed")
    return f'<span class="pill {style}">{text}</span>'


def _solver_note(answer: Answer) -> str:
    """Say what of the solver was timed, and at which state."""
    solver = answer["solver"]
    measured = (
        f"Solver: scene {escape(str(answer['scene']))}, {solver['steps']} steps from t = "
        f"{seconds_text(solver['begin'])} on were timed, {100 * solver['share']:.0f} % of the "
        f"{solver['steps_per_interval']} in an interval of {seconds_text(solver['interval'])}, "
        f"{seconds_text(solver['seconds'] / solver['steps'])} each, on {threads_text(solver['threads'])}; "
        "writing snapshots is left out"
    )
    return f"{measured}. Beads stand apart at the start, with {number(solver['contacts'])} contacts each in the end."


def _late_note(answer: Answer) -> list[str]:
    """Say what developed flow would cost, as far as the source tells."""
    late, ratio = answer["developed"], answer["ratio"]
    if late is None:
        return [
            "Developed flow was not timed: the source has no scene, or no moment at which all walls stand as at first."
        ]
    return [
        f"Developed flow, not measured at this size: in the source a step from t = {seconds_text(late['time'])} on "
        f"({number(late['late']['contacts'])} contacts each) takes {number(late['factor'])} times one at its start "
        f"({number(late['start']['contacts'])}). "
        f"With that the model would be {ratio['single_developed']:,.0f} times faster alone and "
        f"{ratio['batch_developed']:,.0f} times in batch."
    ]


def _model_notes(answer: Answer) -> list[str]:
    """Say what the model is made of, how wrong it is, and how fast memory and processor were used."""
    rom, source = answer["rom"], answer["source"]
    levels = "; ".join(
        f"{axis}: n {n}, n<sub>lr</sub> {number(n_lr)}, n<sub>c</sub> {number(n_c)}, error {number(error)} d"
        for axis, n, n_lr, n_c, error in zip(
            "xyz", source["n_modes"], source["n_lr"], source["n_c"], source["rmse_diameters"], strict=True
        )
    )
    return [
        f"Model: modes of {source['beads']:,} beads ({escape(str(source['run']))}, {source['n_snapshots']} snapshots), "
        f"repeated {source['copies']} times beside each other, which leaves n<sub>lr</sub>, n<sub>c</sub> and "
        f"K<sub>f</sub> as they are. Δτ {seconds_text(source['interval'])}: {escape(str(source['interval_reason']))}. "
        f"{levels}; errors are RMSE between the snapshots.",
        f"A snapshot: all three components, coefficients by {escape(str(source['surrogate']))} "
        f"({seconds_text(rom['regression']['seconds'])}), in {escape(str(rom['precision']))} precision into memory "
        "that is there, at times not asked for before, on "
        f"{escape(str(rom['device']))} with {threads_text(rom['threads'])}. "
        f"Alone it moves {bytes_text(rom['bytes_moved'])}, {rom['bytes_per_second'] / 1e9:.3g} GB/s; "
        f"{rom['batch_size']} at once are computed at {rom['flops_per_second'] / 1e9:.3g} GFLOP/s.",
        *_gpu_note(answer),
    ]


def _gpu_note(answer: Answer) -> list[str]:
    """Say what a GPU does of a step, and what it does not."""
    if not answer["gpu"]:
        return []
    rom = answer["gpu"]["rom"]
    return [
        f"{escape(str(rom['device']))}: the processor predicts the coefficients; to copy a snapshot to its memory "
        f"takes {seconds_text(rom['fetch']['seconds'])}, which is included."
    ]
