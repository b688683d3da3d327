"""Snapshots added to a known set give the basis that a decomposition from scratch gives."""

import numpy as np
import pytest

from pod import InputError, SnapshotMatrix, grown_gram, lanczos_pod


@pytest.fixture(scope="module")
def moving():
    return 7.0 + np.cumsum(np.random.default_rng(1).standard_normal((999, 60)), axis=1)


@pytest.mark.parametrize("known", [1, 30, 59, 60])
def test_a_basis_of_grown_inner_products_is_that_of_all(moving, known):
    matrix = SnapshotMatrix(moving, 200)
    gram = grown_gram(matrix, matrix.columns(range(known)).gram())
    whole = matrix.gram()
    assert np.abs(gram - whole).max() <= 1e-13 * np.abs(whole).max()
    assert np.array_equal(gram, gram.T)
    grown, scratch = lanczos_pod(matrix, modes=12, gram=gram), lanczos_pod(matrix, modes=12, route="gram")
    assert np.abs(grown.values - scratch.values).max() <= 1e-12 * scratch.values[0]
    assert np.abs(grown.modes - scratch.modes).max() <= 1e-10
    assert grown.route == "gram"


def test_one_snapshot_after_another(moving):
    matrix = SnapshotMatrix(moving)
    gram = matrix.columns([0, 1]).gram()
    for n in range(3, 61):
        gram = grown_gram(matrix.columns(range(n)), gram)
    assert np.abs(gram - matrix.gram()).max() <= 1e-13 * np.abs(gram).max()


def test_more_than_there_are_is_refused(moving):
    with pytest.raises(InputError, match=r"known: shape \(61, 61\); give the inner products of the first 1 to 60"):
        grown_gram(SnapshotMatrix(moving), np.zeros((61, 61)))
    with pytest.raises(InputError, match=r"gram: shape \(9, 9\); give the inner products of these 60 snapshots"):
        lanczos_pod(moving, modes=3, gram=np.zeros((9, 9)))


def test_a_new_snapshot_that_is_not_finite_is_refused(moving):
    spoilt = moving.copy()
    spoilt[500, 59] = np.nan
    with pytest.raises(InputError, match="row 500 of snapshot 59 is nan"):
        grown_gram(SnapshotMatrix(spoilt), SnapshotMatrix(moving[:, :40]).gram())


@pytest.mark.parametrize("known", [2, 40, 60])
def test_inner_products_of_other_snapshots_are_not_grown(moving, known):
    other = SnapshotMatrix(moving + 1e-6 * np.random.default_rng(2).standard_normal(moving.shape))
    with pytest.raises(InputError, match="inner products of other snapshots: snapshot 1 lies"):
        grown_gram(SnapshotMatrix(moving), other.columns(range(known)).gram())


def test_inner_products_with_unlike_weights_are_not_grown(moving):
    weighed = SnapshotMatrix(moving, weights=np.linspace(1.0, 2.0, 999))
    with pytest.raises(InputError, match="form them anew"):
        grown_gram(weighed, SnapshotMatrix(moving[:, :30]).gram())
