"""Scenes and studies made by chance: each is accepted or refused in one message, and what is accepted reads back."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim import InputError, Scene, parse_scene
from suffice.changes import toml_value
from suffice.refusal import Refusal
from suffice.study import load_study

# the same examples on every machine
by_chance = settings(max_examples=20, deadline=None, derandomize=True, database=None)
LENGTH = st.floats(1e-6, 1.0)
SHARE = st.floats(0.0, 1.0)
TRIPLE = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3)
ANYTHING = st.recursive(
    st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
MOTIONS = st.one_of(
    st.fixed_dictionaries({"kind": st.just("rotation"), "axis": TRIPLE, "point": TRIPLE, "rpm": st.floats(0.0, 2e4)}),
    st.fixed_dictionaries({"kind": st.just("oscillation"), "amplitude": TRIPLE, "frequency": st.floats(0.0, 1e3)}),
)
BOXES = st.fixed_dictionaries(
    {"shape": st.just("box"), "lowest": TRIPLE, "highest": TRIPLE, "particles": st.sampled_from(["inside", "outside"])}
)
WALLS = st.fixed_dictionaries({"name": st.text(max_size=12), "motion": MOTIONS, "shapes": st.lists(BOXES, max_size=2)})
BEADS = st.fixed_dictionaries({"diameter": LENGTH, "density": st.floats(1.0, 2e4), "count": st.integers(0, 10**6)})
SCENES = st.fixed_dictionaries(
    {
        "particles": st.lists(BEADS, min_size=1, max_size=2),
        "contact": st.fixed_dictionaries({"stiffness": st.floats(1.0, 1e9), "restitution": SHARE, "friction": SHARE}),
        "time": st.fixed_dictionaries({"duration": st.floats(1e-6, 1e3)}),
        "output": st.fixed_dictionaries({"interval": st.floats(1e-6, 10.0)}),
    },
    optional={
        "seed": st.integers(0, 2**31),
        "walls": st.lists(WALLS, max_size=2),
        "filling": st.fixed_dictionaries({"lowest": TRIPLE, "highest": TRIPLE}),
        "gravity": st.fixed_dictionaries({"acceleration": TRIPLE}),
    },
)
STUDIES = st.fixed_dictionaries(
    {"scene": st.text(max_size=12)},
    optional={
        "seed": st.integers(-1, 2**31),
        "select": st.fixed_dictionaries({}, optional={"variables": st.lists(st.text(max_size=9), max_size=2)}),
        "compare": st.fixed_dictionaries({}, optional={"intervals": st.lists(st.floats(), max_size=2)}),
    },
)


def written(table):
    """Write a table as TOML, a line for each of its keys."""
    return "\n".join(f"{json.dumps(name)} = {toml_value(value)}" for name, value in table.items())


@st.composite
def spoilt(draw, tables):
    """A table with anything at one of its places, or at a new one, which may be an inner one."""
    table = place = draw(tables)
    name = draw(st.sampled_from(sorted(place)))
    for _ in range(3):
        inner = place[name][0] if isinstance(place[name], list) and place[name] else place[name]
        if not isinstance(inner, dict) or not inner or draw(st.booleans()):
            break
        place, name = inner, draw(st.sampled_from(sorted(inner)))
    place[draw(st.just(name) | st.text(min_size=1, max_size=8))] = draw(ANYTHING)
    return table


def check_refusal(refused):
    """One message of a length that is read."""
    assert 10 < len(str(refused)) < 1000, str(refused)


def opened_scene(table):
    """Return the scene, or None where it is refused."""
    try:
        return parse_scene(written(table), "mine")
    except InputError as refused:
        check_refusal(refused)
        return None


@pytest.mark.physics
@by_chance
@given(SCENES)
def test_a_scene_of_reasonable_numbers_is_refused_or_reads_back_as_it_was(table):
    scene = opened_scene(table)
    if scene is not None:
        assert Scene.model_validate(scene.model_dump()) == scene
        assert [bead.diameter for bead in scene.particles] == [bead["diameter"] for bead in table["particles"]]
        assert scene.contact.stiffness == table["contact"]["stiffness"]


@pytest.mark.physics
@by_chance
@given(spoilt(SCENES))
def test_a_scene_with_anything_in_it_is_accepted_or_refused_in_one_message(table):
    opened_scene(table)


@pytest.mark.physics
@by_chance
@given(st.one_of(STUDIES, spoilt(STUDIES)))
def test_a_study_with_anything_in_it_is_accepted_or_refused_in_one_message(tmp_path_factory, table):
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_text(written(table), encoding="utf-8")
    try:
        assert load_study(str(path))[1].scene == table["scene"]
    except Refusal as refused:
        check_refusal(refused)
