"""The modes of the snapshots: proper orthogonal decomposition by Lanczos."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from pod.errors import InputError
from pod.gram import centred
from pod.lanczos import RitzPairs, Wanted, lanczos
from pod.orthonormal import fix_signs_, orthonormalise_
from pod.snapshots import RowSource, SnapshotMatrix, as_matrix

Array = NDArray[np.float64]
GRAM_BYTES = 2 * 2**30  # above it the Gram matrix costs more memory than a block of rows; then rows are read every step


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
    n_lr_paper: int | None  # the same with the paper's denominator, the Ritz values of the steps taken
    steps: int  # Lanczos steps
    route: str  # "gram": on inner products formed once; "product": reading all rows every step
    reason: str  # why it stopped, and whether the rank was capped

    def project(self, W: SnapshotMatrix | RowSource) -> Array:
        """Coefficients c = (W - W̄)ᵀ φ of snapshots, (snapshots, modes). W: (rows, snapshots) in the rows' order."""
        matrix = as_matrix(W)
        if matrix.shape[0] != len(self.mean):
            raise InputError(
                f"W: {matrix.shape[0]} rows, the basis has {len(self.mean)}; give the same particles in the same order"
            )
        coefficients = np.zeros((matrix.shape[1], self.modes.shape[1]))
        start = 0
        for block in matrix.row_blocks():
            rows = slice(start, start + len(block))
            coefficients += (block - self.mean[rows, None]).T @ self.modes[rows]
            start += len(block)
        return coefficients

    def reconstruct(self, coefficients: ArrayLike) -> Array:
        """Snapshots W̄ + φ cᵀ, (rows, snapshots), from c (snapshots, n), n at most the number of modes."""
        c = np.atleast_2d(np.asarray(coefficients, dtype=np.float64))
        if c.ndim != 2 or c.shape[1] > self.modes.shape[1]:
            raise InputError(f"coefficients: shape {c.shape}; give (snapshots, at most {self.modes.shape[1]} modes)")
        return np.asarray(self.mean[:, None] + self.modes[:, : c.shape[1]] @ c.T)


class _Operator(NamedTuple):
    """W̃ᵀW̃ / N_t: the same nonzero eigenvalues as A, at the size of the snapshots."""

    product: Callable[[Tensor], Tensor]
    energies: Tensor  # (N_t,) its diagonal, the energy of each snapshot over N_t


def lanczos_pod(
    W: SnapshotMatrix | RowSource,
    *,
    energy: float | None = None,
    modes: int | None = None,
    tolerance: float | None = None,
    reconstructable: float = 0.999,
    route: str | None = None,
    device: str | None = None,
) -> Basis:
    """Modes of the snapshots by Lanczos, up to an energy, a number, or an error (paper 2.2).

    Give at most one of: energy, the share of the total that the modes must hold (default 0.999); modes, their number;
    tolerance, the largest RMSE over rows that any of these snapshots may keep (unit of W). reconstructable: the energy
    that defines n_lr. route: "gram" or "product", default the cheaper one.
    W: (rows, snapshots), any row source; streamed.
    Raises InputError for fewer than two snapshots, snapshots in which nothing moves, NaN, or a bad setting.
    """
    matrix = as_matrix(W, device)
    _check(matrix.shape, energy, modes, tolerance)
    chosen = route or ("gram" if 8 * matrix.shape[1] ** 2 <= GRAM_BYTES else "product")
    operator = _operator(matrix, chosen)
    total = float(operator.energies.sum())
    if total <= 0:
        raise InputError("snapshots: nothing moves, all are the same; choose another variable or a longer run")
    if modes is None and tolerance is None:
        energy = energy if energy is not None else 0.999
    wanted = _wanted(operator.energies, matrix.shape, energy, modes, tolerance)
    pairs = lanczos(operator.product, matrix.shape[1], wanted, trace=total, device=matrix.device)
    return _basis(matrix, pairs, total, reconstructable, chosen)


def _check(shape: tuple[int, int], energy: float | None, modes: int | None, tolerance: float | None) -> None:
    """Refuse what no decomposition can serve."""
    if shape[1] < 2:
        raise InputError(f"snapshots: {shape[1]}; a decomposition needs at least 2")
    if sum(x is not None for x in (energy, modes, tolerance)) > 1:
        raise InputError("energy, modes, tolerance: more than one is given; give one")
    if energy is not None and not 0 < energy <= 1:
        raise InputError(f"energy: {energy}; give a share above 0 and at most 1, for example 0.999")
    if modes is not None and modes < 1:
        raise InputError(f"modes: {modes}; give at least 1")
    if tolerance is not None and not tolerance > 0:
        raise InputError(f"tolerance: {tolerance}; give a positive RMSE in the unit of the snapshots")


def _operator(matrix: SnapshotMatrix, route: str) -> _Operator:
    """Centred Gram operator in the form that the route asks for."""
    n = matrix.shape[1]
    if route == "gram":
        K = centred(torch.from_numpy(matrix.gram()).to(matrix.device)) / n
        return _Operator(lambda v: K @ v, torch.diagonal(K).clamp(min=0.0))
    if route == "product":
        energies = torch.from_numpy(matrix.centred_square_norms() / n).to(matrix.device)
        return _Operator(lambda v: matrix.centred_product(v) / n, energies)
    raise InputError(f"route: {route!r}; give 'gram', 'product', or None for the cheaper one")


def _wanted(
    energies: Tensor, shape: tuple[int, int], energy: float | None, modes: int | None, tolerance: float | None
) -> Wanted:
    """How many pairs are enough, by whichever criterion was given."""

    def by_number(ritz: Tensor, _: Callable[[], Tensor]) -> int | None:
        return modes if modes is not None and modes <= len(ritz) else None

    def by_energy(ritz: Tensor, _: Callable[[], Tensor]) -> int | None:
        return _first(torch.cumsum(ritz, 0) >= (energy or 0.0) * energies.sum())

    def by_error(ritz: Tensor, vectors: Callable[[], Tensor]) -> int | None:
        # what p modes leave of snapshot t: N_t (K_tt - Σ_{i≤p} θ_i v_ti²), squared norm
        left = energies - torch.cumsum(ritz[:, None] * vectors().T ** 2, 0)
        return _first(shape[1] * left.amax(dim=1) <= shape[0] * (tolerance or 0.0) ** 2)

    if modes is not None:
        return by_number
    return by_error if tolerance is not None else by_energy


def _first(true: Tensor) -> int | None:
    """How many until the first that is true, counted from one."""
    return int(true.int().argmax()) + 1 if bool(true.any()) else None


def _basis(matrix: SnapshotMatrix, pairs: RitzPairs, total: float, energy: float, route: str) -> Basis:
    """Modes φ = W̃ v / σ by one pass over the rows, made orthonormal to rounding."""
    sigma = np.sqrt(pairs.values.cpu().numpy() * matrix.shape[1])
    weights = pairs.vectors.cpu().numpy() / sigma
    mean, modes = np.empty(matrix.shape[0]), np.empty((matrix.shape[0], len(sigma)))
    start = 0
    for block in matrix.row_blocks():
        rows = slice(start, start + len(block))
        mean[rows] = block.mean(axis=1)
        modes[rows] = (block - mean[rows, None]) @ weights
        start += len(block)
    p = orthonormalise_(modes)
    capped = (
        "" if p == len(sigma) else f"; {len(sigma) - p} modes left out, not orthogonal to the others within rounding"
    )
    modes = fix_signs_(modes[:, :p])
    values = pairs.values.cpu().numpy()[:p]
    cumulative = np.cumsum(values)
    return Basis(
        mean,
        modes,
        values,
        pairs.residuals.cpu().numpy()[:p],
        total,
        cumulative / total,
        _reach(cumulative, energy * total),
        _reach(cumulative, energy * pairs.ritz_sum),
        pairs.steps,
        route,
        pairs.reason + capped,
    )


def _reach(cumulative: Array, energy: float) -> int | None:
    """How many modes hold this energy; None if all of them do not."""
    enough = cumulative >= energy
    return int(np.argmax(enough)) + 1 if enough.any() else None
