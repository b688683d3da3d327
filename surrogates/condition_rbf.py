"""Radial basis functions over conditions, chosen by leaving one speed out."""

from collections.abc import Callable, Iterator
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from surrogates.conditions import Array, ConditionSurrogate, Samples, groups_of
from surrogates.kernel import KernelName

SHAPED: tuple[KernelName, ...] = ("multiquadric", "gaussian")
SHAPES = (0.5, 1.0, 2.0)  # ε per range of the operating condition
STRETCHES = (0.3, 1.0, 3.0)  # of the circle of the phase, whose radius is 1, against that range
SMOOTHINGS = (0.0, 1e-3, 1e-1)


class Radial(NamedTuple):
    """One way to interpolate."""

    kernel: KernelName  # as scipy spells it
    degree: int  # of the polynomial
    shape: float  # ε
    stretch: float
    smoothing: float  # on the diagonal of the kernel's matrix


class RbfCondition(ConditionSurrogate):
    """Radial interpolation f(x) = Σ w_i φ(ε|x − x_i|) + polynomial, x the conditions with the phase stretched.

    Kernel, degree, shape, stretch and smoothing are those with the least error, summed over modes, at inner operating
    conditions left out with all their phases: leaving out a single sample would test the phase, not the condition.
    Where there are fewer than three conditions nothing can be left out, and the first candidate is taken.
    """

    name: ClassVar[str] = "rbf"

    radial_: Radial
    left_out_: dict[Radial, float]  # RMS error at the conditions left out, by candidate

    def _fit(self, samples: Samples) -> None:
        groups, group = groups_of(samples.conditions[:, : self._operating(samples.conditions)])
        tried = list(candidates(samples.conditions.shape[1], self.phase, len(groups)))
        inner = [g for g in range(len(groups)) if _inside(groups, g)] if len(groups) > 2 else []
        self.left_out_ = {radial: self._left_out(radial, samples, group, inner) for radial in tried if inner}
        self.radial_ = min(self.left_out_, key=lambda radial: self.left_out_[radial]) if inner else tried[0]
        self.curve_ = self._curve(self.radial_, samples)

    def _left_out(self, radial: Radial, samples: Samples, group: NDArray[np.intp], inner: list[int]) -> float:
        total = 0.0
        for g in inner:
            shown, unseen = Samples(*(part[group != g] for part in samples)), samples.conditions[group == g]
            try:
                found = self._curve(radial, shown)(self._stretched(radial, unseen))
            except np.linalg.LinAlgError:  # singular with one condition less
                return np.inf
            total += float(((found - samples.values[group == g]) ** 2).sum())
        return float(np.sqrt(total / np.isin(group, inner).sum()))

    def _curve(self, radial: Radial, samples: Samples) -> Callable[[Array], Array]:
        curve: Callable[[Array], Array] = RBFInterpolator(
            self._stretched(radial, samples.conditions), samples.values, kernel=radial.kernel, epsilon=radial.shape,
            degree=radial.degree, smoothing=radial.smoothing,
        )  # fmt: skip
        return curve

    def _stretched(self, radial: Radial, conditions: Array) -> Array:
        stretched = conditions.copy()
        stretched[:, self._operating(conditions) :] *= radial.stretch
        return stretched

    def _predict(self, conditions: Array) -> Array:
        return np.asarray(self.curve_(self._stretched(self.radial_, conditions)))


def candidates(columns: int, phase: bool, groups: int) -> Iterator[Radial]:
    """Yield what may be chosen with so many columns and different operating conditions, simplest first.

    A circle allows no quadratic polynomial: its squares add up to 1, so the monomials depend on each other.
    """
    quadratic = columns == 1 and groups > 3
    stretches = STRETCHES if phase else (1.0,)
    kinds: list[tuple[KernelName, int, float]] = [
        ("linear", 0, 1.0),
        ("linear", 1, 1.0),
        ("thin_plate_spline", 1, 1.0),
        ("cubic", 1, 1.0),
    ]
    if quadratic:
        kinds += [("thin_plate_spline", 2, 1.0), ("cubic", 2, 1.0), ("quintic", 2, 1.0)]
    if groups > 2:
        kinds += [(name, 1, shape) for name in SHAPED for shape in SHAPES]
    for name, degree, shape in kinds:
        for stretch in stretches:
            for smoothing in SMOOTHINGS:
                yield Radial(name, degree, shape, stretch, smoothing)


def _inside(groups: Array, g: int) -> bool:
    """Whether an operating condition lies within the range of all others."""
    others = np.delete(groups, g, axis=0)
    return bool(((groups[g] >= others.min(axis=0)) & (groups[g] <= others.max(axis=0))).all())
