"""The neighbour list against all pairs, and the contacts it carries."""

import numba
import numpy as np
import pytest

from sim import parse_scene, scene_text, simulate
from sim.cells import cell_grid, sort_by_cell
from sim.neighbors import empty_neighbors, rebuilt_neighbors


def build(position, radius, skin, old=None, spring=None, period=(0.0, 0.0, 0.0), fixed=None):
    period = np.array(period)
    grid = cell_grid(position, 2 * radius.max() + skin, np.zeros(3), period)
    order, start = sort_by_cell(position, grid)
    old = old or empty_neighbors(len(radius), 1, period)
    inverse_mass = np.ones(len(radius)) if fixed is None else np.where(fixed, 0.0, 1.0)
    rows = (position[order], radius[order], inverse_mass[order])
    return order, *rebuilt_neighbors(*rows, order, start, grid, skin, old, spring)


def pairs_of(order, listed):
    """Return every entry as (lister, partner), numbered as before sorting."""
    return [
        (order[i], order[listed.partner[e]]) for i in range(len(order)) for e in range(listed.first[i], listed.last[i])
    ]


@pytest.mark.parametrize("n", [2, 40, 3000])
@pytest.mark.parametrize("stretch", [(1, 1, 1), (30, 0.2, 0.2), (1, 1, 0)])
def test_list_holds_every_near_pair_once(n, stretch):
    rng = np.random.default_rng(n)
    position = rng.uniform(0, n ** (1 / 3), (n, 3)) * np.array(stretch) * 1e-3
    radius = rng.uniform(2e-4, 6e-4, n)
    skin = 1e-4
    order, listed, _ = build(position, radius, skin)
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    near = np.triu(distance < radius[:, None] + radius[None] + skin, 1)
    expected = {(int(i), int(j)) for i, j in zip(*np.nonzero(near), strict=True)}
    found = pairs_of(order, listed)
    place = np.argsort(order)
    chunk = np.searchsorted(listed.chunks, place, side="right")
    assert {(min(int(i), int(j)), max(int(i), int(j))) for i, j in found} == expected
    assert len(found) == len(expected)
    assert len(listed.receiver) == sum(chunk[i] != chunk[j] for i, j in expected)


@pytest.mark.parametrize("size", [(1, 1, 1), (4, 0.25, 1), (0.16, 2, 2)])  # the last: fewer than three cells
@pytest.mark.parametrize("directions", [(1, 1, 1), (1, 0, 0), (0, 1, 1)])
def test_list_holds_the_nearest_image_of_every_near_pair_where_the_box_repeats(size, directions):
    rng = np.random.default_rng(11)
    n, skin = 1200, 1e-4
    lengths = 12e-3 * np.array(size)
    period = lengths * np.array(directions)
    position = rng.uniform(0, 1, (n, 3)) * lengths
    radius = rng.uniform(2e-4, 4e-4, n)
    order, listed, _ = build(position, radius, skin, period=period)
    between = position[:, None] - position[None]
    turns = np.round(np.divide(between, period, out=np.zeros_like(between), where=period > 0))
    distance = np.linalg.norm(between - turns * period, axis=2)
    near = np.triu(distance < radius[:, None] + radius[None] + skin, 1)
    expected = {(int(i), int(j)) for i, j in zip(*np.nonzero(near), strict=True)}
    found = {(min(int(i), int(j)), max(int(i), int(j))) for i, j in pairs_of(order, listed)}
    assert found == expected
    assert len(pairs_of(order, listed)) == len(expected)
    for i in range(n):
        for e in range(listed.first[i], listed.last[i]):
            np.testing.assert_array_equal(listed.image[e], turns[order[i], order[listed.partner[e]]])


def test_two_fixed_particles_are_no_pair():
    position = np.array([[0, 0, 0], [1e-3, 0, 0], [5e-4, 9e-4, 0]])
    order, listed, _ = build(position, np.full(3, 6e-4), 1e-4, fixed=np.array([True, True, False]))
    assert {frozenset(map(int, pair)) for pair in pairs_of(order, listed)} == {frozenset({0, 2}), frozenset({1, 2})}


def test_every_pair_across_chunks_has_a_letter_box_of_its_own_in_the_chunk_of_its_partner():
    rng = np.random.default_rng(3)
    n = 3000
    _, listed, _ = build(rng.uniform(0, 12e-3, (n, 3)), np.full(n, 5e-4), 1e-4)
    used = []
    for i in range(n):
        for e in range(listed.first[i], listed.last[i]):
            assert listed.owner[e] == i
            own, other = np.searchsorted(listed.chunks, [i, listed.partner[e]], side="right")
            if own == other:
                assert listed.target[e] == listed.partner[e]
                continue
            box = int(listed.target[e]) - n
            assert listed.receiver[box] == listed.partner[e]
            assert listed.boxes[other - 1] <= box < listed.boxes[other]
            used.append(box)
    assert sorted(used) == list(range(len(listed.receiver)))
    assert len(used) > 100


def test_contacts_survive_a_new_order_with_the_sign_of_their_spring():
    rng = np.random.default_rng(5)
    n = 2500
    position = rng.uniform(0, 12e-3, (n, 3))
    radius = np.full(n, 5e-4)
    order, listed, spring = build(position, radius, 1e-4, spring=np.zeros((1, 3)))

    def spring_of(i, j):  # antisymmetric, so that both partners of a pair agree
        return np.array([i - j, (i - j) * (i + j), np.sin(i) - np.sin(j)], float)

    for i in range(n):
        for e in range(listed.first[i], listed.last[i]):
            listed.touching[e] = 1
            spring[e] = spring_of(order[i], order[listed.partner[e]])
    # the next list is in another order: the axes change places
    now = position[order][:, [2, 0, 1]]
    again, moved, carried = build(now, radius, 1e-4, listed, spring)
    names = order[again]
    assert moved.touching.sum() == sum(moved.last - moved.first)
    for i in range(n):
        for e in range(moved.first[i], moved.last[i]):
            np.testing.assert_array_equal(carried[e], spring_of(names[i], names[moved.partner[e]]))


def test_few_particles_far_apart_do_not_ask_for_cells_without_number():
    position = np.array([[0.0, 0, 0], [1e3, 0, 0], [0, 1e3, 1e3]])
    assert np.prod(cell_grid(position, 1e-3).cells) < 1000


def test_run_is_bitwise_the_same_on_one_thread_and_on_two():
    text = scene_text("mini_mill").replace("duration = 0.2", "duration = 0.004")
    runs = []
    for threads in (1, 2):
        before = numba.get_num_threads()
        numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
        *_, last = simulate(parse_scene(text))
        numba.set_num_threads(before)
        runs.append(last)
    np.testing.assert_array_equal(runs[0].position, runs[1].position)
    np.testing.assert_array_equal(runs[0].angular_velocity, runs[1].angular_velocity)
    assert runs[0].series == runs[1].series


def test_room_for_the_list_does_not_grow_as_it_is_rebuilt():
    rng = np.random.default_rng(7)
    position, radius = rng.uniform(0, 12e-3, (2000, 3)), np.full(2000, 5e-4)
    _, listed, _ = build(position, radius, 1e-4)
    for _ in range(20):
        _, again, _ = build(position, radius, 1e-4, listed)
        assert len(again.partner) == len(listed.partner)
        listed = again
