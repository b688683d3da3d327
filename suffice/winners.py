"""Which surrogate wins between the snapshots, and by how much: said in a sentence per variable and Δτ."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from suffice.precision import PRECISIONS
from suffice.wording import seconds_text

Row = Mapping[str, Any]

EQUAL = 0.01  # of the smaller error: below it nobody wins
RAW = ("raw-linear", "raw-hermite")
NETWORKS = ("mlp", "lstm")
ENRICHED, OF_BOTH = "enriched", " of positions and velocities"
RIVALS = ("linear", "raw-hermite")  # what a network must beat to be worth its training


def winners(rows: Iterable[Row], networks: Collection[str] = NETWORKS) -> list[dict[str, Any]]:
    """Return who wins each variable and Δτ among surrogates on the same number of modes; plain types, ready for JSON.

    Like is compared with like: only rows in the widest `precision` of a place, that of the run, take part, and those on
    the `enriched` basis of positions and velocities among themselves. rows: as `compare` writes them; a row may carry
    `seeds`, its error for each seed, of which the mean counts and the range is the spread, or `rmse_spread`, in the
    unit of the variable. A difference below the larger spread of the two, or below 1 %, is a tie. networks: names of
    which it is said where they stand behind linear interpolation of the coefficients or Hermite interpolation of the
    snapshots.

    Each entry has `variable`, `interval` (s), `levels` (one per number of modes of the plain basis: `modes`, `winner`,
    who is `tied` with it, the `next`, and `by` what part that errs more), `enriched` (the same of that basis), `raw`,
    the best baseline without a model, `raw_wins`, whether it beats every model on the plain basis, `raw_by`, what part
    more than the best of them it errs (negative: less), `behind`, the networks that a rival beats, and the `sentence`
    that says all this.
    """
    places: dict[tuple[str, float], list[Row]] = {}
    for row in rows:
        places.setdefault((row["variable"], row["interval"]), []).append(row)
    return [_place(variable, interval, own, networks) for (variable, interval), own in places.items()]


def error_of(row: Row) -> float:
    """Error of a row, the mean over its seeds where it has several, unit of the variable."""
    seeds: Sequence[float] = row.get("seeds") or [row["rmse"]]
    return float(sum(seeds) / len(seeds))


def spread_of(row: Row) -> float:
    """How far a row's error varies with the seed, unit of the variable; 0 for what has none."""
    given = row.get("rmse_spread")
    seeds: Sequence[float] = row.get("seeds") or [row["rmse"]]
    return float(max(seeds) - min(seeds)) if given is None else float(given)


def beats(one: Row, other: Row) -> bool:
    """Tell whether the first errs less by more than its seeds and 1 % explain."""
    less, more = error_of(one), error_of(other)
    return more - less > max(spread_of(one), spread_of(other), EQUAL * less)


def _place(variable: str, interval: float, rows: Sequence[Row], networks: Collection[str]) -> dict[str, Any]:
    rows = in_the_widest(rows)
    on_modes = [row for row in rows if row["modes"] is not None]
    enriched = [row for row in on_modes if row.get("basis") == ENRICHED]
    plain = [row for row in on_modes if row.get("basis") != ENRICHED]
    baselines = sorted((row for row in rows if row["modes"] is None and row["surrogate"] in RAW), key=error_of)
    best, equal = (min(some, key=error_of, default=None) for some in (plain, enriched))
    raw = baselines[0] if baselines else None
    found = {
        "variable": variable,
        "interval": interval,
        "levels": _levels(plain),
        "enriched": _levels(enriched),
        "raw": None if raw is None else raw["surrogate"],
        "raw_wins": best is not None and raw is not None and beats(raw, best),
        "raw_by": error_of(raw) / error_of(best) - 1.0 if raw and best and error_of(best) else None,
        "behind": _behind([*plain, *baselines], networks),
    }
    # velocities in the modes may make up for what positions alone lack
    return {**found, "sentence": _sentence(found, best, equal if raw and equal and not beats(raw, equal) else None)}


def in_the_widest(rows: Sequence[Row]) -> list[Row]:
    """Return the rows in the precision that keeps the most digits; those that name none are in that of the run."""
    order = list(PRECISIONS)
    widest = min((order.index(row["precision"]) for row in rows if row.get("precision")), default=0)
    return [row for row in rows if row.get("precision", order[widest]) == order[widest]]


def _levels(rows: Sequence[Row]) -> list[dict[str, Any]]:
    return [_level([row for row in rows if row["modes"] == n]) for n in sorted({row["modes"] for row in rows})]


def _level(rows: Sequence[Row]) -> dict[str, Any]:
    """Who wins on one number of modes: `winner`, who is `tied` with it, the `next`, and `by` what part it errs more."""
    ranked = sorted(rows, key=error_of)
    first = ranked[0]
    tied = [row for row in ranked[1:] if not beats(first, row)]
    rest = [row for row in ranked[1:] if beats(first, row)]
    floor = first.get("projection_rmse")
    return {
        "modes": first["modes"],
        "winner": first["surrogate"],
        "rmse": error_of(first),
        "over_floor": error_of(first) / floor if floor else None,
        "tied": [row["surrogate"] for row in tied],
        "next": rest[0]["surrogate"] if rest else None,
        "by": error_of(rest[0]) / error_of(first) - 1.0 if rest and error_of(first) else None,
    }


def _behind(rows: Sequence[Row], networks: Collection[str]) -> list[dict[str, Any]]:
    """Name what each network stands behind, a rival on as many modes or on none: `surrogate`, `modes`, `rivals`."""
    found = []
    for row in rows:
        if row["surrogate"] in networks:
            rivals = [
                other for other in rows if other["surrogate"] in RIVALS and other["modes"] in (row["modes"], None)
            ]
            ahead = [other["surrogate"] for other in rivals if beats(other, row)]
            if ahead:
                found.append({"surrogate": row["surrogate"], "modes": row["modes"], "rivals": ahead})
    return found


def _said_of(behind: Sequence[Mapping[str, Any]]) -> list[str]:
    """Say who stands behind whom, once for all numbers of modes at which it is the same."""
    places: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for entry in behind:
        places.setdefault((entry["surrogate"], tuple(entry["rivals"])), []).append(str(entry["modes"]))
    return [
        f"{name} on {' and '.join(modes)} modes stands behind {' and '.join(rivals)}"
        for (name, rivals), modes in places.items()
    ]


def _sentence(found: Mapping[str, Any], best: Row | None, equal: Row | None) -> str:
    start = f"{found['variable']}, Δτ {seconds_text(found['interval'])}: "
    parts = [_said(level) for level in found["levels"]]
    # with few modes of both only surrogates that know rates are compared: alone they win nothing
    parts += [_said(level, OF_BOTH) for level in found["enriched"] if level["tied"] or level["next"]]
    if found["raw_wins"] and best is not None:
        none = "no model wins here" if equal is None else "no model of positions alone wins here"
        parts.append(
            f"{none}: {found['raw']}, without any, errs {-found['raw_by']:.0%} less than the best of them, "
            f"{best['surrogate']} on {best['modes']} modes"
        )
        if equal is not None:
            parts[-1] += f", and not less than {equal['surrogate']} on {equal['modes']} modes{OF_BOTH}"
    parts += _said_of(found["behind"])
    return start + ("; ".join(parts) or "nothing could be compared") + "."


def _said(level: Mapping[str, Any], of: str = "") -> str:
    modes = f"on {level['modes']} mode{'' if level['modes'] == 1 else 's'}{of} "
    if level["tied"]:
        first = f"{modes}{', '.join([level['winner'], *level['tied'][:-1]])} and {level['tied'][-1]} tie"
    else:
        first = f"{modes}{level['winner']} wins" if level["next"] else f"{modes}{level['winner']} stands alone"
    if level["next"] and level["by"] is not None:
        first += f", {level['next']} errs {_more(level['by'])}"
    elif level["next"]:
        first += f" without error, {level['next']} errs"
    return first


def _more(share: float) -> str:
    return f"{share:.1%} more" if share < 1.0 else f"{share + 1.0:.2g} times as much"
