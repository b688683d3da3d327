"""Which product the modes are computed from: the cheapest by what it computes and reads."""

from math import ceil
from typing import NamedTuple

from pod.errors import InputError

ROUTES = ("gram", "block", "svd")
BLOCK = 32  # vectors that block Lanczos multiplies by in one reading of the rows
GRAM_BYTES = 2 * 2**30  # of two Gram matrices, that of the snapshots and a copy: more is not formed unless asked for
DENSE_BYTES = 2**29  # of a matrix that is decomposed as it is
LEAD = 128  # vectors of the Krylov space beyond the modes wanted, as benchmarks/pod_vs_peers.py --break-even found
# rates of a common core, of which only ratios count: flop/s of products, bytes/s of memory and of a disk
FLOPS, MEMORY, DISK = 25e9, 8e9, 1e9
SKINNY = 0.5  # of FLOPS that a product with a block of vectors reaches, measured there too


class Problem(NamedTuple):
    """What the cost of a decomposition depends on."""

    rows: int
    snapshots: int
    modes: int | None  # wanted, where that is known before
    in_memory: bool
    processes: int


class Choice(NamedTuple):
    """A route and why it was taken."""

    route: str
    reason: str


def choose_route(problem: Problem, asked: str | None = None) -> Choice:
    """Route of least estimated seconds, or the one asked for. Raises InputError for a route that there is not.

    Gram: rows N_t² flop once, then Lanczos on N_t × N_t numbers. Block Lanczos: 4 rows N_t b flop and one reading a
    step of b vectors, about p + 128 vectors in all. Where rows are no more than snapshots the matrix itself is small.
    """
    if asked is not None:
        if asked not in ROUTES:
            raise InputError(f"route: {asked!r}; give one of {', '.join(ROUTES)}, or None for the cheapest")
        if asked == "svd" and problem.processes > 1:
            raise InputError("route: 'svd' needs all rows in one process; give 'gram' or 'block', or one process")
        return Choice(asked, "asked for")
    small = problem.rows <= problem.snapshots and 8 * problem.rows * problem.snapshots <= DENSE_BYTES
    if small and problem.processes == 1:
        return Choice("svd", f"{problem.rows} rows are no more than {problem.snapshots} snapshots")
    if 16 * problem.snapshots**2 > GRAM_BYTES:
        return Choice("block", f"inner products of {problem.snapshots} snapshots need more than 2 GiB")
    gram, block = gram_seconds(problem), block_seconds(problem)
    words = f"estimated {gram:.2g} s, block Lanczos on the rows {block:.2g} s"
    if block < gram:
        words = f"estimated {block:.2g} s, inner products first {gram:.2g} s"
        return Choice("block", words)
    return Choice("gram", words)


def gram_seconds(p: Problem) -> float:
    """Estimated seconds to form the inner products and their pairs on one core."""
    pairs = 2.0 * p.snapshots**2 * min(_vectors(p), p.snapshots)
    return (p.rows * float(p.snapshots) ** 2 / p.processes + pairs) / FLOPS + _reading(p)


def block_seconds(p: Problem) -> float:
    """Estimated seconds of block Lanczos on the rows on one core."""
    steps = ceil(min(_vectors(p), p.snapshots) / BLOCK)
    return steps * (4.0 * p.rows * p.snapshots * BLOCK / p.processes / (SKINNY * FLOPS) + _reading(p))


def _vectors(p: Problem) -> int:
    """Vectors that the Krylov space is expected to need; all, where the number of modes is not known."""
    return p.snapshots if p.modes is None else p.modes + LEAD


def _reading(p: Problem) -> float:
    return 8.0 * p.rows * p.snapshots / p.processes / (MEMORY if p.in_memory else DISK)
