"""One pass over each stored quantity gives the inner products of its components and of the vector as a whole."""

import json
import lzma
from math import ceil

import numpy as np
import pytest
from numpy.testing import assert_allclose

import pod.snapshots
import suffice.products
from selection import ArraySnapshots, least_reconstructable_mode
from suffice.products import read_products
from suffice.rows import Variable
from suffice.run import Run
from suffice.selecting import select_json, select_run
from suffice.store import RunWriter

WHOLE_AND_PARTS = ("position.x", "velocity.z", "position", "position.z", "velocity")


@pytest.fixture
def run(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5", n=60, interval=0.02)) as opened:
        yield opened


@pytest.fixture
def rows_read(monkeypatch):
    """Count how often each row of a variable is read."""
    counted = {}
    read = Variable.__getitem__

    def counting(self, rows):
        start, stop, _ = rows.indices(self.shape[0])
        counted.setdefault(self._dataset.name, np.zeros(self.shape[0], int))[start:stop] += 1
        return read(self, rows)

    monkeypatch.setattr(Variable, "__getitem__", counting)
    return counted


def in_full(run, name):
    rows = run.variable(name)
    return np.asarray(rows[0 : rows.shape[0]], float)


def test_components_and_the_whole_are_those_of_the_rows(run):
    found = {name: products for name, products, _ in read_products(run, WHOLE_AND_PARTS)}
    assert set(found) == set(WHOLE_AND_PARTS)
    for name, products in found.items():
        together = 1 if "." in name else 3
        direct = ArraySnapshots(in_full(run, name), rows_per_particle=together)
        assert products.rows == direct.shape[0]
        assert_allclose(products.gram, direct.gram(), atol=1e-12 * products.gram.max())
        assert_allclose(products.groups, direct.gram_groups(10), atol=1e-12 * products.gram.max())


def test_each_row_is_read_once_whatever_is_asked_of_it(run, rows_read):
    select_run(run, WHOLE_AND_PARTS)
    assert set(rows_read) == {"/particles/position", "/particles/velocity"}
    assert all((count == 1).all() for count in rows_read.values())


def test_a_component_that_does_not_move_is_not_read_again(tmp_path, rows_read):
    flat = np.random.default_rng(1).standard_normal((41, 30, 3))
    flat[:, :, 2] = 0.25
    about = {"ids": np.arange(30), "radius": np.full(30, 5e-4), "species": np.ones(30, int), "provenance": {}}
    with RunWriter(tmp_path / "flat.h5", **about, n_snapshots=41, variables=("position",)) as writer:
        for k, snapshot in enumerate(flat):
            writer.append(1e-3 * k, {"position": snapshot})
    with Run(tmp_path / "flat.h5") as run:
        found = select_run(run, ["position.x", "position.z", "position"])
    assert (rows_read["/particles/position"] == 1).all()
    assert found["position.z"].candidates[0].n_lr == 0
    assert found["position"].candidates[0].n_lr > 0


def test_what_does_not_fit_at_once_is_read_in_further_passes_to_the_same_end(run, rows_read, monkeypatch):
    whole = select_json(run, select_run(run, WHOLE_AND_PARTS))
    monkeypatch.setattr(suffice.products, "HELD_BYTES", 8 * 41**2 * 20)  # the sum and one component at a time
    rows_read.clear()
    parts = select_json(run, select_run(run, WHOLE_AND_PARTS))
    assert (rows_read["/particles/position"] == 3).all()
    for name, found in parts["variables"].items():
        for mine, theirs in zip(found["candidates"], whole["variables"][name]["candidates"], strict=True):
            assert mine["n_c"] == theirs["n_c"]
            assert (mine["K_f_interval"] is None) == (mine["n_snapshots"] < 10)
            if mine["K_f_interval"] is not None:
                assert mine["K_f_interval"] == pytest.approx(theirs["K_f_interval"], rel=1e-6)


def test_groups_that_do_not_fit_are_fewer_and_the_answer_says_how_many(run, monkeypatch):
    monkeypatch.setattr(suffice.products, "HELD_BYTES", 8 * 41**2 * 4)
    found = select_run(run, ["velocity.x", "velocity"])
    groups = {c.K_f_groups for sweep in found.values() for c in sweep.candidates if c.K_f_interval is not None}
    assert groups == {4}


@pytest.fixture(scope="module")
def shaken(reference, tmp_path_factory):
    """Return the foreign run as imported, in single and in double precision."""
    from suffice.readers import import_run

    folder = tmp_path_factory.mktemp("shaken")
    (folder / "shake.dump").write_bytes(lzma.decompress((reference / "shake.dump.xz").read_bytes()))
    for precision in ("single", "double"):
        import_run([folder / "shake.dump"], folder / f"{precision}.h5", interval=0.001, precision=precision)
    return folder


@pytest.mark.physics
@pytest.mark.parametrize(
    ("precision", "block_rows", "quantities"),
    [
        ("single", 1, ("position",)),
        ("single", 7, ("position", "velocity")),
        ("single", 100, ("position", "velocity")),
        ("double", 100, ("position", "velocity")),
        ("double", 10_000, ("position", "velocity")),
    ],
)
def test_every_integer_of_the_foreign_run_whatever_the_block(
    shaken, reference, monkeypatch, precision, block_rows, quantities
):
    monkeypatch.setattr(pod.snapshots, "BLOCK_VALUES", 301 * block_rows)
    expected = json.loads((reference / "shake.expected.json").read_text())
    names = [f"{quantity}.{axis}" for quantity in quantities for axis in "xyz"]
    with Run(shaken / f"{precision}.h5") as run:
        found = select_run(run, [*names, *quantities])
    for name in names:
        assert len(found[name].candidates) == len(expected[name]) == 9
        for candidate in found[name].candidates:
            for field, value in expected[name][str(round(candidate.interval * 1e3))].items():
                assert getattr(candidate, field) == value, (name, candidate.interval, field)


@pytest.mark.physics
@pytest.mark.parametrize("name", ["position", "velocity"])
def test_a_vector_as_a_whole_is_judged_as_an_svd_of_its_rows_does(shaken, name):
    with Run(shaken / "single.h5") as run:
        W = in_full(run, name)
        candidates = select_run(run, [f"{name}.x", name], [0.008, 0.003])[name].candidates
    for candidate in candidates:
        training = np.arange(0, 301, round(candidate.interval * 1e3))
        D = W[:, : training[-1] + 1] - W[:, training].mean(axis=1, keepdims=True)
        U, sigma, _ = np.linalg.svd(D[:, training], full_matrices=False)
        c = U.T @ D
        left = np.vstack([np.square(c)[::-1].cumsum(axis=0)[::-1], np.zeros(c.shape[1])])
        error = np.sqrt((left + np.square(D - U @ c).sum(axis=0)) / len(W))
        ratio = error[:-2].mean(axis=1) / error[:-2, training].mean(axis=1)
        n_c = int(np.argmax(ratio[1:] > 1.05))
        assert candidate.n_c == n_c
        assert candidate.n_lr == least_reconstructable_mode(sigma**2, 0.999)
        assert candidate.n_lr_paper == least_reconstructable_mode(sigma**2, 0.999, ceil(0.8 * len(training)))
        unseen = np.setdiff1d(np.arange(D.shape[1]), training)
        assert candidate.error_n_c == pytest.approx(error[n_c, unseen].mean(), rel=1e-9)
        assert_allclose(candidate.curves.R_c, ratio[: len(candidate.curves.R_c)], rtol=1e-8)
