"""Radial kernels in time, and the polynomials that go with them."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

from surrogates.errors import InputError

KernelName = Literal[
    "linear", "thin_plate_spline", "cubic", "quintic", "multiquadric", "inverse_multiquadric", "gaussian"
]  # as scipy spells them

Profile = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Family(NamedTuple):
    """Kernels of one formula φ(εr)."""

    profile: Profile  # φ, with the sign that makes it positive definite
    degree: int  # of the polynomial added where there are snapshots enough
    least_degree: int  # below it the interpolation problem may be singular
    shapes: tuple[float, ...]  # ε tried, per Δτ; one where ε only scales the kernel


class Kernel(NamedTuple):
    """One kernel: φ(ε|t - t_i|/Δτ) plus a polynomial in t."""

    name: KernelName
    shape: float  # ε per Δτ
    degree: int  # of the polynomial


SHAPES = (
    1.5,
    1.0,
    0.7,
    0.5,
)  # flatter ones approach polynomials, which quintic gives, and cost digits (Gaussian: e^{π²/4ε²})

# Degrees above the least keep the order of the kernel up to both ends of the series; with the least one the cubic
# kernel is the natural spline, second order there.
FAMILIES: dict[KernelName, Family] = {
    "linear": Family(lambda r: -r, 0, 0, (1.0,)),
    "thin_plate_spline": Family(lambda r: np.asarray(xlogy(r**2, r), dtype=np.float64), 1, 1, (1.0,)),
    "cubic": Family(lambda r: r**3, 3, 1, (1.0,)),
    "quintic": Family(lambda r: -(r**5), 5, 2, (1.0,)),
    "multiquadric": Family(lambda r: -np.sqrt(1 + r**2), 3, 0, SHAPES),
    "inverse_multiquadric": Family(lambda r: 1 / np.sqrt(1 + r**2), 3, 0, SHAPES),
    "gaussian": Family(lambda r: np.exp(-(r**2)), 3, 0, SHAPES),
}


def candidates(name: KernelName | None, shape: float | None, snapshots: int) -> list[Kernel]:
    """Kernels to choose from, simplest first: all of them, those of one family, or the one given.

    The polynomial's degree falls short of `snapshots` by two, so that one snapshot can be left out.
    Raises InputError: the given family needs more snapshots.
    """
    most = max(1, snapshots - 2)
    names = FAMILIES if name is None else (name,)
    kernels = [
        Kernel(family, epsilon, min(FAMILIES[family].degree, most))
        for family in names
        for epsilon in (FAMILIES[family].shapes if shape is None else (shape,))
        if FAMILIES[family].least_degree <= most
    ]
    if not kernels:
        raise InputError(f"kernel {name} needs at least 4 snapshots, {snapshots} given; use kernel cubic")
    return kernels


def family_name(name: str) -> KernelName:
    """Return `name` as the name of a family. Raises InputError if there is none."""
    for family in FAMILIES:
        if family == name:
            return family
    raise InputError(f"kernel {name!r} is unknown; use one of {', '.join(FAMILIES)}, or none to let the data choose")


def checked_shape(shape: float, name: str | None) -> float:
    """Return `shape` (ε per Δτ). Raises InputError unless it is positive and belongs to a kernel."""
    if name is None:
        raise InputError(f"shape {shape:g} given without a kernel; name the kernel it belongs to")
    if not (np.isfinite(shape) and shape > 0):
        raise InputError(f"shape is {shape:g}; use a positive number per snapshot interval, 0.5 to 1.5 are usual")
    return shape


def kernel_matrix(kernel: Kernel, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Saddle matrix [[A, P], [Pᵀ, 0]] of interpolation at `times` (n,) in Δτ: A_ij = φ(ε|t_i - t_j|), P monomials."""
    n, m = len(times), kernel.degree + 1
    saddle = np.zeros((n + m, n + m))
    saddle[:n, :n] = FAMILIES[kernel.name].profile(kernel.shape * np.abs(times[:, None] - times))
    middle, half = (times[0] + times[-1]) / 2, (times[-1] - times[0]) / 2
    saddle[:n, n:] = np.vander((times - middle) / half, m, increasing=True)
    saddle[n:, :n] = saddle[:n, n:].T
    return saddle
