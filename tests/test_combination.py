"""Union, intersection and difference of solids, and the vessels they make."""

import numpy as np
import pytest
from pydantic import ValidationError

from sim import InputError, Scene, simulate
from sim.assembly import walls_of
from sim.surface import wall_distance

BEAD = {"diameter": 1e-3, "density": 2500.0}
RUN = {"time": {"duration": 1e-2}, "output": {"interval": 1e-4}}
BALL = {"shape": "sphere", "radius": 1.0}
BLOCK = {"shape": "box", "lowest": [-0.8, -0.8, -0.8], "highest": [0.8, 0.8, 0.8]}
BORE = {"shape": "cylinder", "axis": [0, 0, 1], "radius": 0.4}
SIDE = {"shape": "plane", "point": [0.1, 0, 0], "normal": [1, 0, 0]}
POINTS = np.random.default_rng(0).uniform(-1.4, 1.4, (300, 3))


def phi(scene_of, shape):
    """Distance and gradient at all points, of a body of this one shape."""
    wall = {"name": "w", "shapes": [{"particles": "outside", **shape} if shape["shape"] != "plane" else shape]}
    walls = walls_of(scene_of(particles=[{**BEAD, "position": [[9, 9, 9]]}], walls=[wall], **RUN))
    return np.array([wall_distance(walls, 0, *point) for point in POINTS])


def combined(operation, *of):
    return {"shape": "combination", "operation": operation, "of": list(of)}


def test_a_solid_is_where_its_members_say(scene_of):
    ball, block, bore, side = (phi(scene_of, shape)[:, 0] < 0 for shape in (BALL, BLOCK, BORE, SIDE))
    for shape, solid in (
        (combined("union", BALL, BLOCK, BORE), ball | block | bore),
        (combined("intersection", BALL, BLOCK, SIDE), ball & block & side),
        (combined("difference", BALL, BORE, SIDE), ball & ~bore & ~side),
        (combined("difference", combined("union", BLOCK, SIDE), combined("difference", BALL, BORE)),
         (block | side) & ~(ball & ~bore)),
        (combined("intersection", combined("union", combined("difference", BALL, SIDE), BORE), BLOCK),
         ((ball & ~side) | bore) & block),
    ):  # fmt: skip
        np.testing.assert_array_equal(phi(scene_of, shape)[:, 0] < 0, solid)
        np.testing.assert_array_equal(phi(scene_of, shape | {"particles": "inside"})[:, 0] > 0, solid)


def test_gradient_of_a_combination_is_that_of_the_member_that_decides(scene_of):
    members = [phi(scene_of, shape) for shape in (BALL, BLOCK)]
    union = phi(scene_of, combined("union", BALL, BLOCK))
    decides = np.where((members[0][:, 0] < members[1][:, 0])[:, None], *members)
    np.testing.assert_array_equal(union, decides)
    np.testing.assert_allclose(np.linalg.norm(union[:, 1:], axis=1), 1.0, atol=1e-12)


def test_outside_of_a_union_the_distance_is_exact_and_elsewhere_a_bound(scene_of):
    halves = [BLOCK | {"highest": [0, 0.8, 0.8]}, BLOCK | {"lowest": [0, -0.8, -0.8]}]
    whole, union = phi(scene_of, BLOCK)[:, 0], phi(scene_of, combined("union", *halves))[:, 0]
    outside = whole > 0
    np.testing.assert_allclose(union[outside], whole[outside], atol=1e-12)
    assert (np.abs(union[~outside]) <= np.abs(whole[~outside]) + 1e-12).all()
    planes = [{"shape": "plane", "point": list(0.8 * n), "normal": list(n)} for n in (*np.eye(3), *-np.eye(3))]
    cut = phi(scene_of, combined("intersection", *planes))[:, 0]
    np.testing.assert_allclose(cut[~outside], whole[~outside], atol=1e-12)
    assert (cut[outside] <= whole[outside] + 1e-12).all()


def test_difference_of_one_cylinder_from_another_holds_a_bead_in_the_bore(scene_of):
    ring = combined("difference", BORE | {"radius": 5e-3, "length": 4e-3}, BORE | {"radius": 2e-3})
    tube = BORE | {"radius": 2e-3, "particles": "inside"}
    paths = []
    for shape in (ring | {"particles": "outside"}, tube):
        scene = scene_of(
            particles=[{**BEAD, "position": [[0, 0, 0]], "velocity": [0.4, 0.1, 0.0]}],
            contact={"friction": 0.3, "restitution": 0.9},
            walls=[{"name": "w", "shapes": [shape]}],
            **RUN,
        )
        paths.append(np.array([s.position[0] for s in simulate(scene)]))
    assert np.abs(paths[0]).max() < 1.6e-3
    np.testing.assert_array_equal(*paths)


def test_copies_within_a_combination_are_all_there(scene_of):
    pin = {"shape": "cylinder", "axis": [1, 0, 0], "centre": [5e-3, 0, 0], "radius": 1e-3, "length": 4e-3, "copies": 3}
    hub = {"shape": "sphere", "radius": 2e-3}
    motion = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0}
    wall = {"name": "rotor", "motion": motion, "shapes": [combined("union", hub, pin) | {"particles": "outside"}]}
    walls = walls_of(scene_of(particles=[{**BEAD, "position": [[0, 0, 1]]}], walls=[wall], **RUN))
    for angle in np.radians([0, 120, 240]):
        assert wall_distance(walls, 0, 5e-3 * np.cos(angle), 5e-3 * np.sin(angle), 0.0)[0] == pytest.approx(-1e-3)


def test_deep_nesting_is_refused_and_long_lists_are_not(scene_of):
    def scene(shape):
        wall = {"name": "w", "shapes": [shape | {"particles": "outside"}]}
        return scene_of(particles=[{**BEAD, "position": [[9, 9, 9]]}], walls=[wall], **RUN)

    deep = BALL
    for depth in range(4):
        deep = combined(("union", "intersection")[depth % 2], deep, deep)
    with pytest.raises(InputError, match="5 shapes wait for one another"):
        walls_of(scene(deep))
    walls_of(scene(combined("union", *[BALL] * 20)))
    ladder = BALL
    for depth in range(20):
        ladder = combined(("union", "intersection")[depth % 2], BLOCK, ladder)
    walls_of(scene(ladder))


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        (combined("union", BALL | {"particles": "outside"}, BLOCK), "a member of a combination has no side"),
        (combined("union", BALL, BLOCK | {"open": ["+z"]}), "a member of a combination is solid"),
        (combined("union", BALL), "at least 2 items"),
        (combined("sum", BALL, BLOCK), "'union', 'intersection' or 'difference'"),
    ],
)
def test_members_without_sense_are_refused(shape, says):
    wall = {"name": "w", "shapes": [shape | {"particles": "outside"}]}
    scene = {"particles": [{**BEAD, "count": 1}], "contact": {"stiffness": 1e3, "restitution": 1.0}, **RUN}
    with pytest.raises(ValidationError, match=says):
        Scene.model_validate(scene | {"walls": [wall]})
