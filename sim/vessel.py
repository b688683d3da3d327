"""What holds the particles: rigid bodies made of shapes, each with its own motion."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from sim.species import Contact
from sim.table import Table, Vector, quantity


class Shape(Table):
    """Solid, or the hollow of one."""

    particles: Literal["inside", "outside"] | None = quantity(
        "", "which side they are on; given for every wall, but not for the members of a combination", default=None
    )


class Plane(Table):
    """Endless plane; particles are on the side that the normal points to. In a combination: all that is behind it."""

    shape: Literal["plane"]
    point: Vector = quantity("m", "any point of it", default=(0.0, 0.0, 0.0))
    normal: Vector = quantity("", "direction, of any length")


class Box(Shape):
    """Box with edges along the axes.

    Particles inside of it are held by its faces, each an endless plane; outside of it by the box as a solid.
    """

    shape: Literal["box"]
    lowest: Vector = quantity("m", "corner")
    highest: Vector = quantity("m", "opposite corner")
    open: list[Literal["-x", "+x", "-y", "+y", "-z", "+z"]] = quantity("", "faces left out (inside only)", default=[])


class Cylinder(Shape):
    """Cylinder with flat ends, or an endless one without a length.

    With an end left open, its side and the other end are thin walls, which also hold what comes from without.
    """

    shape: Literal["cylinder"]
    centre: Vector = quantity("m", "middle of its axis", default=(0.0, 0.0, 0.0))
    axis: Vector = quantity("", "direction, of any length")
    radius: float = quantity("m", "radius", gt=0.0)
    length: float | None = quantity("m", "along the axis; absent: endless", default=None, gt=0.0)
    open: list[Literal["-", "+"]] = quantity("", "ends left out, + where the axis points to (inside only)", default=[])
    copies: int = quantity("", "this many, at equal angles about the axis that the body rotates about", default=1, ge=1)


class Cone(Shape):
    """Cone, pointed or truncated, with flat ends; with open ends a hopper of thin walls."""

    shape: Literal["cone"]
    centre: Vector = quantity("m", "middle of its axis", default=(0.0, 0.0, 0.0))
    axis: Vector = quantity("", "direction, of any length")
    radii: tuple[float, float] = quantity("m", "at the end that the axis comes from, and at the one it points to")
    length: float = quantity("m", "along the axis", gt=0.0)
    open: list[Literal["-", "+"]] = quantity("", "ends left out, + where the axis points to (inside only)", default=[])


class Sphere(Shape):
    """Sphere."""

    shape: Literal["sphere"]
    centre: Vector = quantity("m", "centre", default=(0.0, 0.0, 0.0))
    radius: float = quantity("m", "radius", gt=0.0)


class Capsule(Shape):
    """Cylinder with half spheres at both ends."""

    shape: Literal["capsule"]
    centre: Vector = quantity("m", "middle of its axis", default=(0.0, 0.0, 0.0))
    axis: Vector = quantity("", "direction, of any length")
    radius: float = quantity("m", "radius", gt=0.0)
    length: float = quantity("m", "of the cylinder, without the half spheres", gt=0.0)


class Torus(Shape):
    """Ring of circular section."""

    shape: Literal["torus"]
    centre: Vector = quantity("m", "centre", default=(0.0, 0.0, 0.0))
    axis: Vector = quantity("", "direction, of any length")
    radius: float = quantity("m", "of the circle in the middle of the ring", gt=0.0)
    tube_radius: float = quantity("m", "of the section", gt=0.0)


class Mesh(Shape):
    """Closed surface of triangles from an STL file."""

    shape: Literal["mesh"]
    file: str = quantity("", "path of the STL file, from the working directory or a full one", min_length=1)
    scale: float = quantity("", "metres per unit of the file", default=1.0, gt=0.0)
    resolution: float | None = quantity(
        "m", "between nodes of its distance; absent: an eighth of the smallest diameter", default=None, gt=0.0
    )


class Combination(Shape):
    """One solid made of several: `difference` is the first less all others."""

    shape: Literal["combination"]
    operation: Literal["union", "intersection", "difference"]
    of: list["Member"] = quantity("", "shapes, combinations among them", min_length=2)


Solid = Box | Cylinder | Cone | Sphere | Capsule | Torus | Mesh | Combination
AnyShape = Plane | Solid


def _as_member(shape: AnyShape) -> AnyShape:
    if isinstance(shape, Shape) and shape.particles is not None:
        raise ValueError("particles: a member of a combination has no side; leave it out here")
    if isinstance(shape, Box | Cylinder | Cone) and shape.open:
        raise ValueError("open: a member of a combination is solid; leave it out here")
    return shape


def _as_wall(shape: AnyShape) -> AnyShape:
    if isinstance(shape, Shape) and shape.particles is None:
        raise ValueError('particles: missing; give "inside" or "outside"')
    if isinstance(shape, Box | Cylinder | Cone) and shape.open and shape.particles == "outside":
        raise ValueError('open: a solid has no open faces; leave it out, or give particles = "inside"')
    if isinstance(shape, Cylinder) and shape.open and shape.length is None:
        raise ValueError("open: an endless cylinder has no ends; give a length")
    return shape


Member = Annotated[AnyShape, Field(discriminator="shape"), AfterValidator(_as_member)]
Wall = Annotated[AnyShape, Field(discriminator="shape"), AfterValidator(_as_wall)]
Combination.model_rebuild()


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
    shapes: list[Wall] = Field(min_length=1)
    motion: Annotated[Rotation | Oscillation | Translation, Field(discriminator="kind")] | None = None
    contact: Contact | None = Field(default=None, description="with this body; absent: as with walls in general")
    immersed: bool = quantity("", "whether the fluid feels the body, too", default=False)
