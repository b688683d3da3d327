"""Lanczos finds what a dense eigensolver finds: every copy, no ghost, and not more than there is."""

import numpy as np
import pytest
import torch

from pod import lanczos

EPSILON = np.finfo(float).eps


def symmetric(spectrum, seed=0):
    n = len(spectrum)
    Q = torch.linalg.qr(torch.from_numpy(np.random.default_rng(seed).standard_normal((n, n))))[0]
    A = (Q * torch.tensor(np.array(spectrum), dtype=torch.float64)) @ Q.T
    return (A + A.T) / 2


def leading(A, p, **settings):
    def wanted(ritz, _):
        return p if len(ritz) >= p else None

    return lanczos(lambda V: A @ V, len(A), wanted, trace=float(A.trace()), **settings)


SPECTRA = {
    "random": np.sort(np.random.default_rng(0).chisquare(3, 120))[::-1],
    "repeated": np.repeat([8.0, 5.0, 3.0, 1.0], 30),
    "twice each": np.repeat(0.8 ** np.arange(60), 2),
    "clustered": np.concatenate([1 + 1e-9 * np.arange(10), 0.5 + 1e-7 * np.arange(30), 0.01 * np.ones(80)])[::-1],
    "deficient": np.concatenate([np.linspace(2, 1, 25), np.zeros(95)]),
    "geometric to 1e-16": 10.0 ** np.linspace(0, -16, 120),
    "identity": np.ones(120),
    "one": np.eye(120)[0],
    "tiny": 1e-30 * 0.9 ** np.arange(120),
    "huge": 1e30 * 0.9 ** np.arange(120),
}


@pytest.mark.parametrize("name", SPECTRA)
@pytest.mark.parametrize("p", [1, 7, 40, 120])
def test_values_are_those_of_a_dense_solver(name, p):
    A = symmetric(SPECTRA[name])
    dense = torch.linalg.eigvalsh(A).flip(0)
    pairs = leading(A, p)
    rank = int((dense > 1e-13 * dense[0]).sum())
    # the noise floor is a line drawn in noise: one or two of a spectrum that crosses it may fall either side
    assert abs(len(pairs.values) - min(p, rank)) <= (2 if name.startswith("geometric") and p == 120 else 0)
    assert (pairs.values - dense[: len(pairs.values)]).abs().max() <= 1e-10 * dense[0]


@pytest.mark.parametrize("name", SPECTRA)
def test_vectors_are_orthonormal_and_their_residuals_bounded(name):
    A = symmetric(SPECTRA[name])
    pairs = leading(A, 40)
    p = len(pairs.values)
    assert (pairs.vectors.T @ pairs.vectors - torch.eye(p, dtype=torch.float64)).abs().max() <= 1e-12
    residual = torch.linalg.vector_norm(A @ pairs.vectors - pairs.vectors * pairs.values, dim=0)
    # the bound is that of exact arithmetic; n ε λ₁ is the rounding of the check itself
    assert (residual <= pairs.residuals + len(A) * EPSILON * pairs.values[0]).all()
    assert (pairs.values.diff() <= 0).all()


def test_a_copy_that_the_krylov_space_cannot_see_is_not_missed():
    # in exact arithmetic one starting vector sees one of the two largest; residuals alone would stop with 2, 1.9
    A = torch.diag(torch.tensor([2.0, 2.0, 1.9] + [1e-6] * 97, dtype=torch.float64))
    pairs = leading(A, 2)
    assert torch.allclose(pairs.values, torch.tensor([2.0, 2.0], dtype=torch.float64), rtol=1e-12)


def test_without_reorthogonalisation_there_are_ghosts_and_with_it_none():
    spectrum = np.concatenate([[100.0], 0.9 ** np.arange(149)])
    A = symmetric(spectrum)
    n = len(A)
    q, before, beta = torch.ones(n, dtype=torch.float64) / n**0.5, torch.zeros(n, dtype=torch.float64), 0.0
    diagonal, off = [], []
    for _ in range(100):
        w = A @ q - beta * before
        diagonal.append(float(q @ w))
        w = w - diagonal[-1] * q
        beta = float(torch.linalg.vector_norm(w))
        off.append(beta)
        before, q = q, w / beta
    plain = np.linalg.eigvalsh(np.diag(diagonal) + np.diag(off[:-1], 1) + np.diag(off[:-1], -1))
    assert (plain > 50).sum() > 1
    assert int((leading(A, 60).values > 50).sum()) == 1


def test_a_decaying_spectrum_needs_few_steps():
    pairs = leading(symmetric(0.5 ** np.arange(400)), 10)
    assert pairs.steps < 60
    assert pairs.reason.startswith("10 pairs converged")


def test_more_than_the_rank_is_not_given():
    pairs = leading(symmetric(SPECTRA["deficient"]), 60)
    assert len(pairs.values) == 25
    assert pairs.reason.startswith("rank 25")


def test_the_same_twice():
    A = symmetric(SPECTRA["random"])
    first, second = leading(A, 20), leading(A, 20)
    assert torch.equal(first.values, second.values)
    assert torch.equal(first.vectors, second.vectors)


def test_another_start_finds_the_same():
    A = symmetric(SPECTRA["twice each"])
    first, second = leading(A, 20), leading(A, 20, seed=7)
    assert (first.values - second.values).abs().max() <= 1e-12 * first.values[0]
    between = first.vectors @ first.vectors.T - second.vectors @ second.vectors.T
    # the last pair of the 20 is separated from the next by 0.2 of itself, 0.027 λ₁
    assert torch.linalg.matrix_norm(between, 2) <= 1e-10
