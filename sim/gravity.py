"""Weight of the particles."""

import numpy as np

from sim.kernel import Array
from sim.state import Particles, mass, travelled

Vector = tuple[float, float, float]


def potential_energy(particles: Particles, gravity: Vector | None, period: Array) -> float:
    """−Σ m g·x about the scene's origin, J; zero in a scene without gravity."""
    if gravity is None:
        return 0.0
    return float(-np.sum(mass(particles) * (travelled(particles, period) @ np.array(gravity))))
