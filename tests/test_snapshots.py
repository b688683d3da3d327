"""The snapshot matrix is read by blocks and says the same whatever the blocks."""

import numpy as np
import pytest
import torch

from pod import InputError, SnapshotMatrix


@pytest.fixture
def moving() -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.cumsum(rng.standard_normal((999, 40)), axis=1) + 50 * rng.standard_normal((999, 1))


class OnlySlices:
    """A source as the store offers it: a shape and slices of rows, single precision."""

    def __init__(self, values: np.ndarray) -> None:
        self._values, self.shape, self.rows_per_particle = values.astype(np.float32), values.shape, 3
        self.largest = 0

    def __getitem__(self, rows: slice) -> np.ndarray:
        self.largest = max(self.largest, rows.stop - rows.start)
        return self._values[rows]


@pytest.mark.parametrize("block_rows", [1, 7, 256, 5000])
def test_inner_products_do_not_depend_on_the_size_of_a_block(moving, block_rows):
    whole = SnapshotMatrix(moving).gram()
    largest = np.linalg.eigvalsh(whole)[-1]
    assert np.abs(SnapshotMatrix(moving, block_rows).gram() - whole).max() <= 1e-12 * largest


def test_only_a_block_of_rows_is_ever_read(moving):
    source = OnlySlices(moving)
    matrix = SnapshotMatrix(source, block_rows=100)
    assert sum(len(block) for block in matrix.row_blocks()) == 999
    assert source.largest == 100


def test_the_groups_of_particles_add_up_to_the_whole(moving):
    matrix = SnapshotMatrix(OnlySlices(moving), block_rows=50)
    groups = matrix.gram_groups(4)
    assert np.abs(groups.sum(axis=0) - matrix.gram()).max() <= 1e-14 * np.abs(matrix.gram()).max()
    # particles 0, 4, 8, … of three rows each
    rows = moving.astype(np.float32).astype(float).reshape(-1, 3, 40)[::4].reshape(-1, 40)
    expected = SnapshotMatrix(rows).gram()
    assert np.abs(groups[0] - expected).max() <= 1e-14 * np.abs(expected).max()


def test_a_view_of_some_snapshots_is_those_snapshots(moving):
    view = SnapshotMatrix(moving).columns([3, 9, 30])
    assert view.shape == (999, 3)
    assert np.array_equal(np.concatenate(list(view.row_blocks())), moving[:, [3, 9, 30]])
    assert np.array_equal(view.columns([2, 0]).gram(), SnapshotMatrix(moving[:, [30, 3]]).gram())


def test_a_torch_tensor_is_as_good_as_an_array(moving):
    assert np.array_equal(SnapshotMatrix(torch.from_numpy(moving)).gram(), SnapshotMatrix(moving).gram())


def test_the_product_is_that_of_the_centred_snapshots(moving):
    centred = moving - moving.mean(axis=1, keepdims=True)
    v = np.random.default_rng(2).standard_normal((40, 3))
    product = SnapshotMatrix(moving, 64, device="cpu").centred_product(torch.from_numpy(v)).numpy()
    expected = centred.T @ (centred @ v)
    assert np.abs(product - expected).max() <= 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_refused_by_row_and_snapshot(moving, value):
    moving[777, 12] = value
    with pytest.raises(InputError, match=r"row 777 of snapshot 12 is (nan|inf)"):
        SnapshotMatrix(moving, 100).gram()


@pytest.mark.parametrize("shape", [(5,), (0, 3), (3, 0), (2, 2, 2)])
def test_what_is_no_matrix_is_refused(shape):
    with pytest.raises(InputError, match="give a matrix"):
        SnapshotMatrix(np.zeros(shape))


def test_a_block_of_no_rows_is_refused(moving):
    with pytest.raises(InputError, match="block_rows"):
        SnapshotMatrix(moving, 0)
    with pytest.raises(InputError, match="groups"):
        SnapshotMatrix(moving).gram_groups(0)


def test_a_view_of_no_snapshot_has_rows_and_no_columns(moving):
    view = SnapshotMatrix(moving, 100).columns([])
    assert [block.shape[1] for block in view.row_blocks()] == [0] * len(range(0, 999, 100))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (np.arange(40) % 2 == 0, r"bool values; .*np\.flatnonzero\(mask\)"),
        ([0.0, 2.5], "float64 values"),
        ([0, 40], "beyond 0 to 39"),
    ],
)
def test_a_mask_and_numbers_beyond_the_last_snapshot_are_no_columns(moving, columns, words):
    with pytest.raises(InputError, match=words):
        SnapshotMatrix(moving, columns=columns)
    with pytest.raises(InputError, match=words):
        SnapshotMatrix(moving).columns(columns)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [(lambda W: W + 1j, "complex values"), (lambda W: np.ma.masked_greater(W, 60.0), "some values are masked")],
)
def test_imaginary_parts_and_masks_are_not_lost_silently(moving, spoil, words):
    with pytest.raises(InputError, match=words):
        SnapshotMatrix(spoil(moving)).gram()
    with pytest.raises(InputError, match=words):
        list(SnapshotMatrix(spoil(moving)).row_blocks())


def test_a_list_of_lists_is_named_as_what_it_is(moving):
    with pytest.raises(InputError, match=r"list of shape \(\); give a matrix"):
        SnapshotMatrix(moving.tolist())
