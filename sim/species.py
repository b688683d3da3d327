"""What the particles are: species of spheres, and how they touch."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from sim.table import Table, Vector, Vectors, quantity


class Uniform(Table):
    """Diameters equally frequent, by number, between two bounds."""

    kind: Literal["uniform"]
    low: float = quantity("m", "smallest diameter", gt=0.0)
    high: float = quantity("m", "largest diameter", gt=0.0)


class Lognormal(Table):
    """Logarithms of diameters normally distributed, cut off at two bounds; the species' diameter is the median."""

    kind: Literal["lognormal"]
    sigma: float = quantity("", "standard deviation of ln(diameter)", gt=0.0, le=3.0)
    low: float = quantity("m", "smallest diameter", gt=0.0)
    high: float = quantity("m", "largest diameter", gt=0.0)
    by: Literal["number", "mass"] = Field(default="number", description="what half of lies below the median")


class Sieve(Table):
    """Fractions of a sieve analysis, each of one diameter."""

    kind: Literal["sieve"]
    diameter: list[Annotated[float, Field(gt=0.0)]] = quantity("m", "of each fraction", min_length=1)
    mass_fraction: list[Annotated[float, Field(gt=0.0)]] = quantity("", "of each, scaled to a sum of 1", min_length=1)

    @model_validator(mode="after")
    def _one_mass_each(self) -> "Sieve":
        if len(self.diameter) != len(self.mass_fraction):
            raise ValueError(
                f"diameter lists {len(self.diameter)} fractions, mass_fraction {len(self.mass_fraction)}; give one each"
            )
        return self


Distribution = Annotated[Uniform | Lognormal | Sieve, Field(discriminator="kind")]


class ParticleTable(Table):
    """Spheres of one species."""

    name: str | None = quantity(
        "", "how results call the species; absent: 'species 0', …", default=None, pattern=r"^[\w -]+$"
    )
    diameter: float = quantity("m", "diameter; with a distribution its nominal one, or its median", gt=0.0)
    distribution: Distribution | None = Field(default=None, description="of diameters; absent: all are equal")
    density: float = quantity("kg/m³", "density of the material", gt=0.0)
    count: int | None = quantity("", "how many are packed at random between the walls", default=None, gt=0)
    filling_degree: float | None = quantity(
        "", "instead of a count: bulk volume, at 60 % solids, over the free volume of the vessel", default=None,
        gt=0.0, le=1.1,
    )  # fmt: skip
    volume_fraction: float | None = quantity(
        "",
        "instead of a count: volume of the spheres over the free volume of the vessel",
        default=None,
        gt=0.0,
        le=0.74,
    )
    position: list[Vector] | None = quantity("m", "centres, instead of a count", default=None, min_length=1)
    velocity: Vectors = quantity("m/s", "of each, or of all", default=(0.0, 0.0, 0.0))
    fixed: bool = quantity("", "whether they stay where they are", default=False)
    angular_velocity: Vectors = quantity("rad/s", "of each, or of all", default=(0.0, 0.0, 0.0))

    @property
    def number(self) -> int | None:
        """How many the table says there are; None where the vessel decides."""
        return self.count if self.position is None else len(self.position)

    @property
    def smallest(self) -> float:
        """Least diameter that a sphere of the species can have, m."""
        d = self.distribution
        return self.diameter if d is None else min(d.diameter) if isinstance(d, Sieve) else d.low

    @property
    def largest(self) -> float:
        """Largest diameter that a sphere of the species can have, m."""
        d = self.distribution
        return self.diameter if d is None else max(d.diameter) if isinstance(d, Sieve) else d.high

    @model_validator(mode="after")
    def _one_way_to_say_how_many(self) -> "ParticleTable":
        ways = ("count", "filling_degree", "volume_fraction", "position")
        given = [way for way in ways if getattr(self, way) is not None]
        if len(given) != 1:
            found = f"; found {' and '.join(given)}" if given else ""
            raise ValueError(f"give one of count, filling_degree, volume_fraction and position{found}")
        n = self.number
        for name, value in (("velocity", self.velocity), ("angular_velocity", self.angular_velocity)):
            if isinstance(value, list) and n is None:
                raise ValueError(
                    f"{name} lists {len(value)} vectors, but {given[0]} decides how many particles; give one"
                )
            if isinstance(value, list) and len(value) != n:
                raise ValueError(f"{name} lists {len(value)} vectors for {n} particles; give one each, or a single one")
        return self

    @model_validator(mode="after")
    def _fixed_ones_rest(self) -> "ParticleTable":
        if self.fixed and (np.any(self.velocity) or np.any(self.angular_velocity)):
            raise ValueError("velocity and angular_velocity of fixed particles must be 0")
        return self

    @model_validator(mode="after")
    def _diameter_within_its_distribution(self) -> "ParticleTable":
        if self.distribution is not None and not self.smallest <= self.diameter <= self.largest:
            raise ValueError(
                f"diameter = {self.diameter:g} m is outside of its distribution, {self.smallest:g} to "
                f"{self.largest:g} m; it is the nominal diameter, or the median of a lognormal"
            )
        return self


class Rolling(Table):
    """Resistance against rolling: a constant moment, or an elastic–plastic spring and dashpot."""

    model: Literal["constant", "elastic-plastic"] = "elastic-plastic"
    friction: float = quantity("", "μ_r: the moment is at most μ_r R* |F_n|", gt=0.0, le=10.0)
    damping: float = quantity("", "share of the critical dashpot (elastic-plastic only)", default=0.3, ge=0.0, le=1.0)


class Contact(Table):
    """Linear spring, dashpot and slider (paper eqs. (4), (5))."""

    stiffness: float = quantity("N/m", "normal spring", gt=0.0)
    restitution: float = quantity("", "ratio of normal speeds after and before a contact", ge=1e-3, le=1.0)
    friction: float = quantity(
        "", "Coulomb coefficient; 0: nothing turns, no tangential force", default=0.0, ge=0.0, le=10.0
    )
    tangential_stiffness_ratio: float = quantity("", "k_t / k", default=1.0, gt=0.0, le=10.0)
    tangential_damping_ratio: float = quantity("", "η_t / η", default=1.0, ge=0.0, le=10.0)
    attraction: bool = quantity("", "whether the dashpot may attract as a contact ends", default=True)
    rolling: Rolling | None = None

    @model_validator(mode="after")
    def _rolling_needs_friction(self) -> "Contact":
        if self.rolling is not None and not self.friction:
            raise ValueError("rolling resistance needs friction above 0: without it nothing turns")
        return self


class PairContact(Contact):
    """Contact between two species, instead of the scene's."""

    between: tuple[str, str] = quantity("", "names of the species; the same twice for a species with itself")
