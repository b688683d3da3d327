"""Who predicts an unseen speed best, by how much, and what limits it: in sentences."""

from collections.abc import Mapping, Sequence
from math import hypot
from typing import Any

OVERALL = "overall"

Row = Mapping[str, Any]


def sentences(rows: Sequence[Row], statistical: Mapping[str, float], floor: Mapping[str, float]) -> dict[str, str]:
    """One sentence per field, and one for all, from the rows and floors of a case of `compare_unseen`."""
    return {key: _sentence(key, rows, statistical[key], floor[key]) for key in rows[0]["errors"]}


def tied(a: Row, b: Row, key: str) -> bool:
    """Whether two rows cannot be told apart.

    So it is where their errors differ by less than the scatter over seeds, or where the first and the second half of
    the run held out would choose another one.
    """
    apart = a["errors"][key] - b["errors"][key]
    halves = [one - other for one, other in zip(a["half_errors"][key], b["half_errors"][key], strict=True)]
    scatter = hypot(a["seed_spread"][key], b["seed_spread"][key])
    return abs(apart) <= scatter or any(half * apart <= 0.0 for half in halves)


def ahead_of(row: Row, rows: Sequence[Row], key: str) -> list[str]:
    """Name the surrogates that a row clearly beats."""
    worse = [other for other in rows if other["errors"][key] > row["errors"][key]]
    return [other["surrogate"] for other in worse if not tied(row, other, key)]


def limit(error: float, statistical: float, floor: float) -> str:
    """Name the largest part of error² = statistical² + (floor² − statistical²) + (error² − floor²)."""
    parts = {
        "the statistical error of the averages held out": statistical**2,
        "the modes, which do not hold these fields": max(floor**2 - statistical**2, 0.0),
        "the coefficients, known at few speeds and from averages with errors of their own": max(
            error**2 - floor**2, 0.0
        ),
    }
    name = max(parts, key=lambda part: parts[part])
    return f"{name} ({100 * parts[name] / (sum(parts.values()) or 1.0):.0f} % of its square)"


def _sentence(key: str, rows: Sequence[Row], statistical: float, floor: float) -> str:
    ranked = sorted(rows, key=lambda row: float(row["errors"][key]))
    best, others = ranked[0], ranked[1:]
    level = [best, *(row for row in others if tied(row, best, key))]
    beaten = [row for row in others if row not in level]
    error = float(best["errors"][key])
    if len(level) > 1:
        text = f"{key}: tie of {' and '.join(_named(row, key) for row in level)}"
    else:
        text = f"{key}: {_named(best, key)} wins"
    if beaten:
        text += ", ahead of " + ", ".join(f"{_named(row, key)} {_by(row, error, key)}" for row in beaten)
    text += f"; floors {statistical:.3g} statistical, {floor:.3g} projection"
    return f"{text}; limited by {limit(error, statistical, floor)}."


def _named(row: Row, key: str) -> str:
    scatter = row["seed_spread"][key]
    return f"{row['surrogate']} ({row['errors'][key]:.3g}{f' ± {scatter:.1g}' if scatter else ''})"


def _by(row: Row, error: float, key: str) -> str:
    return f"by {100.0 * (1.0 - error / row['errors'][key]):.0f} %" if row["errors"][key] else "by nothing"
