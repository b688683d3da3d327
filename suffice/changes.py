"""Changes of a scene: values set at a place of its tables, and tables left out."""

import json
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from suffice.refusal import Refusal


def changed_text(
    text: str, source: str, changes: Mapping[str, Any], without: Iterable[str] = (), head: str = ""
) -> str:
    """Return the TOML text of a scene with values changed and tables left out, under a comment.

    changes: value by place, such as `walls.1.motion.rpm`; without: places, such as `fluid`.
    Raises Refusal for a place that the scene does not have.
    """
    tables = tomllib.loads(text)
    for where in without:
        remove_(tables, where, source)
    for where, value in changes.items():
        change_(tables, where, value, source)
    return f"# {head}\n" + "".join(f"{key} = {toml_value(value)}\n" for key, value in tables.items())


def change_(tables: Any, where: str, value: Any, source: str) -> None:
    """Set a value of a scene's tables, at a place such as `walls.1.motion.rpm`. Raises Refusal where there is none."""
    try:
        node, last = _place(tables, where)
        node[last] = value
    except (LookupError, ValueError, TypeError):
        raise _no_place("changes", where, source) from None


def remove_(tables: Any, where: str, source: str) -> None:
    """Leave out what stands at a place of a scene's tables. Raises Refusal where nothing does."""
    try:
        node, last = _place(tables, where)
        del node[last]
    except (LookupError, ValueError, TypeError):
        raise _no_place("without", where, source) from None


def _place(tables: Any, where: str) -> tuple[Any, Any]:
    """Return the table or list that holds a place, and its key or number there."""
    *path, last = where.split(".")
    node = tables
    for key in path:
        node = node[int(key) if isinstance(node, list) else key]
    return node, int(last) if isinstance(node, list) else last


def _no_place(field: str, where: str, source: str) -> Refusal:
    return Refusal(f"{field}: {where} is no place in scene {source}; `suffice scenes` shows its tables")


def toml_value(value: Any) -> str:
    """Write a value as TOML on one line: tables inline, numbers so that they read back the same."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)
