"""A box that repeats: the same flow wherever its borders are drawn."""

import numpy as np
import pytest

from sim import InputError, Simulation, simulate
from sim.checkpoint import restore_, state_of

D, SIDE = 1e-3, 8e-3
BOX = {"directions": ["x", "y", "z"], "lowest": [0, 0, 0], "highest": [SIDE] * 3}


def gas(scene_of, shift=(0.0, 0.0, 0.0), friction=0.0, restitution=1.0, duration=0.01, n=5, **tables):
    """Spheres on a lattice thrown about at random, the whole moved by `shift` (m)."""
    rng = np.random.default_rng(4)
    lattice = (np.stack(np.meshgrid(*[np.arange(n)] * 3), axis=-1).reshape(-1, 3) + 0.5) * SIDE / n
    velocity = rng.normal(0.0, 0.5, lattice.shape)
    velocity -= velocity.mean(axis=0)
    return scene_of(
        particles=[{"diameter": D, "density": 2500.0, "position": (lattice + shift).tolist(),
                    "velocity": velocity.tolist()}],
        contact={"stiffness": 1e4, "restitution": restitution, "friction": friction},
        time={"duration": duration}, output={"interval": duration / 10, "precision": "double"},
        **({"periodic": BOX} | tables),
    )  # fmt: skip


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_where_the_borders_are_does_not_change_the_flow(scene_of, friction):
    """Until chaos has made round-off large: at 4 ms about every sphere has collided."""
    shift = np.array([0.3, 0.45, 0.6]) * SIDE
    *_, here = simulate(gas(scene_of, friction=friction, restitution=0.8, duration=4e-3))
    *_, there = simulate(gas(scene_of, shift, friction, 0.8, 4e-3))
    assert here.series["energy.dissipated"] > 1e-3 * here.series["energy.kinetic"]
    np.testing.assert_allclose(there.position - shift, here.position, atol=1e-8 * D)


def test_an_elastic_gas_keeps_momentum_to_round_off_and_energy_to_truncation(scene_of):
    first, *_, last = simulate(gas(scene_of))
    speed = np.abs(first.velocity).max()
    assert np.abs(last.velocity.mean(axis=0) - first.velocity.mean(axis=0)).max() < 1e-13 * speed
    energy = [s.series["energy.balance"] for s in (first, last)]
    assert abs(energy[1] / energy[0] - 1) < 2e-4
    assert np.abs(last.velocity - first.velocity).max() > 0.5  # they did collide


def test_snapshots_follow_a_particle_out_of_the_box(scene_of):
    scene = scene_of(
        particles=[{"diameter": D, "density": 1e3, "position": [[1e-3, 1e-3, 1e-3]], "velocity": [2.0, 0.0, -0.5]}],
        periodic=BOX, time={"duration": 0.02}, output={"interval": 0.001, "precision": "double"},
    )  # fmt: skip
    for moment in simulate(scene):
        expected = [1e-3 + 2 * moment.time, 1e-3, 1e-3 - 0.5 * moment.time]
        np.testing.assert_allclose(moment.position[0], expected, atol=1e-14)


def test_two_spheres_collide_through_the_border(scene_of):
    scene = scene_of(
        particles=[{"diameter": D, "density": 1e3, "position": [[0.6 * D, 0, 0], [SIDE - 0.6 * D, 0, 0]],
                    "velocity": [[-1.0, 0, 0], [1.0, 0, 0]]}],
        periodic=BOX | {"directions": ["x"]}, time={"duration": 1e-3}, output={"interval": 1e-3},
    )  # fmt: skip
    *_, last = simulate(scene)
    np.testing.assert_allclose(last.velocity[:, 0], [1.0, -1.0], rtol=1e-3)


def test_a_floor_holds_particles_where_the_sides_repeat(scene_of):
    floor = {"name": "floor", "shapes": [{"shape": "plane", "normal": [0, 0, 1]}]}
    scene = gas(
        scene_of, (0, 0, 1e-3), 0.3, 0.5, 0.05, periodic=BOX | {"directions": ["x", "y"]}, walls=[floor],
        gravity={"acceleration": [0, 0, -9.81]},
    )  # fmt: skip
    *_, last = simulate(scene)
    assert last.position[:, 2].min() > 0.45 * D
    assert np.ptp(last.position[:, :2], axis=0).max() > SIDE - 2 * D


def stirred(scene_of, at, copies=1):
    """Spheres around a cross that turns about a point (m) of a periodic box; the cross may be there again."""
    ring = [(0.5 + 0.43 * np.cos(a), 0.5 + 0.43 * np.sin(a)) for a in np.arange(12) * np.pi / 6]
    turn = {"kind": "rotation", "axis": [0, 0, 1], "rpm": 600.0}
    walls = []
    for k in range(copies):
        x = at + k * SIDE
        arms = [[[x - 2e-3, 3.5e-3, -1], [x + 2e-3, 4.5e-3, 1]], [[x - 0.5e-3, 2e-3, -1], [x + 0.5e-3, 6e-3, 1]]]
        cross = [{"shape": "box", "lowest": low, "highest": high, "particles": "outside"} for low, high in arms]
        walls.append({"name": f"cross {k}", "motion": turn | {"point": [x, 4e-3, 0]}, "shapes": cross})
    position = [[(a * SIDE + at - 4e-3) % SIDE, b * SIDE, 0] for a, b in ring]
    return scene_of(
        particles=[{"diameter": D, "density": 2500.0, "position": position, "velocity": [0.2, 0.1, 0]}],
        contact={"stiffness": 1e4, "restitution": 0.8, "friction": 0.3},
        periodic=BOX | {"directions": ["x", "y"]}, walls=walls,
        time={"duration": 0.02}, output={"interval": 1e-3, "precision": "double"},
    )  # fmt: skip


def test_a_solid_on_a_border_is_refused_and_one_that_stands_there_twice_is_the_one_within(scene_of):
    for at in (0.0, 2.4e-3, SIDE):
        with pytest.raises(InputError, match=r"walls\.0\.shapes\.0: is or comes .* in x, within a radius of a border"):
            Simulation(stirred(scene_of, at))
    within, across = (list(simulate(stirred(scene_of, *args))) for args in ((4e-3,), (0.0, 2)))
    assert within[-1].series["energy.wall_work"] > 0.1 * within[0].series["energy.kinetic"]
    moved = [(a.position - b.position)[:, 0] + 4e-3 for a, b in zip(across, within, strict=True)]
    np.testing.assert_allclose([m - SIDE * np.round(m / SIDE) for m in moved], 0.0, atol=1e-6 * D)


def test_a_run_in_a_periodic_box_goes_on_bitwise_from_its_state(scene_of):
    scene = gas(scene_of, friction=0.3, restitution=0.9)
    through, before = Simulation(scene), Simulation(scene)
    steps = through.steps_per_snapshot
    through.advance_to(4 * steps)
    before.advance_to(2 * steps)
    after = Simulation(scene)
    restore_(after, state_of(before))
    after.advance_to(4 * steps)
    np.testing.assert_array_equal(after.snapshot().position, through.snapshot().position)


def test_a_box_too_short_for_its_particles_is_refused(scene_of):
    with pytest.raises(ValueError, match=r"periodic.*x"):
        Simulation(gas(scene_of, periodic=BOX | {"highest": [1.9 * D, SIDE, SIDE]}))


def test_an_inverted_box_is_refused(scene_of):
    with pytest.raises(ValueError, match="must exceed lowest"):
        gas(scene_of, periodic=BOX | {"highest": [SIDE, -1.0, SIDE]})
