"""Eulerian fields of a run: what particles and fluid are in the cells of the fluid's grid.

Everything is an amount per volume of the cell: a cell without particles holds no solid momentum, and nobody has to say
how fast the solid moves there. Such amounts add up over cells, and their averages over time are those of what is
conserved. Solid velocity and granular temperature are ratios of averages, taken last.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sim import Scene, parse_scene
from sim.assembly import walls_of
from sim.exchange import cloud_of, spread_
from sim.flow import Drag
from sim.grid import cells_of, grid_of
from sim.immersed import Immersed
from sim.motion import move_bodies
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.run import Run

Array = NDArray[np.float64]

NEEDED = ("position", "velocity", "fluid.velocity", "fluid.pressure")


class Densities(NamedTuple):
    """Amounts per volume of a cell, of one snapshot or averaged over some."""

    solid: Array  # (z, y, x) φ = Σ V_p w / V_cell
    solid_flux: Array  # (z, y, x, 3) m/s, j = Σ V_p w v / V_cell
    solid_square: Array  # (z, y, x) m²/s², Σ V_p w |v|² / V_cell
    void_fraction: Array  # (z, y, x) ε, as the solver had it
    fluid_flux: Array  # (z, y, x, 3) m/s, (1 − α) ε u, α the share behind immersed walls
    pressure: Array  # (z, y, x) Pa, (1 − α) (p − p̄), p̄ the mean over the volume before the walls

    @property
    def agitation(self) -> Array:
        """φ T = (Σ V_p w |v|² / V_cell − |j|²/φ) / 3, (z, y, x) in m²/s²: what differs from the mean velocity.

        Of averages over snapshots, T counts all that differs from the averaged velocity.
        """
        held = np.where(self.solid > 0.0, self.solid, 1.0)
        noise = (self.solid_square - (self.solid_flux**2).sum(axis=-1) / held) / 3.0
        return np.asarray(np.where(self.solid > 0.0, np.maximum(noise, 0.0), 0.0))

    @property
    def solid_velocity(self) -> Array:
        """Mean velocity j/φ of the particles by volume, (z, y, x, 3) in m/s; NaN where there are none."""
        return self.solid_flux / np.where(self.solid > 0.0, self.solid, np.nan)[..., None]

    @property
    def granular_temperature(self) -> Array:
        """T, a third of the variance of the particles' velocity, (z, y, x) in m²/s²; NaN where there are none."""
        return np.asarray(self.agitation / np.where(self.solid > 0.0, self.solid, np.nan))

    def scaled(self, factor: float) -> Self:
        """Multiply everything by a factor."""
        return type(self)(*(factor * field for field in self))

    def plus(self, other: Self) -> Self:
        """Add other amounts to these."""
        return type(self)(*(a + b for a, b in zip(self, other, strict=True)))


def scene_of(run: Run) -> Scene:
    """Return the scene that made a run. Raises `Refusal` for a run that does not say, as imported ones."""
    text = run.provenance.get("scene")
    if text is None:
        raise Refusal(f"{run.path} does not say which scene made it; use a run of `suffice simulate`")
    return parse_scene(text, str(run.path))


class Eulerian:
    """The densities of the snapshots of a run with a fluid, by the solver's own kernel.

    Raises `Refusal` where the run has no fluid, lacks a variable or does not say its scene.
    """

    def __init__(self, run: Run) -> None:
        missing = [name for name in NEEDED if name not in run.quantities]
        if missing:
            raise Refusal(f"{run.path} has no {', '.join(missing)}; fields on a grid need particles in a fluid")
        self.run, self.scene = run, scene_of(run)
        if self.scene.fluid is None:
            raise Refusal(f"{run.path}: its scene has no fluid, so there is no grid; give a scene with a table [fluid]")
        self.grid = grid_of(self.scene.fluid, self.scene.repeats)
        self._check_grid(run.grid)
        self.volume = 4.0 / 3.0 * np.pi * np.asarray(run.radius, np.float64) ** 3  # m³
        drag = self.scene.drag or Drag()
        self.half_width = 2.0 * drag.kernel * float(np.max(run.radius))  # m
        self.walls = walls_of(self.scene)
        shown = [wall.immersed for wall in self.scene.walls]
        self.immersed = Immersed(self.walls, shown, self.grid) if self.walls is not None and any(shown) else None

    def _check_grid(self, found: Grid | None) -> None:
        if found is None or found.shape != self.grid.cells[::-1]:
            raise Refusal(f"{self.run.path}: its cells are not those of its scene; make it again")

    def at(self, k: int) -> Densities:
        """Return the densities of snapshot k."""
        snapshot = self.run.snapshot(k)
        value = {name: np.asarray(rows, np.float64) for name, rows in snapshot.values.items()}
        share = self._share(snapshot.time)
        amounts = self.spread(value["position"], value["velocity"], share)
        solid, flux, square = amounts[..., 0], amounts[..., 1:4], amounts[..., 4]
        void = value.get("fluid.void_fraction", 1.0 - solid)
        open_share = np.ones(void.shape) if share is None else 1.0 - cells_of(share, self.grid)
        fluid_flux = (open_share * void)[..., None] * value["fluid.velocity"]
        level = float((open_share * value["fluid.pressure"]).sum() / open_share.sum())
        return Densities(solid, flux, square, void, fluid_flux, open_share * (value["fluid.pressure"] - level))

    def spread(self, position: Array, velocity: Array, share: Array | None = None) -> Array:
        """Spread volume, volume times velocity and times its square over the cells, (z, y, x, 5) per volume of cell.

        position, velocity: (n, 3) in m and m/s; share: (size,) of every cell behind immersed walls, None for no walls.
        """
        square = (velocity**2).sum(axis=1)
        amount = self.volume[:, None] * np.column_stack([np.ones(len(square)), velocity, square])
        field = np.zeros((amount.shape[1], self.grid.size))
        cloud = cloud_of(self.grid, self.half_width, None if share is None else 1.0 - share)
        spread_(cloud, position, amount, field)
        return np.stack([cells_of(rows, self.grid) for rows in field], axis=-1) / self.grid.volume

    def _share(self, time: float) -> Array | None:
        """Share of every cell (size,) that lies behind immersed walls, where these stand at a time (s)."""
        if self.immersed is None or self.walls is None:
            return None
        if self.immersed.moves:
            move_bodies(self.walls, time)
            self.immersed.update_()
        share: Array = self.immersed.share[3]
        return share
