"""Walls from STL files."""

import numpy as np
import pytest

from sim import InputError, Simulation, simulate
from sim.assembly import walls_of
from sim.gridded import gridded_distance, gridded_parameters
from sim.mesh import gridded_mesh, mesh_distance, spacing_for
from sim.surface import wall_distance
from sim.triangles import ExactDistance, Mesh, closed

pytest.importorskip("vtkmodules.vtkIOGeometry")

R = 5e-4  # m
BEAD = {"diameter": 2 * R, "density": 2500.0}
MASS = 2500.0 * np.pi * (2 * R) ** 3 / 6
G = 9.81
K = 1e4


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "suffice" / "sdf"


def block(lowest, highest, cuts=1):
    """Triangles of a box (t, 3 corners, 3), each face of `cuts`² squares of two triangles."""
    lowest, highest = np.array(lowest, float), np.array(highest, float)
    triangles = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        for side in (0, 1):
            for i, j in np.ndindex(cuts, cuts):
                a = side * np.eye(3)[axis] + (i * u + j * v) / cuts
                b, c, d = a + u / cuts, a + (u + v) / cuts, a + v / cuts
                pair = [(a, b, c), (a, c, d)]
                triangles += pair if side else [(p, r, q) for p, q, r in pair]
    return np.array(triangles) * (highest - lowest) + lowest


def globe(radius, n=48):
    """Triangles of a sphere."""
    theta, phi = np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1)
    phi[-1] = 0.0
    at = np.stack([np.outer(np.sin(theta), np.cos(phi)), np.outer(np.sin(theta), np.sin(phi)),
                   np.outer(np.cos(theta), np.ones(2 * n + 1))], axis=-1)  # fmt: skip
    at[0], at[-1] = [0, 0, 1], [0, 0, -1]
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    upper = np.stack([a, b, c], axis=2).reshape(-1, 3, 3)
    lower = np.stack([a, c, d], axis=2).reshape(-1, 3, 3)
    triangles = np.concatenate([upper, lower])
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    return radius * triangles[area > 1e-9]


def write_stl(path, triangles):
    """Write a binary STL file."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corners"] = triangles
    path.write_bytes(bytes(80) + np.array(len(rows), "<u4").tobytes() + rows.tobytes())
    return path


def mesh_of(triangles):
    corners, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return closed("mesh", Mesh(corners, number.reshape(-1, 3)))


def wall(path, **more):
    return {"name": "w", "shapes": [{"shape": "mesh", "file": str(path), "particles": "outside", **more}]}


def looked_up(grid, points):
    parameter = np.zeros((1, 10))
    parameter[0, :9] = gridded_parameters(grid, 0)
    return np.array([gridded_distance(parameter, 0, grid.blocks, grid.spline, *point) for point in points])


def test_distance_to_a_mesh_is_within_the_stated_bound():
    """1 % of a diameter where a particle touches a smooth or convex part; a quarter of a spacing in a concave edge."""
    mesh = mesh_of(block([-2.3, -2.1, -1.9], [2.2, 2.05, 1.95]))
    grid = gridded_mesh("mesh", mesh, spacing_for(1.0), 0.55)
    points = np.random.default_rng(0).uniform(-3, 3, (20000, 3))
    exact, found = ExactDistance(mesh)(points), looked_up(grid, points)[:, 0]
    convex, concave = (exact > 0.4) & (exact < 0.52), (exact < -0.4) & (exact > -0.52)
    assert convex.sum() > 500
    assert concave.sum() > 500
    assert np.abs(found - exact)[convex].max() < 0.01 * 0.3
    assert np.abs(found - exact)[concave].max() < 0.25 * spacing_for(1.0)


def test_far_from_a_mesh_its_distance_is_a_bound_of_the_right_sign():
    mesh = mesh_of(globe(2.0))
    grid = gridded_mesh("mesh", mesh, 0.1, 0.55)
    points = np.random.default_rng(1).uniform(-5, 5, (4000, 3))
    exact, found = ExactDistance(mesh)(points), looked_up(grid, points)
    far = (found[:, 1:] == 0).all(axis=1)
    assert far.sum() > 1000
    assert (np.sign(found[far, 0]) == np.sign(exact[far])).all()
    assert (np.abs(found[far, 0]) <= np.abs(exact[far]) + 1e-12).all()
    assert (np.abs(found[far, 0]) >= 0.55 - 1e-12).all()


def test_gradient_is_the_exact_derivative_and_continuous_at_cell_faces():
    grid = gridded_mesh("mesh", mesh_of(globe(1.5)), 0.125, 0.55)
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(300, 3))
    points = directions / np.linalg.norm(directions, axis=1)[:, None] * rng.uniform(1.3, 1.9, (300, 1))
    step = 1e-5
    found = looked_up(grid, points)[:, 1:]
    numeric = [
        (looked_up(grid, points + step * e) - looked_up(grid, points - step * e))[:, 0] / (2 * step) for e in np.eye(3)
    ]
    np.testing.assert_allclose(found, np.array(numeric).T, atol=1e-8)
    on_face = points.copy()
    on_face[:, 0] = grid.origin[0] + (np.round((points[:, 0] - grid.origin[0]) / 0.125) + 0.5) * 0.125
    shift = np.array([1e-12, 0, 0])
    left, right = looked_up(grid, on_face - shift), looked_up(grid, on_face + shift)
    np.testing.assert_allclose(left, right, atol=1e-9)


def test_quadratic_distance_is_reproduced_exactly():
    """φ = x² + yz − 3x + 1 on the nodes gives φ everywhere: the coefficients undo the smoothing of the spline."""
    from sim.gridded import coefficients, spline_at

    x, y, z = np.meshgrid(*[np.arange(-2.0, 10.0)] * 3, indexing="ij")
    spline = coefficients((x**2 + y * z - 3 * x + 1)[None])
    value, *gradient = spline_at(spline, 0, 3, 4, 5, 0.3, -0.2, 0.45, 1.0)
    x, y, z = 3.3, 3.8, 5.45
    assert value == pytest.approx(x**2 + y * z - 3 * x + 1, abs=1e-12)
    np.testing.assert_allclose(gradient, [2 * x - 3, z, y], atol=1e-12)


def oblique_impact(scene_of, shape):
    scene = scene_of(
        particles=[{**BEAD, "position": [[3e-4, 1e-4, 1e-3]], "velocity": [[0.2, -0.1, -0.7]],
                    "angular_velocity": [[100.0, -300.0, 50.0]]}],
        contact={"restitution": 0.8, "friction": 0.3},
        walls=[{"name": "floor", "shapes": [shape]}],
        time={"duration": 4e-3},
        output={"interval": 1e-4},
    )  # fmt: skip
    snapshots = list(simulate(scene))
    return np.array(
        [np.concatenate([1e3 * s.position[0], s.velocity[0], s.angular_velocity[0] * R]) for s in snapshots]
    )


def test_face_of_a_mesh_is_a_plane(scene_of, tmp_path):
    """Of whatever triangles: spin, slip, dashpot and path of an oblique impact agree to rounding."""
    plane = oblique_impact(scene_of, {"shape": "plane", "normal": [0, 0, 1]})
    stl = write_stl(tmp_path / "floor.stl", block([-4, -4, -4], [4, 4, 0], cuts=3))
    mesh = oblique_impact(scene_of, {"shape": "mesh", "file": str(stl), "scale": 1e-3, "particles": "outside"})
    assert plane[-1, 5] > 0.4
    assert np.abs(mesh - plane).max() < 1e-12


@pytest.mark.physics
def test_a_ball_rolls_over_the_triangles_of_a_floor_as_over_a_plane(scene_of, tmp_path):
    stl = write_stl(tmp_path / "floor.stl", block([-3e-3, -3e-3, -3e-3], [3e-3, 3e-3, 0], cuts=4))
    speed = 0.1
    scene = scene_of(
        particles=[{**BEAD, "position": [[-1.5e-3, -1.3e-3, R - MASS * G / K]], "velocity": [[speed, 0.8 * speed, 0]],
                    "angular_velocity": [[-0.8 * speed / R, speed / R, 0]]}],
        contact={"restitution": 0.8, "friction": 0.3, "stiffness": K},
        gravity={"acceleration": [0, 0, -G]},
        walls=[wall(stl)],
        time={"duration": 2.8e-2},
        output={"interval": 1e-4},
    )  # fmt: skip
    _, *snapshots = simulate(scene)
    weight = np.array([s.series["force.w.z"] for s in snapshots])
    assert snapshots[-1].position[0, 0] > 1.2e-3
    assert np.abs(weight / (MASS * G) - 1).max() < 1e-6


def energies(scene_of, path, step, **bead):
    scene = scene_of(
        particles=[{**BEAD, **bead}],
        contact={"stiffness": K},
        gravity={"acceleration": [0, 0, -G]},
        walls=[wall(path)],
        time={"duration": 2.4e-2, "step": step},
        output={"interval": 1e-4},
    )
    return list(simulate(scene))


@pytest.mark.physics
def test_no_energy_is_gained_at_the_edge_of_a_block_and_the_error_is_of_second_order(scene_of, tmp_path):
    stl = write_stl(tmp_path / "block.stl", block([-2e-3, -2e-3, -2e-3], [2e-3, 2e-3, 0], cuts=2))
    t_c = np.pi * np.sqrt(MASS / K)
    start = {"position": [[1.6e-3, 1e-4, R - MASS * G / K]], "velocity": [[0.05, 0, 0]]}
    worst = []
    for steps in (25, 50, 100):
        snapshots = energies(scene_of, stl, t_c / steps, **start)
        balance = np.array([s.series["energy.balance"] for s in snapshots])
        worst.append(np.abs(balance - balance[0]).max() / snapshots[0].series["energy.kinetic"])
        assert snapshots[-1].position[0, 2] < -1e-4  # it fell over the edge
        assert snapshots[-1].position[0, 0] > 2e-3
    assert worst[1] < 1e-5  # at the default step
    assert worst[2] < worst[0] / 6  # second order: 16


@pytest.mark.physics
def test_an_elastic_bead_keeps_its_energy_on_a_meshed_sphere(scene_of, tmp_path):
    stl = write_stl(tmp_path / "sphere.stl", globe(1.5e-3))
    start = {"position": [[2e-4, 1e-4, 2.4e-3]], "velocity": [[0.05, 0.02, -0.6]]}
    t_c = np.pi * np.sqrt(MASS / K)
    snapshots = energies(scene_of, stl, t_c / 50, **start)
    balance = np.array([s.series["energy.balance"] for s in snapshots])
    assert snapshots[-1].velocity[0, 2] > -0.3
    assert np.abs(balance[-1] / balance[0] - 1) < 1e-3


def test_a_mesh_turns_with_its_body_and_joins_combinations(scene_of, tmp_path):
    stl = write_stl(tmp_path / "block.stl", block([-1e-3] * 3, [1e-3] * 3))
    spin = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 60.0}
    block_itself = {"shape": "box", "lowest": [-1e-3] * 3, "highest": [1e-3] * 3}
    bore = {"shape": "cylinder", "axis": [1, 0, 0], "radius": 5e-4}
    cut = [
        {"shape": "combination", "operation": "difference", "of": [member, bore], "particles": "outside"}
        for member in ({"shape": "mesh", "file": str(stl)}, block_itself)
    ]
    scene = scene_of(
        particles=[{**BEAD, "position": [[9, 9, 9]]}],
        walls=[{"name": f"w{k}", "shapes": [shape], "motion": spin} for k, shape in enumerate(cut)],
        time={"duration": 1e-2},
        output={"interval": 1e-4},
    )
    from sim.motion import move_bodies

    walls = walls_of(scene)
    move_bodies(walls, 0.1)
    compared = 0
    for point in np.random.default_rng(3).uniform(-1.4e-3, 1.4e-3, (400, 3)):
        mesh, primitives = wall_distance(walls, 0, *point), wall_distance(walls, 1, *point)
        if abs(primitives[0]) < 5e-4:
            assert mesh[0] == pytest.approx(primitives[0], abs=0.25 * spacing_for(2 * R))
            compared += 1
    assert compared > 100


def test_two_meshes_stand_side_by_side(scene_of, tmp_path):
    paths = [write_stl(tmp_path / f"{k}.stl", globe(1e-3) + np.array([3e-3 * k, 0, 0])) for k in (0, 1)]
    scene = scene_of(
        particles=[{**BEAD, "position": [[9, 9, 9]]}],
        walls=[wall(path) | {"name": f"w{k}"} for k, path in enumerate(paths)],
        time={"duration": 1e-2},
        output={"interval": 1e-4},
    )
    walls = walls_of(scene)
    for k in (0, 1):
        assert wall_distance(walls, k, 3e-3 * k, 0.0, 1.4e-3)[0] == pytest.approx(4e-4, abs=5e-6)
        assert wall_distance(walls, k, 3e-3 * (1 - k), 0.0, 1.4e-3)[0] > 0.5e-3


@pytest.mark.parametrize(
    ("triangles", "says"),
    [
        (block([0] * 3, [1e-3] * 3)[1:], "has 3 open edges"),
        (np.concatenate([block([0] * 3, [1e-3] * 3), block([1e-3, 1e-3, 0], [2e-3] * 2 + [1e-3])]),
         "has 1 edges of more than two triangles"),
        (np.concatenate([block([0] * 3, [1e-3] * 3)[:1, ::-1], block([0] * 3, [1e-3] * 3)[1:]]),
         "at 3 edges two triangles disagree"),
        (np.zeros((0, 3, 3)), "holds no triangles"),
    ],
)  # fmt: skip
def test_a_mesh_that_encloses_nothing_is_refused(scene_of, tmp_path, triangles, says):
    stl = write_stl(tmp_path / "bad.stl", triangles)
    scene = scene_of(
        particles=[{**BEAD, "position": [[9, 9, 9]]}],
        walls=[wall(stl)],
        time={"duration": 1e-2},
        output={"interval": 1e-4},
    )
    with pytest.raises(InputError, match=rf"walls\.0\.shapes\.0\.file = '.*bad\.stl': {says}"):
        Simulation(scene)


def test_a_missing_file_and_a_resolution_too_fine_are_refused(scene_of, tmp_path):
    run = {"time": {"duration": 1e-2}, "output": {"interval": 1e-4}, "particles": [{**BEAD, "position": [[9, 9, 9]]}]}
    with pytest.raises(InputError, match=r"walls\.0\.shapes\.0\.file = 'nowhere\.stl': no such file"):
        Simulation(scene_of(walls=[wall("nowhere.stl")], **run))
    stl = write_stl(tmp_path / "large.stl", block([0] * 3, [1] * 3))
    with pytest.raises(
        InputError, match=r"walls\.0\.shapes\.0\.resolution = 0\.0005 m: takes .* in mm, else use 0\.\d+ m or more"
    ):
        Simulation(scene_of(walls=[wall(stl, resolution=5e-4)], **run))


def test_triangles_wound_inwards_enclose_the_same_solid():
    triangles = block([0] * 3, [1] * 3)
    inner, outer = mesh_of(triangles), mesh_of(triangles[:, ::-1])
    points = np.random.default_rng(4).uniform(-0.5, 1.5, (50, 3))
    np.testing.assert_allclose(ExactDistance(inner)(points), ExactDistance(outer)(points), atol=1e-15)


def test_beads_are_packed_in_a_mesh(scene_of, tmp_path):
    stl = write_stl(tmp_path / "ball.stl", globe(4e-3))
    scene = scene_of(
        particles=[{**BEAD, "count": 60}],
        walls=[wall(stl, particles="inside")],
        time={"duration": 1e-2},
        output={"interval": 1e-4},
    )
    beads = Simulation(scene).particles.position
    assert np.linalg.norm(beads, axis=1).max() < 4e-3 - R


def test_distances_are_kept_between_runs_and_made_anew_for_another_file_or_spacing(cache, tmp_path, monkeypatch):
    stl = write_stl(tmp_path / "ball.stl", globe(1e-3))
    made = mesh_distance("mesh", str(stl), 1.0, 2e-4, 5e-4)
    (kept,) = cache.glob("*.npz")
    with monkeypatch.context() as without:
        without.setattr("sim.mesh.gridded_mesh", None)  # not called again
        again = mesh_distance("mesh", str(stl), 1.0, 2e-4, 5e-4)
    np.testing.assert_array_equal(again.spline, made.spline)
    mesh_distance("mesh", str(stl), 1.0, 1e-4, 5e-4)
    write_stl(stl, globe(1.1e-3))
    mesh_distance("mesh", str(stl), 1.0, 2e-4, 5e-4)
    assert len(list(cache.glob("*.npz"))) == 3
    write_stl(stl, globe(1e-3))
    kept.write_bytes(kept.read_bytes()[:1000])  # cut off
    np.testing.assert_array_equal(mesh_distance("mesh", str(stl), 1.0, 2e-4, 5e-4).spline, made.spline)
