"""What is wrong in a study file, as one message: field, value, what is wanted, and the keys that there are."""

from collections.abc import Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

MOST = 5  # faults that are told


def faults_text(error: ValidationError, study: type[BaseModel]) -> str:
    """Tell what pydantic found in a study's tables, a fault after the other.

    study: the model of the whole file, whose fields say what they mean and in which unit.
    """
    found = [_fault(fault, study) for fault in error.errors(include_url=False, include_context=False)]
    rest = f" (and {len(found) - MOST} more)" if len(found) > MOST else ""
    return "; ".join(found[:MOST]) + rest


def _fault(fault: Any, study: type[BaseModel]) -> str:
    place, table, field = _at(fault["loc"], study)
    value, wanted = fault["input"], fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        wanted = f"unknown key; there are {', '.join(table.model_fields)}"
    elif fault["type"] == "missing":
        wanted = "it is missing"
    shown = f" = {value!r}" if isinstance(value, str | int | float | bool) else ""
    meant = f" ({field.description})" if field is not None and field.description else ""
    return f"{'.'.join(place)}{shown}: {wanted}{meant}" if place else wanted


def _at(path: Sequence[str | int], table: type[BaseModel]) -> tuple[list[str], type[BaseModel], FieldInfo | None]:
    """Return the place of a fault as the file writes it, the table it lies in, and the field, None for an unknown key.

    Pydantic's path goes on with the kind of value that it tried, which no file says.
    """
    place: list[str] = []
    field: FieldInfo | None = None
    inner: type[BaseModel] | None = table
    for key in path:
        if isinstance(key, str):
            if inner is None:
                break
            table, field = inner, inner.model_fields.get(key)
            inner = None if field is None else _table_in(field.annotation)
        place.append(str(key))
    return place, table, field


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """Return the table that a field may hold, by itself, in a list or beside None."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _table_in(part)) is not None), None)
