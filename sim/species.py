"""What the particles are: species of spheres, and how they touch."""

from typing import Literal

from pydantic import model_validator

from sim.table import Table, Vector, Vectors, quantity


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
