"""What a scene may say, and how it is refused: one message with field, value, unit and remedy."""

import copy
import json

import pytest
from pydantic import ValidationError

from sim import InputError, Scene, Simulation, built_in_scenes, parse_scene, scene_text

GOOD = {
    "particles": [{"diameter": 1e-3, "density": 2500.0, "position": [[0.0, 0.0, 2e-3], [3e-3, 0.0, 2e-3]]}],
    "contact": {"stiffness": 1e3, "restitution": 0.9, "friction": 0.3},
    "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    "time": {"duration": 2e-3},
    "output": {"interval": 1e-3},
    "walls": [{"name": "floor", "shapes": [{"shape": "plane", "normal": [0.0, 0.0, 1.0]}]}],
}
BOX = {"shape": "box", "lowest": [0.0, 0.0, 0.0], "highest": [1e-2, 1e-2, 1e-2], "particles": "inside"}
CYLINDER = {"shape": "cylinder", "axis": [1.0, 0.0, 0.0], "radius": 1.0, "particles": "inside"}
PACKED = {"diameter": 1e-3, "density": 2500.0, "count": 5}
PAIR = {"between": ["species 0", "species 0"], "stiffness": 1e3, "restitution": 0.9}
SLIT = {"kind": "inflow", "speed": 0.1, "lowest": [3e-3, 0.0, 0.0]}
OUT = {"+z": {"kind": "outflow"}}
NAN, INF = float("nan"), float("inf")


def inline(value):
    """Write a value as TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def changed(where, value):
    """The good scene as TOML, with the value at a dotted place replaced or added."""
    scene = copy.deepcopy(GOOD)
    *path, last = where.split(".")
    node = scene
    for part in path:
        node = node[int(part)] if isinstance(node, list) else node.setdefault(part, {})
    node[int(last) if isinstance(node, list) else last] = value
    return "\n".join(f"{key} = {inline(item)}" for key, item in scene.items())


def refused(text):
    with pytest.raises(InputError) as caught:
        Simulation(parse_scene(text, "my.toml"))
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("where", "value", "says"),
    [
        ("particles.0.diameter", -1e-3, "particles.0.diameter = -0.001 m: Input should be greater than 0"),
        ("particles.0.density", 0.0, "particles.0.density = 0.0 kg/m³: Input should be greater than 0"),
        ("contact.stifness", 1e3, "contact.stifness = 1000.0: unknown key; `suffice scenes mini_mill` shows"),
        ("magnet", {"law": "coulomb"}, "magnet: unknown key"),
        ("drag", {"law": "ergun"}, "drag.law = 'ergun': Input should be 'ergun-wen-yu', 'blended' or 'di-felice'"),
        ("contact.restitution", 0.0, "contact.restitution = 0.0: Input should be greater than or equal to 0.001"),
        ("contact.restitution", NAN, "contact.restitution = nan: Input should be a finite number"),
        ("contact.stiffness", INF, "contact.stiffness = inf N/m: Input should be a finite number"),
        ("limits.max_overlap", NAN, "limits.max_overlap = nan radii: Input should be greater than 0"),
        ("time.step", 0.0, "time.step = 0.0 s: Input should be greater than 0"),
        ("particles.0.position.1", [0.0, NAN, 1.0], "particles.0.position.1.1 = nan m: Input should be a finite"),
        ("particles.0.position.1", [0.0, 1.0], "particles.0.position.1.2: Field required"),
        ("particles.0.velocity", [INF, 0.0, 0.0], "particles.0.velocity.0 = inf m/s: Input should be a finite number"),
        ("particles.0.velocity", [1.0, 2.0], "particles.0.velocity.2: Field required"),
        ("particles.0.velocity", "fast", "particles.0.velocity = 'fast' m/s: must be a list with a number for each"),
        ("particles.0.velocity", [[1.0, 0.0, 0.0]], "velocity lists 1 vectors for 2 particles; give one each"),
        ("particles.0.count", 3, "particles.0: give one of .* found count and position"),
        ("gravity.acceleration", [0.0, 0.0, NAN], "gravity.acceleration.2 = nan m/s²: Input should be a finite"),
        ("walls.0.name", "a/b", "walls.0.name = 'a/b': String should match pattern"),
        ("walls.0.shapes.0.point", [0.0, 0.0, -INF], "walls.0.shapes.0.point.2 = -inf m: Input should be a finite"),
        ("walls.0.shapes.0", CYLINDER | {"length": -1.0}, "walls.0.shapes.0.length = -1.0 m: Input should be greater"),
        ("walls.0.motion", {"kind": "spin"}, "walls.0.motion: Input tag 'spin' .* 'rotation', 'oscillation'"),
        ("contact.rolling", 0.1, "contact.rolling = 0.1: must be a table, { key = value }"),
        ("pair_contact", [PAIR, PAIR], "pair_contact.1.between = .* is the pair of pair_contact.0"),
        ("walls", {"name": "box"}, "walls: must be a list, .* double brackets"),
        ("seed", -1, "seed = -1: Input should be greater than or equal to 0"),
        ("particles", [], "particles: there are none, and no fluid either"),
    ],
)
def test_a_value_out_of_range_is_named_with_its_field_unit_and_limit(where, value, says):
    text = changed(where, value)
    with pytest.raises(InputError, match=f"^scene my.toml: .*{says}"):
        parse_scene(text, "my.toml")


@pytest.mark.parametrize(
    ("where", "value", "says"),
    [
        ("walls.0.shapes.0.normal", [0.0, 0.0, 0.0], "walls.0.shapes.0.normal = [0.0, 0.0, 0.0]: has no direction"),
        ("walls.0.shapes.0", CYLINDER | {"axis": [0, 0, 0]}, "walls.0.shapes.0.axis = [0.0, 0.0, 0.0]: has no direct"),
        (
            "walls.0.motion",
            {"kind": "rotation", "axis": [0, 0, 0], "rpm": 1.0},
            "walls.0.motion.axis = [0.0, 0.0, 0.0]",
        ),
        (
            "walls.0.shapes.0",
            BOX | {"highest": [1e-2, 1e-2, -1e-2]},
            "walls.0.shapes.0.highest = [0.01, 0.01, -0.01] m: must exceed lowest = [0.0, 0.0, 0.0] m",
        ),
        ("walls.0.shapes.0", CYLINDER | {"copies": 4}, "walls.0.shapes.0.copies = 4: only a body with a rotation"),
        (
            "filling",
            {"lowest": [0.0, 0.0, 1.0], "highest": [1.0, 1.0, 0.0]},
            "filling: highest = [1.0, 1.0, 0.0] m must exceed lowest = [0.0, 0.0, 1.0] m",
        ),
        ("walls", [GOOD["walls"][0], GOOD["walls"][0]], "walls.1.name = 'floor' is taken by walls.0; give another"),
    ],
)
def test_walls_that_have_no_shape_direction_or_name_of_their_own_are_refused(where, value, says):
    assert says in refused(changed(where, value))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"cells": [1, 2, 2]}, "one cell in x cannot show the friction of the walls that -x and +x are unless told"),
        ({"faces": OUT | {"-z": SLIT | {"highest": [4e-3, 1e-2, 0.0]}}}, "from 0.003 to 0.004 m in x holds no centre"),
        ({"faces": OUT | {"-z": SLIT | {"highest": [2e-2, 1e-2, 0.0]}}}, "from 0.003 to 0.02 m in x is not within"),
        ({"cells": [2, 2, 1], "faces": {"-z": {"kind": "slip"}}}, "of the walls that +z are unless told"),
        (
            {"faces": {"+y": {"kind": "wall", "velocity": [0.1, 0.2, 0.0]}}},
            "faces.+y.velocity: 0.2 m/s in y is through",
        ),
    ],
)
def test_a_fluid_whose_sides_would_not_do_what_the_scene_seems_to_say_is_refused(change, says):
    fluid = {"density": 1e3, "viscosity": 1e-3, "lowest": [0.0] * 3, "highest": [1e-2] * 3, "cells": [2, 2, 2]}
    assert says in refused(changed("fluid", fluid | change))


def test_two_particles_in_one_place_are_refused_by_their_numbers_and_overlap():
    # centres 0.5 mm apart, radius 0.5 mm: an overlap of one radius
    message = refused(changed("particles.0.position.1", [5e-4, 0.0, 2e-3]))
    assert message == (
        "particles 0 and 1 overlap by 1 radii (limits.max_overlap 0.1); move them apart, or raise the limit"
    )


def test_a_particle_in_a_wall_is_refused_with_the_name_of_the_wall():
    # 0.2 mm above the floor, radius 0.5 mm: an overlap of 0.6 radii
    message = refused(changed("particles.0.position.1", [3e-3, 0.0, 2e-4]))
    assert "particle 1 at [0.003, 0.0, 0.0002] m overlaps the wall 'floor' by 0.6 radii" in message
    assert "limits.max_overlap 0.1" in message
    assert "move it, or raise the limit" in message


def test_no_limit_lets_a_centre_stand_behind_a_wall():
    scene = json.loads(json.dumps(GOOD)) | {"limits": {"max_overlap": INF}}
    scene["particles"][0]["position"][1] = [3e-3, 0.0, -1e-5]
    with pytest.raises(InputError, match=r"overlaps the wall 'floor' by 1\.02 radii"):
        Simulation(Scene.model_validate(scene))


def test_spins_are_refused_where_nothing_can_change_them():
    scene = copy.deepcopy(GOOD)
    scene["contact"]["friction"] = 0.0
    scene["particles"][0]["angular_velocity"] = [0.0, 0.0, 5.0]
    with pytest.raises(InputError, match=r"angular_velocity: contact\.friction is 0, so nothing turns .* add friction"):
        Simulation(Scene.model_validate(scene))


@pytest.mark.parametrize("text", ["x = [", "[contact\n", "a = 1\na = 2"])
def test_bad_toml_is_refused_with_the_place_of_the_mistake(text):
    with pytest.raises(InputError, match=r"scene my.toml: not valid TOML: .*(line|end of document)"):
        parse_scene(text, "my.toml")


def test_a_scene_lists_every_fault_at_once_but_not_without_end():
    assert refused("").count("Field required") == 2
    message = refused("\n".join(f"key_{k} = 1" for k in range(9)))
    assert message.endswith("(and 6 more)")


def test_the_same_scene_is_built_from_toml_and_in_python():
    text = changed("seed", 7)
    assert parse_scene(text) == Scene.model_validate(GOOD | {"seed": 7})
    assert Scene.model_validate(parse_scene(text).model_dump()) == parse_scene(text)


def test_a_scene_cannot_be_changed_once_it_is_built():
    scene = Scene.model_validate(GOOD)
    with pytest.raises(ValidationError, match="frozen"):
        scene.seed = 2
    with pytest.raises(ValidationError, match="Extra inputs are not permitted"):
        Scene.model_validate(GOOD | {"magnet": {}})


def test_one_velocity_serves_all_particles_or_each_has_its_own():
    one = Scene.model_validate(GOOD | {"particles": [GOOD["particles"][0] | {"velocity": [1.0, 2.0, 3.0]}]})
    assert (Simulation(one).particles.velocity == [1.0, 2.0, 3.0]).all()
    own = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    each = Scene.model_validate(GOOD | {"particles": [GOOD["particles"][0] | {"velocity": own}]})
    assert Simulation(each).snapshot().velocity.tolist() == own


def test_every_built_in_scene_says_what_it_is_and_is_valid():
    scenes = built_in_scenes()
    assert {"mini_mill", "shaken_box"} <= set(scenes)
    for name, text in scenes.items():
        assert text.startswith("# ")
        assert scene_text(name) == text
        parse_scene(text, name)


def test_a_scene_that_is_neither_built_in_nor_a_text_is_refused(tmp_path):
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe\xfa")
    for place in ("no_such_scene", str(tmp_path), str(tmp_path / "noise.toml")):
        with pytest.raises(InputError, match=r"no such file or not a text .* built-in scenes: .*drum, .*mini_mill, "):
            scene_text(place)
