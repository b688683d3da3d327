"""Impacts of a run, summed up: how many, how strong, and the power that they pass."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from suffice.run import Run

KINDS = ("pairs", "walls")


def impact_facts(run: Run) -> dict[str, Any]:
    """Return the mean spectrum of impacts over a run in words, for pairs and for walls; nothing where none is counted.

    The first snapshot has no time before it and does not count.
    """
    found = run.impacts
    if found is None or run.n_snapshots < 2:
        return {}
    weight = np.diff(run.times) / (run.times[-1] - run.times[0])
    mean = np.tensordot(weight, found.rate[1:], axes=1)
    return {f"impacts.{kind}": _sentence(found.energy, rate) for kind, rate in zip(KINDS, mean, strict=True)}


def _sentence(edges: NDArray[np.float64], rate: NDArray[np.float64]) -> str:
    """Say rate, power, and the energies below which half of the impacts and half of the power lie."""
    total = float(rate.sum())
    if not total:
        return "none"
    power = rate * np.sqrt(edges[:-1] * edges[1:])
    return (
        f"{total:.4g} 1/s, half of them below {_half(edges, rate):.3g} J; {power.sum():.3g} W, "
        f"half of it below {_half(edges, power):.3g} J"
    )


def _half(edges: NDArray[np.float64], parts: NDArray[np.float64]) -> float:
    """Energy (J) below which half of the parts lie, on a logarithmic scale within a bin."""
    below = np.concatenate([[0.0], np.cumsum(parts)]) / parts.sum()
    return float(np.exp(np.interp(0.5, below, np.log(edges))))
