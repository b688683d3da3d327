"""How well the modes of the training snapshots represent the snapshots between them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
EPSILON = float(np.finfo(np.float64).eps)
ROUND_OFF = 1e-7  # of ‖W̃‖: below it E_train is rounding, and R_c a ratio to rounding
WEAK = 1e3  # times ε λ₁: below it an inner product knows the size of a mode but not its direction


class Projection(NamedTuple):
    """All testing snapshots on all modes of the training set, about the training mean (paper eqs. (31)-(32)).

    A stack of them, of small data sets that are worked on at once, has one more dimension in front. There p is the
    most modes that one of them has, and what another lacks is zero.
    """

    eigenvalues: Array  # (..., p) of A = W̃ W̃ᵀ / m, descending
    coefficients: Array  # (..., testing, p), fewer columns where fewer modes were wanted
    outside: Array  # (..., testing) squared norm of what no mode represents; zero at training times
    training: NDArray[np.intp]  # (m,) where the training snapshots stand among the testing ones


class Consistency(NamedTuple):
    """Errors and their ratios against the number of modes n = 0, 1, … while E_train is above round-off."""

    E_train: Array  # (n,) mean over training times of the RMSE over rows, unit of W
    E_test: Array  # (n,) the same over all testing times
    E_gap: Array  # (n,) the same over testing times that are not training times; NaN if there are none
    R_c: Array  # (n,) E_test / E_train, paper eq. (35)
    R_gap: Array  # (n,) E_gap / E_train
    predicted_error: Array  # (n,) relative error of R_c from rounding


def unseen_times(testing: int, training: NDArray[np.intp]) -> NDArray[np.intp]:
    """Which of the testing snapshots, so many, are not training snapshots, (u,)."""
    unseen = np.ones(testing, bool)
    unseen[training] = False
    return np.flatnonzero(unseen)


def project_from_gram(gram: Array, training: NDArray[np.intp]) -> Projection:
    """Project every snapshot on the modes of a subset, knowing inner products alone.

    gram: (testing, testing) inner products about any point; training: (m,) indices S.
    """
    return project_from_products(gram[:, training], gram.diagonal(), training)


def project_from_products(
    products: Array, squares: Array, training: NDArray[np.intp], leading: int | None = None
) -> Projection:
    """Project every snapshot on the modes of a subset, from its inner products with that subset.

    C_ij = (w_i - w̄)·(w_j - w̄); C[S,S] = V Σ² Vᵀ; c_j = Σ⁻¹ Vᵀ C[S,j], which is Σ Vᵀ at training times.
    products: (..., testing, m) with the training snapshots, about any point; squares: (..., testing) squared norms
    about the same; training: (m,) indices S. leading: how many modes are wanted; what all others hold is then counted
    outside.
    """
    to_mean = products.mean(axis=-1)
    centre = to_mean[..., training].mean(axis=-1)[..., None]
    centred = products - to_mean[..., None]
    centred -= (to_mean[..., training] - centre)[..., None, :]
    among = centred[..., training, :]
    m = len(training)
    # centring leaves nothing but rounding along the vector of ones; below zero it cannot pass for a mode
    square, vectors = np.linalg.eigh(among - np.trace(among, axis1=-2, axis2=-1)[..., None, None] / m**2)
    square, vectors = square[..., ::-1], vectors[..., ::-1]
    eigenvalues, found = _above_round_off(square)
    p = min(eigenvalues.shape[-1], m if leading is None else leading)
    sigma, vectors = np.sqrt(eigenvalues[..., :p]), vectors[..., :p]
    coefficients, unseen = np.empty((*to_mean.shape, p)), unseen_times(to_mean.shape[-1], training)
    coefficients[..., training, :] = vectors * sigma[..., None, :]
    # a quotient of roundings; what these modes hold of an unseen snapshot is counted outside instead
    told = (sigma > 0.0) & (sigma**2 >= WEAK * EPSILON * square[..., :1])
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=told)
    coefficients[..., unseen, :] = centred[..., unseen, :] @ (vectors * inverse[..., None, :])
    # the difference of two nearly equal numbers: this is what squares the condition number
    whole = squares - 2.0 * to_mean + centre
    outside = np.maximum(whole - np.einsum("...ij,...ij->...i", coefficients, coefficients), 0.0)
    outside[..., training] *= found > p
    return Projection(eigenvalues / m, coefficients, outside, training)


def project_from_low_rank(factor: Array, training: NDArray[np.intp]) -> Projection:
    """Project every snapshot likewise, from F with FᵀF its inner products and fewer rows than there are modes.

    C[S,S] has the eigenvalues of F̃_S F̃_Sᵀ = U Σ² Uᵀ, (r, r), and c = F̃ᵀ U; what no mode represents are the
    coefficients of the other columns of U. factor: (..., r, testing); training: (m,) indices.
    """
    centred = factor - factor[..., training].mean(axis=-1, keepdims=True)
    among = centred[..., training]
    square, directions = np.linalg.eigh(among @ among.swapaxes(-1, -2))
    square, directions = square[..., ::-1], directions[..., ::-1]
    eigenvalues, found = _above_round_off(square)
    coefficients = centred.swapaxes(-1, -2) @ directions
    kept = np.arange(square.shape[-1]) < found
    outside = np.square(coefficients).sum(axis=-1, where=~kept[..., None, :])
    outside[..., training] = 0.0
    coefficients *= kept[..., None, :]
    return Projection(eigenvalues / len(training), coefficients[..., : eigenvalues.shape[-1]], outside, training)


def _above_round_off(square: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the eigenvalues that are no rounding, and how many they are, (..., 1); in a stack the others are zero.

    square: (..., m) descending.
    """
    kept = square > EPSILON * np.maximum(square[..., :1], 0.0)
    found = kept.sum(axis=-1, keepdims=True)
    return np.where(kept, square, 0.0)[..., : found.max()], found


def project_from_factor(factor: Array, training: NDArray[np.intp]) -> Projection:
    """Project every snapshot likewise, but from F with FᵀF = (W - w₀)ᵀ(W - w₀), by singular values.

    Residuals are formed as vectors, so the error is ε‖W‖/E and not its square.
    factor: (N_t, testing) columns of F; training: (m,) indices.
    """
    centred = factor - factor[:, training].mean(axis=1, keepdims=True)
    modes, sigma, rotation = np.linalg.svd(centred[:, training], full_matrices=False)
    kept = sigma > EPSILON * len(training) * sigma[0]
    modes, sigma, rotation = modes[:, kept], sigma[kept], rotation[kept]
    coefficients = centred.T @ modes
    residual = centred - modes @ coefficients.T
    coefficients[training] = (rotation * sigma[:, None]).T
    outside = np.einsum("ij,ij->j", residual, residual)
    outside[training] = 0.0
    return Projection(sigma**2 / len(training), coefficients, outside, training)


def modes_known(projection: Projection) -> NDArray[np.intp]:
    """How many leading modes inner products know by direction; those after them may be turned anyhow by rounding."""
    values = projection.eigenvalues
    return np.asarray(((values > 0.0) & (values >= WEAK * EPSILON * values[..., :1])).sum(axis=-1))


def squared_errors(projection: Projection) -> Array:
    """Squared norm of what the first n modes leave of each snapshot, (..., testing, p + 1) for n = 0 … p.

    ‖r‖² + Σ_{i>n} c_i²: a sum of the tail, free of cancellation, where ‖d‖² - Σ_{i≤n} c_i² is not.
    """
    *stack, p = projection.coefficients.shape
    tail = np.empty((*stack, p + 1))
    tail[..., -1] = projection.outside
    tail[..., :-1] = np.square(projection.coefficients)[..., ::-1].cumsum(axis=-1)[..., ::-1]
    tail[..., :-1] += projection.outside[..., None]
    return tail


def unseen_error(projection: Projection, rows: int, n: int) -> float | None:
    """RMSE over rows that n modes leave at testing times that are not training times, averaged over these.

    For any n, also where E_train is at round-off. None where there is no such time.
    """
    square = projection.outside + np.square(projection.coefficients[:, n:]).sum(axis=1)
    unseen = np.delete(square, projection.training)
    return float(np.sqrt(unseen / rows).mean()) if unseen.size else None


def consistency(projection: Projection, rows: int, motion: float, exact: bool) -> Consistency:
    """Consistency ratio R_c(n) = mean E_test / mean E_train (paper eqs. (33)-(35)), and the same over the gaps alone.

    rows: number of rows the RMSE is taken over; motion: ‖W‖, the RMS over all snapshots that rounding is
    relative to; exact: the projection came from singular values, not from inner products. Evaluated while
    E_train > 1e-7 ‖W̃‖.
    """
    error, train, count = projection_errors(projection, rows)
    error, train = error[:, :count], train[:count]
    gap = np.delete(error, projection.training, axis=0)
    test = error.mean(axis=0)
    gaps = gap.mean(axis=0) if len(gap) else np.full(count, np.nan)
    return Consistency(train, test, gaps, test / train, gaps / train, predicted_error(train, motion, exact))


class ProjectionErrors(NamedTuple):
    """RMSE over rows that n = 0 … p modes leave."""

    each: Array  # (..., testing, p + 1) of every snapshot, unit of W
    E_train: Array  # (..., p + 1) mean over training times
    evaluated: NDArray[np.intp]  # (...) how many n from 0 on, those at which E_train is above round-off


def projection_errors(projection: Projection, rows: int) -> ProjectionErrors:
    """Return what n modes leave of every snapshot, and up to which n that is more than rounding."""
    error = np.sqrt(squared_errors(projection) / rows)
    train = error[..., projection.training, :].mean(axis=-2)
    # ‖W̃‖ of the training set, the RMS that its eigenvalues sum to
    floor = ROUND_OFF * np.sqrt(projection.eigenvalues.sum(axis=-1, keepdims=True) / rows)
    return ProjectionErrors(error, train, (train > floor).cumprod(axis=-1).sum(axis=-1))


def predicted_error(train: Array, motion: float, exact: bool) -> Array:
    """Relative error of R_c from rounding, ε (‖W‖/E_train), squared unless exact; arguments as in `consistency`."""
    return np.asarray(EPSILON * (motion / train) ** (1 if exact else 2))
