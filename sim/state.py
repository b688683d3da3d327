"""Particles as data: one array per quantity, one row per particle."""

from typing import NamedTuple

from sim.kernel import Array, Indices


class Particles(NamedTuple):
    """State and properties of n spheres in the solver's own order (spatially sorted; `id` tells who is who)."""

    position: Array  # (n, 3) m
    velocity: Array  # (n, 3) m/s
    radius: Array  # (n,) m
    inverse_mass: Array  # (n,) 1/kg
    id: Indices  # (n,) rank in the scene
    species: Indices  # (n,) index of the scene's `particles` table
    spin: Array | None  # (n, 3) rad/s; absent where nothing turns a particle
    coming: Array  # (n, 3) m/s, velocity foreseen for the end of the step
    coming_spin: Array | None  # (n, 3) rad/s


class Snapshot(NamedTuple):
    """What a run shows of one moment, particles in the scene's order."""

    time: float  # s
    position: Array  # (n, 3) m
    velocity: Array  # (n, 3) m/s
    angular_velocity: Array | None  # (n, 3) rad/s
    series: dict[str, float]  # diagnostics of this moment by name: J, N, N m, W; overlaps in radii
    impacts: Array | None = None  # (2, bins) 1/s since the last one, of pairs and with walls, by energy


def mass(particles: Particles) -> Array:
    """Mass of each particle, shape (n,), kg."""
    return 1.0 / particles.inverse_mass


def inertia(particles: Particles) -> Array:
    """Moment of inertia of each solid sphere, I = 2/5 m r², shape (n,), kg m² (paper eq. (2))."""
    return 0.4 * mass(particles) * particles.radius**2


def reordered(particles: Particles, order: Indices) -> Particles:
    """Return the same particles with row k taken from row order[k]."""
    spin, coming_spin = particles.spin, particles.coming_spin
    return Particles(
        particles.position[order],
        particles.velocity[order],
        particles.radius[order],
        particles.inverse_mass[order],
        particles.id[order],
        particles.species[order],
        None if spin is None else spin[order],
        particles.coming[order],
        None if coming_spin is None else coming_spin[order],
    )
