"""Scenes in a line."""

from collections.abc import Callable
from math import inf
from typing import Any

import pytest

from sim import Scene

FLOOR = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}


@pytest.fixture
def scene_of() -> Callable[..., Scene]:
    """Build a scene of elastic contacts without an overlap limit, changed by the tables given."""

    def build(**tables: Any) -> Scene:
        contact = {"stiffness": 1e4, "restitution": 1.0} | tables.pop("contact", {})
        scene = {"contact": contact, "limits": {"max_overlap": inf}, **tables}
        return Scene.model_validate(scene)

    return build
