"""What a scene may say: one table per physical term; a table that is absent is absent from the program."""

from typing import Literal

from pydantic import Field, model_validator

from sim.species import Contact, ParticleTable
from sim.table import Table, Vector, quantity
from sim.vessel import WallTable


class Gravity(Table):
    """Weight of the particles."""

    acceleration: Vector = quantity("m/s²", "of free fall")


class Time(Table):
    """How long, and in which steps."""

    duration: float = quantity("s", "end of the run", gt=0.0)
    step: float | None = quantity("s", "time step; absent: a fiftieth of the shortest contact", default=None, gt=0.0)


class Output(Table):
    """What is kept."""

    interval: float = quantity("s", "between snapshots", gt=0.0)
    precision: Literal["single", "double"] = "single"


class Limits(Table):
    """What stops a run."""

    max_overlap: float = quantity(
        "radii", "largest overlap of a contact; inf lifts the limit", default=0.1, gt=0.0, allow_inf_nan=True
    )


class Filling(Table):
    """Box in which counted particles are placed; absent: the bounds of the walls."""

    lowest: Vector = quantity("m", "corner")
    highest: Vector = quantity("m", "opposite corner")

    @model_validator(mode="after")
    def _has_room(self) -> "Filling":
        if not all(low < high for low, high in zip(self.lowest, self.highest, strict=True)):
            raise ValueError(
                f"highest = {list(self.highest)} m must exceed lowest = {list(self.lowest)} m in every direction"
            )
        return self


class Start(Table):
    """Snapshot of another run that this one starts from: positions, velocities and spins, at a time zero of its own."""

    run: str = quantity("", "file of the run, beside the scene or by its whole path", min_length=1)
    time: float | None = quantity("s", "of the snapshot; absent: the last", default=None, ge=0.0)


class Scene(Table):
    """A granular flow, complete."""

    particles: list[ParticleTable] = Field(min_length=1)
    contact: Contact
    time: Time
    output: Output
    limits: Limits = Limits()
    wall_contact: Contact | None = Field(default=None, description="contact with walls; absent: as between particles")
    gravity: Gravity | None = None
    walls: list[WallTable] = Field(default=[])
    filling: Filling | None = None
    start: Start | None = Field(default=None, description="absent: counted particles are packed at random")
    seed: int = quantity("", "of the random packing", default=0, ge=0)

    @model_validator(mode="after")
    def _walls_have_their_own_names(self) -> "Scene":
        names = [wall.name for wall in self.walls]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise ValueError(f"walls.{k}.name = {name!r} is taken by walls.{names.index(name)}; give another")
        return self

    @model_validator(mode="after")
    def _species_have_their_own_names(self) -> "Scene":
        names = self.species
        for k, name in enumerate(names):
            if name in names[:k]:
                raise ValueError(
                    f"particles.{k}.name = {name!r} is taken by particles.{names.index(name)}; give another"
                )
        return self

    @property
    def species(self) -> list[str]:
        """Names of the species, in the order of the tables."""
        return [table.name or f"species {k}" for k, table in enumerate(self.particles)]

    @property
    def law_of_walls(self) -> Contact:
        """Constants of contacts with walls."""
        return self.wall_contact or self.contact

    @property
    def turns(self) -> bool:
        """Whether anything in the scene can turn a particle or is meant to spin."""
        return self.contact.friction > 0.0 or (bool(self.walls) and self.law_of_walls.friction > 0.0)
