"""Impacts of a run, summed up: how many, how strong, and the power that they pass."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from suffice.run import Run

Array = NDArray[np.float64]
KINDS = ("pairs", "walls")


class Spectrum(NamedTuple):
    """Mean rate of impacts in bins of their energy."""

    energy: Array  # (bins + 1,) J, edges of the bins
    rate: Array  # (bins,) 1/s

    @property
    def power(self) -> Array:
        """Energy that the impacts of each bin pass in a second, at the middle of the bin on a logarithmic scale, W."""
        return np.asarray(self.rate * np.sqrt(self.energy[:-1] * self.energy[1:]))


def impact_facts(run: Run) -> dict[str, Any]:
    """Return the mean spectrum of impacts over a run in words, for pairs and for walls; nothing where none is counted.

    The first snapshot has no time before it and does not count.
    """
    return {f"impacts.{kind}": _sentence(found) for kind, found in mean_spectra(run).items()}


def mean_spectra(run: Run, first: int = 0, last: int | None = None) -> dict[str, Spectrum]:
    """Return the spectrum of impacts between two snapshots, by default all, for pairs and for walls.

    Empty where none is counted, or where there is no time between them.
    """
    found, end = run.impacts, run.n_snapshots - 1 if last is None else last
    if found is None or end <= first:
        return {}
    weight = np.diff(run.times[first : end + 1]) / (run.times[end] - run.times[first])
    mean = np.tensordot(weight, found.rate[first + 1 : end + 1], axes=1)
    return {kind: Spectrum(found.energy, rate) for kind, rate in zip(KINDS, mean, strict=True)}


def _sentence(found: Spectrum) -> str:
    """Say rate, power, and the energies below which half of the impacts and half of the power lie."""
    total = float(found.rate.sum())
    if not total:
        return "none"
    return (
        f"{total:.4g} 1/s, half of them below {half_energy(found.energy, found.rate):.3g} J; "
        f"{found.power.sum():.3g} W, half of it below {half_energy(found.energy, found.power):.3g} J"
    )


def half_energy(edges: Array, parts: Array) -> float:
    """Energy (J) below which half of the parts lie, on a logarithmic scale within a bin."""
    below = np.concatenate([[0.0], np.cumsum(parts)]) / parts.sum()
    return float(np.exp(np.interp(0.5, below, np.log(edges))))
