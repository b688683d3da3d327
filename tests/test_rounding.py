"""What rounding of mean and modes adds to an error, from inner products, against the snapshots written out."""

import numpy as np
import pytest

from pod import SnapshotMatrix, lanczos_pod
from suffice.precision import extent_of, read_back
from suffice.rounding import rounded_errors, roundings


def motion(rank, rows=300, seed=0):
    """Snapshots (rows, 41) of a known rank about a mean far from zero, every fourth one for training."""
    rng = np.random.default_rng(seed)
    space, time = rng.standard_normal((rows, rank)), rng.standard_normal((rank, 41))
    W = 5.0 + space @ (time * 0.5 ** np.arange(rank)[:, None])
    training = np.arange(0, 41, 4)
    return W, training, np.setdiff1d(np.arange(41), training)


def kept(array, name):
    return read_back(array, name, extent_of([array]))


@pytest.mark.parametrize("name", ["single", "half", "int16", "int8"])
@pytest.mark.parametrize("n", [3, 10])
def test_it_is_the_error_of_the_snapshots_put_together_from_rounded_modes(name, n):
    W, training, unseen = motion(25)
    basis = lanczos_pod(W[:, training], modes=len(training) - 1)
    c = basis.project(W)[unseen]
    found = roundings(basis, SnapshotMatrix(W, 37).columns(unseen), c, [name])[name]
    # a prediction that misses, too
    predicted = c[:, :n] + 0.01 * np.random.default_rng(1).standard_normal((len(unseen), n))
    floor = np.square(W[:, unseen] - basis.reconstruct(c[:, :n])).sum(axis=0)
    whole = kept(basis.mean[:, None], name) + kept(basis.modes, name)[:, :n] @ predicted.T
    direct = np.square(W[:, unseen] - whole).sum(axis=0)
    np.testing.assert_allclose(rounded_errors(found, floor, c, predicted), direct, rtol=1e-9)


@pytest.mark.parametrize(("name", "step"), [("half", 2.0**-11), ("int16", 1 / 32767), ("int8", 1 / 127)])
def test_a_motion_of_known_rank_errs_by_rounding_alone_and_by_its_size(name, step):
    W, training, unseen = motion(4)
    basis = lanczos_pod(W[:, training], modes=4)
    c = basis.project(W)[unseen]
    found = roundings(basis, SnapshotMatrix(W).columns(unseen), c, [name])[name]
    floor = np.square(W[:, unseen] - basis.reconstruct(c)).sum(axis=0)
    assert floor.max() < 1e-20 * np.square(W).sum()
    error = np.sqrt(rounded_errors(found, floor, c, c).mean() / len(W))
    # of a mode whose largest entry is R rms, an integer keeps R·step/√12; of a normal spread R is 3 to 4 here
    moved = np.sqrt(np.square(W[:, unseen] - basis.mean[:, None]).mean())
    assert 0.1 * step * moved < error < 2.0 * step * moved


def test_in_double_there_is_nothing_to_add():
    W, training, unseen = motion(4)
    basis = lanczos_pod(W[:, training], modes=4)
    assert roundings(basis, SnapshotMatrix(W).columns(unseen), basis.project(W)[unseen], ["double"]) == {}
