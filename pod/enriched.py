"""A basis of positions and velocities: it can represent the cubic Hermite interpolant of the snapshots.

Between two snapshots that interpolant is a combination of their positions and of Δτ times their velocities. A basis of
positions alone cannot represent the velocities' part of it, whatever the regressor.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pod.basis import Basis, Spectrum, basis_of, reach
from pod.errors import InputError
from pod.facts import facts_html, facts_text
from pod.gram import Array
from pod.lanczos import EPSILON
from pod.orthonormal import modes_of
from pod.ranks import ALONE, Ranks
from pod.routes import Choice
from pod.snapshots import RowSource, SnapshotMatrix

WEIGHTS = (0.0, 0.0625, 0.125, 0.25, 0.5, 1.0, 2.0)
NOISE = 1e-13  # of the largest eigenvalue of inner products: below it there is no mode


class Enriched(NamedTuple):
    """A basis of positions and weighted velocities, and what each weight would have left."""

    basis: Basis
    weight: float  # ω of the velocities ω Δτ v; 0 is the plain basis
    weights: Array  # (w,) tried
    errors: Array  # (w,) RMSE over rows and held-out snapshots of their projection, unit of the positions
    held_out: NDArray[np.intp]  # (h,) snapshots that were held out

    def __repr__(self) -> str:
        return facts_text(*self._facts())

    def _repr_html_(self) -> str:
        return facts_html(*self._facts())

    def _facts(self) -> tuple[str, dict[str, str]]:
        """Say what the velocities gained at the snapshots held out."""
        p, rows = self.basis.modes.shape[1], self.basis.modes.shape[0]
        tried = " … ".join(f"{weight:g}" for weight in (self.weights.min(), self.weights.max()))
        return f"{p} modes of {rows} rows, of positions and velocities", {
            "weight": f"{self.weight:g} of the velocities, of {tried} tried; 0 leaves them out",
            "error": f"{self.errors.min():.4g} at {len(self.held_out)} snapshots held out, unit of the positions",
            "orthogonality": f"{self.basis.orthogonality:.2g}, ‖φᵀφ - 1‖",
        }


class _Joined:
    """Positions, and beside them where each training velocity would lead from the first position in Δτ."""

    def __init__(
        self, positions: RowSource, velocities: RowSource, training: NDArray[np.intp], interval: float
    ) -> None:
        self._positions, self._velocities, self._training, self._interval = positions, velocities, training, interval
        self.shape = (int(positions.shape[0]), int(positions.shape[1]) + len(training))
        self.rows_per_particle = int(getattr(positions, "rows_per_particle", 1))

    def __getitem__(self, rows: slice, /) -> Array:
        x = np.asarray(self._positions[rows], dtype=np.float64)
        v = np.asarray(self._velocities[rows], dtype=np.float64)[:, self._training]
        return np.hstack([x, x[:, :1] + self._interval * v])


def enriched_pod(
    positions: RowSource,
    velocities: RowSource,
    training: Sequence[int],
    interval: float,
    *,
    modes: int | None = None,
    weights: ArrayLike = WEIGHTS,
    reconstructable: float = 0.999,
    ranks: Ranks = ALONE,
) -> Enriched:
    """Modes of [W̃, ω Δτ V] at the training snapshots, ω by the least error at the snapshots held out (method 6).

    positions, velocities: (rows, N_t) in m and m/s, any row sources; training: indices of evenly spaced snapshots;
    interval: Δτ, s, between them; those in between are held out. modes: their number, default as many as there are
    training snapshots. Mean and total energy of the result are those of the training positions, and `ratio` and `n_lr`
    say how much of that energy the modes hold; `values` are the λ of positions and velocities together, of which the
    paper's denominators mean nothing, so that `n_lr_paper` and `n_lr_ritz` are None.
    Raises InputError where nothing is held out, shapes differ, or nothing moves.
    """
    chosen = np.asarray(training, dtype=np.intp)
    between = np.setdiff1d(np.arange(chosen[0], chosen[-1]), chosen)
    if positions.shape != velocities.shape:
        raise InputError(f"velocities: shape {velocities.shape}, positions have {positions.shape}; give one for each")
    if len(between) == 0:
        raise InputError("training: nothing lies between its snapshots; take every second or fewer of them")
    joined = SnapshotMatrix(_Joined(positions, velocities, chosen, interval), ranks=ranks)
    mean, columns = _columns(joined.shape[1], int(positions.shape[1]), chosen)
    products = _about_mean(joined.gram(), mean, int(positions.shape[1]))
    tried = np.asarray(weights, dtype=np.float64)
    kept = min(modes or len(chosen), 2 * len(chosen))
    found = [_weighted(products, columns, omega, kept) for omega in tried]
    rows = float(joined.shape[0])
    errors = np.array([_left(products, columns, between, vectors, rows) for _, vectors in found])
    best = int(np.argmin(errors))
    values, vectors = found[best]
    total = float(products[np.ix_(chosen, chosen)].trace()) / len(chosen)
    combined = np.zeros((joined.shape[1], vectors.shape[1]))
    combined[columns] = vectors
    combined -= mean[:, None] * combined[: int(positions.shape[1])].sum(axis=0)
    choice = Choice("gram", f"inner products of positions and velocities, ω = {tried[best]:g}")
    made = modes_of(joined, combined, mean)
    basis = basis_of(made, values, total, reconstructable, choice, Spectrum(values, len(columns)))
    held = np.square(products[np.ix_(chosen, columns)] @ vectors).mean(axis=0)
    return Enriched(_of_positions(basis, held, reconstructable), float(tried[best]), tried, errors, between)


def _of_positions(basis: Basis, held: Array, energy: float) -> Basis:
    """Basis whose shares of energy are those of the positions; held: (p,) energy of the positions in each mode."""
    cumulative = np.cumsum(held[: len(basis.values)])
    n_lr = reach(cumulative, energy * basis.total_energy)
    return basis._replace(ratio=cumulative / basis.total_energy, n_lr=n_lr, n_lr_paper=None, n_lr_ritz=None)


def _columns(size: int, n: int, training: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Weights (size,) of the mean training position, and the columns of training positions and velocities."""
    mean = np.zeros(size)
    mean[training] = 1.0 / len(training)
    return mean, np.concatenate([training, np.arange(n, size)])


def _about_mean(gram: Array, mean: Array, n: int) -> Array:
    """Inner products with the mean taken from the n positions, and nothing from the velocities."""
    shift = np.eye(len(gram))
    shift[:, :n] -= mean[:, None]
    return np.asarray(shift.T @ gram @ shift)


def _weighted(products: Array, columns: NDArray[np.intp], omega: float, kept: int) -> tuple[Array, Array]:
    """Leading λ (p,) of positions and weighted velocities, and their combinations (2m, p) of length-one modes."""
    m = len(columns) // 2
    scale = np.repeat([1.0, omega], m)
    values, vectors = np.linalg.eigh(scale[:, None] * products[np.ix_(columns, columns)] * scale)
    values, vectors = values[::-1], vectors[:, ::-1]
    if not values[0] > 0.0:
        raise InputError("snapshots: nothing moves, all are the same; choose another variable or a longer run")
    p = min(kept, int((values > NOISE * values[0]).sum()))
    return values[:p] / m, scale[:, None] * vectors[:, :p] / np.sqrt(values[:p])


def _left(products: Array, columns: NDArray[np.intp], held_out: NDArray[np.intp], vectors: Array, rows: float) -> float:
    """RMSE of the projection of the held-out snapshots."""
    projected = products[np.ix_(held_out, columns)] @ vectors
    whole = products.diagonal()[held_out]
    rest = np.maximum(whole - np.square(projected).sum(axis=1), EPSILON * whole)
    return float(np.sqrt(rest.mean() / rows))
