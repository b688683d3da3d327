"""What of a scene a LAMMPS deck can say; everything else is refused by name, never left out in silence."""

from collections.abc import Iterator

from pydantic import BaseModel

from sim import Scene
from suffice.refusal import Refusal

EXPRESSIBLE = {
    "Scene": {
        "particles",
        "contact",
        "time",
        "output",
        "limits",
        "wall_contact",
        "gravity",
        "walls",
        "filling",
        "seed",
    },
    "ParticleTable": {
        "name",
        "diameter",
        "distribution",
        "density",
        "count",
        "filling_degree",
        "volume_fraction",
        "position",
        "velocity",
        "angular_velocity",
    },
    "Uniform": {"kind", "low", "high"},
    "Lognormal": {"kind", "sigma", "low", "high", "by"},
    "Sieve": {"kind", "diameter", "mass_fraction"},
    "Contact": {"stiffness", "restitution", "friction", "tangential_stiffness_ratio", "tangential_damping_ratio"},
    "Gravity": {"acceleration"},
    "Time": {"duration", "step"},
    "Output": {"interval", "precision"},
    "Limits": {"max_overlap"},
    "Filling": {"lowest", "highest"},
    "WallTable": {"name", "shapes", "motion", "contact"},
    "Plane": {"shape", "point", "normal"},
    "Box": {"shape", "lowest", "highest", "particles", "open"},
    "Cylinder": {"shape", "centre", "axis", "radius", "length", "particles", "copies", "open"},
    "Sphere": {"shape", "centre", "radius", "particles"},
    "Rotation": {"kind", "axis", "point", "rpm"},
    "Oscillation": {"kind", "amplitude", "frequency", "phase"},
    "Translation": {"kind", "velocity"},
}
REMEDY = "leave it out, or use --engine numba"


def check_expressible(scene: Scene) -> None:
    """Refuse a scene that says more than a deck can (Refusal naming the first such field and its value)."""
    for field, value in _beyond(scene, ""):
        raise Refusal(f"{field} = {value}: a LAMMPS deck cannot say it; {REMEDY}")


def _beyond(table: BaseModel, path: str) -> Iterator[tuple[str, str]]:
    """Yield fields that are set and that no deck can say, with their values."""
    known = EXPRESSIBLE.get(type(table).__name__)
    if known is None:
        yield path.rstrip("."), str(table.model_dump(exclude_unset=True))
        return
    for name, field in type(table).model_fields.items():
        value = getattr(table, name)
        if name not in known:
            if value != field.get_default(call_default_factory=True):
                yield f"{path}{name}", "a table" if isinstance(value, BaseModel) else repr(value)
            continue
        tables = enumerate(value) if isinstance(value, list) else [(None, value)]
        for k, inner in tables:
            if isinstance(inner, BaseModel):
                yield from _beyond(inner, f"{path}{name}." if k is None else f"{path}{name}.{k}.")
