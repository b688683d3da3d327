"""Impacts counted by their energy: what grinds in a mill.

An impact is a contact at its first moment, while the two still approach. Its energy is ½ m* v_n² + ½ k δ²: the second
part is what the spring took since the surfaces met, so that the sum is ½ m* v_n² of the moment at which they did.
"""

from math import log10

import numpy as np

from sim.kernel import Array, inlined

LOWEST, DECADES, PER_DECADE = 1e-18, 21, 5  # J; weaker impacts count in the first bin, stronger ones in the last
BINS = DECADES * PER_DECADE


def impact_energy_edges() -> Array:
    """Edges of the bins, equal on a logarithmic scale, shape (bins + 1,), J."""
    return np.asarray(LOWEST * 10.0 ** (np.arange(BINS + 1) / PER_DECADE))


@inlined
def count_impact(
    impacts: Array, c: int, count: float, separation_speed: float, overlap: float, stiffness: float, reduced_mass: float
) -> None:
    """Count a contact that was apart before, in row c of `impacts` (chunks, bins), where its partners approach.

    `count` is 1, or ½ where both partners list the pair.
    """
    if separation_speed >= 0.0:
        return
    energy = 0.5 * (reduced_mass * separation_speed * separation_speed + stiffness * overlap * overlap)
    place = int((log10(energy) - log10(LOWEST)) * PER_DECADE)
    impacts[c, min(max(place, 0), BINS - 1)] += count
