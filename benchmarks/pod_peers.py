"""Ways to decompose snapshots: ours, the barest, and those of the peers.

Each takes snapshots W (rows, N_t), far from the origin, and a number of modes p, and returns the work to be timed; that
returns modes (rows, p) and singular values (p,). Whoever does not centre takes the mean away before. Libraries are
imported where they are used, for each is the only one in its process.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.linalg

HEIGHT = 8192  # rows that are centred at once


def centred(W):
    """Take the mean away, in place; the difference is formed in double precision."""
    for low in range(0, len(W), HEIGHT):
        some = W[low : low + HEIGHT]
        some -= some.mean(axis=1, dtype=np.float64, keepdims=True)
    return W


def ours(W, p):
    from pod import lanczos_pod

    def solve():
        basis = lanczos_pod(W, modes=p)
        return basis.modes, np.sqrt(basis.values * W.shape[1])

    return solve


def bare_gram(W, p, by_algebra=False):
    """Gram matrix, `eigh` and product; the mean goes away beforehand or, by_algebra, from the Gram matrix."""
    product, eigh, combine = fastest_parts(W if by_algebra else centred(W), p)

    def solve():
        G = product(W)
        values, vectors = eigh(about_mean(G) if by_algebra else G)
        sigma, vectors = np.sqrt(values[: -p - 1 : -1]), vectors[:, : -p - 1 : -1]
        if by_algebra:  # (W - W̄) v = W v for v orthogonal to ones
            vectors = vectors - vectors.mean(axis=0)
        return combine(W, vectors / sigma), sigma

    return solve


def fastest_parts(W, p):
    """Symmetric product (its upper triangle counts), eigenpairs (the last p count) and product with vectors."""
    import torch
    from torch import from_numpy

    syrk = scipy.linalg.get_blas_funcs("syrk", (W,))
    last = (W.shape[1] - p, W.shape[1] - 1)
    products = [lambda W: syrk(1.0, W.T), lambda W: W.T @ W, lambda W: (from_numpy(W.T) @ from_numpy(W)).numpy()]
    eigenpairs = [
        lambda G: scipy.linalg.eigh(G, lower=False, subset_by_index=last, check_finite=False),
        lambda G: np.linalg.eigh(G, UPLO="U"),
        lambda G: [x.numpy() for x in torch.linalg.eigh(from_numpy(G), UPLO="U")],
    ]
    combinations = [lambda W, X: W @ X, lambda W, X: (from_numpy(W) @ from_numpy(X)).numpy()]
    G, X = about_mean(products[0](W)), np.ones((W.shape[1], p), W.dtype)
    return fastest(products, W), fastest(eigenpairs, G), fastest(combinations, W, X)


def about_mean(G):
    """Inner products of centred snapshots from the upper triangle of those about the origin."""
    G = np.triu(G)
    G += np.triu(G, 1).T
    to_mean = G.mean(axis=0)
    return G - to_mean - to_mean[:, None] + to_mean.mean()


def fastest(candidates, *arguments):
    def seconds(work):
        start = time.perf_counter()
        work(*arguments)
        return time.perf_counter() - start

    return min(candidates, key=lambda work: min(seconds(work), seconds(work)))


def torch_gram(W, p):
    import torch

    X = torch.from_numpy(centred(W))

    def solve():
        values, vectors = torch.linalg.eigh(X.T @ X)
        sigma = values[-p:].flip(0).sqrt()
        return X @ (vectors[:, -p:].flip(1) / sigma), sigma

    return solve


def torch_svd(W, p):
    import torch

    X = torch.from_numpy(centred(W))

    def solve():
        U, sigma, _ = torch.linalg.svd(X, full_matrices=False)
        return U[:, :p], sigma[:p]

    return solve


def torch_lowrank(W, p):
    import torch

    X = torch.from_numpy(centred(W))
    return lambda: torch.svd_lowrank(X, q=p)[:2]


def sklearn_randomized(W, p):
    from sklearn.utils.extmath import randomized_svd

    centred(W)
    return lambda: randomized_svd(W, n_components=p, random_state=0)[:2]


def scipy_svds(W, p, solver):
    from scipy.sparse.linalg import svds

    centred(W)

    def solve():
        U, sigma, _ = svds(W, k=p, solver=solver, return_singular_vectors="u", rng=0)
        return U[:, ::-1], sigma[::-1]

    return solve


def pymor(W, p, raw=False):
    from pymor.algorithms.pod import pod
    from pymor.core.logger import set_log_levels
    from pymor.vectorarrays.numpy import NumpyVectorSpace

    set_log_levels({"pymor": "ERROR"})
    best = None if raw else np.asfortranarray(centred(W))

    def solve():
        A = NumpyVectorSpace.from_numpy(centred(W) if raw else best)
        modes, sigma = pod(A, modes=p, method="method_of_snapshots")
        return modes.to_numpy(), sigma

    return solve


def ezyrb(W, p, method):
    from ezyrb import POD

    centred(W)

    def solve():
        pod = POD(method, rank=p).fit(W)
        return pod.modes, pod.singular_values

    return solve


def pydmd(W, p):
    from pydmd.utils import compute_svd

    centred(W)
    return lambda: compute_svd(W, svd_rank=p)[:2]


def flowtorch(W, p):
    import torch
    from flowtorch.analysis import SVD

    X = torch.from_numpy(centred(W))

    def solve():
        svd = SVD(X, rank=p)
        return svd.U, svd.s

    return solve


class Method(NamedTuple):
    """A way to decompose snapshots, and how it is called in a table."""

    prepare: Callable
    call: str
    package: str
    turns: int = 99  # at most so many, where one takes long
    slow: bool = False  # over a minute


METHODS = {
    "ours": Method(ours, "lanczos_pod(W, modes=p)", "torch"),
    "bare": Method(bare_gram, "bare Gram, centred before", "scipy"),
    "bare-algebra": Method(partial(bare_gram, by_algebra=True), "bare Gram, centred by algebra", "scipy"),
    "pymor": Method(pymor, "pod(A, modes=p)", "pymor"),
    "pymor-raw": Method(partial(pymor, raw=True), "pod(W - mean, modes=p)", "pymor"),
    "torch-gram": Method(torch_gram, "X.T @ X, linalg.eigh", "torch"),
    "flowtorch": Method(flowtorch, "SVD(X, rank=p)", "flowtorch-fluid"),
    "ezyrb-correlation": Method(partial(ezyrb, method="correlation_matrix"), 'POD("correlation_matrix", p)', "ezyrb"),
    "torch-lowrank": Method(torch_lowrank, "svd_lowrank(X, q=p)", "torch"),
    "sklearn": Method(sklearn_randomized, "randomized_svd(W, p)", "scikit-learn"),
    "torch-svd": Method(torch_svd, "linalg.svd(X, full_matrices=False)", "torch", turns=1),
    "ezyrb-svd": Method(partial(ezyrb, method="svd"), 'POD("svd", p)', "ezyrb", turns=1),
    "pydmd": Method(pydmd, "compute_svd(W, p)", "pydmd", turns=1),
    "arpack": Method(partial(scipy_svds, solver="arpack"), 'svds(W, p, solver="arpack")', "scipy", turns=1),
    "propack": Method(partial(scipy_svds, solver="propack"), 'svds(W, p, solver="propack")', "scipy", 1, slow=True),
}
