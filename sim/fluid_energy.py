"""Work done on the fluid, term by term, and what immersed bodies give to it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sim.grid import along, faces_of
from sim.kernel import Array

if TYPE_CHECKING:
    from sim.fluid import Fluid

# by immersed bodies; by viscosity and sliding sides; by what the flow carries along, numerical loss included; by the
# drag of particles; by the pressure gradient, that which is imposed included
TERMS = ("bodies", "friction", "convection", "particles", "pressure")
# A body that reaches a face gives it its own velocity at once: of its work Σ F u_w only Σ F u arrives. The rest is
# `lost_at_bodies`, as in a plastic impact.


class Exchange(NamedTuple):
    """What the particles do to the fluid within a step, in the cells (size,), margins filled."""

    void_fraction: Array  # at its end
    growth: Array  # 1/s, ∂ε/∂t over the step
    drag: Array  # kg/(m³ s), K
    push: Array  # (3, size) N/m³, K v and what is owed from before


def account_(fluid: Fluid, before: Array, dt: float, exchange: Exchange | None) -> None:
    """Add to `spent` the work of every term in a step (s) from velocities `before`, and to `given` what bodies gave.

    At the mean u of old and new velocity, ½ ρε (u'² − u²) is exactly the sum of the terms times u, but for what ε
    itself changed. What the other terms leave of the momentum that a covered face gained is the body's.
    """
    table, grid = fluid.table, fluid.grid
    share = dt * grid.volume
    work = np.zeros(len(TERMS))
    for a in range(3):
        now, then = faces_of(fluid.velocity[a], a, grid), faces_of(before[a], a, grid)
        porous = fluid.on_faces(fluid.void_fraction, a)
        rubbed, carried = faces_of(fluid.friction[a], a, grid), faces_of(fluid.carried[a], a, grid)
        pressed = -porous * (faces_of(fluid.gradient[a], a, grid) + table.pressure_gradient[a])
        dragged = np.zeros_like(now)
        if exchange is not None:
            dragged = fluid.on_faces(exchange.push[a], a) - fluid.on_faces(exchange.drag, a) * now
        held = np.zeros_like(now)
        if fluid.immersed is not None:
            covered = faces_of(fluid.immersed.part[a].sum(axis=0), a, grid) > 0.0
            gained = table.density * porous * (now - then) / dt
            held = np.where(covered, gained - carried - rubbed - pressed - dragged, 0.0)
            fluid.immersed.tally_(a, held, share, fluid.given)
        terms = np.stack([held, rubbed, carried, dragged, pressed])
        inside = (slice(None), *along(a, slice(None, -1) if grid.periodic[a] else slice(1, -1)))
        work += share * (0.5 * (now + then) * terms)[inside].sum(axis=(1, 2, 3))
    fluid.spent += work


def kinetic_energy(fluid: Fluid) -> float:
    """Σ ½ ρ ε u² V over the faces inside, J."""
    total = 0.0
    for a in range(3):
        inside = along(a, slice(None, -1) if fluid.grid.periodic[a] else slice(1, -1))
        speed = faces_of(fluid.velocity[a], a, fluid.grid)[inside]
        total += float((fluid.on_faces(fluid.void_fraction, a)[inside] * speed**2).sum())
    return 0.5 * fluid.table.density * fluid.grid.volume * total
