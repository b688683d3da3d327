"""What can be foreseen, in sentences and tables."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from suffice.wording import number, seconds_text

TIED = 1.02  # errors within this factor are ties: eight starts scatter by more

Curve = Sequence[float | None]


def first_above(curve: Curve, other: Curve) -> int | None:
    """Return the first horizon, in snapshots, at which a curve lies above the other; None for never.

    A curve that has ended, because its rollout was lost, lies above.
    """
    for k, (error, reference) in enumerate(zip(curve, other, strict=True)):
        if reference is not None and (error is None or error > reference):
            return k + 1
    return None


def foretold(variable: str, answer: Mapping[str, Any]) -> str:
    """Say who errs least one snapshot ahead, and when everything has become worse than persistence.

    From the end of training all are compared, from the other starts those that can start there.
    """
    rows = [r for r in answer["rows"] if r["variable"] == variable and r["surrogate"] != "persistence"]
    begin = f"{variable}, Δτ {seconds_text(answer['interval'])}, one snapshot ahead"
    ends = [(r["from_end"]["over_persistence"], r) for r in rows]
    said = [f"from the end of training {_best(ends)}"]
    several = [(r["over_persistence"], r) for r in rows if r["starts"] > 1]
    if several:
        said.append(f"from {len(answer['start_times'])} starts {_best(several)}")
    return f"{begin}: {'; '.join(said)}; {_all_behind(rows, answer['interval'])}."


def _best(ranked: Sequence[tuple[float | None, Mapping[str, Any]]]) -> str:
    """Name the row of least error as a share of that of persistence, its ties, and those that are no better."""
    known = sorted(((share, row) for share, row in ranked if share is not None), key=lambda pair: pair[0])
    if not known:
        return "nothing moves, and nothing can be better than persistence"
    (least, best), *others = known
    if least >= 1:
        return f"nothing is better than persistence, {_named(best)} least bad with {number(least)} times its error"
    said = f"{_named(best)} errs least, {number(least)} times the error of persistence"
    if tied := [_named(row) for share, row in others if share <= TIED * least]:
        said += f", tied with {', '.join(tied)}"
    learnt = next(((share, row) for share, row in known if row["modes"] is not None), None)
    if best["modes"] is None and learnt is not None:
        said += f", and of what learns {_named(learnt[1])}, {number(learnt[0])} times"
    if worse := [_named(row) for share, row in known if share >= 1]:
        said += f" (no better than persistence: {', '.join(worse)})"
    return said


def _all_behind(rows: Sequence[Mapping[str, Any]], interval: float) -> str:
    """Say at which horizon every row lies above persistence, or which does not at the last one."""
    ahead = len(rows[0]["rmse"]) if rows else 0
    for k in range(ahead):
        better = [r for r in rows if r["rmse"][k] is not None and r["rmse"][k] <= r["persistence"][k]]
        if not better:
            horizon = f"{k + 1} snapshot{'s' * (k > 0)} ahead ({seconds_text((k + 1) * interval)})"
            return f"{horizon} everything is worse than persistence"
    return f"{ahead} snapshots ahead still better than persistence: {', '.join(map(_named, better))}"


def _named(row: Mapping[str, Any]) -> str:
    return str(row["surrogate"]) if row["modes"] is None else f"{row['surrogate']} with {row['modes']} modes"


def show_beyond(answer: Mapping[str, Any]) -> None:
    """Print the error at each horizon asked for, the floor beside it, one table per variable, and the sentences."""
    console = Console()
    for base in answer["bases"]:
        console.print(_table(base, answer))
    console.print(
        f"trained on the snapshots up to {answer['train_end']:g} s; regressors in time (*) can only go on from there, "
        f"the others start from {len(answer['start_times'])} snapshots spread over the rest. end, starts: error one "
        "snapshot ahead over that of persistence, from the end of training and from all starts; behind: snapshots "
        "ahead from which persistence is better; floor: what exact coefficients would leave, the start kept.",
        highlight=False,
    )
    for sentence in answer["sentences"].values():
        console.print(sentence, highlight=False)
    for left in answer["left_out"]:
        console.print(f"left out: {left['reason']}", highlight=False, markup=False)


def _table(base: Mapping[str, Any], answer: Mapping[str, Any]) -> Table:
    rows = [r for r in answer["rows"] if r["variable"] == base["variable"]]
    in_diameters = all(r["rmse_diameters"] is not None for r in rows)
    unit, scale = ("diameters", answer["diameter"]) if in_diameters else (base["unit"], 1.0)
    ahead = [f"+{h}" for h in answer["horizons"]]
    title = f"{base['variable']}, Δτ = {answer['interval']:g} s: error in {unit}, so many snapshots ahead"
    table = Table("surrogate", "modes", *ahead, "end", "starts", "behind", title=title, padding=(0, 0))
    table.columns[0].no_wrap = True
    for r in sorted(rows, key=lambda r: float(r["from_end"]["over_persistence"] or 0)):
        everywhere = number(r["over_persistence"]) if r["starts"] > 1 else "–"
        ends = [number(r["from_end"]["over_persistence"]), everywhere, number(r["behind_persistence"])]
        table.add_row(_starred(r), number(r["modes"]), *_errors(r["rmse"], answer["horizons"], scale), *ends)
    floors = {(r["modes"], r["starts"] > 1): r for r in rows if r["floor"] is not None}
    table.add_section()
    for (modes, several), r in sorted(floors.items()):
        name = "floor" if several else "floor*"
        table.add_row(name, number(modes), *_errors(r["floor"], answer["horizons"], scale), style="dim")
    return table


def _starred(row: Mapping[str, Any]) -> str:
    """Name a surrogate; a star says that it has one start only."""
    return f"{row['surrogate']}*" if row["starts"] == 1 else str(row["surrogate"])


def _errors(curve: Curve, horizons: Sequence[int], scale: float) -> list[str]:
    found = [curve[h - 1] for h in horizons]
    return ["lost" if error is None else number(error / scale) for error in found]
