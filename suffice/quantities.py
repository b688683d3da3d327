"""What a run can hold: the variables of particles and of fluid, their components and units."""

from collections.abc import Iterable
from typing import NamedTuple

AXES = ("x", "y", "z")


class Quantity(NamedTuple):
    """One variable of a run: where `run.h5` keeps it, how many components it has, its unit."""

    dataset: str
    components: int
    unit: str

    @property
    def of_fluid(self) -> bool:
        """Whether it lives in grid cells; otherwise it lives on particles."""
        return self.dataset.startswith("fluid/")

    @property
    def field(self) -> str:
        """The name ParaView shows, that of the dataset without its group."""
        return self.dataset.partition("/")[2]


class Grid(NamedTuple):
    """A uniform grid of cells; fields on it are stored (z, y, x), the fastest index last."""

    shape: tuple[int, int, int]  # cells along z, y, x
    origin: tuple[float, float, float]  # x, y, z of the lower corner of the first cell, m
    spacing: tuple[float, float, float]  # edges of a cell along x, y, z, m


QUANTITIES = {
    "position": Quantity("particles/position", 3, "m"),
    "velocity": Quantity("particles/velocity", 3, "m/s"),
    "angular_velocity": Quantity("particles/angular_velocity", 3, "rad/s"),
    "fluid.velocity": Quantity("fluid/velocity", 3, "m/s"),
    "fluid.pressure": Quantity("fluid/pressure", 1, "Pa"),
    "fluid.void_fraction": Quantity("fluid/void_fraction", 1, "1"),
}


def component_names(variables: Iterable[str]) -> list[str]:
    """Return the scalar rows of these variables: `position` gives `position.x`, `position.y`, `position.z`."""
    return [name for variable in variables for name in _components(variable)]


def _components(variable: str) -> list[str]:
    if QUANTITIES[variable].components == 1:
        return [variable]
    return [f"{variable}.{axis}" for axis in AXES]


def whole_of(variable: str) -> str:
    """Return the quantity that a variable is, or is a component of: `position` of `position.x` and of itself."""
    return variable if variable in QUANTITIES else variable.rpartition(".")[0]


def velocity_of(position: str) -> str:
    """Return the name of the derivative of a position: `velocity.x` of `position.x`."""
    return position.replace("position", "velocity", 1)
