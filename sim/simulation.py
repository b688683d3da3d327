"""A run of particles: its state between two compiled calls."""

from math import sqrt
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.assembly import law_of, laws_of, laws_of_walls, walls_of
from sim.cells import cell_grid, sort_by_cell
from sim.collisions import BINS
from sim.diagnostics import diagnostics
from sim.energy import Ledger, kinetic_energy, pair_elastic_energy, rotational_energy, wall_elastic_energy
from sim.errors import LimitError
from sim.gravity import potential_energy
from sim.guards import Guards
from sim.kernel import Array, threads_for
from sim.near_walls import no_near_walls, rebuilt_near_walls
from sim.neighbors import empty_neighbors, rebuilt_neighbors
from sim.overlap import deepest_pair, deepest_wall
from sim.pairs import TALLY
from sim.scene import Scene
from sim.start import StartState, check_pairs, check_walls, starting_particles, thickest_skin
from sim.state import Snapshot, reordered, seen_by_forces, travelled, wrap_
from sim.surface import wall_speed
from sim.suspended import Suspended
from sim.timestep import snapshots_in, time_step
from sim.verlet import Step, Terms, advance, fill_forces
from sim.walls import BODY_TALLY

THINNEST_SKIN, FIRST_SKIN, THICKEST_SKIN = 0.01, 0.1, 0.4  # of the largest diameter
REBUILD_COST = 3.0  # see `Simulation.skin_for`


class Simulation:
    """State of a run between two compiled calls."""

    def __init__(self, scene: Scene, start: StartState | None = None) -> None:
        self.scene = scene
        self.dt, self.steps_per_snapshot = time_step(scene)
        self.snapshots = snapshots_in(scene)
        self.gravity = scene.gravity.acceleration if scene.gravity else None
        self.seconds = {"lists": 0.0}  # what parts of the run took; contact and motion are the rest
        self.guards, self.rebuilds = Guards(), 0  # lists of neighbours made after the first
        self.suspended: Suspended | None = None  # what a fluid does to the particles; see sim/coupled.py
        self.pair_law, self.pair_laws, self.wall_laws = law_of(scene.contact), laws_of(scene), laws_of_walls(scene)
        self.pairs_roll = True if scene.pairs_roll else None
        self.walls_roll = True if any(contact.rolling for contact in scene.contacts_with_walls) else None
        self.period = np.array(scene.periodic.period if scene.periodic else (0.0, 0.0, 0.0))
        self.walls = walls_of(scene)
        self.particles = starting_particles(scene, self.walls, start)
        check_walls(scene, self.particles, self.walls)
        n, turns = len(self.particles.radius), self.particles.spin is not None
        self.seen = seen_by_forces(self.particles)
        self.step = self.listed_step = 0
        self.listed = empty_neighbors(n, 1, self.period)
        self.spring = np.zeros((len(self.listed.partner), 6 if self.pairs_roll else 3)) if turns else None
        self.near = no_near_walls(n)
        self.wall_spring = np.zeros((0, 6 if self.walls_roll else 3)) if turns else None
        self.thickest_skin = thickest_skin(scene, 2.0 * float(self.particles.radius.max()))
        self.skin = min(FIRST_SKIN * 2.0 * float(self.particles.radius.max()), self.thickest_skin)
        chunks = len(self.listed.chunks) - 1
        self.tally = np.zeros((chunks, TALLY))
        self.body_tally = np.zeros((chunks, len(scene.walls), BODY_TALLY))
        self.reported = np.zeros((len(scene.walls), BODY_TALLY))
        counts = np.zeros((chunks, BINS)) if scene.output.impacts else None
        self.impacts, self.wall_impacts = counts, None if counts is None or not scene.walls else counts.copy()
        self.reported_impacts = None if counts is None else np.zeros((2, BINS))
        with threads_for(chunks):
            self.rebuild()
        check_pairs(scene, self.particles, self.listed)
        self._fill_starting_forces()

    def rebuild(self) -> None:
        """Sort the particles by space and list their neighbours anew.

        Raises LimitError where a position is not a number or a centre is beyond a wall.
        """
        began = perf_counter()
        self._rebuild()
        self.seconds["lists"] += perf_counter() - began

    def _rebuild(self) -> None:
        if not np.isfinite(self.particles.position.sum()):
            finite = np.isfinite(self.particles.position).all(axis=1)
            raise self._stopped(int(np.argmin(finite)), "position is not a number", "lower time.step")
        radius = self.particles.radius
        self._check_speed()
        lowest = np.array(self.scene.periodic.lowest) if self.scene.periodic else np.zeros(3)
        wrap_(self.particles, self.seen, lowest, self.period)
        grid = cell_grid(self.particles.position, 2.0 * float(radius.max()) + self.skin, lowest, self.period)
        order, start = sort_by_cell(self.particles.position, grid)
        self.particles, self.seen = reordered(self.particles, order), self.seen[order]
        if self.suspended is not None:
            self.suspended = Suspended(*(rows[order] for rows in self.suspended))
        p = self.particles
        position, radius = p.position, p.radius
        self.listed, self.spring = rebuilt_neighbors(
            position, radius, p.inverse_mass, order, start, grid, self.skin, self.listed, self.spring
        )
        rows = len(radius) + len(self.listed.receiver)
        self.wrench = np.zeros((rows, 6 if self.scene.turns else 3))
        self.listed_at = position.copy()
        self.listed_step = self.step
        self.wall_speed = 0.0
        if self.walls is not None:
            self.near, self.wall_spring, least = rebuilt_near_walls(
                position, radius, p.inverse_mass, self.walls, self.skin, order, self.near, self.wall_spring
            )
            self.wall_speed = wall_speed(self.walls, position)
            worst = int(np.argmin(least))
            if least[worst] < 0.0:
                depth = f"is {-least[worst]:.3g} m behind a wall"
                raise self._stopped(worst, depth, "raise wall stiffness or lower time.step")

    def advance_to(self, step: int) -> None:
        """Run to a step; stops with LimitError where an overlap passes the limit."""
        drifted = False
        with threads_for(len(self.listed.chunks) - 1):
            while self.step < step:
                done, drifted, closer = self._advance(step - self.step, drifted)
                self.step += done
                if drifted:
                    self.step += 1  # positions and walls already stand at the next step
                    self.skin = self.skin_for(closer / (self.step - self.listed_step))
                    self.rebuild()
                    self.rebuilds += 1
                    self.step -= 1
                self._check_overlap()

    def skin_for(self, closing: float) -> float:
        """Return the skin (m) that costs least where particles close up by `closing` (m) per step.

        A skin of s lengthens the list in proportion to s, and a list lasts s / closing steps: the cost
        a s + b closing / s is least at sqrt(b/a closing). With lengths in diameters sqrt(b/a) is REBUILD_COST.
        """
        diameter = 2.0 * float(self.particles.radius.max())
        best = REBUILD_COST * sqrt(closing / diameter) if closing >= 0.0 else 0.0
        return min(diameter * min(max(best, THINNEST_SKIN), THICKEST_SKIN), self.thickest_skin)

    def _advance(self, steps: int, drifted: bool) -> tuple[int, bool, float]:
        p = self.particles
        limit = self.scene.limits.max_overlap
        return advance(
            Step(self.step, self.listed_step, self.dt, self.skin, self.wall_speed, limit),
            steps,
            drifted,
            self.gravity,
            self.suspended,
            p.position,
            p.velocity,
            p.spin,
            self.seen,
            self.wrench,
            self.listed,
            self.listed_at,
            self.walls,
            self.tally,
            self._terms(),
        )

    def _terms(self) -> Terms:
        return (
            self.spring, self.pairs_roll, None if self.pair_laws is None else self.particles.species, self.pair_law,
            self.pair_laws, self.walls, self.near, self.wall_spring, self.walls_roll, self.wall_laws, self.tally,
            self.body_tally, self.impacts, self.wall_impacts,
        )  # fmt: skip

    def snapshot(self) -> Snapshot:
        """Return the present moment in the scene's order of particles."""
        p = self.particles
        back = np.argsort(p.id)
        spin = None if p.spin is None else p.spin[back]
        position = travelled(p, self.period)[back]
        return Snapshot(self.time, position, p.velocity[back], spin, self.series(), self._impact_rates())

    def _impact_rates(self) -> Array | None:
        """Return how many new contacts there were between particles and with walls since the last call, 1/s."""
        if self.impacts is None or self.reported_impacts is None:
            return None
        pairs = self.impacts.sum(axis=0)
        walls = np.zeros(BINS) if self.wall_impacts is None else self.wall_impacts.sum(axis=0)
        counts = np.stack([pairs, walls])
        new = counts - self.reported_impacts
        self.reported_impacts = counts
        return np.asarray(new / (self.dt * self.steps_per_snapshot))

    def fluid_state(self) -> dict[str, NDArray[Any]]:
        """Return what a fluid's next step depends on, by name: nothing in a dry run."""
        return {}

    def restore_fluid_(self, state: dict[str, NDArray[Any]]) -> None:
        """Put a fluid into a state that `fluid_state` returned."""

    def term_seconds(self) -> dict[str, float]:
        """Return what parts of the run have taken so far, s."""
        return dict(self.seconds)

    def fluid_arrays(self) -> list[Array]:
        """Return the arrays of a fluid: in a dry run there are none."""
        return []

    def steps_to_next_flow(self) -> int:
        """Return the steps that a step of the fluid spans now; in a dry run there is none."""
        return 1

    @property
    def time(self) -> float:
        """Time of the run, s."""
        return self.step * self.dt

    def ledger(self) -> tuple[Ledger, float, float]:
        """Return the energies (J), the mean number of contacts of a particle, and the largest overlap (radii)."""
        p = self.particles
        elastic, pairs, deepest = pair_elastic_energy(
            p.position, p.radius, p.species, self.listed, self.spring, self.pair_law, self.pair_laws
        )
        contacts = 2.0 * pairs
        if self.walls is not None:
            energy, touches, depth = wall_elastic_energy(
                p.position, p.radius, self.walls, self.near, self.wall_spring, self.wall_laws
            )
            elastic, contacts, deepest = elastic + energy, contacts + touches, max(deepest, depth)
        ledger = Ledger(
            kinetic_energy(p),
            rotational_energy(p),
            potential_energy(p, self.gravity, self.period),
            elastic,
            float(self.tally[:, 0].sum()),
            float(self.body_tally[:, :, 6].sum()),
        )
        return ledger, contacts / len(p.radius), deepest

    def series(self) -> dict[str, float]:
        """Return the diagnostics of this moment; torque and power are means since the last call."""
        ledger, coordination, overlap = self.ledger()
        series = {f"energy.{name}": value for name, value in ledger._asdict().items()}
        series |= {"energy.balance": ledger.balance, "coordination": coordination, "max_overlap": overlap}
        series |= diagnostics(self.scene, self.particles, self.listed, self.walls, self.near)
        totals = self.body_tally.sum(axis=0)
        elapsed = self.dt * self.steps_per_snapshot
        for table, given in zip(self.scene.walls, (totals - self.reported) / elapsed, strict=True):
            series |= {f"force.{table.name}.{axis}": given[k] for k, axis in enumerate("xyz")}
            series |= {f"torque.{table.name}.{axis}": given[3 + k] for k, axis in enumerate("xyz")}
            series[f"power.{table.name}"] = given[6]
        self.reported = totals
        return {name: float(value) for name, value in series.items()}

    def _fill_starting_forces(self) -> None:
        """Set the forces at time zero; over no time, so that nothing slips or is dissipated."""
        fill_forces(0.0, self.seen, self.wrench, self.listed, *self._terms())

    def _check_speed(self) -> None:
        """Stop where a particle is faster than the limit (LimitError)."""
        velocity = self.particles.velocity
        speed = np.sqrt(np.einsum("ij,ij->i", velocity, velocity))
        row = int(np.argmax(speed))
        limit = self.scene.limits.max_speed or 0.1 * float(self.particles.radius.min()) / self.dt
        self.guards.note_("speed", speed[row], limit, self.time)
        if speed[row] > limit:
            raise self._stopped(
                row,
                f"moves at {speed[row]:.4g} m/s (limits.max_speed {limit:.4g} m/s)",
                "lower time.step or what drives it, or raise the limit",
            )

    def _check_overlap(self) -> None:
        limit = self.scene.limits.max_overlap
        deepest = float(self.tally[:, 1].max())
        self.guards.note_("overlap", deepest, limit, self.time)
        if deepest <= limit:
            return
        p = self.particles
        overlap, row, other = deepest_pair(p.position, p.radius, self.listed)
        partner = f"particle {p.id[other]}"
        if self.walls is not None:
            depth, touching, body = deepest_wall(p.position, p.radius, self.walls, self.near)
            if depth > overlap:
                overlap, row, partner = depth, touching, f"the wall {self.scene.walls[body].name!r}"
        raise self._stopped(
            row,
            f"overlaps {partner} by {overlap:.3g} radii (limits.max_overlap {limit:g})",
            f"raise contact.stiffness to about {self._stiffness_for(overlap, limit):.2g} N/m, or the limit",
        )

    def _stiffness_for(self, overlap: float, limit: float) -> float:
        """Stiffness (N/m) at which the same impact stays within the limit, as overlap ∝ 1/sqrt(k), and a third more."""
        stiffest = max(contact.stiffness for contact in self.scene.all_contacts)
        return 1.33 * stiffest * (overlap / limit) ** 2

    def _stopped(self, row: int, what: str, remedy: str) -> LimitError:
        position: Array = self.particles.position[row]
        place = ", ".join(f"{x:.5g}" for x in position)
        return LimitError(
            f"particle {self.particles.id[row]} {what} at t = {self.time:.6g} s, position ({place}) m; {remedy}"
        )
