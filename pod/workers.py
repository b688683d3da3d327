"""Tiles of rows, and the threads that share them out: each computes alone, so that none waits for another."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple, TypeVar

import torch
from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]

from pod.gram import Array

T = TypeVar("T")
HELD_VALUES = 2**27  # of the sums of all threads, 1 GiB: beyond it one thread forms them, its products on all cores
MOST_WORKERS = 4  # each holds sums of its own; beyond them the products have the other threads


class Tile(NamedTuple):
    """Some rows of W in double precision, about the first snapshot; the next tile may overwrite them."""

    rows: slice  # among all rows
    motion: Array  # (b, N_t) (W - w₀) √weight, unit of W
    first: Array  # (b,) w₀ √weight


def workers_for(rows: int, height: int, held: int = 0) -> int:
    """Threads for so many rows in tiles of such a height: as many as torch has, a few tiles for each.

    held: values of the sums that each would hold.
    """
    fit = HELD_VALUES // held if held else MOST_WORKERS
    return max(1, min(torch.get_num_threads(), MOST_WORKERS, rows // (4 * height), fit))


def in_parallel(work: Callable[[int], T], workers: int) -> list[T]:
    """Results of work(0) … work(workers - 1), one thread for each, the products of each on its share of the cores."""
    if workers == 1:
        return [work(0)]
    cores = torch.get_num_threads()
    share = max(1, cores // workers)
    with _libraries().limit(limits=share, user_api="blas"), ThreadPoolExecutor(workers) as pool:
        torch.set_num_threads(share)  # which each new thread asks for at its first product
        try:
            return list(pool.map(work, range(workers)))
        finally:
            torch.set_num_threads(cores)


def sum_of(parts: Sequence[Array]) -> Array:
    """Sum in fixed order, in the memory of the first."""
    for part in parts[1:]:
        parts[0].__iadd__(part)
    return parts[0]


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()
