"""Verdicts from inner products that somebody else made: a simulation, other processes, a file."""

import numpy as np
import pytest

from selection import ArraySnapshots, InnerProducts, InputError, inner_products, judge, square_root, sweep


def test_inner_products_known_already_are_judged_as_the_snapshots_are():
    rng = np.random.default_rng(7)
    times = np.arange(121) * 1e-3
    modes = np.array([np.cos(np.pi * j * times / 0.12 + j) / j**2 for j in range(1, 61)])
    W = rng.standard_normal((300, 60)) @ modes + 1.0
    snapshots = ArraySnapshots(W)
    products = inner_products(snapshots, 10)
    grown = np.empty_like(products.gram)
    for k in range(len(times)):  # snapshot by snapshot, as a simulation gives them
        grown[k, : k + 1] = grown[: k + 1, k] = (W[:, : k + 1] - W[:, :1]).T @ (W[:, k] - W[:, 0])
    whole = sweep(W, times)
    for known in (products, products._replace(gram=grown)):
        found = judge(known, times, factor=lambda: square_root(snapshots, products.gram))
        for mine, theirs in zip(found.candidates, whole.candidates, strict=True):
            assert (mine.n_lr, mine.n_c, mine.verdict) == (theirs.n_lr, theirs.n_c, theirs.verdict)


def test_without_a_second_pass_inner_products_admit_that_rounding_hides_the_crossing():
    # forty motions from 1e-6 down to 1e-7 beside one of 1, and an unseen one: R_c rises more slowly than it is known
    rng = np.random.default_rng(8)
    t = np.arange(161)
    shapes = np.linalg.qr(rng.standard_normal((400, 42)))[0]
    amplitudes = np.append(1.0, 10.0 ** -np.linspace(6, 7, 40))
    seen = amplitudes[:, None] * np.cos(np.pi * np.arange(1, 42)[:, None] * t / 160)
    W = shapes[:, :41] @ seen + 3e-7 * shapes[:, 41:] * np.sin(np.pi * t / 2) ** 2
    snapshots = ArraySnapshots(W)
    products = inner_products(snapshots, None)
    (poor,) = judge(products, t * 1e-3, [0.002]).candidates
    (exact,) = sweep(W, t * 1e-3, [0.002], groups=None).candidates
    assert (exact.n_c, exact.verdict) == (20, "sufficient")  # as singular values of W itself say
    assert poor.verdict == "undecidable"
    assert "inner products know R_c too poorly to tell n_c; rounding hides E_train there" in poor.reasons
    assert not any("too poorly" in reason for reason in exact.reasons)


@pytest.mark.parametrize(
    ("products", "message"),
    [
        (InnerProducts(np.eye(30), None, 9), r"gram \(30, 30\), groups None for 31 times"),
        (InnerProducts(np.eye(31), np.ones((2, 30, 30)), 9), r"groups \(2, 30, 30\) for 31 times"),
        (InnerProducts(np.diag([*np.ones(30), np.nan]), None, 9), "snapshot 30 holds a value that is not finite"),
        (InnerProducts(np.eye(31), np.eye(31)[None], 9), "9 rows, 1 groups"),
        (InnerProducts(np.eye(31), None, 0), "0 rows"),
    ],
)
def test_inner_products_that_do_not_fit_are_refused(products, message):
    with pytest.raises(InputError, match=message):
        judge(products, np.arange(31) * 1e-3)
