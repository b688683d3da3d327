"""What a scene may say of the fluid, and of how it and the particles act on each other."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim.table import Table, Vector, quantity

Side = Literal["-x", "+x", "-y", "+y", "-z", "+z"]
SIDES: tuple[Side, ...] = ("-x", "+x", "-y", "+y", "-z", "+z")


class NoSlip(Table):
    """Wall that the fluid sticks to."""

    kind: Literal["wall"]
    velocity: Vector = quantity("m/s", "at which the wall slides in its own plane", default=(0.0, 0.0, 0.0))


class FreeSlip(Table):
    """Wall, or plane of symmetry, without friction."""

    kind: Literal["slip"]


class Inflow(Table):
    """Fluid that enters at a given speed; where a region is given, the rest of the face is a wall."""

    kind: Literal["inflow"]
    speed: float = quantity("m/s", "into the box as clear fluid (between particles faster), mean over the face", ge=0.0)
    profile: Literal["uniform", "parabolic"] = Field(default="uniform", description="over the face or its region")
    start_speed: float = quantity("m/s", "at time zero, where it is ramped", default=0.0, ge=0.0)
    ramp: float = quantity("s", "from the start speed to the speed; 0: at once", default=0.0, ge=0.0)
    lowest: Vector | None = quantity(
        "m", "corner of the region; the component across the face counts not", default=None
    )
    highest: Vector | None = quantity("m", "opposite corner", default=None)

    @model_validator(mode="after")
    def _whole_region(self) -> "Inflow":
        if (self.lowest is None) != (self.highest is None):
            raise ValueError("give both lowest and highest of the region, or neither for the whole face")
        return self


class Outflow(Table):
    """Fluid that leaves; the pressure is zero there."""

    kind: Literal["outflow"]


Face = Annotated[NoSlip | FreeSlip | Inflow | Outflow, Field(discriminator="kind")]


class FluidTable(Table):
    """Incompressible Newtonian fluid in a box of equal cells."""

    density: float = quantity("kg/m³", "of the fluid", gt=0.0)
    viscosity: float = quantity("Pa s", "dynamic", gt=0.0)
    lowest: Vector = quantity("m", "corner of the box")
    highest: Vector = quantity("m", "opposite corner")
    cells: tuple[int, int, int] = quantity("", "along x, y, z; 1 in a direction that does not matter")
    faces: dict[Side, Face] = Field(default={}, description="what is at each side; absent: a wall, or periodic")
    velocity: Vector = quantity("m/s", "of all fluid at time zero", default=(0.0, 0.0, 0.0))
    pressure_gradient: Vector = quantity(
        "Pa/m", "that drives the fluid beside its own pressure", default=(0.0, 0.0, 0.0)
    )
    convection: Literal["central", "bounded"] = Field(default="bounded", description="scheme; central can overshoot")
    step: float | None = quantity("s", "time step; absent: the largest within its limits", default=None, gt=0.0)
    largest_step: float | None = quantity("s", "bound of the time step chosen within the limits", default=None, gt=0.0)

    @model_validator(mode="after")
    def _has_room(self) -> "FluidTable":
        if not all(low < high for low, high in zip(self.lowest, self.highest, strict=True)):
            raise ValueError(
                f"highest = {list(self.highest)} m must exceed lowest = {list(self.lowest)} m in every direction"
            )
        if min(self.cells) < 1:
            raise ValueError(f"cells = {list(self.cells)}: at least one in every direction")
        for side, face in self.faces.items():
            across = face.velocity["xyz".index(side[1])] if isinstance(face, NoSlip) else 0.0
            if across:
                raise ValueError(
                    f"faces.{side}.velocity: {across:g} m/s in {side[1]} is through the wall, which slides in its own "
                    "plane; give 0 there, or an inflow"
                )
        kinds = [face.kind for face in self.faces.values()]
        if "inflow" in kinds and "outflow" not in kinds:
            raise ValueError("faces: what flows in must get out; give a face of kind outflow")
        return self

    @model_validator(mode="after")
    def _regions_are_on_their_faces(self) -> "FluidTable":
        for side, face in self.faces.items():
            if isinstance(face, Inflow) and face.lowest is not None and face.highest is not None:
                for k, axis in enumerate("xyz"):
                    if axis != side[1]:
                        self._check_region(f"faces.{side}", axis, face.lowest[k], face.highest[k])
        return self

    def _check_region(self, field: str, axis: str, low: float, high: float) -> None:
        """Refuse an open region (m, along an axis) that is not on the face, or that no cell's centre is in."""
        k = "xyz".index(axis)
        first, last, cells = self.lowest[k], self.highest[k], self.cells[k]
        region, size = f"{field}: its region from {low:g} to {high:g} m in {axis}", (last - first) / cells
        if not first - 1e-6 * size <= low < high <= last + 1e-6 * size:
            raise ValueError(f"{region} is not within the box, from {first:g} to {last:g} m; move its corners")
        if not any(low < first + (i + 0.5) * size < high for i in range(cells)):
            raise ValueError(
                f"{region} holds no centre of a cell of {size:.3g} m, so that nothing would flow; widen it, or give "
                "more cells"
            )


class Drag(Table):
    """How fluid and particles act on each other."""

    law: Literal["ergun-wen-yu", "blended", "di-felice"] = Field(
        default="ergun-wen-yu",
        description="Ergun up to a void fraction of 0.8 and Wen-Yu above, the same blended, or Di Felice",
    )
    coupling: Literal["one-way", "two-way"] = Field(
        default="two-way", description="whether the particles act on the fluid as well"
    )
    kernel: float = quantity("diameters", "half width of the averaging kernel, a cell at least", default=1.5, gt=0.0)
    least_void_fraction: float = quantity(
        "", "void fractions below count as this, and are counted", default=0.2, gt=0.0, lt=1.0
    )
