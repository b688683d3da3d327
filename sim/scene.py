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
    seed: int = quantity("", "of the random packing", default=0, ge=0)

    @model_validator(mode="after")
    def _walls_have_their_own_names(self) -> "Scene":
        names = [wall.name for wall in self.walls]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise ValueError(f"walls.{k}.name = {name!r} is taken by walls.{names.index(name)}; give another")
        return self

    @property
    def contacts_with_walls(self) -> list[Contact]:
        """Constants of the contacts with each body: its own, those of walls in general, or those of particles."""
        return [wall.contact or self.wall_contact or self.contact for wall in self.walls]

    @property
    def turns(self) -> bool:
        """Whether anything in the scene can turn a particle or is meant to spin."""
        return any(contact.friction > 0.0 for contact in (self.contact, *self.contacts_with_walls))
