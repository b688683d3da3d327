"""Weight of the particles."""

import numpy as np

from sim.kernel import Array
from sim.state import Particles, mass, travelled

Vector = tuple[float, float, float]


def potential_energy(particles: Particles, gravity: Vector | None, period: Array | None = None) -> float:
    """−Σ m g·x about the scene's origin, J; zero in a scene without gravity."""
    if gravity is None:
        return 0.0
    return float(
        -np.sum(mass(particles) * (travelled(particles, np.zeros(3) if period is None else period) @ np.array(gravity)))
    )
