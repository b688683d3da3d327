"""The pressure solver against sparse factorisations, closed forms, and itself on another number of threads."""

from math import pi

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from sim.pressure import PressureSolver

CLOSED, OPEN, PERIODIC = "closed", "open", "periodic"  # what the two ends of an axis are


def coefficients(cells, ends, solid=None, decades=0.0, seed=0):
    """Coefficients of all faces over some decades at random, none where a face belongs to a solid cell."""
    rng = np.random.default_rng(seed)
    solid = np.zeros(cells[::-1], bool) if solid is None else solid
    faces = []
    for axis, end in enumerate(ends):
        shape = np.array(cells[::-1])
        shape[2 - axis] += 1
        a = 10.0 ** rng.uniform(-decades, 0.0, shape)
        view, body = np.moveaxis(a, 2 - axis, 0), np.moveaxis(solid, 2 - axis, 0)
        view[:-1][body], view[1:][body] = 0.0, 0.0
        if end == PERIODIC:
            view[0] = view[-1] = np.minimum(view[0], view[-1])
        elif end == CLOSED:
            view[0] = view[-1] = 0.0
        faces.append(a)
    return faces


def matrix(faces, cells, spacing, ends):
    """Dense sum of the equation in the docstring of `sim.pressure`, face by face."""
    number = np.arange(np.prod(cells)).reshape(cells[::-1])
    rows, columns, values = [], [], []

    def add(row, column, value):
        rows.append(row.ravel())
        columns.append(column.ravel())
        values.append(value.ravel())

    for axis, (a, h, end) in enumerate(zip(faces, spacing, ends, strict=True)):
        w, c = np.moveaxis(a, 2 - axis, 0) / h**2, np.moveaxis(number, 2 - axis, 0)
        pairs = [(c[:-1], c[1:], w[1:-1])] + ([(c[-1:], c[:1], w[:1])] if end == PERIODIC else [])
        for one, other, value in pairs:
            for here, there in ((one, other), (other, one)):
                add(here, there, value)
                add(here, here, -value)
        if end != PERIODIC:
            add(c[0], c[0], -2.0 * w[0])
            add(c[-1], c[-1], -2.0 * w[-1])
    triplets = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return coo_array(triplets, shape=(number.size, number.size)).tocsr()


def solver_of(faces, cells, spacing, ends):
    solver = PressureSolver(cells, spacing, tuple(end == PERIODIC for end in ends))
    solver.set_coefficients(*faces)
    return solver


def random_problem(n, decades=0.0, solid=None, seed=1):
    """Return coefficients of a closed cube of n³ cells, a solver for them, and a right-hand side without a mean."""
    cells, ends = (n, n, n), (CLOSED,) * 3
    faces = coefficients(cells, ends, solid, decades)
    rhs = np.random.default_rng(seed).standard_normal(cells)
    return solver_of(faces, cells, (1.0 / n,) * 3, ends), rhs - rhs.mean()


def smooth_problem(n):
    """Return a solver for coefficients 1 + ½ sin 6x cos 5y of a closed unit cube, and a random right-hand side."""
    x, y = np.arange(n + 1) / n, (np.arange(n) + 0.5) / n
    a = 1.0 + 0.5 * np.sin(6 * x) * np.cos(5 * y)[:, None] * np.ones((n, 1, 1))
    a[..., [0, -1]] = 0.0
    y_faces = np.zeros((n, n + 1, n))
    y_faces[:, 1:-1] = 1.0 + 0.5 * np.sin(6 * y) * np.cos(5 * x[1:-1])[:, None]
    z_faces = np.zeros((n + 1, n, n))
    z_faces[1:-1] = 1.0 + 0.5 * np.sin(6 * y) * np.cos(5 * y)[:, None]
    solver = solver_of((a, y_faces, z_faces), (n, n, n), (1.0 / n,) * 3, (CLOSED,) * 3)
    rhs = np.random.default_rng(n).standard_normal((n, n, n))
    return solver, rhs


@pytest.mark.parametrize("cells", [(5, 20, 5), (12, 26, 1), (2, 30, 9), (1, 1, 64), (7, 11, 13), (3, 1, 3)])
@pytest.mark.parametrize(
    "ends",
    [(OPEN, CLOSED, CLOSED), (OPEN, PERIODIC, PERIODIC), (PERIODIC, OPEN, CLOSED), (OPEN, OPEN, OPEN)],
)
def test_pressure_is_that_of_a_sparse_factorisation(cells, ends):
    spacing = (0.1, 0.3, 0.07)
    faces = coefficients(cells, ends, decades=1.0)
    rhs = np.random.default_rng(2).standard_normal(cells[::-1])
    expected = spsolve(matrix(faces, cells, spacing, ends), rhs.ravel()).reshape(rhs.shape)
    pressure = np.ones(rhs.shape)  # any guess
    solution = solver_of(faces, cells, spacing, ends).solve_(pressure, rhs, 1e-10)
    assert solution.residual <= 1e-10
    assert solution.imbalance == 0.0
    assert_allclose(pressure, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("ends", [(CLOSED,) * 3, (PERIODIC,) * 3, (PERIODIC, CLOSED, PERIODIC)])
@pytest.mark.parametrize("cells", [(8, 8, 8), (5, 7, 1), (3, 5, 9)])
def test_without_a_known_pressure_the_mean_of_both_sides_is_taken_away(cells, ends):
    spacing = (0.1, 0.1, 0.1)
    faces = coefficients(cells, ends)
    rhs = np.random.default_rng(3).standard_normal(cells[::-1]) + 2.0
    pressure = np.zeros(rhs.shape)
    solution = solver_of(faces, cells, spacing, ends).solve_(pressure, rhs, 1e-9)
    left = matrix(faces, cells, spacing, ends) @ pressure.ravel() - (rhs - rhs.mean()).ravel()
    assert np.abs(left).max() <= 1.001e-9
    assert solution.residual == pytest.approx(np.abs(left).max(), abs=1e-11)
    assert solution.imbalance == pytest.approx(rhs.mean())
    assert abs(pressure.mean()) < 1e-12 * np.abs(pressure).max()


def test_cells_inside_a_solid_have_no_pressure_and_closed_off_regions_have_each_their_own_mean():
    cells, ends, spacing = (9, 8, 7), (CLOSED, CLOSED, OPEN), (0.1, 0.1, 0.1)
    solid = np.zeros(cells[::-1], bool)
    solid[3] = True  # nothing passes: behind it only the upper half sees no opening
    solid[5, 2:4, 3:6] = True
    faces = coefficients(cells, ends, solid)
    faces[2][-1] = 0.0
    rhs = np.random.default_rng(4).standard_normal(cells[::-1])
    rhs[solid] = np.nan  # ignored
    pressure = np.full(rhs.shape, 7.0)
    solution = solver_of(faces, cells, spacing, ends).solve_(pressure, rhs, 1e-10)
    upper = np.zeros_like(solid)
    upper[4:] = ~solid[4:]
    balanced = np.where(solid, 0.0, rhs)
    balanced[upper] -= rhs[upper].mean()
    left = matrix(faces, cells, spacing, ends) @ pressure.ravel() - balanced.ravel()
    assert np.abs(left).max() <= 1.01e-10
    assert solution.imbalance == pytest.approx(rhs[upper].mean())
    assert_array_equal(pressure[solid], 0.0)
    assert abs(pressure[upper].mean()) < 1e-14


def test_pressure_of_a_smooth_field_converges_with_the_square_of_the_spacing():
    errors = []
    for n in (8, 16, 32):
        x, faces = (np.arange(n) + 0.5) / n, np.arange(n + 1) / n
        exact = np.cos(pi * x) * np.sin(pi * x)[:, None] * np.cos(2 * pi * x)[:, None, None]  # walls, p = 0, periodic
        # ∂x((1 + x) ∂x p) + ∂y² p + ∂z² p
        rhs = (-pi * np.sin(pi * x) - (1 + x) * pi**2 * np.cos(pi * x)) * (
            np.sin(pi * x)[:, None] * np.cos(2 * pi * x)[:, None, None]
        ) - 5 * pi**2 * exact
        ax = np.ones((n, n, 1)) * (1.0 + faces)
        ax[..., [0, -1]] = 0.0
        solver = PressureSolver((n, n, n), (1.0 / n,) * 3, (False, False, True))
        solver.set_coefficients(ax, np.ones((n, n + 1, n)), np.ones((n + 1, n, n)))
        pressure = np.zeros((n, n, n))
        assert solver.solve_(pressure, rhs, 1e-9).residual <= 1e-9
        errors.append(np.sqrt(np.square(pressure - exact).mean()))
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.1)


@pytest.mark.parametrize("n", [16, 32, pytest.param(64, marks=pytest.mark.physics)])
def test_iterations_do_not_grow_with_the_grid_where_coefficients_are_smooth(n):
    solver, rhs = smooth_problem(n)
    solution = solver.solve_(np.zeros_like(rhs), rhs, 1e-8 * np.abs(rhs).max())
    assert solution.iterations <= 12
    assert solution.residual <= 1e-8 * np.abs(rhs).max()


@pytest.mark.parametrize("n", [16, 32, pytest.param(64, marks=pytest.mark.physics)])
def test_solid_bodies_cost_a_few_more_iterations(n):
    x = (np.arange(n) + 0.5) / n
    solid = np.zeros((n, n, n), bool)
    for centre in np.random.default_rng(5).random((12, 3)):
        squares = [(x - c) ** 2 for c in centre]
        solid |= squares[0] + squares[1][:, None] + squares[2][:, None, None] < 0.15**2
    solver, rhs = random_problem(n, solid=solid)
    solution = solver.solve_(np.zeros_like(rhs), rhs, 1e-8 * np.abs(rhs).max())
    assert solution.iterations <= 40


@pytest.mark.parametrize("ratio", [1e-3, 1e-6])
def test_a_porous_bed_below_a_free_fluid_costs_no_more_iterations(ratio):
    n = 32
    faces = coefficients((n, n, n), (CLOSED,) * 3)
    for a in faces:
        a[: n // 2] *= ratio
    solver = solver_of(faces, (n, n, n), (1.0 / n,) * 3, (CLOSED,) * 3)
    rhs = np.random.default_rng(6).standard_normal((n, n, n))
    solution = solver.solve_(np.zeros_like(rhs), rhs, 1e-8 * np.abs(rhs).max())
    assert solution.iterations <= 20
    assert solution.residual <= 1e-8 * np.abs(rhs).max()


def test_flat_cells_cost_no_more_iterations():
    cells, ends = (24, 24, 24), (CLOSED,) * 3
    solver = solver_of(coefficients(cells, ends), cells, (1.0, 0.05, 0.2), ends)
    rhs = np.random.default_rng(7).standard_normal(cells)
    assert solver.solve_(np.zeros_like(rhs), rhs, 1e-8 * np.abs(rhs).max()).iterations <= 20


def test_any_number_of_threads_gives_the_same_bits():
    allowed, found = numba.get_num_threads(), []
    try:
        for threads in (1, numba.config.NUMBA_NUM_THREADS):
            numba.set_num_threads(threads)
            solver, rhs = random_problem(29, decades=1.0)
            found.append(np.zeros_like(rhs))
            solver.solve_(found[-1], rhs, 1e-6)
    finally:
        numba.set_num_threads(allowed)
    assert_array_equal(found[0], found[1])


def test_nothing_to_solve_takes_no_iteration():
    solver, rhs = random_problem(8)
    pressure = np.full_like(rhs, 3.0)
    assert solver.solve_(pressure, np.zeros_like(rhs), 0.0) == (0, 0.0, 0.0)
    assert_array_equal(pressure, 0.0)


def test_a_good_guess_takes_fewer_iterations_and_an_answer_none():
    solver, rhs = random_problem(16)
    pressure = np.zeros_like(rhs)
    cold = solver.solve_(pressure, rhs, 1e-6)
    assert solver.solve_(pressure, rhs, 1e-6).iterations == 0
    assert solver.solve_(pressure, rhs * (1 + 1e-3), 1e-6).iterations < cold.iterations


def test_too_few_iterations_are_told_by_the_residual():
    solver, rhs = random_problem(16)
    solution = solver.solve_(np.zeros_like(rhs), rhs, 1e-9, most=2)
    assert solution.iterations == 2
    assert solution.residual > 1e-9
