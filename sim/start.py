"""The first moment: particles where the scene puts them, and what is refused there."""

from typing import NamedTuple

import numpy as np

from sim.errors import InputError
from sim.filling import numbers_of, region_of
from sim.kernel import Array, Indices
from sim.motion import Bodies
from sim.near_walls import count_near_walls
from sim.neighbors import Neighbors
from sim.overlap import deepest_pair
from sim.packing import pack
from sim.scene import Scene
from sim.sizes import drawn_diameters
from sim.state import Particles
from sim.surface import distance_to_wall


def _rows(value: object, n: int) -> Array:
    """Give every particle its vector: the one of all, or its own."""
    return np.array(np.broadcast_to(np.asarray(value, dtype=np.float64), (n, 3)))


class StartState(NamedTuple):
    """A moment of another run, particles in its scene's order."""

    position: Array  # (n, 3) m
    velocity: Array  # (n, 3) m/s
    angular_velocity: Array | None  # (n, 3) rad/s
    radius: Array  # (n,) m
    species: Indices  # (n,)


def starting_particles(scene: Scene, walls: Bodies | None, start: StartState | None = None) -> Particles:
    """Return the particles of a scene in the order of its tables; counted ones are packed between the walls.

    A `start` takes the place of the packing, and of the positions, velocities and spins of the tables. Raises
    InputError where spins are given but nothing in the scene could change them, or where `start` has other particles.
    """
    if scene.start is not None and start is None:
        raise InputError(
            f"start.run = {scene.start.run!r}: only `suffice simulate` reads runs; "
            "in Python, give Simulation(scene, start=StartState(...))"
        )
    if start is not None:
        check_start(scene, start)
        spin = start.angular_velocity if start.angular_velocity is not None else np.zeros_like(start.position)
        return _particles(scene, start.position, start.velocity, spin, start.radius, start.species)
    return _placed(scene, walls)


def _placed(scene: Scene, walls: Bodies | None) -> Particles:
    """Particles where the tables put them, and packed ones between the walls."""
    rng = np.random.default_rng(scene.seed)
    numbers = numbers_of(scene, walls)
    species = np.repeat(np.arange(len(numbers)), numbers)
    columns = list(zip(scene.particles, numbers, strict=True))
    radius = np.concatenate([drawn_diameters(table, n, rng) / 2.0 for table, n in columns])
    given = np.repeat([table.position is not None for table in scene.particles], numbers)
    position = np.empty((len(radius), 3))
    rows = [row for table in scene.particles for row in table.position or ()]
    position[given] = np.array(rows).reshape(-1, 3)
    if not given.all():
        stand = (position[given], radius[given])
        position[~given] = pack(region_of(scene, walls), walls, radius[~given], stand, rng)
    spin = np.concatenate([_rows(table.angular_velocity, n) for table, n in columns])
    if spin.any() and not scene.turns:
        raise InputError(
            "particles.angular_velocity: contact.friction is 0, so nothing turns in this scene; "
            "leave it out or add friction"
        )
    velocity = np.concatenate([_rows(table.velocity, n) for table, n in columns])
    return _particles(scene, position, velocity, spin, radius, species)


def _particles(
    scene: Scene, position: Array, velocity: Array, spin: Array, radius: Array, species: Indices
) -> Particles:
    density = np.array([table.density for table in scene.particles])[species]
    fixed = np.array([table.fixed for table in scene.particles])[species]
    return Particles(
        position.copy(),
        velocity.copy(),
        radius.copy(),
        np.where(fixed, 0.0, 1.0 / (density * (4.0 / 3.0) * np.pi * radius**3)),
        np.arange(len(radius)),
        species.copy(),
        spin.copy() if scene.turns else None,
        np.zeros((len(radius), 3), np.int64) if scene.periodic else None,
    )


def check_start(scene: Scene, start: StartState) -> None:
    """Refuse a start whose species are not as many, as numerous or as large as those of the scene (InputError)."""
    there = int(start.species.max()) + 1
    if there > len(scene.particles) or start.species.min() < 0:
        raise InputError(
            f"start.run: has {there} species and the scene {len(scene.particles)}; give as many [[particles]]"
        )
    for k, table in enumerate(scene.particles):
        radius = start.radius[start.species == k]
        if len(radius) != (len(radius) if table.number is None else table.number):
            raise InputError(
                f"particles.{k}: {table.number} particles, and start.run has {len(radius)}; give count = {len(radius)}"
            )
        low, high = table.smallest * (1.0 - 1e-6), table.largest * (1.0 + 1e-6)  # single precision may have stored them
        outside = radius[~((2.0 * radius >= low) & (2.0 * radius <= high))]
        if len(outside):
            raise InputError(
                f"particles.{k}.diameter = {table.diameter:g} m: start.run has a sphere of {2.0 * outside[0]:g} m; "
                "give the diameter, or the distribution, of the run"
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
        distances = [distance_to_wall(walls, s, *p.position[i])[0] for s in range(len(walls.kind))]
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


def thickest_skin(scene: Scene, diameter: float) -> float:
    """Return the skin (m) up to which a particle has one image of each other in reach, of a largest diameter (m).

    Raises InputError where a periodic box is shorter than two and a half diameters.
    """
    if scene.periodic is None:
        return np.inf
    period = np.array(scene.periodic.period)
    shortest = float(period[period > 0.0].min())
    if shortest < 2.5 * diameter:
        raise InputError(
            f"periodic: the box is {shortest:g} m long in {'xyz'[int(np.argmax(period == shortest))]}; it needs "
            f"{2.5 * diameter:g} m, two and a half of the largest diameters"
        )
    return 0.5 * shortest - diameter
