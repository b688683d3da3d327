"""What a scene may say: one table per physical term, checked with units before anything runs.

A table that is absent is absent from the program. All lengths in metres, times in seconds, masses in kilograms.
"""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, model_validator

from sim.errors import InputError

Vector = tuple[float, float, float]


def _of_each(value: object) -> str:
    """Tell whether a vector is given for each particle, or one for all of them."""
    return "each" if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple) else "all"


Vectors = Annotated[Annotated[list[Vector], Tag("each")] | Annotated[Vector, Tag("all")], Discriminator(_of_each)]


def quantity(unit: str, description: str, **limits: Any) -> Any:
    """Describe a number of a scene with its unit and limits."""
    return Field(description=description, json_schema_extra={"unit": unit}, **limits)


class Table(BaseModel):
    """A table of a scene: unknown keys are refused, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ParticleTable(Table):
    """Spheres of one species."""

    diameter: float = quantity("m", "diameter", gt=0.0)
    density: float = quantity("kg/m³", "density of the material", gt=0.0)
    count: int | None = quantity("", "how many are packed at random between the walls", default=None, gt=0)
    position: list[Vector] | None = quantity("m", "centres, instead of a count", default=None, min_length=1)
    velocity: Vectors = quantity("m/s", "of each, or of all", default=(0.0, 0.0, 0.0))
    angular_velocity: Vectors = quantity("rad/s", "of each, or of all", default=(0.0, 0.0, 0.0))

    @model_validator(mode="after")
    def _count_or_positions(self) -> "ParticleTable":
        if (self.count is None) == (self.position is None):
            raise ValueError("give either count or position")
        n = self.count or len(self.position or ())
        for name, value in (("velocity", self.velocity), ("angular_velocity", self.angular_velocity)):
            if isinstance(value, list) and len(value) != n:
                raise ValueError(f"{name} lists {len(value)} vectors for {n} particles; give one each, or a single one")
        return self


class Contact(Table):
    """Linear spring, dashpot and slider (paper eqs. (4), (5))."""

    stiffness: float = quantity("N/m", "normal spring", gt=0.0)
    restitution: float = quantity("", "ratio of normal speeds after and before a contact", ge=1e-3, le=1.0)
    friction: float = quantity(
        "", "Coulomb coefficient; 0: nothing turns, no tangential force", default=0.0, ge=0.0, le=10.0
    )
    tangential_stiffness_ratio: float = quantity("", "k_t / k", default=1.0, gt=0.0, le=10.0)
    tangential_damping_ratio: float = quantity("", "η_t / η", default=1.0, ge=0.0, le=10.0)


class Gravity(Table):
    """Weight of the particles."""

    acceleration: Vector = quantity("m/s²", "of free fall")


class Plane(Table):
    """Endless plane; particles are on the side that the normal points to."""

    shape: Literal["plane"]
    point: Vector = quantity("m", "any point of it", default=(0.0, 0.0, 0.0))
    normal: Vector = quantity("", "direction, of any length")


class Box(Table):
    """Box with edges along the axes.

    Particles inside of it are held by its faces, each an endless plane; outside of it by the box as a solid.
    """

    shape: Literal["box"]
    lowest: Vector = quantity("m", "corner")
    highest: Vector = quantity("m", "opposite corner")
    particles: Literal["inside", "outside"]
    open: list[Literal["-x", "+x", "-y", "+y", "-z", "+z"]] = quantity("", "faces left out (inside only)", default=[])


class Cylinder(Table):
    """Cylinder with flat ends, or an endless one without a length."""

    shape: Literal["cylinder"]
    centre: Vector = quantity("m", "middle of its axis", default=(0.0, 0.0, 0.0))
    axis: Vector = quantity("", "direction, of any length")
    radius: float = quantity("m", "radius", gt=0.0)
    length: float | None = quantity("m", "along the axis; absent: endless", default=None, gt=0.0)
    particles: Literal["inside", "outside"]
    copies: int = quantity("", "this many, at equal angles about the axis that the body rotates about", default=1, ge=1)


class Rotation(Table):
    """Steady turn about an axis."""

    kind: Literal["rotation"]
    axis: Vector = quantity("", "direction, of any length")
    point: Vector = quantity("m", "any point of the axis", default=(0.0, 0.0, 0.0))
    rpm: float = quantity("1/min", "revolutions per minute, counter-clockwise about the axis")


class Oscillation(Table):
    """Harmonic motion x(t) = amplitude sin(2π f t + phase), starting from where the shapes stand."""

    kind: Literal["oscillation"]
    amplitude: Vector = quantity("m", "largest displacement along each axis")
    frequency: float = quantity("Hz", "frequency", gt=0.0)
    phase: float = quantity("rad", "phase at time zero", default=0.0)


class Translation(Table):
    """Steady motion."""

    kind: Literal["translation"]
    velocity: Vector = quantity("m/s", "velocity")


class WallTable(Table):
    """Rigid body made of shapes; each shape that a particle overlaps acts on it."""

    name: str = quantity("", "how results call it: letters, digits, spaces, - and _", pattern=r"^[\w -]+$")
    shapes: list[Annotated[Plane | Box | Cylinder, Field(discriminator="shape")]] = Field(min_length=1)
    motion: Annotated[Rotation | Oscillation | Translation, Field(discriminator="kind")] | None = None


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
    walls: list[WallTable] = []
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
    def law_of_walls(self) -> Contact:
        """Constants of contacts with walls."""
        return self.wall_contact or self.contact

    @property
    def turns(self) -> bool:
        """Whether anything in the scene can turn a particle or is meant to spin."""
        return self.contact.friction > 0.0 or (bool(self.walls) and self.law_of_walls.friction > 0.0)


def _unit(model: type[BaseModel], path: tuple[int | str, ...]) -> str:
    """Return the unit of the field at a path of a refused scene, empty where it has none."""
    schema: Any = model.model_json_schema()
    definitions = schema.get("$defs", {})
    node: Any = schema
    unit = ""  # a component of a vector has that of the vector
    for key in path:
        options = [node, *node.get("anyOf", []), *node.get("oneOf", [])]
        options = [definitions[o["$ref"].split("/")[-1]] if "$ref" in o else o for o in options]
        options += [definitions[p["$ref"].split("/")[-1]] for o in options for p in o.get("oneOf", []) if "$ref" in p]
        step = next((o["items"] for o in options if isinstance(key, int) and "items" in o), None)
        step = step or next((o["properties"][key] for o in options if key in o.get("properties", {})), None)
        if step is None:
            continue
        node = definitions[step["$ref"].split("/")[-1]] if "$ref" in step else step
        unit = node.get("unit", unit)
    return unit


def _place(tables: Any, path: tuple[int | str, ...]) -> str:
    """Name a field as the scene writes it; pydantic's path also holds which kind of shape or motion it tried."""
    kept, node = [], tables
    for part in path:
        inside = part in node if isinstance(node, dict) else isinstance(node, list | tuple) and part in range(len(node))
        if inside:
            node = node[part]
        if inside or (part == path[-1] and part not in ("each", "all")):
            kept.append(str(part))
    return ".".join(kept)


def refusal(error: ValidationError, source: str, tables: Any) -> InputError:
    """Turn pydantic's findings on a scene's tables into one message with field, value, unit and what is wanted."""
    findings = error.errors(include_url=False, include_context=False)
    lines = []
    for found in findings[:5]:
        path = found["loc"]
        name = _place(tables, path)
        unit = _unit(Scene, path)
        value = found["input"]
        shown = f" = {value!r}" if isinstance(value, str | int | float | bool) else ""
        wanted = found["msg"].removeprefix("Value error, ")
        if found["type"] == "extra_forbidden":
            wanted = "unknown key; `suffice scenes mini_mill` shows what a scene may say"
        at_fault = f"{name}{shown}{' ' + unit if shown and unit else ''}"
        lines.append(f"{at_fault}: {wanted}" if at_fault else wanted)
    rest = f" (and {len(findings) - 5} more)" if len(findings) > 5 else ""
    return InputError(f"scene {source}: " + "; ".join(lines) + rest)


def parse_scene(text: str, source: str = "") -> Scene:
    """Read a scene from TOML text.

    Raises InputError with every field at fault, its value, unit and limit.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"scene {source}: not valid TOML: {error}") from None
    try:
        return Scene.model_validate(tables)
    except ValidationError as error:
        raise refusal(error, source, tables) from None


def built_in_scenes() -> dict[str, str]:
    """Names and TOML texts of the scenes that come with the program."""
    folder = resources.files("sim") / "scenes"
    return {Path(f.name).stem: f.read_text() for f in sorted(folder.iterdir(), key=str) if f.name.endswith(".toml")}


def scene_text(name_or_path: str) -> str:
    """TOML text of a built-in scene, or of a file.

    Raises InputError where it is neither, naming the built-in scenes.
    """
    built_in = built_in_scenes()
    if name_or_path in built_in:
        return built_in[name_or_path]
    try:
        return Path(name_or_path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"scene {name_or_path!r}: no such file or not a text ({error}); "
            f"give a TOML file or one of the built-in scenes: {', '.join(built_in)}"
        ) from None
