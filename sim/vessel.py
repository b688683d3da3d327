"""What holds the particles: rigid bodies made of shapes, each with its own motion."""

from typing import Annotated, Literal

from pydantic import Field

from sim.table import Table, Vector, quantity


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
