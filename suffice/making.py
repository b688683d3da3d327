"""Surrogates made by name, with what those that are trained need to know."""

import inspect
from typing import Any

from surrogates import SURROGATES, Network, Surrogate


def made(name: str, seed: int = 0, max_seconds: float | None = None) -> Surrogate:
    """Return a new surrogate of this name, with seed and limit of its training (s) if it takes them."""
    member = SURROGATES[name]
    given: dict[str, Any] = {"seed": seed, "max_seconds": max_seconds}
    taken = inspect.signature(member).parameters
    return member(**{key: value for key, value in given.items() if key in taken})


def is_trained(name: str) -> bool:
    """Tell whether it is a network, whose fit takes seconds and depends on a seed."""
    return issubclass(SURROGATES[name], Network)
