"""Energy ledger: what the particles have, what they lost, what the walls gave."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from sim.contact import ContactLaw
from sim.kernel import Array, kernel
from sim.motion import Bodies
from sim.neighbors import Neighbors
from sim.state import Particles, inertia, mass
from sim.walls import NearWalls, law_of_body, wall_distance


class Ledger(NamedTuple):
    """Energies in J; kinetic + rotational + potential + elastic + dissipated − wall_work stays constant."""

    kinetic: float
    rotational: float
    potential: float
    elastic: float
    dissipated: float
    wall_work: float

    @property
    def balance(self) -> float:
        """The sum that ought to stay constant, J."""
        return self.kinetic + self.rotational + self.potential + self.elastic + self.dissipated - self.wall_work


@kernel
def pair_elastic_energy(
    position: Array, radius: Array, listed: Neighbors, spring: Array | None, law: ContactLaw
) -> tuple[float, float, float]:
    """Energy of all pair springs (J), number of touching pairs, largest overlap in radii."""
    energy, contacts, deepest = 0.0, 0.0, 0.0
    for c in range(listed.chunks.shape[0] - 1):
        begin, end = listed.chunks[c], listed.chunks[c + 1]
        for i in range(begin, end):
            for entry in range(listed.first[i], listed.last[i]):
                j = listed.partner[entry]
                dx, dy, dz = (
                    position[i, 0] - position[j, 0],
                    position[i, 1] - position[j, 1],
                    position[i, 2] - position[j, 2],
                )
                overlap = radius[i] + radius[j] - sqrt(dx * dx + dy * dy + dz * dz)
                if overlap <= 0.0:
                    continue
                count = 1.0 if begin <= j < end else 0.5  # pairs across chunks are listed twice
                contacts += count
                deepest = max(deepest, overlap / min(radius[i], radius[j]))
                energy += count * 0.5 * law.stiffness * overlap**2
                if spring is not None:
                    for axis in range(3):
                        energy += count * 0.5 * law.tangential_stiffness * spring[entry, axis] ** 2
    return energy, contacts, deepest


@kernel
def wall_elastic_energy(
    position: Array, radius: Array, walls: Bodies, near: NearWalls, spring: Array | None, laws: Array
) -> tuple[float, float, float]:
    """Energy of all wall springs (J), number of touching walls, largest overlap in radii."""
    energy, contacts, deepest = 0.0, 0.0, 0.0
    for i in range(radius.shape[0]):
        for entry in range(near.first[i], near.last[i]):
            x, y, z = position[i, 0], position[i, 1], position[i, 2]
            law = law_of_body(laws, walls.body[near.surface[entry]])
            overlap = radius[i] - wall_distance(walls, near.surface[entry], x, y, z)[0]
            if overlap <= 0.0:
                continue
            contacts += 1.0
            deepest = max(deepest, overlap / radius[i])
            energy += 0.5 * law.stiffness * overlap**2
            if spring is not None:
                for axis in range(3):
                    energy += 0.5 * law.tangential_stiffness * spring[entry, axis] ** 2
    return energy, contacts, deepest


def kinetic_energy(particles: Particles) -> float:
    """Σ ½ m v², J."""
    return float(0.5 * np.sum(mass(particles) * np.sum(particles.velocity**2, axis=1)))


def rotational_energy(particles: Particles) -> float:
    """Σ ½ I ω², J; zero where nothing turns."""
    if particles.spin is None:
        return 0.0
    return float(0.5 * np.sum(inertia(particles) * np.sum(particles.spin**2, axis=1)))
