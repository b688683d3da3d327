"""Inner products of the snapshots of a run: one pass over each stored quantity, for its components and the whole."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod import ALONE, Ranks, SnapshotMatrix
from pod import InputError as UnfitRows
from selection import InnerProducts
from suffice.quantities import AXES
from suffice.refusal import Refusal
from suffice.run import Run

GROUPS = 10  # of particles, left out one at a time
HELD_BYTES = 4 * 2**30  # that inner products take at once; 10 groups of 1000 snapshots take 80 MB a component


class Products(NamedTuple):
    """Inner products of one variable; scarce where its particles are too few to be put into groups."""

    variable: str
    products: InnerProducts
    scarce: bool


def read_products(run: Run, variables: Sequence[str], ranks: Ranks = ALONE) -> Iterator[Products]:
    """Yield the inner products of each variable, those of one stored quantity together, each row read once.

    Gram matrices of the components of a vector come from the same rows, that of the vector is their sum. Groups and
    components that do not fit in 4 GiB are read in further passes, and beyond 7,300 snapshots groups are fewer. Of
    several ranks each reads its own rows, and all get the sum.
    Raises Refusal for values that are not finite or whose squares are not.
    """
    asked: dict[str, list[str]] = {}
    for name in variables:
        asked.setdefault(name if name in run.quantities else name.rpartition(".")[0], []).append(name)
    for quantity, names in asked.items():
        several = run.variable(quantity).rows_per_particle > 1 and len(names) > 1
        try:
            yield from _of_components(run, quantity, names, ranks) if several else _of_one(run, names[0], ranks)
        except UnfitRows as error:
            raise Refusal(f"{run.path}: {quantity if several else names[0]}: {error}") from None


def _of_one(run: Run, name: str, ranks: Ranks) -> Iterator[Products]:
    matrix = SnapshotMatrix(run.variable(name), ranks=ranks)
    groups = _groups(matrix)
    yield _named(name, matrix.gram_groups(groups or 1), matrix.shape[0], groups)


def _of_components(run: Run, vector: str, names: list[str], ranks: Ranks) -> Iterator[Products]:
    """Components of a vector, as many at once as fit, and their sum if it is asked for."""
    matrix = SnapshotMatrix(run.variable(vector), ranks=ranks)
    groups, rows, whole = _groups(matrix), matrix.shape[0], vector in names
    axes = [k for k, axis in enumerate(AXES) if whole or f"{vector}.{axis}" in names]
    fit = max(HELD_BYTES // (_bytes(matrix) * (groups or 1)) - whole, 1)
    total: NDArray[np.float64] | None = None
    for low in range(0, len(axes), fit):
        together = axes[low : low + fit]
        for axis, part in zip(together, matrix.component_gram_groups(groups or 1, together), strict=True):
            if whole:
                total = part if total is None else total + part
            if (name := f"{vector}.{AXES[axis]}") in names:
                yield _named(name, part, rows // len(AXES), groups)
    if total is not None:
        yield _named(vector, total, rows, groups)


def _groups(matrix: SnapshotMatrix) -> int | None:
    """How many groups the particles are put into, None where that leaves fewer than two in each."""
    if matrix.shape[0] // matrix.rows_per_particle < 2 * GROUPS:
        return None
    return max(min(GROUPS, HELD_BYTES // _bytes(matrix)), 2)


def _bytes(matrix: SnapshotMatrix) -> int:
    return 8 * matrix.shape[1] ** 2


def _named(name: str, parts: NDArray[np.float64], rows: int, groups: int | None) -> Products:
    products = InnerProducts(np.asarray(parts.sum(axis=0)), None if groups is None else parts, rows)
    return Products(name, products, groups is None)
