"""A table of a scene: fields with units, checked before anything runs. Lengths in m, times in s, masses in kg."""

from collections.abc import Iterator
from math import inf
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

LARGEST = 1e40  # of any number of a scene, and one over it the smallest: products of four stay in double precision

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

    @model_validator(mode="after")
    def _can_be_computed_with(self) -> Self:
        for name, value in self:
            for number in _numbers(value):
                if number != 0.0 and not 1.0 / LARGEST <= abs(number) <= LARGEST and abs(number) != inf:
                    raise ValueError(f"{name} = {number:g}: beyond {1.0 / LARGEST:g} to {LARGEST:g}, give SI units")
        return self


def _numbers(value: Any) -> Iterator[float]:
    """Yield the numbers of a field, of a vector or of a list of vectors."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, list | tuple):
        for part in value:
            yield from _numbers(part)
