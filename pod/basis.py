"""The modes of the snapshots: proper orthogonal decomposition by Lanczos."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from pod.dense import dense_pairs
from pod.errors import InputError
from pod.facts import facts_html, facts_text
from pod.gram import Array, centred_pairs
from pod.lanczos import EPSILON, RitzPairs, Wanted, lanczos
from pod.orthonormal import Modes, modes_of
from pod.routes import BLOCK, Choice, Problem, choose_route
from pod.snapshots import RowSource, SnapshotMatrix, as_matrix
from pod.truncation import Truncation, checked, wanted_by

PAPER_SHARE = 0.8  # of the eigenvalues, in the paper's denominator of I(p)
GRAM_BLOCK = 8  # vectors that Lanczos multiplies the Gram matrix by at once


class Basis(NamedTuple):
    """Mean and modes of a set of snapshots, with what is known about their accuracy.

    W(t) ≈ W̄ + Σ c_i(t) φ_i (paper eq. (29)); A = W̃ W̃ᵀ / N_t, A φ = λ φ (paper eq. (24)).
    """

    mean: Array  # (rows,) W̄ over the training snapshots, unit of W
    modes: Array  # (rows, p) φ, orthonormal, largest entry of each positive
    values: Array  # (p,) λ, descending, unit of W squared
    residuals: Array  # (p,) ‖A φ - λ φ‖ bound, an error bound of λ
    total_energy: float  # trace(A), exact
    ratio: Array  # (p,) Lanczos ratio I = Σ_{i≤p} λ_i / trace(A), paper eq. (28)
    n_lr: int | None  # least reconstructable mode; None if it lies beyond the modes kept
    n_lr_paper: int | None  # the same of the leading 80 % of the eigenvalues; None where so many are not known
    n_lr_ritz: int | None  # the same of the Ritz values of the steps taken, however few
    steps: int  # vectors of the Krylov space; 0 for a dense decomposition
    route: str  # "gram": on inner products formed once; "block": reading all rows every step; "svd": dense
    route_reason: str  # why this route
    reason: str  # why it stopped, and whether the rank was capped
    orthogonality: float  # ‖φᵀφ - 1‖_F, measured
    tridiagonal: Array  # (k, k) T_k of the Lanczos process, by blocks; (0, 0) for a dense decomposition
    weights: Array | None  # (rows,) of the inner product, None for ones

    def __repr__(self) -> str:
        return facts_text(*self._facts())

    def _repr_html_(self) -> str:
        return facts_html(*self._facts())

    def _facts(self) -> tuple[str, dict[str, str]]:
        """How many modes hold how much, and how well they are known."""
        rows, p = self.modes.shape
        beyond = f"more than {p}"
        return f"{p} modes of {rows} rows", {
            "energy held": f"{self.ratio[-1]:.6g} of the total {self.total_energy:.4g}" if p else "none",
            "n_lr": beyond if self.n_lr is None else str(self.n_lr),
            "route": f"{self.route}: {self.route_reason}",
            "stopped": f"after {self.steps} Lanczos vectors: {self.reason}" if self.steps else self.reason,
            "residual, largest": f"{self.residuals.max() / self.values[0]:.2g} of the first eigenvalue"
            if p
            else "none",
            "orthogonality": f"{self.orthogonality:.2g}, ‖φᵀφ - 1‖",
        }

    def project(self, W: SnapshotMatrix | RowSource) -> Array:
        """Coefficients c = (W - W̄)ᵀ φ of snapshots, (snapshots, modes). W: (rows, snapshots) in the rows' order.

        A matrix that processes share gives every process the coefficients, from modes of its own rows.
        """
        matrix = as_matrix(W)
        if matrix.own.stop - matrix.own.start != len(self.mean):
            raise InputError(
                f"W: {matrix.shape[0]} rows, the basis has {len(self.mean)}; give the same particles in the same order"
            )
        coefficients = np.zeros((matrix.shape[1], self.modes.shape[1]))
        start = 0
        for block in matrix.row_blocks():
            rows = slice(start, start + len(block))
            modes = self.modes[rows] if self.weights is None else self.weights[rows, None] * self.modes[rows]
            coefficients += (block - self.mean[rows, None]).T @ modes
            start += len(block)
        return matrix.summed(coefficients)

    def reconstruct(self, coefficients: ArrayLike) -> Array:
        """Snapshots W̄ + φ cᵀ, (rows, snapshots), from c (snapshots, n), n at most the number of modes."""
        c = np.atleast_2d(np.asarray(coefficients, dtype=np.float64))
        if c.ndim != 2 or c.shape[1] > self.modes.shape[1]:
            raise InputError(f"coefficients: shape {c.shape}; give (snapshots, at most {self.modes.shape[1]} modes)")
        return np.asarray(self.mean[:, None] + self.modes[:, : c.shape[1]] @ c.T)


def lanczos_pod(
    W: SnapshotMatrix | RowSource,
    *,
    energy: float | None = None,
    modes: int | None = None,
    tolerance: float | None = None,
    error: float | None = None,
    reconstructable: float = 0.999,
    route: str | None = None,
    gram: Array | None = None,
    device: str | None = None,
) -> Basis:
    """Modes of the snapshots by Lanczos, up to an energy, a number, or an error (paper 2.2).

    Give at most one of: energy, the share of the total that the modes must hold (default 0.999); modes, their number;
    tolerance, the largest RMSE over rows that any of these snapshots may keep; error, the RMSE over rows and snapshots
    that may be left (both in the unit of W). reconstructable: the energy that defines n_lr. route: "gram", "block" or
    "svd", default the cheapest. gram: inner products of these snapshots that are known already (`pod.grown_gram`).
    W: (rows, snapshots), any row source; streamed.
    Raises InputError for fewer than two snapshots, snapshots in which nothing moves, NaN, or a bad setting.

    >>> times = np.linspace(0.0, 1.0, 21)  # s
    >>> W = np.outer([3.0, 4.0, 0.0], np.sin(5 * times)) + np.outer([0.0, 0.0, 0.1], np.cos(7 * times))
    >>> basis = lanczos_pod(W, energy=0.9999)
    >>> basis.modes.shape, basis.n_lr
    ((3, 2), 1)
    >>> coefficients = basis.project(W)  # (21, 2)
    >>> bool(np.allclose(basis.reconstruct(coefficients), W))
    True
    """
    matrix = as_matrix(W, device)
    criterion = checked(Truncation(energy, modes, tolerance, error))
    if matrix.shape[1] < 2:
        raise InputError(f"snapshots: {matrix.shape[1]}; a decomposition needs at least 2")
    problem = Problem(*matrix.shape, modes, matrix.in_memory, matrix.ranks.size)
    if not 0.0 < reconstructable <= 1.0:
        raise InputError(f"reconstructable: {reconstructable}; give a share above 0 and at most 1, for example 0.999")
    choice = choose_route(problem, "gram" if route is None and gram is not None else route)
    operator = _operator(matrix, choice.route, gram)
    total = float(operator.energies.sum())
    if not total > 0.0:
        raise InputError("snapshots: nothing moves, all are the same; choose another variable or a longer run")
    wanted = wanted_by(criterion, operator.energies, matrix.total_weight)
    pairs = _pairs(matrix, choice.route, operator, wanted)
    return _basis(matrix, pairs, total, reconstructable, choice)


class _Operator(NamedTuple):
    """W̃ᵀW̃ / N_t: the same nonzero eigenvalues as A, at the size of the snapshots."""

    product: Callable[[Tensor], Tensor]
    energies: Tensor  # (N_t,) its diagonal, the energy of each snapshot over N_t


def _operator(matrix: SnapshotMatrix, route: str, gram: Array | None) -> _Operator:
    """Centred Gram operator in the form that the route asks for."""
    n = matrix.shape[1]
    if route == "gram":
        known = matrix.gram() if gram is None else _fitting(gram, n)
        K = torch.from_numpy(centred_pairs(known)).to(matrix.device) / n
        return _Operator(lambda V: K @ V, torch.diagonal(K).clamp(min=0.0))
    energies = torch.from_numpy(matrix.centred_square_norms() / n).to(matrix.device)
    return _Operator(lambda V: matrix.centred_product(V) / n, energies)


def _fitting(gram: Array, n: int) -> Array:
    if gram.shape != (n, n):
        raise InputError(f"gram: shape {gram.shape}; give the inner products of these {n} snapshots, ({n}, {n})")
    return gram


def _pairs(matrix: SnapshotMatrix, route: str, operator: _Operator, wanted: Wanted) -> RitzPairs:
    if route == "svd":
        return dense_pairs(matrix, wanted)
    return lanczos(
        operator.product,
        matrix.shape[1],
        wanted,
        trace=float(operator.energies.sum()),
        block=GRAM_BLOCK if route == "gram" else BLOCK,
        device=matrix.device,
    )


def _basis(matrix: SnapshotMatrix, pairs: RitzPairs, total: float, energy: float, choice: Choice) -> Basis:
    """Basis from eigenpairs, with modes by one pass over the rows."""
    values, vectors = pairs.values.cpu().numpy(), pairs.vectors.cpu().numpy()
    # W̃ v = (W - w₀) v only for v orthogonal to ones, which rounding has spoilt where λ is small
    made = modes_of(matrix, (vectors - vectors.mean(axis=0)) / np.sqrt(values * matrix.shape[1]))
    basis = basis_of(made, values, total, energy, choice, Spectrum(pairs.ritz.cpu().numpy(), matrix.shape[1]))
    return basis._replace(
        residuals=pairs.residuals.cpu().numpy()[: len(basis.values)],
        steps=pairs.steps,
        reason=pairs.reason + basis.reason,
        tridiagonal=pairs.tridiagonal.cpu().numpy(),
        weights=None if matrix.weights is None else matrix.weights[matrix.own],
    )


class Spectrum(NamedTuple):
    """What is known of all eigenvalues of A, for the denominators that the paper takes."""

    ritz: Array  # (k,) Ritz values, descending
    size: int  # N_t, eigenvalues there are, zeros included

    def leading(self, total: float) -> float | None:
        """Σ of the leading 80 % of the eigenvalues ("e.g., 80 % of total data"), None where fewer are known."""
        count = math.ceil(PAPER_SHARE * self.size)
        whole = self.ritz.sum() >= total * (1.0 - self.size * EPSILON)
        return float(self.ritz[:count].sum()) if whole or len(self.ritz) >= count else None


def basis_of(made: Modes, values: Array, total: float, energy: float, choice: Choice, spectrum: Spectrum) -> Basis:
    """Basis from modes, those that could be made orthogonal, and all λ; nothing is known of a Lanczos process."""
    p = made.modes.shape[1]
    lost = len(values) - p
    capped = f"; {lost} modes left out, not orthogonal to the others within rounding" if lost else ""
    cumulative, leading = np.cumsum(values[:p]), spectrum.leading(total)
    return Basis(
        mean=made.mean,
        modes=made.modes,
        values=values[:p],
        residuals=np.full(p, EPSILON * float(values[0])),
        total_energy=total,
        ratio=cumulative / total,
        n_lr=reach(cumulative, energy * total),
        n_lr_paper=None if leading is None else reach(cumulative, energy * leading),
        n_lr_ritz=reach(cumulative, energy * float(spectrum.ritz.sum())),
        steps=0,
        route=choice.route,
        route_reason=choice.reason,
        reason=capped,
        orthogonality=made.orthogonality,
        tridiagonal=np.zeros((0, 0)),
        weights=None,
    )


def reach(cumulative: Array, energy: float) -> int | None:
    """How many modes hold this energy; None if all of them do not."""
    enough = cumulative >= energy
    return int(np.argmax(enough)) + 1 if enough.any() else None
