"""From inner products to projections the cheapest way: through a factor of few rows where the motion has few modes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf

from selection.consistency import Projection, project_from_low_rank, project_from_products
from selection.gram import EPSILON, InnerProducts
from selection.intervals import Subset

Array = NDArray[np.float64]
FEW = 3  # a factor is kept where it has no more than a third as many rows as there are snapshots


class Routes(NamedTuple):
    """Inner products, and what stands for them where the snapshots are of low rank."""

    products: InnerProducts
    factor: Array | None  # (r, N_t) F with FᵀF = gram, None where r is not small
    without: Array | None  # (k, r, N_t) the same of each group of particles left out, with rows of zero at the end

    def squares_without(self, groups: slice) -> Array:
        """Squared norms of the snapshots without one group of particles, for some groups, (k, N_t)."""
        gram, parts, _ = self.products
        assert parts is not None
        return np.asarray(gram.diagonal() - np.einsum("gtt->gt", parts[groups]))


def routes(products: InnerProducts) -> Routes:
    """Look for a factor of few rows, for all particles and without each group of them."""
    factor = low_rank_factor(products.gram)
    if factor is None or products.groups is None:
        return Routes(products, factor, None)
    without = [low_rank_factor(products.gram - part) for part in products.groups]
    few = [found for found in without if found is not None]
    if len(few) < len(without):
        return Routes(products, factor, None)
    most = max(map(len, few))
    return Routes(products, factor, np.stack([np.pad(found, ((0, most - len(found)), (0, 0))) for found in few]))


def low_rank_factor(gram: Array) -> Array | None:
    """F (r, N_t), FᵀF = G to rounding, r the numerical rank; None where it is above a third of N_t, or 0.

    A Cholesky decomposition with the largest remaining diagonal entry as pivot, ended where that is ε of the first: as
    much as G itself is uncertain by. It takes r N_t² operations.
    """
    largest = float(gram.diagonal().max())
    upper, pivots, rank, _ = dpstrf(gram.T, tol=EPSILON * largest)  # symmetric; by columns, as LAPACK wants it
    if rank == 0 or FEW * rank > len(gram) or largest <= 0.0:
        return None
    factor = np.empty((rank, len(gram)))
    factor[:, pivots - 1] = np.triu(upper[:rank])
    return factor


def project(known: Routes, subset: Subset) -> Projection:
    """All testing snapshots on all modes of the training snapshots of one Δτ."""
    last, gram, training = len(subset.testing), known.products.gram, subset.training
    if known.factor is not None and len(known.factor) < len(training):
        return project_from_low_rank(known.factor[:, :last], training)
    return project_from_products(gram[:last, training], gram.diagonal()[:last], training)


def project_without(known: Routes, groups: slice, subset: Subset, leading: int | None) -> Projection:
    """Project likewise without one group of particles, for some groups at once, on the leading modes if they do."""
    last, training, (gram, parts, _) = len(subset.testing), subset.training, known.products
    if known.without is not None and known.without.shape[1] < len(training):
        return project_from_low_rank(known.without[groups, :, :last], training)
    assert parts is not None
    every = slice(0, last, int(training[1] - training[0]))  # a view is subtracted faster than gathered
    products = gram[:last, every] - parts[groups, :last, every]
    return project_from_products(products, known.squares_without(groups)[:, :last], training, leading)
