"""Positions decomposed together with their velocities, for comparison with a basis of positions alone."""

from time import perf_counter

import numpy as np

from pod import enriched_pod
from suffice.reconstruction import Case, Reduced, reduced_on

WEIGHT = 1 / np.sqrt(39.0)  # of the velocities, see below


def reduce_enriched(case: Case, energy: float) -> Reduced:
    """Decompose the training positions and ω Δτ times their velocities, keeping every mode, and project the window.

    ω weighs both as the Hermite interpolant h₀₀ x₀ + h₀₁ x₁ + Δτ (h₁₀ v₀ + h₁₁ v₁) does in the mean over 0 ≤ s ≤ 1:
    ω² = ∫h₁₀² / ∫h₀₀² = (1/105) / (13/35) = 1/39. No unseen snapshot takes part in it. n_lr counts the modes that hold
    `energy` of the positions (paper eq. (28)).
    Raises pod.InputError as `reduce` does, and where velocities are missing or snapshots are not evenly spaced.
    """
    assert case.rates is not None  # whoever asks has looked
    begin = perf_counter()
    interval = float(case.times[case.training[1]] - case.times[case.training[0]])
    most = 2 * len(case.training) - 1  # the mean takes one of the positions' degrees of freedom
    found = enriched_pod(
        case.values, case.rates, case.training.tolist(), interval, modes=most, weights=[WEIGHT], reconstructable=energy
    )
    return reduced_on(found.basis, case, perf_counter() - begin)
