"""Results as figures of matplotlib, one call for all of them."""

from collections.abc import Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from pod import Basis, Convergence
from selection import Candidate, Sweep
from suffice.answers import Selection, Tradeoff
from suffice.plots import QUIET, colours_of, error_field
from suffice.refusal import Refusal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INKS = {"sufficient": "#187546", "insufficient": "#b3362b", "undecidable": "#8a6100"}


def plot(result: Sweep | Candidate | Selection | Tradeoff | Basis | Convergence, axes: "Axes | None" = None) -> "Axes":
    """Draw a result into these axes, or into a new figure; return the axes.

    A sweep, or a selection of several: K_f against Δτ, with its interval. A candidate: R_c against modes, with n_c and
    n_lr. A basis: the energy left beyond n modes, 1 - I(n) (paper eq. (28)). A convergence: the Lanczos ratio against
    steps (paper Figure 2). A trade-off: error against storage.
    Raises Refusal where matplotlib is not installed, or nothing is known of how to draw this.
    """
    return _drawn(result, _axes() if axes is None else axes)


def _axes() -> "Axes":
    try:
        import matplotlib.pyplot as plt
    except ModuleNotFoundError:
        raise Refusal("plot needs matplotlib, which is not installed; pip install matplotlib") from None
    return plt.subplots(layout="constrained")[1]


@singledispatch
def _drawn(result: Any, _axes: "Axes") -> "Axes":
    known = "a sweep, a candidate, a selection, a trade-off, a basis or a Lanczos convergence"
    raise Refusal(f"plot of a {type(result).__name__} is not known; give {known}")


@_drawn.register(Sweep)
def _of_sweep(result: Sweep, axes: "Axes") -> "Axes":
    """K_f against Δτ: marks in the colour of our verdict, a band from leaving out particles, dotted the limit."""
    _feasibility(axes, result, "")
    for verdict in sorted({c.verdict for c in result.candidates}):
        own = [c for c in result.candidates if c.verdict == verdict]
        axes.plot(*_points(own), "o", color=INKS[verdict], label=verdict)
    return _limit(axes, result)


@_drawn.register(Selection)
def _of_selection(result: Selection, axes: "Axes") -> "Axes":
    for name, found in result.items():
        _feasibility(axes, found, name)
    return _limit(axes, next(iter(result.values())))


@_drawn.register(Candidate)
def _of_candidate(result: Candidate, axes: "Axes") -> "Axes":
    ratio = result.curves.R_c
    known = np.flatnonzero(np.isfinite(ratio[1:])) + 1  # n = 0 is the mean alone
    axes.plot(known, ratio[known], color=INKS[result.verdict])
    for n, line, name in ((result.n_lr, "--", "n_lr"), (result.n_c, "-", "n_c")):
        axes.axvline(n, color=QUIET, linestyle=line, linewidth=1, label=f"{name} = {n}")
    top = 1.5  # beyond it a mode describes what its snapshots had by chance, however much
    axes.set(xlabel="modes n", ylabel="$R_c(n)$", ylim=(0.95, top), title=f"Δτ = {1e3 * result.interval:.6g} ms")
    axes.legend(frameon=False)
    return axes


@_drawn.register(Basis)
def _of_basis(result: Basis, axes: "Axes") -> "Axes":
    left = np.clip(1.0 - result.ratio, np.finfo(float).eps, None)  # all modes leave rounding, which has no logarithm
    axes.semilogy(1 + np.arange(len(left)), left, color=INKS["sufficient"])
    if result.n_lr is not None:
        axes.axvline(result.n_lr, color=QUIET, linestyle="--", linewidth=1, label=f"n_lr = {result.n_lr}")
        axes.legend(frameon=False)
    axes.set(xlabel="modes n", ylabel="energy left, $1 - I(n)$")
    return axes


@_drawn.register(Convergence)
def _of_convergence(result: Convergence, axes: "Axes") -> "Axes":
    axes.plot(result.steps, result.ratio, color=INKS["sufficient"], label="of the exact total")
    axes.plot(result.steps, result.paper_ratio, color=QUIET, linestyle="--", label="of the Ritz values, as the paper")
    axes.set(xlabel="Lanczos steps", ylabel="Lanczos ratio")
    axes.legend(frameon=False)
    return axes


@_drawn.register(Tradeoff)
def _of_tradeoff(result: Tradeoff, axes: "Axes") -> "Axes":
    """RMSE against bytes of all alternatives, in diameters where they are known."""
    rows = result["rows"]
    variables = sorted({row["variable"] for row in rows})
    if len(variables) != 1:
        first = variables[0] if variables else "position.z"
        raise Refusal(
            f"plot of a trade-off is that of one variable, this one has {len(variables)}; take .of({first!r})"
        )
    field, unit = error_field(rows)
    for name, colour in colours_of(rows).items():
        own = [row for row in rows if row["surrogate"] == name]
        axes.loglog([row["storage_bytes"] for row in own], [row[field] for row in own], ".", color=colour, label=name)
    axes.set(xlabel="bytes to keep", ylabel=f"RMSE at unseen times ({unit})", title=variables[0])
    axes.legend(frameon=False, fontsize="small")
    return axes


def _feasibility(axes: "Axes", found: Sweep, label: str) -> None:
    """Draw K_f against Δτ, and its interval as a band where it is known."""
    line = {"color": QUIET} if not label else {"marker": "o", "markersize": 4, "label": label}
    (drawn,) = axes.plot(*_points(found.candidates), **line)
    spread = [(1e3 * c.interval, *c.K_f_interval) for c in found.candidates if c.K_f_interval is not None]
    if spread:
        axes.fill_between(*np.array(spread).T, color=drawn.get_color(), alpha=0.2, linewidth=0)


def _points(candidates: Sequence[Candidate]) -> tuple[list[float], list[float]]:
    """Return Δτ in ms and K_f where it is defined."""
    known = [(1e3 * c.interval, c.K_f) for c in candidates if c.K_f is not None]
    return [x for x, _ in known], [y for _, y in known]


def _limit(axes: "Axes", found: Sweep) -> "Axes":
    axes.axhline(found.thresholds.feasibility, color=QUIET, linestyle=":", linewidth=1)
    axes.set(xlabel="Δτ (ms)", ylabel="$K_f$")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False)
    return axes
