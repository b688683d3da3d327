"""Numbers and names as the report shows them: with units, and safe inside a page."""

import math
from collections.abc import Mapping
from html import escape
from typing import Any

__all__ = [
    "bytes_text",
    "errors_text",
    "escape",
    "finite",
    "number",
    "plain_number",
    "seconds_text",
    "threads_text",
    "two_decimals",
]

PLAIN = 1e6  # numbers below are written without a power of ten
UNITS_OF_TIME = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))


def finite(value: Any) -> float | None:
    """Return a number, or None where it is missing, infinite or none at all."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def number(value: Any, digits: int = 3, sign: str = "") -> str:
    """Return a number with so many significant digits, `–` where there is none; sign: `+` shows that of all.

    >>> number(-104.3, 2), number(0.02, sign="+")
    ('-100', '+0.02')
    """
    known = finite(value)
    if known is None:
        return "–"
    text = f"{known:{sign}.{digits}g}"
    return f"{float(text):{sign}.0f}" if "e+" in text and abs(known) < PLAIN else text


def plain_number(value: Any, digits: int = 3) -> str:
    """Return the same without a power of ten where it is large: 2,670 and not 2.67e+03."""
    known = finite(value)
    return "–" if known is None else f"{float(f'{known:.{digits}g}'):,.12g}"


def two_decimals(value: Any) -> str:
    """Return a number with two decimals, `–` where there is none."""
    known = finite(value)
    return "–" if known is None else f"{known:.2f}"


def seconds_text(value: Any) -> str:
    """Return a time in the unit that suits it: 0.003 is `3 ms`."""
    known = finite(value)
    if known is None:
        return "–"
    if abs(known) >= 120:
        return f"{known / 60:.3g} min"
    # a thousandth below the unit still reads well in it, a rounding below must not fall to the next
    scale, unit = next((pair for pair in UNITS_OF_TIME if abs(known) >= pair[0] * (1 - 1e-9)), UNITS_OF_TIME[-1])
    return f"{known / scale:.3g} {unit}" if known else "0 s"


def errors_text(candidate: Mapping[str, Any], unit: str) -> str:
    """Return the errors of n_lr and of n_c modes at unseen times, `0.82 … 0.11 d` where bead diameters are known.

    candidate: as `select` writes it; unit: of the variable. Empty where there is no unseen time.
    """
    for suffix, shown in (("_diameters", "d"), ("", unit)):
        errors = [finite(candidate.get(f"error_{n}{suffix}")) for n in ("n_lr", "n_c")]
        if any(error is not None for error in errors):
            text = " … ".join(number(error, 2) for error in errors)
            return text if shown == "1" else f"{text} {shown}"
    return ""


def threads_text(count: int) -> str:
    """Return `1 thread`, `2 threads`."""
    return f"{count} thread{'' if count == 1 else 's'}"


def bytes_text(value: Any) -> str:
    """Return a number of bytes in kB, MB or GB."""
    known = finite(value)
    if known is None:
        return "–"
    for scale, unit in ((1e9, "GB"), (1e6, "MB")):
        if known >= scale:
            return f"{known / scale:.3g} {unit}"
    return f"{known / 1e3:.3g} kB"
