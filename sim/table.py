"""A table of a scene: fields with units, checked before anything runs. Lengths in m, times in s, masses in kg."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

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
