"""The first moment: particles where the scene puts them, and what is refused there."""

import numpy as np

from sim.errors import InputError
from sim.kernel import Array
from sim.motion import Bodies
from sim.neighbors import Neighbors
from sim.overlap import deepest_pair
from sim.packing import pack
from sim.scene import Scene
from sim.species import ParticleTable
from sim.state import Particles
from sim.timestep import particle_mass
from sim.walls import count_near_walls, wall_distance


def _rows(value: object, n: int) -> Array:
    """Give every particle its vector: the one of all, or its own."""
    return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (n, 3)))


def _size(table: ParticleTable) -> int:
    return table.count or len(table.position or ())


def starting_particles(scene: Scene, walls: Bodies | None) -> Particles:
    """Return the particles of a scene in the order of its tables; counted ones are packed between the walls.

    Raises InputError where spins are given but nothing in the scene could change them.
    """
    packed = pack(scene, walls, np.random.default_rng(scene.seed))
    sizes = [_size(table) for table in scene.particles]
    position = []
    for table in scene.particles:
        rows = packed[: table.count] if table.count else np.array(table.position)
        packed = packed[table.count or 0 :]
        position.append(rows)
    columns = list(zip(scene.particles, sizes, strict=True))
    spin = np.concatenate([_rows(table.angular_velocity, n) for table, n in columns])
    if spin.any() and not scene.turns:
        raise InputError(
            "particles.angular_velocity: contact.friction is 0, so nothing turns in this scene; "
            "leave it out or add friction"
        )
    velocity = np.concatenate([_rows(table.velocity, n) for table, n in columns])
    return Particles(
        np.concatenate(position),
        velocity,
        np.repeat([table.diameter / 2.0 for table in scene.particles], sizes),
        np.repeat([1.0 / particle_mass(table) for table in scene.particles], sizes),
        np.arange(sum(sizes)),
        np.repeat(np.arange(len(sizes)), sizes),
        spin if scene.turns else None,
    )


def check_walls(scene: Scene, p: Particles, walls: Bodies | None) -> None:
    """Refuse particles whose centre is behind a wall, or that overlap it by more than the limit (InputError)."""
    if walls is None:
        return
    _, least = count_near_walls(p.position, p.radius, walls, 0.0)
    overlap = 1.0 - least / p.radius
    i = int(np.argmax(overlap))
    limit = min(scene.limits.max_overlap, 1.0)
    if overlap[i] > limit:
        distances = [wall_distance(walls, s, *p.position[i])[0] for s in range(len(walls.kind))]
        name = scene.walls[walls.body[int(np.argmin(distances))]].name
        raise InputError(
            f"particle {i} at {p.position[i].tolist()} m overlaps the wall {name!r} by {overlap[i]:.3g} radii "
            f"(limits.max_overlap {limit:g}); move it, or raise the limit"
        )


def check_pairs(scene: Scene, p: Particles, listed: Neighbors) -> None:
    """Refuse particles that overlap each other by more than limits.max_overlap (InputError)."""
    overlap, i, j = deepest_pair(p.position, p.radius, listed)
    if overlap > scene.limits.max_overlap:
        first, second = sorted((int(p.id[i]), int(p.id[j])))
        raise InputError(
            f"particles {first} and {second} overlap by {overlap:.3g} radii "
            f"(limits.max_overlap {scene.limits.max_overlap:g}); move them apart, or raise the limit"
        )
