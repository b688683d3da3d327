"""The deepest overlap: how much, and between whom."""

from math import sqrt

from sim.kernel import Array, kernel
from sim.motion import Bodies
from sim.near_walls import NearWalls
from sim.neighbors import Neighbors, separation
from sim.surface import distance_to_wall


@kernel
def deepest_pair(position: Array, radius: Array, listed: Neighbors) -> tuple[float, int, int]:
    """Largest overlap of two particles in radii of the smaller one (negative: a gap), and the two rows."""
    deepest, first, second = -1.0, -1, -1
    for i in range(radius.shape[0]):
        for entry in range(listed.first[i], listed.last[i]):
            j = listed.partner[entry]
            dx, dy, dz = separation(position, i, j, listed, entry)
            gap = sqrt(dx * dx + dy * dy + dz * dz) - radius[i] - radius[j]
            overlap = -gap / min(radius[i], radius[j])
            if overlap > deepest:
                deepest, first, second = overlap, i, j
    return deepest, first, second


@kernel
def deepest_wall(position: Array, radius: Array, walls: Bodies, near: NearWalls) -> tuple[float, int, int]:
    """Largest overlap of a particle and a wall in radii (negative: a gap), its row and the body."""
    deepest, row, body = -1.0, -1, -1
    for i in range(radius.shape[0]):
        for entry in range(near.first[i], near.last[i]):
            s = near.surface[entry]
            distance = distance_to_wall(walls, s, position[i, 0], position[i, 1], position[i, 2])[0]
            overlap = 1.0 - distance / radius[i]
            if overlap > deepest:
                deepest, row, body = overlap, i, walls.body[s]
    return deepest, row, body
