"""The cheapest way to keep a limit on error, on time or on storage, said in one sentence."""

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from selection.tradeoff import Choice, choose
from suffice.precision import PRECISIONS
from suffice.refusal import Refusal
from suffice.wording import bytes_text, seconds_text

DIAMETERS = "d"
ALIKE = 1.01  # errors that differ by less are not worth a byte
TIMING_NOISE = 1.5  # medians of five timings of some 20 µs scatter by this much on a busy machine
CHOICES = (
    ("fastest", "single_seconds", TIMING_NOISE),
    ("smallest", "storage_bytes", 1.0),
    ("most_accurate", "rmse", ALIKE),
)


class Limits(NamedTuple):
    """What the user can bear; None for no limit."""

    max_error: float | None  # RMSE over the rows, mean over the unseen times
    error_unit: str  # a unit of the run's variables, or "d", particle diameters
    max_seconds: float | None  # to reconstruct one snapshot
    max_bytes: float | None = None  # to keep, for one variable

    @property
    def any(self) -> bool:
        """Whether there is a limit at all."""
        return any(limit is not None for limit in (self.max_error, self.max_seconds, self.max_bytes))

    def error_in(self, unit: str, diameter: float | None) -> float | None:
        """Return the largest error in this unit; None where there is no limit or it is one on another quantity."""
        if self.max_error is None:
            return None
        if self.error_unit == DIAMETERS:
            return self.max_error * diameter if unit == "m" and diameter is not None else None
        return self.max_error if self.error_unit == unit else None


def parse_error(text: str) -> tuple[float, str]:
    """Return value and unit of an error such as `0.05d` (diameters), `5e-5` (m) or `0.01 m/s`.

    Raises Refusal where it does not begin with a number.
    """
    number, unit = re.fullmatch(r"\s*([-+.\d]*(?:[eE][-+]?\d+)?)(.*)", text, re.DOTALL).groups()  # type: ignore[union-attr]
    try:
        return float(number), unit.strip() or "m"
    except ValueError:
        raise Refusal(
            f"--max-error {text!r}: not an error; give diameters such as 0.05d, or a number with the variable's unit "
            "such as 5e-5m"
        ) from None


def parse_bytes(text: str) -> float:
    """Return bytes of a size such as `500kB`, `2MB`, `1.5 GB` or `200000`.

    Raises Refusal where it is none.
    """
    number = text.strip().rstrip("kMGB ")
    unit = text.strip()[len(number) :].strip().removesuffix("B")
    try:
        return float(number) * {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}[unit]
    except (ValueError, KeyError):
        raise Refusal(f"--max-bytes {text!r}: not a size; give bytes, or such as 500kB or 2MB") from None


def check_limits(limits: Limits, units: Collection[str], diameter: float | None) -> None:
    """Raise `Refusal` for a limit that is not positive, in a unit that no variable has, or in unknown diameters."""
    for name, value, unit in (
        ("max_error", limits.max_error, limits.error_unit),
        ("max_seconds", limits.max_seconds, "s"),
        ("max_bytes", limits.max_bytes, "B"),
    ):
        if value is not None and not 0 < value < float("inf"):
            raise Refusal(f"{name} is {value:g} {unit}; it must be a positive number")
    if limits.max_error is None:
        return
    if limits.error_unit == DIAMETERS and diameter is None:
        raise Refusal(
            f"max_error is {limits.max_error:g} d, but the run does not know its particle diameters; give the limit "
            "in m, or import the run again with its diameter"
        )
    if (meant := "m" if limits.error_unit == DIAMETERS else limits.error_unit) not in units:
        raise Refusal(
            f"max_error is {limits.max_error:g} {limits.error_unit}, but the variables are in "
            f"{', '.join(sorted(units))}; give the limit in one of these, or compare a variable in {meant}"
        )


def cheapest(
    variable: str, rows: Sequence[Mapping[str, Any]], limits: Limits, diameter: float | None
) -> dict[str, Any]:
    """Choose for one variable among the rows of a comparison; plain types, ready for JSON.

    `fastest` and `smallest` are the least in seconds per snapshot and in bytes among the rows that keep the limits,
    `most_accurate` the least in error; all None where none does, and then `closest` is the row that comes nearest.
    Without a limit on the error the sentence names the most accurate within the others. Errors within 1 % are equal,
    and so are seconds within a factor of 1.5, as far as a wall clock can tell: the smallest in bytes of these counts.
    """
    own = [row for row in rows if row["variable"] == variable]
    answer: dict[str, Any] = {"kept": False, "fastest": None, "smallest": None, "most_accurate": None, "closest": None}
    if not own:
        return {**answer, "sentence": f"{variable}: nothing could be compared."}
    unit = own[0]["unit"]
    error = limits.error_in(unit, diameter)
    all_bounds = {"rmse": error, "single_seconds": limits.max_seconds, "storage_bytes": limits.max_bytes}
    bounds = {key: most for key, most in all_bounds.items() if most is not None}
    if not bounds:
        return {**answer, "sentence": f"{variable}: a limit in {limits.error_unit} does not apply to {unit}."}
    chosen = _chosen(own, bounds)
    wanted = " and ".join(_limit(key, most, unit, limits) for key, most in bounds.items())
    first = chosen["fastest" if error is not None else "most_accurate"]
    if not first.kept:
        row = own[first.chosen]
        sentence = f"{variable}: none keeps {wanted}; the closest is {_described(row)}."
        return {**answer, "closest": _named(row), "sentence": sentence}
    answer |= {name: _named(own[choice.chosen]) for name, choice in chosen.items()}
    if error is None:
        sentence = f"{variable}: within {wanted} the most accurate is {_described(own[first.chosen])}."
        return {**answer, "kept": True, "sentence": sentence}
    sentence = f"{variable}: {wanted} is kept fastest by {_described(own[first.chosen])}"
    if (smallest := own[chosen["smallest"].chosen]) is not own[first.chosen]:
        sentence += f"; the least storage is that of {_described(smallest)}"
    return {**answer, "kept": True, "sentence": f"{sentence}."}


def _chosen(rows: Sequence[Mapping[str, Any]], bounds: Mapping[str, float]) -> dict[str, Choice]:
    """Choose by each quantity within the bounds; of what is as good in it, the smallest in bytes."""
    limits, bounded = list(bounds.values()), [[row[key] for key in bounds] for row in rows]
    sizes, found = [row["storage_bytes"] for row in rows], {}
    for name, key, alike in CHOICES:
        found[name] = choose([row[key] for row in rows], bounded, limits)
        most = alike * rows[found[name].chosen][key]
        if found[name].kept and most > 0:  # an error of zero leaves no room for another
            as_good = [[*some, row[key]] for some, row in zip(bounded, rows, strict=True)]
            found[name] = choose(sizes, as_good, [*limits, most])
    return found


def _limit(key: str, most: float, unit: str, limits: Limits) -> str:
    if key == "single_seconds":
        return f"at most {seconds_text(most)} per snapshot"
    if key == "storage_bytes":
        return f"at most {bytes_text(most)} to keep"
    in_diameters = f" ({limits.max_error:g} d)" if limits.error_unit == DIAMETERS else ""
    return f"an error of at most {most:.3g} {unit}{in_diameters}"


def _named(row: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("interval", "n_snapshots", "surrogate", "basis", "modes", "precision", "rmse", "rmse_diameters")
    return {key: row[key] for key in (*keys, "single_seconds", "storage_bytes")}


def _described(row: Mapping[str, Any]) -> str:
    modes = "" if row["modes"] is None else f" with {row['modes']} modes"
    of = " of positions and velocities" if row["basis"] == "enriched" else ""
    kept = PRECISIONS[row["precision"]].text
    return (
        f"{row['surrogate']}{modes}{of} in {kept} at Δτ {seconds_text(row['interval'])} (error {row['rmse']:.3g} "
        f"{row['unit']}, {seconds_text(row['single_seconds'])} per snapshot, "
        f"{bytes_text(row['storage_bytes'])} to keep)"
    )
