"""Leading eigenpairs of a symmetric operator that is known only by its product with a vector (Lanczos)."""

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
    residuals: Tensor  # (p,) ‖A x - θ x‖ = |β_k y_ki|, a bound on the error of the value
    steps: int  # k
    ritz_sum: float  # Σ of all k Ritz values, the paper's total
    reason: str  # why it stopped


def lanczos(
    product: Callable[[Tensor], Tensor],
    size: int,
    wanted: Wanted,
    *,
    trace: float,
    tolerance: float = 1e-12,
    seed: int = 0,
    device: torch.device | None = None,
) -> RitzPairs:
    """Lanczos with full reorthogonalisation, twice, on a positive semidefinite operator (paper eqs. (25)-(27)).

    A Q_k = Q_k T_k + β_k q_{k+1} e_kᵀ. It stops when the wanted pairs have residual bounds |β_k y_ki| ≤ tolerance·θ₁
    *and* no larger one can be missing. The Krylov space holds one copy of a repeated eigenvalue and may be late to see
    another; but what it has not found is at most the trace not yet found plus the largest Ritz value not yet
    converged, and that must be below the last wanted value. It ends as well when only noise (1e-13 θ₁) is left, or
    after `size` steps. At a breakdown (invariant subspace) it goes on from a new orthogonal vector.

    product: v -> A v, (size,) double precision; trace: of A, exact; seed: of the starting vectors.
    """
    krylov = _Krylov(product, size, seed, device or torch.device("cpu"))
    while True:
        for _ in range(max(8, krylov.steps // 8)):
            krylov.extend()
        pairs = _finished(krylov, wanted, trace, tolerance)
        if pairs is not None:
            return pairs


def _finished(krylov: "_Krylov", wanted: Wanted, trace: float, tolerance: float) -> RitzPairs | None:
    """Wanted pairs if they have converged and none can be missing, or all there are at the end; else None."""
    ritz, y = krylov.tridiagonal_eigenpairs()
    # the bound of exact arithmetic, but never below the rounding of one product
    bounds = (krylov.beta[-1] * y[-1].abs()).clamp(min=EPSILON * float(ritz[0]))
    settled = bounds <= tolerance * ritz[0]
    missing = trace - float(ritz.sum())
    unseen = missing + float((ritz * ~settled).max())
    noise = NOISE * float(ritz[0])
    p, rank = wanted(ritz, partial(krylov.ritz_vectors, y)), int((ritz > noise).sum())
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
    return RitzPairs(ritz[:p], krylov.ritz_vectors(y[:, :p]), bounds[:p], krylov.steps, float(ritz.sum()), reason)


class _Krylov:
    """The orthonormal vectors q_1 … q_k and the tridiagonal matrix T_k of the process so far."""

    def __init__(self, product: Callable[[Tensor], Tensor], size: int, seed: int, device: torch.device) -> None:
        self._product, self._size, self._device = product, size, device
        self._generator = torch.Generator().manual_seed(seed)
        self._rows = torch.empty((min(size, 64), size), dtype=torch.float64, device=device)  # q_i as rows: contiguous
        self.steps = 0
        self.alpha: list[float] = []
        self.beta: list[float] = []
        self._next = self._new_direction()

    def extend(self) -> None:
        """Take one step, if there is room: q_{k+1} joins, A q_{k+1} is orthogonalised against all, α and β recorded."""
        if self.complete:
            return
        if self.steps == len(self._rows):
            room = torch.empty((min(self._size - self.steps, self.steps), self._size), dtype=torch.float64)
            self._rows = torch.cat([self._rows, room.to(self._device)])
        q = self._next
        self._rows[self.steps] = q
        self.steps += 1
        w = self._product(q)
        self.alpha.append(float(q @ w))
        w = self._orthogonal(w)
        beta = float(torch.linalg.vector_norm(w))
        norm = max([*self.alpha, *self.beta])
        if beta > BREAKDOWN * norm:
            self.beta.append(beta)
            self._next = w / beta
        else:
            self.beta.append(0.0)
            if not self.complete:
                self._next = self._new_direction()

    @property
    def complete(self) -> bool:
        """Whether the q_i span the whole space."""
        return self.steps == self._size

    def ritz_vectors(self, y: Tensor) -> Tensor:
        """Q_k y, (n, p), for eigenvectors y (k, p) of T_k."""
        return self._rows[: self.steps].T @ y

    def tridiagonal_eigenpairs(self) -> tuple[Tensor, Tensor]:
        """Eigenvalues of T_k, descending, and its eigenvectors y (k, k)."""
        T = torch.diag(torch.tensor(self.alpha, dtype=torch.float64))
        off = torch.tensor(self.beta[:-1], dtype=torch.float64)
        T += torch.diag(off, 1) + torch.diag(off, -1)
        ritz, y = torch.linalg.eigh(T)
        return ritz.flip(0).to(self._device), y.flip(1).to(self._device)

    def _orthogonal(self, w: Tensor) -> Tensor:
        """Take from w its parts along all q_i; twice, because once leaves what cancellation uncovered."""
        Q = self._rows[: self.steps]
        for _ in range(2):
            w = w - (Q @ w) @ Q
        return w

    def _new_direction(self) -> Tensor:
        """Direction orthogonal to all q_i, of length one."""
        while True:
            v = torch.randn(self._size, dtype=torch.float64, generator=self._generator).to(self._device)
            w = self._orthogonal(v / torch.linalg.vector_norm(v))
            length = torch.linalg.vector_norm(w)
            # in the last few directions little of a random vector is left; orthogonalise that little again
            if length > EPSILON**0.5:
                w = self._orthogonal(w / length)
                return torch.nn.functional.normalize(w, dim=0)
