"""What a snapshot says beside energies: how deep contacts are, how hot the flow is, how well species are mixed."""

from itertools import combinations
from math import sqrt

import numpy as np

from sim.averaging import cell_width, cells_of
from sim.granular_temperature import granular_temperature
from sim.kernel import Array, kernel
from sim.mixing import lacey_index
from sim.motion import Bodies
from sim.near_walls import NearWalls
from sim.neighbors import Neighbors, separation
from sim.scene import Scene
from sim.state import Particles, mass
from sim.surface import distance_to_wall

QUANTILES = (50, 90, 99, 100)  # % of the touching contacts


@kernel
def pair_overlaps(position: Array, radius: Array, listed: Neighbors) -> Array:
    """Overlap of every touching pair in diameters of the smaller partner."""
    deep = np.empty(listed.partner.shape[0])
    found = 0
    for i in range(radius.shape[0]):
        for entry in range(listed.first[i], listed.last[i]):
            j = listed.partner[entry]
            dx, dy, dz = separation(position, i, j, listed, entry)
            overlap = radius[i] + radius[j] - sqrt(dx * dx + dy * dy + dz * dz)
            if overlap > 0.0:
                deep[found] = 0.5 * overlap / min(radius[i], radius[j])
                found += 1
    return deep[:found]


@kernel
def wall_overlaps(position: Array, radius: Array, walls: Bodies, near: NearWalls) -> Array:
    """Overlap of every particle with every shape it touches, in diameters."""
    deep = np.empty(near.surface.shape[0])
    found = 0
    for i in range(radius.shape[0]):
        for entry in range(near.first[i], near.last[i]):
            s = near.surface[entry]
            distance = distance_to_wall(walls, s, position[i, 0], position[i, 1], position[i, 2])[0]
            if distance < radius[i]:
                deep[found] = 0.5 * (1.0 - distance / radius[i])
                found += 1
    return deep[:found]


def overlap_quantiles(overlap: Array) -> dict[str, float]:
    """Return what overlap (diameters) 50, 90, 99 and 100 % of the contacts stay below; 0 where nothing touches."""
    values = np.quantile(overlap, np.array(QUANTILES) / 100.0) if len(overlap) else np.zeros(len(QUANTILES))
    return {f"overlap.{share}": float(value) for share, value in zip(QUANTILES, values, strict=True)}


def mixing_indices(scene: Scene, particles: Particles, width: float) -> dict[str, float]:
    """Return Lacey's index of every two species, in cells of this width (m)."""
    found = {}
    for (a, first), (b, second) in combinations(enumerate(scene.species), 2):
        rows = (particles.species == a) | (particles.species == b)
        cell = cells_of(particles.position[rows], width)
        found[f"mixing.{first}.{second}"] = lacey_index((particles.species[rows] == a).astype(np.uint8), cell)
    return found


def diagnostics(
    scene: Scene, particles: Particles, listed: Neighbors, walls: Bodies | None, near: NearWalls
) -> dict[str, float]:
    """Return overlaps in diameters, granular temperature in m²/s² and mixing indices of this moment, by name."""
    p = particles
    overlap = pair_overlaps(p.position, p.radius, listed)
    if walls is not None:
        overlap = np.concatenate([overlap, wall_overlaps(p.position, p.radius, walls, near)])
    width = cell_width(p.radius)
    heat = granular_temperature(p.position, p.velocity, mass(p), cells_of(p.position, width))
    return overlap_quantiles(overlap) | {"granular_temperature": heat} | mixing_indices(scene, p, width)
