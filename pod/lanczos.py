"""Leading eigenpairs of a symmetric operator that is known only by its product with vectors (Lanczos)."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import torch
from torch import Tensor

EPSILON = torch.finfo(torch.float64).eps
NOISE = 1e-13  # of λ₁: below it an eigenvalue of a Gram matrix in double precision is rounding
BREAKDOWN = 100 * EPSILON  # of the operator's norm: below it β is rounding and the subspace invariant

Wanted = Callable[[Tensor, Callable[[], Tensor]], int | None]
"""How many leading pairs are wanted, from Ritz values (k,) and, on demand, Ritz vectors (n, k); None for not yet."""


class RitzPairs(NamedTuple):
    """Leading eigenpairs as the Lanczos process found them."""

    values: Tensor  # (p,) descending
    vectors: Tensor  # (n, p) orthonormal
    residuals: Tensor  # (p,) ‖A x - θ x‖ = ‖β_k y_ki‖, a bound on the error of the value
    steps: int  # k, vectors of the Krylov space
    ritz: Tensor  # (k,) all Ritz values, descending; of a dense decomposition all eigenvalues
    reason: str  # why it stopped
    tridiagonal: Tensor  # (k, k) T_k, by blocks


def lanczos(
    product: Callable[[Tensor], Tensor],
    size: int,
    wanted: Wanted,
    *,
    trace: float,
    block: int = 1,
    tolerance: float = 1e-12,
    seed: int = 0,
    device: torch.device | None = None,
) -> RitzPairs:
    """Lanczos with full reorthogonalisation, twice, on a positive semidefinite operator (paper eqs. (25)-(27)).

    A Q_k = Q_k T_k + q_{k+1} β_k e_kᵀ, with one vector a step or a block of them. It stops when the wanted pairs have
    residual bounds ‖β_k y_ki‖ ≤ tolerance·θ₁ *and* no larger one can be missing. The Krylov space holds as many copies
    of a repeated eigenvalue as a block has vectors and may be late to see another; but what it has not found is at
    most the trace not yet found plus the largest Ritz value not yet converged, and that must be below the last wanted
    value. It ends as well when only noise (1e-13 θ₁) is left, or when the space is whole. At a breakdown (invariant
    subspace) it goes on from new orthogonal vectors.

    product: V -> A V, (size, b) double precision, b at most `block`; trace: of A, exact; seed: of the first vectors.
    """
    # as parts of the trace, so that squares of what is computed do not leave the range of doubles
    krylov = _Krylov(lambda V: product(V) / trace, size, min(block, size), seed, device or torch.device("cpu"))
    while True:
        checked = krylov.steps
        while krylov.steps < checked + max(8, checked // 8) and not krylov.complete:
            krylov.extend()
        pairs = _finished(krylov, wanted, trace, tolerance)
        if pairs is not None:
            values, vectors, residuals, steps, ritz, reason, T = pairs
            return RitzPairs(values * trace, vectors, residuals * trace, steps, ritz * trace, reason, T * trace)


def _finished(krylov: "_Krylov", wanted: Wanted, trace: float, tolerance: float) -> RitzPairs | None:
    """Wanted pairs if they have converged and none can be missing, or all there are at the end; else None.

    All values here are parts of the trace.
    """
    ritz, y = krylov.ritz_pairs()
    # the bound of exact arithmetic, but never below the rounding of one product
    coupling = krylov.beta @ y[-krylov.beta.shape[1] :]
    bounds = torch.linalg.vector_norm(coupling, dim=0).clamp(min=EPSILON * float(ritz[0]))
    settled = bounds <= tolerance * ritz[0]
    missing = 1.0 - float(ritz.sum())
    unseen = missing + float((ritz * ~settled).max())
    noise = NOISE * float(ritz[0])
    p, rank = wanted(ritz * trace, partial(krylov.ritz_vectors, y)), int((ritz > noise).sum())
    proven = p is not None and p <= rank and bool(settled[:p].all()) and unseen < ritz[p - 1]
    if proven:
        reason = f"{p} pairs converged and the trace leaves no room for a missed one"
    elif missing <= noise:
        reason = f"nothing above {NOISE:g} of the largest eigenvalue is left"
    elif krylov.complete:
        reason = f"all {krylov.steps} directions used"
    else:
        return None
    if p is None or p > rank:
        p, reason = rank, f"rank {rank}: {reason}; smaller eigenvalues are noise"
    found = ritz[:p], krylov.ritz_vectors(y[:, :p]), bounds[:p]
    return RitzPairs(*found, krylov.steps, ritz, reason, krylov.tridiagonal)


def thin_svd(matrix: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Thin singular value decomposition, on a GPU as accurate as on a CPU: not by the Jacobi method that is faster."""
    left, lengths, right = torch.linalg.svd(matrix, full_matrices=False, driver="gesvd" if matrix.is_cuda else None)
    return left, lengths, right


class _Krylov:
    """The orthonormal vectors q_1 … q_k and the (block) tridiagonal matrix T_k of the process so far."""

    def __init__(
        self, product: Callable[[Tensor], Tensor], size: int, block: int, seed: int, device: torch.device
    ) -> None:
        self._product, self._size, self._device = product, size, device
        self._generator = torch.Generator().manual_seed(seed)
        room = min(size, max(64, 4 * block))
        self._rows = self._empty(room, size)  # q_i as rows: contiguous
        self._T = torch.zeros((room, room), dtype=torch.float64)
        self._norm = 0.0  # largest entry of T
        self.steps = 0
        self.beta = self._empty(0, 0)  # (b', b) of the last step, to the next block
        self._next = self._new_directions(block)

    @property
    def complete(self) -> bool:
        """Whether the q_i span the whole space."""
        return self.steps == self._size

    @property
    def tridiagonal(self) -> Tensor:
        """T_k, (k, k)."""
        return self._T[: self.steps, : self.steps]

    def extend(self) -> None:
        """Take one step: the next block joins, its product is orthogonalised against all, α and β are recorded."""
        q = self._next
        low, high = self.steps, self.steps + len(q)
        self._make_room(high)
        self._rows[low:high] = q
        self.steps = high
        w = self._product(q.T).T
        alpha = (q @ w.T).cpu()
        self._T[low:high, low:high] = 0.5 * (alpha + alpha.T)
        w = self._orthogonal(w)
        self._next, self.beta = self._divided(w, min(len(q), self._size - high))
        top = min(high + len(self._next), self._size)
        self._make_room(top)
        self._T[high:top, low:high] = self.beta.cpu()
        self._T[low:high, high:top] = self.beta.T.cpu()
        self._norm = max(self._norm, float(self._T[low:top, low:high].abs().max()))

    def ritz_vectors(self, y: Tensor) -> Tensor:
        """Q_k y, (n, p), for eigenvectors y (k, p) of T_k."""
        return self._rows[: self.steps].T @ y

    def ritz_pairs(self) -> tuple[Tensor, Tensor]:
        """Eigenvalues of T_k, descending, and its eigenvectors y (k, k)."""
        ritz, y = torch.linalg.eigh(self.tridiagonal)
        return ritz.flip(0).to(self._device), y.flip(1).to(self._device)

    def _divided(self, w: Tensor, room: int) -> tuple[Tensor, Tensor]:
        """Orthonormal rows q (b', n) and β (b', b) with w = βᵀ q, for w (b, n) orthogonal to all; b' at most `room`.

        Where w has less than b' directions above rounding, new ones take their place with β zero.
        """
        if room == 0:
            return self._empty(0, self._size), self._empty(0, len(w))
        if len(w) == 1:
            length = torch.linalg.vector_norm(w)
            q, beta = w / length.clamp(min=torch.finfo(torch.float64).tiny), length.reshape(1, 1)
        else:
            left, lengths, right = thin_svd(w)
            q, beta = right[:room], (left * lengths).T[:room]
        scale = max(self._norm, float(self._T[: self.steps, : self.steps].diagonal().max()))
        dead = torch.linalg.vector_norm(beta, dim=1) <= BREAKDOWN * scale
        if dead.any():
            beta[dead] = 0.0
            q[dead] = self._new_directions(int(dead.sum()))
        if len(q) == 1:
            return q, beta
        # what was divided by a small length has lost its orthogonality to the others
        frame, turn = torch.linalg.qr(self._orthogonal(q).T)
        return frame.T, turn @ beta

    def _orthogonal(self, w: Tensor) -> Tensor:
        """Take from the rows of w their parts along all q_i; twice, because once leaves what cancellation uncovered."""
        Q = self._rows[: self.steps]
        for _ in range(2):
            w = w - (w @ Q.T) @ Q
        return w

    def _new_directions(self, count: int) -> Tensor:
        """Rows (count, n) orthonormal and orthogonal to all q_i."""
        v = torch.randn((count, self._size), dtype=torch.float64, generator=self._generator).to(self._device)
        # in the last few directions little of a random vector is left; what is, is made orthogonal again
        for _ in range(3):
            v = torch.linalg.qr(self._orthogonal(v).T)[0].T
        return v

    def _make_room(self, steps: int) -> None:
        held = len(self._rows)
        if steps > held:
            more = max(min(self._size - held, held), steps - held)
            self._rows = torch.cat([self._rows, self._empty(more, self._size)])
            self._T = torch.nn.functional.pad(self._T, (0, more, 0, more))

    def _empty(self, *shape: int) -> Tensor:
        return torch.empty(shape, dtype=torch.float64, device=self._device)
