"""The Lanczos ratio converges from below, and the paper's denominator flatters it."""

import numpy as np
import pytest

from pod import lanczos_convergence, lanczos_pod


@pytest.fixture(scope="module")
def basis():
    rng = np.random.default_rng(0)
    W = (rng.standard_normal((2000, 300)) * (1 + np.arange(300)) ** -0.8) @ rng.standard_normal((300, 400))
    return lanczos_pod(W, modes=60, route="gram")


def test_the_ratio_rises_to_that_of_the_basis(basis):
    found = lanczos_convergence(basis)
    assert found.steps[0] == 1
    assert found.steps[-1] == basis.steps == len(basis.tridiagonal)
    assert (np.diff(found.ratio) >= -1e-12).all()  # Cauchy's interlacing
    assert found.ratio[-1] == pytest.approx(basis.ratio[-1], rel=1e-10)
    assert found.ratio[len(found.ratio) // 4] < basis.ratio[-1]


def test_few_steps_under_count_the_modes_where_the_total_is_that_of_the_ritz_values(basis):
    found = lanczos_convergence(basis, energy=0.8)
    reached = found.n_lr > 0
    assert reached[-1]
    assert (found.n_lr[reached] >= found.n_lr[-1]).all()  # Ritz values lie below the eigenvalues
    early = found.steps < basis.steps / 2
    assert (found.n_lr_ritz[early] < found.n_lr[-1]).all()
    assert (found.paper_ratio[early] > found.ratio[early]).all()


def test_a_dense_basis_has_no_steps():
    dense = lanczos_pod(np.random.default_rng(1).standard_normal((20, 50)), modes=3)
    assert dense.route == "svd"
    assert len(lanczos_convergence(dense).steps) == 0
