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


def rounding(basis, W, unseen, name, n, block_rows=None):
    """Return the rounding of the first n modes, and the coefficients on them."""
    c = basis.project(W)[unseen, :n]
    outside = np.square(W[:, unseen] - basis.reconstruct(c)).sum(axis=0)
    return roundings(basis, SnapshotMatrix(W, block_rows).columns(unseen), c, outside, [name]).get(name), c


@pytest.mark.parametrize("name", ["single", "half", "int16", "int8"])
@pytest.mark.parametrize("n", [3, 10])
def test_it_is_the_error_of_the_snapshots_put_together_from_rounded_modes(name, n):
    W, training, unseen = motion(25)
    basis = lanczos_pod(W[:, training], modes=len(training) - 1)
    found, c = rounding(basis, W, unseen, name, n, 37)
    # a prediction that misses, too
    predicted = c + 0.01 * np.random.default_rng(1).standard_normal((len(unseen), n))
    floor = np.square(W[:, unseen] - basis.reconstruct(c)).sum(axis=0)
    modes = np.hstack([kept(basis.modes[:, : found.leading], "int16"), kept(basis.modes[:, found.leading :], name)])
    whole = kept(basis.mean[:, None], "int16" if name == "int8" else name) + modes[:, :n] @ predicted.T
    direct = np.square(W[:, unseen] - whole).sum(axis=0)
    np.testing.assert_allclose(rounded_errors(found, floor, c, predicted), direct, rtol=1e-9)


@pytest.mark.parametrize(("name", "step"), [("half", 2.0**-11), ("int16", 1 / 32767)])
def test_a_motion_of_known_rank_errs_by_rounding_alone_and_by_its_size(name, step):
    W, training, unseen = motion(4)
    basis = lanczos_pod(W[:, training], modes=4)
    found, c = rounding(basis, W, unseen, name, 4)
    floor = np.square(W[:, unseen] - basis.reconstruct(c)).sum(axis=0)
    assert floor.max() < 1e-20 * np.square(W).sum()
    error = np.sqrt(rounded_errors(found, floor, c, c).mean() / len(W))
    # of a mode whose largest entry is R rms, an integer keeps R·step/√12; of a normal spread R is 3 to 4 here
    moved = np.sqrt(np.square(W[:, unseen] - basis.mean[:, None]).mean())
    assert 0.1 * step * moved < error < 2.0 * step * moved


def test_eight_bits_are_for_modes_that_can_bear_it_and_add_a_hundredth_of_the_squared_error_at_most():
    W, training, unseen = motion(25)
    basis = lanczos_pod(W[:, training], modes=10)
    found, c = rounding(basis, W, unseen, "int8", 10)
    assert 0 < found.leading < 10
    floor = np.square(W[:, unseen] - basis.reconstruct(c)).sum(axis=0)
    added = rounded_errors(found, floor, c, c).mean() / floor.mean() - 1.0
    assert abs(added) < 0.012  # and what 16 bits add, and inner products of rounding and rest that are not quite zero


def test_the_fewer_modes_the_fewer_of_them_need_more_than_eight_bits():
    W, training, unseen = motion(25)
    basis = lanczos_pod(W[:, training], modes=10)
    leading = [rounding(basis, W, unseen, "int8", n)[0].leading for n in (2, 5, 10)]
    assert leading == sorted(leading)
    assert leading[0] < leading[-1]


def test_where_modes_leave_nothing_none_is_kept_in_eight_bits():
    W, training, unseen = motion(4)
    basis = lanczos_pod(W[:, training], modes=4)
    assert rounding(basis, W, unseen, "int8", 4)[0].leading == 4


def test_in_double_there_is_nothing_to_add():
    W, training, unseen = motion(4)
    assert rounding(lanczos_pod(W[:, training], modes=4), W, unseen, "double", 4)[0] is None
