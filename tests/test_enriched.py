"""A basis of positions and velocities represents the Hermite interpolant; its weight is the one that errs least."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from pod import InputError, enriched_pod, lanczos_pod

DENSE = 1e-3  # s


def paths(rows=400, snapshots=81, seed=0):
    """Positions and velocities (rows, snapshots) of independent oscillations, several within a coarse interval."""
    rng = np.random.default_rng(seed)
    t = DENSE * np.arange(snapshots)
    phase, pace = rng.uniform(0, 6, (rows, 1)), rng.uniform(100.0, 500.0, (rows, 1))
    return 5.0 + np.sin(pace * t + phase), pace * np.cos(pace * t + phase), t


def rmse(values):
    return np.sqrt(np.square(values).mean())


def test_the_enriched_basis_holds_the_hermite_interpolant_of_its_snapshots():
    x, v, t = paths()
    training = np.arange(0, 81, 8)
    found = enriched_pod(x, v, training, 8 * DENSE, modes=2 * len(training), weights=[1.0])
    hermite = CubicHermiteSpline(t[training], x[:, training], v[:, training], axis=1)(t)
    rest = hermite - found.basis.reconstruct(found.basis.project(hermite))
    assert np.abs(rest).max() <= 1e-11
    assert found.errors[0] <= rmse(
        hermite[:, found.held_out] - x[:, found.held_out]
    )  # the projection is the best there


def test_errors_are_those_of_projecting_the_snapshots_held_out():
    x, v, _ = paths()
    training = np.arange(0, 81, 4)
    found = enriched_pod(x, v, training, 4 * DENSE, modes=15)
    unseen = x[:, found.held_out]
    own = rmse(found.basis.reconstruct(found.basis.project(unseen)) - unseen)
    assert own == pytest.approx(found.errors.min(), rel=1e-9)
    assert found.weight == found.weights[found.errors.argmin()]
    assert found.basis.modes.shape == (400, 15)
    assert found.basis.orthogonality <= 1e-12
    assert np.abs(found.basis.mean - x[:, training].mean(axis=1)).max() <= 1e-13


def test_without_velocities_it_is_the_plain_basis():
    x, v, _ = paths()
    training = np.arange(0, 81, 8)
    plain = lanczos_pod(x[:, training], modes=8)
    found = enriched_pod(x, v, training, 8 * DENSE, modes=8, weights=[0.0])
    assert np.abs(found.basis.values - plain.values).max() <= 1e-12 * plain.values[0]
    assert np.abs(found.basis.modes - plain.modes).max() <= 1e-9
    assert found.basis.total_energy == pytest.approx(plain.total_energy, rel=1e-12)


@pytest.mark.parametrize("weight", [0.0, 0.25, 2.0])
def test_the_energy_held_is_that_of_the_positions_whatever_the_velocities_add(weight):
    x, v, _ = paths()
    training = np.arange(0, 81, 4)
    basis = enriched_pod(x, v, training, 4 * DENSE, modes=2 * len(training), weights=[weight]).basis
    motion = x[:, training] - x[:, training].mean(axis=1, keepdims=True)
    held = np.cumsum(np.square(basis.modes.T @ motion).sum(axis=1)) / np.square(motion).sum()
    assert np.abs(basis.ratio - held).max() <= 1e-12
    assert basis.ratio[-1] <= 1.0 + 1e-12
    assert basis.n_lr == np.argmax(held >= 0.999) + 1
    assert (basis.n_lr_paper, basis.n_lr_ritz) == (None, None)


def test_velocities_help_where_the_basis_limits():
    x, v, _ = paths()
    training = np.arange(0, 81, 8)
    found = enriched_pod(x, v, training, 8 * DENSE, modes=2 * len(training))
    plain = found.errors[list(found.weights).index(0.0)]
    assert found.weight > 0.0
    assert found.errors.min() < 0.8 * plain


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"training": range(81)}, "nothing lies between its snapshots"),
        ({"velocities": np.zeros((400, 80))}, r"shape \(400, 80\), positions have \(400, 81\)"),
        ({"positions": np.ones((400, 81)), "velocities": np.zeros((400, 81))}, "nothing moves"),
    ],
)
def test_what_cannot_be_enriched_is_refused(changed, words):
    x, v, _ = paths()
    arguments = {"positions": x, "velocities": v, "training": range(0, 81, 8), "interval": 8 * DENSE} | changed
    with pytest.raises(InputError, match=words):
        enriched_pod(**arguments)
