"""What a scene may say: one table per physical term; a table that is absent is absent from the program."""

from typing import Literal

from pydantic import Field, model_validator

from sim.flow import Drag, FluidTable
from sim.species import Contact, PairContact, ParticleTable
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
    impacts: bool = quantity("", "whether new contacts are counted by their energy", default=False)


class Limits(Table):
    """What stops a run."""

    max_overlap: float = quantity(
        "radii", "largest overlap of a contact; inf lifts the limit", default=0.1, gt=0.0, allow_inf_nan=True
    )
    max_speed: float | None = quantity(
        "m/s", "of a particle; absent: a tenth of the smallest radius in a step", default=None, gt=0.0
    )


class Periodic(Table):
    """Box that repeats: what leaves it on one side comes in on the other."""

    directions: list[Literal["x", "y", "z"]] = quantity("", "in which the box repeats", min_length=1)
    lowest: Vector = quantity("m", "corner; components in other directions do not matter")
    highest: Vector = quantity("m", "opposite corner")

    @model_validator(mode="after")
    def _has_room(self) -> "Periodic":
        for axis in self.directions:
            k = "xyz".index(axis)
            if not self.lowest[k] < self.highest[k]:
                raise ValueError(
                    f"highest = {list(self.highest)} m must exceed lowest = {list(self.lowest)} m in {axis}"
                )
        return self

    @property
    def period(self) -> Vector:
        """Length of the box in each direction, m; 0 where it does not repeat."""
        x, y, z = (
            high - low if axis in self.directions else 0.0
            for axis, low, high in zip("xyz", self.lowest, self.highest, strict=True)
        )
        return x, y, z


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

    particles: list[ParticleTable] = Field(default=[], description="absent in a flow of fluid alone")
    contact: Contact = Field(default=Contact(stiffness=1.0, restitution=1.0), description="between particles")
    time: Time
    output: Output
    limits: Limits = Limits()
    wall_contact: Contact | None = Field(default=None, description="contact with walls; absent: as between particles")
    pair_contact: list[PairContact] = Field(default=[])
    gravity: Gravity | None = None
    periodic: Periodic | None = None
    walls: list[WallTable] = Field(default=[])
    fluid: FluidTable | None = None
    drag: Drag | None = Field(default=None, description="absent: fluid and particles do not feel each other")
    filling: Filling | None = None
    start: Start | None = Field(default=None, description="absent: counted particles are packed at random")
    seed: int = quantity("", "of the random packing", default=0, ge=0)

    @model_validator(mode="after")
    def _has_particles_or_fluid(self) -> "Scene":
        if not self.particles and self.fluid is None:
            raise ValueError("particles: there are none, and no fluid either; give a table [[particles]] or [fluid]")
        if self.particles and "contact" not in self.model_fields_set:
            raise ValueError("contact: particles need the table [contact], with stiffness and restitution")
        if self.drag is not None and (self.fluid is None or not self.particles):
            raise ValueError("drag: needs a fluid and particles; leave out [drag], or give [fluid] and [[particles]]")
        return self

    @model_validator(mode="after")
    def _fluid_repeats_with_the_box(self) -> "Scene":
        if self.fluid is None:
            return self
        for k, (axis, repeats) in enumerate(zip("xyz", self.repeats, strict=True)):
            sides = [side for side in self.fluid.faces if side[1] == axis]
            if repeats and sides:
                raise ValueError(f"fluid.faces.{sides[0]}: the box repeats in {axis}; leave the face out")
            if repeats and self.periodic is not None:
                box = (self.periodic.lowest[k], self.periodic.highest[k])
                if box != (self.fluid.lowest[k], self.fluid.highest[k]):
                    raise ValueError(
                        f"fluid: from {self.fluid.lowest[k]} to {self.fluid.highest[k]} m in {axis}, where the box "
                        f"repeats from {box[0]} to {box[1]} m; give the fluid the same"
                    )
        return self

    @model_validator(mode="after")
    def _single_cells_stand_between_given_faces(self) -> "Scene":
        if self.fluid is None:
            return self
        for k, (axis, repeats) in enumerate(zip("xyz", self.repeats, strict=True)):
            missing = [side for side in (f"-{axis}", f"+{axis}") if side not in self.fluid.faces]
            if self.fluid.cells[k] == 1 and not repeats and missing:
                raise ValueError(
                    f"fluid.cells = {list(self.fluid.cells)}: one cell in {axis} cannot show the friction of the walls "
                    f"that {' and '.join(missing)} are unless told; where {axis} does not matter, give these faces "
                    f'kind = "slip" or let the box repeat there, else more cells'
                )
        return self

    @model_validator(mode="after")
    def _immersed_walls_have_a_fluid(self) -> "Scene":
        for k, wall in enumerate(self.walls):
            if wall.immersed and self.fluid is None:
                raise ValueError(f"walls.{k}.immersed = true: there is no fluid; give [fluid], or leave it out")
        return self

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
    def repeats(self) -> tuple[bool, bool, bool]:
        """Whether the box repeats along x, y, z."""
        directions = self.periodic.directions if self.periodic else []
        return "x" in directions, "y" in directions, "z" in directions

    @property
    def species(self) -> list[str]:
        """Names of the species, in the order of the tables."""
        return [table.name or f"species {k}" for k, table in enumerate(self.particles)]

    @property
    def contacts_with_walls(self) -> list[Contact]:
        """Constants of the contacts with each body: its own, those of walls in general, or those of particles."""
        return [wall.contact or self.wall_contact or self.contact for wall in self.walls]

    @property
    def turns(self) -> bool:
        """Whether anything in the scene can turn a particle or is meant to spin."""
        return any(contact.friction > 0.0 for contact in self.all_contacts)

    @property
    def all_contacts(self) -> list[Contact]:
        """Constants of every kind of contact in the scene."""
        return [self.contact, *self.pair_contact, *self.contacts_with_walls]

    @property
    def pairs_roll(self) -> bool:
        """Whether particles resist rolling over each other."""
        return any(contact.rolling is not None for contact in (self.contact, *self.pair_contact))

    @model_validator(mode="after")
    def _pair_contacts_name_species(self) -> "Scene":
        for k, table in enumerate(self.pair_contact):
            for name in table.between:
                if name not in self.species:
                    raise ValueError(
                        f"pair_contact.{k}.between names {name!r}; the species are {', '.join(map(repr, self.species))}"
                    )
        pairs = [sorted(table.between) for table in self.pair_contact]
        for k, pair in enumerate(pairs):
            if pair in pairs[:k]:
                raise ValueError(
                    f"pair_contact.{k}.between = {pair} is the pair of pair_contact.{pairs.index(pair)}; give it once"
                )
        return self
