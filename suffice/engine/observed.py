"""What the snapshots of another program tell without its forces: energies, contacts, overlaps."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from sim.energy import kinetic_energy, rotational_energy
from sim.gravity import potential_energy
from sim.kernel import Array
from sim.motion import Bodies, move_bodies
from sim.near_walls import count_near_walls
from sim.state import Particles

SERIES = ("coordination", "energy.kinetic", "energy.potential", "energy.rotational", "max_overlap")


class Touching(NamedTuple):
    """Contacts of one moment."""

    coordination: float  # mean number of contacts of a particle, walls included
    max_overlap: float  # radii


def touching(position: Array, radius: Array, walls: Bodies | None, time: float) -> Touching:
    """Find all overlaps of particles (n, 3) m with each other and with the walls where these are at a time (s)."""
    pairs = cKDTree(position).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    first, second = pairs.T
    distance = np.linalg.norm(position[first] - position[second], axis=1)
    overlap = (radius[first] + radius[second] - distance) / np.minimum(radius[first], radius[second])
    contacts, deepest = 2.0 * np.count_nonzero(overlap > 0.0), float(overlap.max(initial=0.0))
    if walls is not None:
        move_bodies(walls, time)
        near, least = count_near_walls(position, radius, walls, 0.0)
        contacts += near.sum()
        deepest = max(deepest, float((1.0 - least / radius).max()))
    return Touching(float(contacts) / len(radius), deepest)


def series_of(
    particles: Particles, walls: Bodies | None, gravity: tuple[float, float, float] | None, time: float
) -> dict[str, float]:
    """Return the diagnostics `SERIES` that positions and velocities determine; springs are the other program's."""
    contacts = touching(particles.position, particles.radius, walls, time)
    return {
        "energy.kinetic": kinetic_energy(particles),
        "energy.rotational": rotational_energy(particles),
        "energy.potential": potential_energy(particles, gravity),
        "coordination": contacts.coordination,
        "max_overlap": contacts.max_overlap,
    }
