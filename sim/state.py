"""Particles as data: one array per quantity, one row per particle."""

from typing import NamedTuple

import numpy as np

from sim.kernel import Array, Indices

# columns of the rows that forces see: m, m/s, 1/kg, rad/s, 1/(kg m²)
X, Y, Z, RADIUS, VELOCITY_X, VELOCITY_Y, VELOCITY_Z, INVERSE_MASS, SPIN_X, SPIN_Y, SPIN_Z, INVERSE_INERTIA = range(12)


class Particles(NamedTuple):
    """State and properties of n spheres in the solver's own order (spatially sorted; `id` tells who is who)."""

    position: Array  # (n, 3) m
    velocity: Array  # (n, 3) m/s
    radius: Array  # (n,) m
    inverse_mass: Array  # (n,) 1/kg; 0 for a fixed particle
    id: Indices  # (n,) rank in the scene
    species: Indices  # (n,) index of the scene's `particles` table
    spin: Array | None  # (n, 3) rad/s; absent where nothing turns a particle
    image: Indices | None = None  # (n, 3) periods that a particle has travelled; absent where nothing repeats


class FluidFields(NamedTuple):
    """The fluid at the centres of its cells."""

    velocity: Array  # (z, y, x, 3) m/s
    pressure: Array  # (z, y, x) Pa, without its hydrostatic part
    void_fraction: Array  # (z, y, x)


class Snapshot(NamedTuple):
    """What a run shows of one moment, particles in the scene's order."""

    time: float  # s
    position: Array  # (n, 3) m
    velocity: Array  # (n, 3) m/s
    angular_velocity: Array | None  # (n, 3) rad/s
    series: dict[str, float]  # diagnostics of this moment by name: J, N, N m, W; overlaps in radii
    impacts: Array | None = None  # (2, bins) 1/s since the last one, of pairs and with walls, by energy
    fluid: FluidFields | None = None


def mass(particles: Particles) -> Array:
    """Mass of each particle that moves, 0 for a fixed one, shape (n,), kg."""
    free = particles.inverse_mass > 0.0
    return np.divide(1.0, particles.inverse_mass, out=np.zeros(len(free)), where=free)


def inertia(particles: Particles) -> Array:
    """Moment of inertia of each solid sphere, I = 2/5 m r², shape (n,), kg m² (paper eq. (2))."""
    return 0.4 * mass(particles) * particles.radius**2


def reordered(particles: Particles, order: Indices) -> Particles:
    """Return the same particles with row k taken from row order[k]."""
    p = particles
    spin = None if p.spin is None else p.spin[order]
    image = None if p.image is None else p.image[order]
    return Particles(
        p.position[order],
        p.velocity[order],
        p.radius[order],
        p.inverse_mass[order],
        p.id[order],
        p.species[order],
        spin,
        image,
    )


def wrap_(particles: Particles, seen: Array, lowest: Array, period: Array) -> None:
    """Bring particles (and what forces see of them) back into the periodic box, and count the periods travelled."""
    if particles.image is None:
        return
    for axis in np.flatnonzero(period):
        turns = np.floor((particles.position[:, axis] - lowest[axis]) / period[axis]).astype(np.int64)
        particles.position[:, axis] -= turns * period[axis]
        seen[:, X + axis] = particles.position[:, axis]
        particles.image[:, axis] += turns


def travelled(particles: Particles, period: Array) -> Array:
    """Return where particles would be had they not been brought back into the periodic box, shape (n, 3), m."""
    if particles.image is None:
        return particles.position
    return np.asarray(particles.position + particles.image * period)


def seen_by_forces(particles: Particles) -> Array:
    """Return what a force must know of each particle side by side, in one or two lines of the processor's cache.

    Columns X to INVERSE_MASS, and SPIN_X to INVERSE_INERTIA where particles turn: shape (n, 8) or (n, 12). While a run
    goes on, velocities here are those foreseen for the end of the step.
    """
    n = len(particles.radius)
    columns = [particles.position, particles.radius.reshape(n, 1)]
    columns += [particles.velocity, particles.inverse_mass.reshape(n, 1)]
    if particles.spin is not None:
        inverse_inertia = 2.5 * particles.inverse_mass / particles.radius**2
        columns += [particles.spin, inverse_inertia.reshape(n, 1)]
    return np.ascontiguousarray(np.hstack(columns))
