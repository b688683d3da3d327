"""Kalman filter and smoother: what measurements say about a state at their times, in one sweep there and one back."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surrogates.matern import REVERSED, Matern

Array = NDArray[np.float64]


class Track(NamedTuple):
    """States at the times measured; all columns of the measurements share the covariances."""

    means: Array  # (times, 3, columns)
    covariances: Array  # (times, 3, 3)


class Filtered(NamedTuple):
    """States given the measurements up to each time, and how well those were foreseen."""

    track: Track
    surprises: Array  # (times, columns) measurement minus its forecast
    variances: Array  # (times,) of the surprises, for a kernel of unit variance


def kalman_filter(kernel: Matern, times: Array, measured: Array, noise: float) -> Filtered:
    """Sweep forwards over `times` (m,) with `measured` (m, columns), f plus white noise of variance `noise`.

    m⁻ = A m, P⁻ = A P Aᵀ + Q; v = y - m⁻₀, S = P⁻₀₀ + r, k = P⁻_{:0}/S; m = m⁻ + k v, P = P⁻ - k P⁻_{0:}.
    """
    gaps = np.diff(times)
    moves, noises = kernel.transition(gaps), kernel.added(gaps)
    means, covariances = np.empty((len(times), 3, measured.shape[1])), np.empty((len(times), 3, 3))
    surprises, variances = np.empty_like(measured), np.empty(len(times))
    mean, covariance = np.zeros((3, measured.shape[1])), kernel.stationary()
    for i, value in enumerate(measured):
        if i:
            mean, covariance = moves[i - 1] @ mean, moves[i - 1] @ covariance @ moves[i - 1].T + noises[i - 1]
        surprises[i], variances[i] = value - mean[0], covariance[0, 0] + noise
        gain = covariance[:, 0] / variances[i]
        mean = mean + gain[:, None] * surprises[i]
        covariance = covariance - gain[:, None] * covariance[0]
        covariance = (covariance + covariance.T) / 2
        means[i], covariances[i] = mean, covariance
    return Filtered(Track(means, covariances), surprises, variances)


def smoother(kernel: Matern, times: Array, filtered: Track) -> Track:
    """Sweep back: states given all measurements (Rauch, Tung and Striebel 1965).

    G = P Aᵀ (P⁻)⁻¹; mˢ = m + G (mˢ₊ - A m), Pˢ = P + G (Pˢ₊ - P⁻) Gᵀ.
    """
    gaps = np.diff(times)
    moves, noises = kernel.transition(gaps), kernel.added(gaps)
    forecasts = moves @ filtered.covariances[:-1] @ moves.transpose(0, 2, 1) + noises
    gains = np.linalg.solve(forecasts, moves @ filtered.covariances[:-1]).transpose(0, 2, 1)
    means, covariances = filtered.means.copy(), filtered.covariances.copy()
    for i in range(len(times) - 2, -1, -1):
        means[i] += gains[i] @ (means[i + 1] - moves[i] @ filtered.means[i])
        covariances[i] += gains[i] @ (covariances[i + 1] - forecasts[i]) @ gains[i].T
    return Track(means, covariances)


class Weights(NamedTuple):
    """f at some times, as a weighted sum of the states at the times measured, and its variance."""

    before: NDArray[np.intp]  # (any,) the time whose filtered state counts
    of_before: Array  # (any, 3)
    after: NDArray[np.intp]  # (any,) the time whose smoothed state counts
    of_after: Array  # (any, 3)
    variance: Array  # (any,) of f, for a kernel of unit variance


def weights_between(kernel: Matern, times: Array, asked: Array, filtered: Track, smoothed: Track) -> Weights:
    """Weights of f at `asked` (any,): a step of the filter from the time before, one of the smoother from the next.

    After the last time the forecast of the filter, before the first that of the smoothed state, run backwards.
    """
    last = len(times) - 1
    before = np.clip(np.searchsorted(times, asked, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    move = kernel.transition(np.maximum(asked - times[before], 0.0))
    forecast = move @ filtered.covariances[before] @ move.transpose(0, 2, 1)
    forecast += kernel.added(np.maximum(asked - times[before], 0.0))
    of_before, of_after, variance = move[:, 0].copy(), np.zeros((len(asked), 3)), forecast[:, 0, 0].copy()
    inner = (asked >= times[0]) & (before < last)
    if inner.any():
        rest = times[after[inner]] - asked[inner]
        on = kernel.transition(rest)
        there = on @ forecast[inner] @ on.transpose(0, 2, 1) + kernel.added(rest)
        gain = np.linalg.solve(there, on @ forecast[inner][:, :, :1])[:, :, 0]
        of_after[inner] = gain
        of_before[inner] -= np.einsum("ai,aij,ajk->ak", gain, on, move[inner])
        known = smoothed.covariances[after[inner]] - there
        variance[inner] += np.einsum("ai,aij,aj->a", gain, known, gain)
    early = asked < times[0]
    if early.any():
        back = kernel.transition(times[0] - asked[early])[:, 0] * REVERSED
        of_before[early], after[early], of_after[early] = 0.0, 0, back
        variance[early] = np.einsum("ai,ij,aj->a", back, smoothed.covariances[0], back)
        variance[early] += kernel.added(times[0] - asked[early])[:, 0, 0]
    return Weights(before, of_before, after, of_after, np.maximum(variance, 0.0))
