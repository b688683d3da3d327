"""The time step: how large each contact lets it be, and which one binds."""

from math import inf, pi, sqrt
from typing import NamedTuple

from sim.assembly import law_of, rolling_constants
from sim.errors import InputError
from sim.law import (
    FEWEST_STEPS_PER_CONTACT,
    NEARLY_ELASTIC,
    STEPS_PER_CONTACT,
    TANGENTIAL_COMPLIANCE,
    contact_time,
    tangential_time,
)
from sim.scene import Scene
from sim.species import Contact, ParticleTable

MOST_STEPS = 2.0**53  # in a snapshot interval: beyond, not every number of steps is one in double precision


class TimeLimit(NamedTuple):
    """The largest step that one term allows."""

    term: str
    largest: float  # s
    advised: float  # s
    stiffness: float  # N/m, of the normal spring


def particle_mass(table: ParticleTable) -> float:
    """Mass of the smallest sphere that a species can have, kg."""
    return sphere_mass(table, table.smallest)


def sphere_mass(table: ParticleTable, diameter: float) -> float:
    """Mass of a sphere of a species, of this diameter (m), kg."""
    return table.density * pi * diameter**3 / 6.0


def contact_limits(term: str, contact: Contact, reduced_mass: float) -> list[TimeLimit]:
    """Return the limits of the normal spring and dashpot and, with friction, of what acts in the contact plane."""
    normal = contact_time(contact.stiffness, contact.restitution, reduced_mass)
    fewest = FEWEST_STEPS_PER_CONTACT if contact.restitution >= NEARLY_ELASTIC else STEPS_PER_CONTACT
    limits = [TimeLimit(f"{term}, normal spring", normal / fewest, normal / STEPS_PER_CONTACT, contact.stiffness)]
    if not contact.attraction:
        damped = damped_limit(contact, reduced_mass)
        limits.append(TimeLimit(f"{term}, normal dashpot", damped, damped, contact.stiffness))
    if contact.friction > 0.0:
        tangential = tangential_time(contact.tangential_stiffness_ratio * contact.stiffness, reduced_mass)
        largest = tangential / FEWEST_STEPS_PER_CONTACT
        limits.append(TimeLimit(f"{term}, tangential spring", largest, largest, contact.stiffness))
        slowest = dashpot_limit(contact, reduced_mass)
        limits.append(TimeLimit(f"{term}, tangential dashpot", slowest, slowest, contact.stiffness))
    if contact.rolling is not None and contact.rolling.model == "elastic-plastic":
        rolls = rolling_limit(contact, reduced_mass)
        limits.append(TimeLimit(f"{term}, rolling spring", rolls, rolls, contact.stiffness))
    return limits


def damped_limit(contact: Contact, reduced_mass: float) -> float:
    """Return the step (s) up to which the normal dashpot is resolved, 0.4 m*/η: it may be overdamped."""
    damping = law_of(contact).damping * sqrt(reduced_mass)
    return 0.4 * reduced_mass / damping if damping > 0.0 else inf


def rolling_limit(contact: Contact, reduced_mass: float) -> float:
    """Return a twentieth of half a period of the rolling spring (s), π sqrt(I*/k_r), of a sphere on a wall.

    I* = 2/5 m r² and k_r = 2.25 k μ_r² r²; between two equal spheres the period is longer.
    """
    friction, stiffness, _ = rolling_constants(contact)
    return pi * sqrt(0.4 * reduced_mass / stiffness) / FEWEST_STEPS_PER_CONTACT if friction else inf


def dashpot_limit(contact: Contact, reduced_mass: float) -> float:
    """Return the step (s) up to which the tangential dashpot, which lags by half a step, is stable: m* / (7 η_t)."""
    tangential = law_of(contact).tangential_damping * sqrt(reduced_mass)
    return 0.5 * reduced_mass / (TANGENTIAL_COMPLIANCE * tangential) if tangential > 0.0 else inf


def time_limits(scene: Scene) -> list[TimeLimit]:
    """Return what every term of a scene allows; the lightest particles bind."""
    lightest = min(particle_mass(table) for table in scene.particles)
    limits = []
    alone = [table.number for table in scene.particles] == [1]
    if not alone or not scene.walls:
        limits += contact_limits("contact between particles", scene.contact, lightest / 2.0)
    limits += pair_limits(scene)
    limits += wall_limits(scene, lightest)
    return limits


def pair_limits(scene: Scene) -> list[TimeLimit]:
    """Return the limits of the pairs of species that have their own constants."""
    limits = []
    lightest = dict(zip(scene.species, map(particle_mass, scene.particles), strict=True))
    for table in scene.pair_contact:
        a, b = table.between
        reduced_mass = 1.0 / (1.0 / lightest[a] + 1.0 / lightest[b])
        limits += contact_limits(f"contact of {a!r} with {b!r}", table, reduced_mass)
    return limits


def wall_limits(scene: Scene, lightest: float) -> list[TimeLimit]:
    """Return the limits of the contacts with walls in general, and with each body that has its own."""
    limits = []
    if any(wall.contact is None for wall in scene.walls):
        limits += contact_limits("contact with walls", scene.wall_contact or scene.contact, lightest)
    for wall in scene.walls:
        if wall.contact is not None:
            limits += contact_limits(f"contact with the wall {wall.name!r}", wall.contact, lightest)
    return limits


def time_step(scene: Scene) -> tuple[float, int]:
    """Return the time step (s) and how many of them make a snapshot interval.

    The step asked for, or the smallest advised one, shortened so that snapshots fall on whole steps.
    Raises InputError where the step asked for exceeds a limit.
    """
    limits = time_limits(scene)
    wanted = scene.time.step or min(limit.advised for limit in limits)
    binding = min(limits, key=lambda limit: limit.largest)
    if wanted > binding.largest * (1.0 + 1e-6):  # a step meant to be the limit passes in spite of rounding
        raise InputError(
            f"time.step = {wanted:g} s: above the limit of {binding.largest:.3g} s set by the {binding.term} "
            f"(stiffness {binding.stiffness:g} N/m); lower the step, or leave it out for {_advice(limits):.3g} s"
        )
    if not scene.output.interval < MOST_STEPS * wanted:
        raise InputError(
            f"output.interval = {scene.output.interval:g} s: more than {MOST_STEPS:.2g} steps of {wanted:.3g} s, which "
            "nobody can count; soften the contact, take larger particles, or lower the interval"
        )
    per_snapshot = steps_between(scene.output.interval, wanted)
    return scene.output.interval / per_snapshot, per_snapshot


def _advice(limits: list[TimeLimit]) -> float:
    return min((limit.advised for limit in limits), default=inf)


def steps_between(interval: float, step: float) -> int:
    """Return the fewest steps no longer than `step` that make up the interval."""
    whole = round(interval / step)
    if whole and abs(interval / step - whole) < 1e-9 * whole:
        return whole
    return int(interval / step) + 1


def snapshots_in(scene: Scene) -> int:
    """Return how many snapshots a run writes, the one at time zero included."""
    intervals = scene.time.duration / scene.output.interval
    if intervals < 1.0 - 1e-9:
        raise InputError(
            f"output.interval = {scene.output.interval:g} s: longer than time.duration = {scene.time.duration:g} s; "
            "a run needs two snapshots at least"
        )
    if abs(intervals - round(intervals)) > 1e-6 * intervals:
        whole = int(intervals) * scene.output.interval
        raise InputError(
            f"time.duration = {scene.time.duration:g} s: not a multiple of output.interval = {scene.output.interval:g} "
            f"s, so its end would be lost; use {whole:g} or {whole + scene.output.interval:g} s"
        )
    return round(intervals) + 1
