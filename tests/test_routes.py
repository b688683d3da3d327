"""One contract for every route to the modes, over shapes, ranks and scales; and which route is taken, and why."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pod import InputError, SnapshotMatrix, lanczos_pod
from pod.routes import GRAM_BYTES, Problem, choose_route

EPSILON = np.finfo(float).eps
ROUTES = ("gram", "block", "svd")


@st.composite
def snapshots(draw):
    """A matrix of any shape and rank, with duplicate snapshots and rows of zero, at any scale."""
    rows, n, seed = draw(st.integers(1, 60)), draw(st.integers(2, 40)), draw(st.integers(0, 2**31))
    rng = np.random.default_rng(seed)
    rank = draw(st.integers(1, min(rows, n)))
    W = (rng.standard_normal((rows, rank)) * 10.0 ** -rng.uniform(0, 3, rank)) @ rng.standard_normal((rank, n))
    if draw(st.booleans()):
        W[rng.integers(0, rows, rows // 3)] = 0.0
    if draw(st.booleans()):
        W = W[:, rng.integers(0, n, n)]
    offset = draw(st.sampled_from([0.0, 1.0, -100.0]))
    return (W + offset) * 10.0 ** draw(st.integers(-120, 120))


@pytest.mark.parametrize("route", ROUTES)
@settings(deadline=None, max_examples=60)
@given(W=snapshots(), wanted=st.integers(1, 40), block_rows=st.integers(1, 70))
def test_every_route_finds_the_modes_that_there_are(route, W, wanted, block_rows):
    motion = W - W.mean(axis=1, keepdims=True)
    if not np.abs(motion).max() > 1e-9 * np.abs(W).max():
        return  # nothing moves, or by rounding only
    sigma = torch.linalg.svdvals(torch.from_numpy(motion)).numpy()
    values = sigma**2 / W.shape[1]
    basis = lanczos_pod(SnapshotMatrix(W, block_rows), modes=wanted, route=route)
    p = len(basis.values)
    # motion itself carries the rounding of positions; what lies below it or below 1e-13 λ₁ is noise
    noise = max(1e-13, (100 * EPSILON * np.abs(W).max() / np.abs(motion).max()) ** 2)
    assert min(wanted, int((values > 10 * noise * values[0]).sum())) <= p <= wanted
    assert np.abs(basis.values - values[:p]).max() <= 1e-10 * values[0]
    assert np.abs(basis.modes.T @ basis.modes - np.eye(p)).max() <= 1e-12
    assert basis.orthogonality <= 1e-12
    left = np.linalg.norm(motion - basis.modes @ (basis.modes.T @ motion))
    tail = np.linalg.norm(sigma[p:])
    assert left <= tail + 1e-6 * sigma[0]
    assert left**2 - tail**2 <= 1e-10 * sigma[0] ** 2


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("scale", [1e-300, 1e-170, 1e160, 1e300])
def test_motion_whose_square_a_double_cannot_hold_is_refused_with_its_size(route, scale):
    W = scale * np.random.default_rng(0).standard_normal((30, 12))
    with pytest.raises(InputError, match=r"they move by .*e[+-]\d+, whose square a double cannot hold; choose a unit"):
        lanczos_pod(W, modes=3, route=route)


@pytest.mark.parametrize("route", ROUTES)
def test_a_value_that_is_not_finite_is_refused_by_its_place(route):
    W = np.random.default_rng(0).standard_normal((300, 12))
    W[211, 7] = np.inf
    with pytest.raises(InputError, match="row 211 of snapshot 7 is inf"):
        lanczos_pod(W, modes=3, route=route)


@pytest.mark.parametrize("route", ROUTES)
def test_modes_are_orthonormal_in_the_weighted_inner_product(route):
    rng = np.random.default_rng(4)
    W, weights = rng.standard_normal((200, 30)) + 5.0, rng.uniform(0.5, 20.0, 200)
    basis = lanczos_pod(SnapshotMatrix(W, weights=weights), modes=8, route=route)
    root = np.sqrt(weights)[:, None]
    motion = W - W.mean(axis=1, keepdims=True)
    U, sigma, _ = np.linalg.svd(root * motion, full_matrices=False)
    assert np.abs(basis.modes.T @ (weights[:, None] * basis.modes) - np.eye(8)).max() <= 1e-12
    assert np.abs(basis.values - sigma[:8] ** 2 / 30).max() <= 1e-12 * sigma[0] ** 2
    projector = root * basis.modes
    assert np.linalg.norm(projector @ projector.T - U[:, :8] @ U[:, :8].T, 2) <= 1e-9
    assert np.abs(basis.mean - W.mean(axis=1)).max() <= 1e-13
    left = (basis.reconstruct(basis.project(W)) - W) * root
    assert np.sum(left**2) == pytest.approx(np.sum(sigma[8:] ** 2), rel=1e-10)


@pytest.mark.parametrize(
    ("weights", "words"),
    [(np.ones(3), r"shape \(3,\); give one per row, \(200,\)"), (np.zeros(200), "0.0 at row 0; give positive ones")],
)
def test_weights_that_are_none_are_refused(weights, words):
    with pytest.raises(InputError, match=words):
        SnapshotMatrix(np.ones((200, 3)), weights=weights)


def test_the_error_left_is_the_one_allowed_and_a_mode_less_leaves_more():
    rng = np.random.default_rng(1)
    W = (rng.standard_normal((300, 40)) * 0.8 ** np.arange(40)) @ rng.standard_normal((40, 90))
    basis = lanczos_pod(W, error=0.05)

    def left(n):
        return np.sqrt(np.square(basis.reconstruct(basis.project(W)[:, :n]) - W).mean())

    p = len(basis.values)
    assert left(p) <= 0.05 < left(p - 1)


def steep(rows=3000, snapshots=300, seed=2):
    """The matrix of verification.md whose modes single-precision inner products lose: s_k = 10^(-(k-1)/20)."""
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.standard_normal((rows, snapshots - 1)))[0]
    V = rng.standard_normal((snapshots, snapshots - 1))
    V = np.linalg.qr(V - V.mean(axis=0))[0]
    return ((U * 10.0 ** (-np.arange(snapshots - 1) / 20)) @ V.T).astype(np.float32)


@pytest.mark.parametrize("route", ROUTES)
def test_a_steep_spectrum_in_single_precision_keeps_its_hundred_modes(route):
    W = steep()
    basis = lanczos_pod(W, modes=100, route=route)
    motion = W.astype(float) - W.astype(float).mean(axis=1, keepdims=True)
    left = np.linalg.norm(motion - basis.modes @ (basis.modes.T @ motion))
    optimal = np.linalg.norm(np.linalg.svd(motion, compute_uv=False)[100:])
    assert left <= 1.001 * optimal
    assert np.abs(basis.modes.T @ basis.modes - np.eye(100)).max() <= 1e-6


def test_modes_that_inner_products_lose_are_left_out_and_said_so_where_a_dense_solver_keeps_them():
    rng = np.random.default_rng(3)
    sigma = 10.0 ** -np.arange(0, 14, 0.5)
    U = np.linalg.qr(rng.standard_normal((200, len(sigma))))[0]
    V = rng.standard_normal((60, len(sigma)))
    V = np.linalg.qr(V - V.mean(axis=0))[0]
    W = (U * sigma) @ V.T
    squared, dense = (lanczos_pod(W, modes=28, route=route) for route in ("gram", "svd"))
    assert 12 <= len(squared.values) <= 15  # down to 3e-7 σ₁
    assert "smaller eigenvalues are noise" in squared.reason
    assert len(dense.values) >= 27
    assert dense.orthogonality <= 1e-12
    own = np.sqrt(60 * dense.values[:24])
    assert np.abs(own - sigma[:24]).max() <= 1e-14
    assert np.abs(own / sigma[:24] - 1.0)[:20].max() <= 1e-5


@pytest.mark.parametrize(
    ("problem", "route", "words"),
    [
        (Problem(50, 400, None, True, 1), "svd", "50 rows are no more than 400 snapshots"),
        (Problem(100_000, 500, 100, True, 1), "gram", "block Lanczos on the rows"),
        (Problem(100_000, 500, None, True, 1), "gram", "estimated"),
        (Problem(100_000, 4000, 20, True, 1), "block", "inner products first"),
        (Problem(100_000, 20_000, None, True, 1), "block", "need more than 2 GiB"),
        (Problem(100_000, 4000, 400, False, 1), "gram", "estimated"),
    ],
)
def test_the_cheapest_route_is_taken_and_the_reason_is_said(problem, route, words):
    choice = choose_route(problem)
    assert choice.route == route
    assert words in choice.reason
    assert GRAM_BYTES < 16 * 20_000**2


def test_the_route_taken_is_in_the_result():
    W = np.random.default_rng(0).standard_normal((300, 40))
    basis = lanczos_pod(W, modes=3)
    assert (basis.route, basis.route_reason[:9]) == ("gram", "estimated")
    assert lanczos_pod(W, modes=3, route="block").route_reason == "asked for"
    assert lanczos_pod(W.T, modes=3).route == "svd"


def test_a_dense_route_needs_all_rows_in_one_process():
    with pytest.raises(InputError, match="needs all rows in one process"):
        choose_route(Problem(50, 400, None, True, 2), "svd")


def test_threads_change_the_result_by_rounding_only():
    W = np.cumsum(np.random.default_rng(5).standard_normal((40_000, 30)), axis=1)
    before = torch.get_num_threads()
    found = []
    try:
        for threads in (1, 3):
            torch.set_num_threads(threads)
            found.append([lanczos_pod(W, modes=6, route=route) for route in ("gram", "block")])
    finally:
        torch.set_num_threads(before)
    for one, other in zip(*found, strict=True):
        assert np.abs(one.values - other.values).max() <= 1e-12 * one.values[0]
        assert np.abs(one.modes - other.modes).max() <= 1e-10
        assert np.abs(one.mean - other.mean).max() <= 1e-12
