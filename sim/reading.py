"""From TOML text to a scene, or to one message that names every field at fault."""

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from sim.errors import InputError
from sim.scene import Scene

WANTED = {  # by pydantic's names, where its own words mean something to programmers only
    "extra_forbidden": "unknown key; `suffice scenes mini_mill` shows what a scene may say",
    "tuple_type": "must be a list with a number for each component, such as [x, y, z]",
    "list_type": "must be a list, [ … ]; a list of tables has double brackets, [[ … ]]",
    "model_type": "must be a table, { key = value }",
    "model_attributes_type": "must be a table, { key = value }",
}


def _unit(model: type[BaseModel], path: tuple[int | str, ...]) -> str:
    """Return the unit of the field at a path of a refused scene, empty where it has none."""
    schema: Any = model.model_json_schema()
    definitions = schema.get("$defs", {})
    node: Any = schema
    unit = ""  # a component of a vector has that of the vector
    for key in path:
        options = [node, *node.get("anyOf", []), *node.get("oneOf", [])]
        options = [definitions[o["$ref"].split("/")[-1]] if "$ref" in o else o for o in options]
        options += [definitions[p["$ref"].split("/")[-1]] for o in options for p in o.get("oneOf", []) if "$ref" in p]
        step = next((o["items"] for o in options if isinstance(key, int) and "items" in o), None)
        step = step or next((o["properties"][key] for o in options if key in o.get("properties", {})), None)
        if step is None:
            continue
        node = definitions[step["$ref"].split("/")[-1]] if "$ref" in step else step
        unit = node.get("unit", unit)
    return unit


def _place(tables: Any, path: tuple[int | str, ...]) -> str:
    """Name a field as the scene writes it; pydantic's path also holds which kind of shape or motion it tried."""
    kept, node = [], tables
    for part in path:
        inside = part in node if isinstance(node, dict) else isinstance(node, list | tuple) and part in range(len(node))
        if inside:
            node = node[part]
        if inside or (part == path[-1] and part not in ("each", "all")):
            kept.append(str(part))
    return ".".join(kept)


def refusal(error: ValidationError, source: str, tables: Any) -> InputError:
    """Turn pydantic's findings on a scene's tables into one message with field, value, unit and what is wanted."""
    findings = error.errors(include_url=False, include_context=False)
    lines = []
    for found in findings[:5]:
        path = found["loc"]
        name = _place(tables, path)
        unit = _unit(Scene, path)
        value = found["input"]
        shown = f" = {value!r}" if isinstance(value, str | int | float | bool) else ""
        wanted = found["msg"].removeprefix("Value error, ")
        wanted = WANTED.get(found["type"], wanted)
        at_fault = f"{name}{shown}{' ' + unit if shown and unit else ''}"
        lines.append(f"{at_fault}: {wanted}" if at_fault else wanted)
    rest = f" (and {len(findings) - 5} more)" if len(findings) > 5 else ""
    return InputError(f"scene {source}: " + "; ".join(lines) + rest)


def parse_scene(text: str, source: str = "") -> Scene:
    """Read a scene from TOML text.

    Raises InputError with every field at fault, its value, unit and limit.
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers and nesting beyond what Python reads
        raise InputError(f"scene {source}: not valid TOML: {error}") from None
    try:
        return Scene.model_validate(tables)
    except ValidationError as error:
        raise refusal(error, source, tables) from None


def built_in_scenes() -> dict[str, str]:
    """Names and TOML texts of the scenes that come with the program."""
    folder = resources.files("sim") / "scenes"
    return {Path(f.name).stem: f.read_text() for f in sorted(folder.iterdir(), key=str) if f.name.endswith(".toml")}


def scene_text(name_or_path: str) -> str:
    """TOML text of a built-in scene, or of a file.

    Raises InputError where it is neither, naming the built-in scenes.
    """
    built_in = built_in_scenes()
    if name_or_path in built_in:
        return built_in[name_or_path]
    try:
        return Path(name_or_path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"scene {name_or_path!r}: no such file or not a text ({error}); "
            f"give a TOML file or one of the built-in scenes: {', '.join(built_in)}"
        ) from None
