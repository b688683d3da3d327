"""Energy ledger: what the particles have, what they lost, what the walls gave."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from sim.contact import spring_energy
from sim.kernel import Array, Indices, kernel
from sim.law import ContactLaw, law_between, law_of_row
from sim.motion import Bodies
from sim.near_walls import NearWalls
from sim.neighbors import Neighbors, separation
from sim.pairs import reduced_radius
from sim.state import Particles, inertia, mass
from sim.surface import distance_to_wall


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
    position: Array,
    radius: Array,
    species: Indices,
    listed: Neighbors,
    spring: Array | None,
    law: ContactLaw,
    laws: Array | None,
) -> tuple[float, float, float]:
    """Energy of all pair springs (J), number of touching pairs, largest overlap in radii."""
    energy, contacts, deepest = 0.0, 0.0, 0.0
    for i in range(radius.shape[0]):
        for entry in range(listed.first[i], listed.last[i]):
            j = listed.partner[entry]
            dx, dy, dz = separation(position, i, j, listed, entry)
            overlap = radius[i] + radius[j] - sqrt(dx * dx + dy * dy + dz * dz)
            if overlap <= 0.0:
                continue
            if laws is not None:
                law = law_between(laws, species[i], species[j])
            contacts += 1.0
            deepest = max(deepest, overlap / min(radius[i], radius[j]))
            energy += 0.5 * law.stiffness * overlap**2
            if spring is not None:
                energy += spring_energy(entry, spring, law, reduced_radius(radius[i], radius[j]))
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
            law = law_of_row(laws, walls.body[near.surface[entry]])
            overlap = radius[i] - distance_to_wall(walls, near.surface[entry], x, y, z)[0]
            if overlap <= 0.0:
                continue
            contacts += 1.0
            deepest = max(deepest, overlap / radius[i])
            energy += 0.5 * law.stiffness * overlap**2
            if spring is not None:
                energy += spring_energy(entry, spring, law, radius[i])
    return energy, contacts, deepest


def kinetic_energy(particles: Particles) -> float:
    """Σ ½ m v², J."""
    return float(0.5 * np.sum(mass(particles) * np.sum(particles.velocity**2, axis=1)))


def rotational_energy(particles: Particles) -> float:
    """Σ ½ I ω², J; zero where nothing turns."""
    if particles.spin is None:
        return 0.0
    return float(0.5 * np.sum(inertia(particles) * np.sum(particles.spin**2, axis=1)))
