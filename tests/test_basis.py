"""Modes of snapshots: the best there are, in a fixed order and sign, with honest numbers beside them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pod import Basis, InputError, SnapshotMatrix, lanczos_pod

EPSILON = np.finfo(float).eps
RNG = np.random.default_rng(11)


def with_spectrum(rows, n_times, sigma, seed=0):
    """Snapshots whose centred singular values are sigma, about a mean of one."""
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.standard_normal((rows, len(sigma))))[0]
    V = rng.standard_normal((n_times, len(sigma)))
    V = np.linalg.qr(V - V.mean(axis=0))[0]
    return 1.0 + (U * sigma) @ V.T


CASES = {
    "random": RNG.standard_normal((300, 40)),
    "deficient": with_spectrum(300, 60, np.linspace(2, 1, 15)),
    "clustered": with_spectrum(300, 60, np.concatenate([1 + 1e-8 * np.arange(10), 1e-3 * np.ones(20)])),
    "repeated": with_spectrum(300, 60, np.repeat([4.0, 2.0, 1.0], 8)),
    "geometric to 1e-16": with_spectrum(400, 80, 10.0 ** np.linspace(0, -16, 70)),
    "duplicate snapshots": np.repeat(RNG.standard_normal((300, 20)), 2, axis=1),
    "constant rows": np.vstack([RNG.standard_normal((50, 30)), np.ones((100, 1)) * np.full((1, 30), 7.0)]),
    "fewer rows than snapshots": RNG.standard_normal((12, 90)),
    "two snapshots": RNG.standard_normal((40, 2)),
    "single precision": RNG.standard_normal((300, 40)).astype(np.float32),
}


def dense(W):
    W = np.asarray(W, dtype=float)
    D = W - W.mean(axis=1, keepdims=True)
    U, sigma, _ = np.linalg.svd(D, full_matrices=False)
    return D, U, sigma**2 / W.shape[1]


@pytest.mark.parametrize("route", ["gram", "block", "svd"])
@pytest.mark.parametrize("name", CASES)
def test_every_mode_there_is_agrees_with_a_dense_solver(name, route):
    W = CASES[name]
    D, _, values = dense(W)
    basis = lanczos_pod(W, modes=W.shape[1], route=route)
    p = len(basis.values)
    # λ below 1e-13 λ₁ is noise of the inner products; a spectrum that crosses that line may lose one either side.
    # A dense decomposition squares nothing and sees singular values down to rounding.
    noise = (max(W.shape) * EPSILON) ** 2 if route == "svd" else 1e-13
    rank = int((values > noise * values[0]).sum())
    assert abs(p - rank) <= (1 if name.startswith("geometric") else 0)
    assert np.abs(basis.values - values[:p]).max() <= 1e-10 * values[0]
    assert np.abs(basis.modes.T @ basis.modes - np.eye(p)).max() <= 1e-12
    # Eckart-Young: what the modes leave is the tail of the spectrum
    left = np.square(D - basis.modes @ (basis.modes.T @ D)).sum() / W.shape[1]
    assert abs(left - values[p:].sum()) <= 1e-10 * values.sum()
    assert_allclose(basis.total_energy, values.sum(), rtol=1e-13)


@pytest.mark.parametrize("n", [1, 3, 8])
def test_truncation_error_is_the_tail_of_the_spectrum(n):
    W = CASES["random"]
    D, _, values = dense(W)
    basis = lanczos_pod(W, modes=n)
    left = np.square(D - basis.modes @ (basis.modes.T @ D)).sum() / W.shape[1]
    assert abs(left - values[n:].sum()) <= 1e-10 * values.sum()


def test_the_largest_entry_of_each_mode_is_positive():
    basis = lanczos_pod(CASES["random"], modes=20)
    largest = np.abs(basis.modes).argmax(axis=0)
    assert (basis.modes[largest, np.arange(20)] > 0).all()


def test_blocks_and_row_order_change_the_modes_by_rounding_only():
    sigma = 0.7 ** np.arange(30)
    W = with_spectrum(500, 60, sigma)
    order = np.random.default_rng(3).permutation(500)
    whole, blocked = lanczos_pod(W, modes=10), lanczos_pod(SnapshotMatrix(W, 33), modes=10)
    shuffled = lanczos_pod(W[order], modes=10)
    gap = (sigma[9] ** 2 - sigma[10] ** 2) / sigma[0] ** 2
    for other, modes in [(blocked, blocked.modes), (shuffled, shuffled.modes[np.argsort(order)])]:
        assert np.abs(other.values - whole.values).max() <= 1e-12 * whole.values[0]
        difference = modes @ modes.T - whole.modes @ whole.modes.T
        assert np.linalg.norm(difference, 2) <= 100 * EPSILON / gap


def test_energy_is_reached_and_no_earlier():
    W = with_spectrum(400, 100, 0.9 ** np.arange(60))
    _, _, values = dense(W)
    ratio = np.cumsum(values) / values.sum()
    basis = lanczos_pod(W, energy=0.99, reconstructable=0.99)
    n = int(np.argmax(ratio >= 0.99)) + 1
    assert len(basis.values) == n == basis.n_lr
    assert_allclose(basis.ratio, ratio[:n], rtol=1e-12)


def test_the_least_reconstructable_mode_counts_all_energy_and_the_papers_fewer():
    # a slow spectrum: the Ritz values of few steps hold less than the trace, and the paper's ratio is reached sooner
    W = with_spectrum(2000, 400, (1 + np.arange(380)) ** -1.2)
    _, _, values = dense(W)
    basis = lanczos_pod(W, energy=0.9, reconstructable=0.9)
    assert basis.n_lr == int(np.argmax(np.cumsum(values) >= 0.9 * values.sum())) + 1
    assert basis.n_lr_ritz is not None
    assert basis.n_lr_ritz <= basis.n_lr
    assert basis.steps < 0.8 * 400
    assert basis.n_lr_paper is None  # which counts the leading 80 % of the eigenvalues, and so many are not known
    assert lanczos_pod(W, modes=3).n_lr is None


def test_tolerance_holds_for_the_worst_snapshot_and_with_a_mode_less_does_not():
    W = with_spectrum(400, 100, 0.8 ** np.arange(60))
    basis = lanczos_pod(W, tolerance=1e-3)

    def worst(n):
        c = basis.project(W)[:, :n]
        return np.sqrt(np.square(basis.reconstruct(c) - W).mean(axis=0)).max()

    n = len(basis.values)
    assert worst(n) <= 1e-3 < worst(n - 1)


def test_a_snapshot_comes_back_from_all_its_coefficients():
    W = CASES["deficient"]
    basis = lanczos_pod(SnapshotMatrix(W, 64), modes=60)
    assert len(basis.values) == 15
    assert "rank 15" in basis.reason
    assert np.abs(basis.reconstruct(basis.project(W)) - W).max() <= 1e-13 * np.abs(W).max() * 10


def test_projection_of_unseen_snapshots_is_about_the_training_mean():
    W = CASES["random"]
    basis = lanczos_pod(W[:, :20], modes=5)
    assert_allclose(basis.project(W), (W - W[:, :20].mean(axis=1, keepdims=True)).T @ basis.modes, atol=1e-12)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"energy": 1.5}, "energy: 1.5"),
        ({"energy": 0.0}, "energy: 0"),
        ({"modes": 0}, "modes: 0"),
        ({"tolerance": -1.0}, "tolerance: -1"),
        ({"modes": 3, "energy": 0.9}, "give one"),
        ({"route": "fast"}, "route: 'fast'"),
    ],
)
def test_a_bad_setting_is_refused(settings, message):
    with pytest.raises(InputError, match=message):
        lanczos_pod(CASES["random"], **settings)


def test_one_snapshot_is_refused():
    with pytest.raises(InputError, match="snapshots: 1; a decomposition needs at least 2"):
        lanczos_pod(np.ones((5, 1)))


def test_snapshots_in_which_nothing_moves_are_refused():
    with pytest.raises(InputError, match="nothing moves"):
        lanczos_pod(np.ones((5, 4)))


def test_other_particles_are_refused():
    basis: Basis = lanczos_pod(CASES["random"], modes=3)
    with pytest.raises(InputError, match="the basis has 300"):
        basis.project(np.zeros((299, 2)))
    with pytest.raises(InputError, match="at most 3 modes"):
        basis.reconstruct(np.zeros((2, 4)))


def test_fewer_modes_than_asked_for_by_the_rule_have_no_least_reconstructable_one():
    W = with_spectrum(400, 100, 0.9 ** np.arange(60))
    assert lanczos_pod(W, energy=0.9).n_lr is None
    assert lanczos_pod(W, energy=0.9999).n_lr == lanczos_pod(W, energy=0.999).n_lr == len(lanczos_pod(W).values)
