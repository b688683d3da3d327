"""Threads for small matrices: each works alone, because threads of one small product wait longer than they compute."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from threading import Lock
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]

T = TypeVar("T")
R = TypeVar("R")


def alone() -> AbstractContextManager[Any]:
    """Let every call of linear algebra inside compute on one thread."""
    cores()  # asked before the limit
    limit: AbstractContextManager[Any] = _libraries().limit(limits=1, user_api="blas")
    return limit


def shared(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """Results of a piece of work for each item, in order; the cores share the items out."""
    with alone(), ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(work, items))


def once(work: Callable[[], R]) -> Callable[[], R]:
    """Return what does a piece of work when it is first asked for, whichever thread asks, and knows it from then on."""
    found, lock = cache(work), Lock()

    def ask() -> R:
        with lock:
            return found()

    return ask


@cache
def cores() -> int:
    """Threads that linear algebra was given."""
    return max((library["num_threads"] for library in _libraries().select(user_api="blas").info()), default=1)


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()
