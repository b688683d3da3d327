"""How fast particles may meet, how deep they overlap then, and which stiffness would keep that small."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from sim.filling import Region
from sim.kernel import Array
from sim.motion import FIXED, Bodies
from sim.near_walls import count_near_walls
from sim.scene import Scene
from sim.state import Particles
from sim.surface import wall_speed
from sim.timestep import sphere_mass

SMALL_OVERLAP = 0.02  # diameters, of an impact at the expected speed
SAMPLES_PER_EDGE = 48


class ExpectedSpeed(NamedTuple):
    """A speed that particles may meet at, and where it comes from."""

    speed: float  # m/s
    source: str


def expected_speeds(
    scene: Scene, particles: Particles, walls: Bodies | None, region: Region | None
) -> list[ExpectedSpeed]:
    """Return those of the start, of a free fall through the region, and of every moving wall that are not zero."""
    found = [ExpectedSpeed(float(np.linalg.norm(particles.velocity, axis=1).max()), "velocity at the start")]
    if scene.gravity is not None:
        g = np.array(scene.gravity.acceleration)
        length = float(np.linalg.norm(g))
        low, high = particles.position.min(axis=0), particles.position.max(axis=0)
        if region is not None:
            low, high = np.minimum(low, region.lowest), np.maximum(high, region.highest)
        # 2 g·h of the box along the acceleration
        fall = sqrt(2.0 * float(np.abs(g) @ (high - low)))
        found.append(
            ExpectedSpeed(fall, f"free fall through {fall**2 / (2.0 * length):.3g} m" if length else "no fall")
        )
    if walls is not None and region is not None:
        for b, table in enumerate(scene.walls):
            if walls.motion[b] != FIXED:
                found.append(ExpectedSpeed(surface_speed(walls, b, region), f"surface of the wall {table.name!r}"))
    return [one for one in found if one.speed > 0.0]


def surface_speed(walls: Bodies, body: int, region: Region) -> float:
    """Largest speed (m/s) of the surface of a body within a region, to the width of a 48th of its longest edge."""
    extent = region.highest - region.lowest
    edge = float(extent.max()) / SAMPLES_PER_EDGE
    axes = [
        np.linspace(a, b, max(2, round((b - a) / edge) + 1)) for a, b in zip(region.lowest, region.highest, strict=True)
    ]
    points: Array = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    mine = walls.body == body
    alone = walls._replace(
        kind=walls.kind[mine], parameter=walls.parameter[mine], side=walls.side[mine], body=walls.body[mine],
        motion=np.where(np.arange(len(walls.motion)) == body, walls.motion, FIXED),
    )  # fmt: skip
    _, distance = count_near_walls(points, np.zeros(len(points)), alone, 0.0)
    surface = points[np.abs(distance) < edge]
    return wall_speed(alone, surface if len(surface) else points)


def overlaps_at(scene: Scene, speed: float) -> dict[str, float]:
    """Overlap in diameters of the largest sphere at a speed (m/s), δ = v sqrt(m*/k), with its like and with a wall."""
    deep = {}
    for name, stiffness, share in _contacts(scene):
        deep[name] = max(
            speed * sqrt(share * sphere_mass(table, table.largest) / stiffness) / table.largest
            for table in scene.particles
        )
    return deep


def stiffness_for(scene: Scene, speed: float, overlap: float = SMALL_OVERLAP) -> dict[str, float]:
    """Stiffness (N/m) at which an impact at a speed (m/s) overlaps by so many diameters, k = m* (v / δ)²."""
    deep = overlaps_at(scene, speed)
    return {name: stiffness * (deep[name] / overlap) ** 2 for name, stiffness, _ in _contacts(scene)}


def _contacts(scene: Scene) -> list[tuple[str, float, float]]:
    """Name, least stiffness (N/m) and m*/m of each kind of contact."""
    kinds = [("contact", min(c.stiffness for c in (scene.contact, *scene.pair_contact)), 0.5)]
    if scene.walls:
        kinds.append(("wall_contact", min(c.stiffness for c in scene.contacts_with_walls), 1.0))
    return kinds
