"""How the Lanczos ratio converges with the number of Lanczos steps (the paper's Figure 2)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pod.basis import Basis
from pod.facts import facts_html, facts_text
from pod.gram import Array

MOST_POINTS = 60


class Convergence(NamedTuple):
    """Lanczos ratio against steps k of the process, from the leading k × k part of T."""

    steps: NDArray[np.int64]  # (points,) k
    ratio: Array  # (points,) Σ_{i≤p} θ_i / trace(A)
    paper_ratio: Array  # (points,) Σ_{i≤p} θ_i / Σ_{all k} θ_i, the paper's denominator
    n_lr: NDArray[np.int64]  # (points,) modes that hold the energy asked for, of the exact total; 0 for not yet
    n_lr_ritz: NDArray[np.int64]  # (points,) the same of the paper's denominator, the Ritz values there are

    def __repr__(self) -> str:
        return facts_text(*self._facts())

    def _repr_html_(self) -> str:
        return facts_html(*self._facts())

    def _facts(self) -> tuple[str, dict[str, str]]:
        """Ratio and n_lr after the first, the middle and the last of the steps."""
        shown = sorted({0, len(self.steps) // 2, len(self.steps) - 1}) if len(self.steps) else []
        return f"Lanczos convergence, {len(self.steps)} points", {
            f"after step {self.steps[k]}": f"ratio {self.ratio[k]:.6g}, n_lr {self.n_lr[k] or 'not reached'}"
            for k in shown
        }


def lanczos_convergence(basis: Basis, modes: int | None = None, energy: float = 0.999) -> Convergence:
    """Lanczos ratio and least reconstructable mode as they would be after fewer steps; empty for a dense basis.

    modes: p of the ratio, default all that the basis has; energy: that defines n_lr.
    """
    total, k = basis.total_energy, len(basis.tridiagonal)
    p = modes or len(basis.values)
    steps = np.unique(np.linspace(1, k, min(k, MOST_POINTS)).astype(int)) if k else np.zeros(0, int)
    rows = []
    for step in steps:
        sums = np.cumsum(np.linalg.eigvalsh(basis.tridiagonal[:step, :step])[::-1])
        held = sums[min(p, step) - 1]
        rows.append((held / total, held / sums[-1], _reach(sums, energy * total), _reach(sums, energy * sums[-1])))
    ratio, paper, n_lr, n_lr_ritz = np.array(rows).reshape(-1, 4).T
    return Convergence(steps, ratio, paper, n_lr.astype(int), n_lr_ritz.astype(int))


def _reach(sums: Array, energy: float) -> int:
    enough = sums >= energy
    return int(np.argmax(enough)) + 1 if enough.any() else 0
