"""Diameters of the spheres of a species."""

from math import exp, log

import numpy as np
from scipy.special import ndtr, ndtri

from sim.kernel import Array
from sim.species import Lognormal, ParticleTable, Sieve, Uniform

RESOLUTION = 20_000  # quantiles behind a mean volume


def quantiles(table: ParticleTable, share: Array) -> Array:
    """Diameters (m) below which these shares, by number, of a species lie; same shape.

    A lognormal whose median is by mass has its median by number a factor exp(−3σ²) lower (Hatch and Choate, 1929).
    """
    given = table.distribution
    if given is None:
        return np.full(np.shape(share), table.diameter)
    if isinstance(given, Uniform):
        return np.asarray(given.low + share * (given.high - given.low))
    if isinstance(given, Sieve):
        return _sieved(given, share)
    return _lognormal(given, table.diameter, share)


def _lognormal(given: Lognormal, median: float, share: Array) -> Array:
    middle = median * exp(-3.0 * given.sigma**2) if given.by == "mass" else median
    low, high = (log(bound / middle) / given.sigma for bound in (given.low, given.high))
    if low > 0.0:  # in the upper tail, from above: shares near 1 have no digits left
        mirrored = ndtri(ndtr(-low) - share * (ndtr(-low) - ndtr(-high)))
        return np.clip(middle * np.exp(-given.sigma * mirrored), given.low, given.high)
    inside = ndtri(ndtr(low) + share * (ndtr(high) - ndtr(low)))
    return np.clip(middle * np.exp(given.sigma * inside), given.low, given.high)


def _sieved(given: Sieve, share: Array) -> Array:
    diameter = np.array(given.diameter)
    number = np.array(given.mass_fraction) / diameter**3
    upper = np.cumsum(number / number.sum())
    return diameter[np.minimum(np.searchsorted(upper, share, side="right"), len(diameter) - 1)]


def drawn_diameters(table: ParticleTable, n: int, rng: np.random.Generator) -> Array:
    """Return n diameters (m) in random order, one from each of n equal shares, so that even few follow the law."""
    if table.distribution is None:
        return np.full(n, table.diameter)
    share = (np.arange(n) + rng.uniform(size=n)) / max(n, 1)
    return rng.permutation(quantiles(table, share))


def mean_volume(table: ParticleTable) -> float:
    """Mean volume of a sphere of a species, by number, m³."""
    if table.distribution is None:
        return float(np.pi / 6.0 * table.diameter**3)
    if isinstance(table.distribution, Sieve):
        diameter, mass = np.array(table.distribution.diameter), np.array(table.distribution.mass_fraction)
        return float(np.pi / 6.0 * mass.sum() / (mass / diameter**3).sum())
    middles = (np.arange(RESOLUTION) + 0.5) / RESOLUTION
    return float(np.pi / 6.0 * np.mean(quantiles(table, middles) ** 3))
