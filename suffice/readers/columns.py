"""Numbers of a table of particles, one line each."""

import io
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from suffice.refusal import Refusal

REMEDY = "correct it, or leave that snapshot out"


def read_columns(lines: bytes, columns: Sequence[str], wanted: Sequence[str], where: str) -> NDArray[np.float64]:
    """Return the wanted columns of these lines, (lines, wanted), each the first of its name; `wanted` begins with id.

    Raises `Refusal` naming particle, column and `where` for text, NaN, infinity, a line of another length, or an id
    that is not an integer.
    """
    n = lines.count(b"\n")
    try:
        table = np.loadtxt(io.BytesIO(lines), comments=None, usecols=[columns.index(name) for name in wanted], ndmin=2)
    except ValueError as error:
        raise Refusal(_first_flaw(lines, columns, wanted, where) or f"{where}: {error}; {REMEDY}") from None
    regular = len(table) == n and lines.count(b" ") % n == 0  # a line of another length, unless others make up for it
    if not (regular and np.isfinite(table).all() and (table[:, 0] == np.rint(table[:, 0])).all()):
        flaw = _first_flaw(lines, columns, wanted, where)
        if flaw:
            raise Refusal(flaw)
    return table


def _first_flaw(lines: bytes, columns: Sequence[str], wanted: Sequence[str], where: str) -> str | None:
    for i, line in enumerate(lines.decode("latin-1").splitlines()):
        words = line.split()
        if len(words) != len(columns):
            flaw = f"line {i + 1} of its atoms has {len(words)} columns, not {len(columns)}: {line[:60]!r}"
            return f"{where}: {flaw}; {REMEDY}"
        by_name = dict(zip(reversed(columns), reversed(words), strict=True))  # the first of a repeated name stays
        for name in wanted:
            if not _is_number(by_name[name]):
                return (
                    f"{where}: particle id {by_name['id']} has {name} = {by_name[name]}, not a finite number; {REMEDY}"
                )
        if not float(by_name["id"]).is_integer():
            return f"{where}: particle id {by_name['id']} is not an integer; {REMEDY}"
    return None


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
