"""Modes of positions and velocities in the comparison: what they hold, what they cost, who is compared on them."""

import numpy as np
import pytest

from suffice.compare import compare
from suffice.enriching import reduce_enriched
from suffice.reconstruction import Case
from suffice.run import Run
from suffice.store import RunWriter

N = 40


@pytest.fixture(scope="module")
def wavy(tmp_path_factory):
    """Beads that move as sums of waves, 42 snapshots in double precision, one every millisecond."""
    rng, path = np.random.default_rng(0), tmp_path_factory.mktemp("wavy") / "wavy.h5"
    frequency, phase = rng.uniform(50, 900, (8, N, 3)), rng.uniform(0, 6, (8, N, 3))
    about = {"ids": np.arange(N), "radius": np.full(N, 1e-3), "species": np.ones(N, int), "n_snapshots": 42}
    with RunWriter(path, variables=("position", "velocity"), precision="double", provenance={}, **about) as run:
        for t in 1e-3 * np.arange(42):
            angle = frequency * t + phase
            velocity = 1e-3 * (frequency * np.cos(angle)).sum(axis=0)
            run.append(t, {"position": 1e-3 * np.sin(angle).sum(axis=0), "velocity": velocity})
    with Run(path) as run:
        yield run


def row(answer, surrogate):
    """Return the row of this surrogate on all modes of positions, or on none."""
    rows = [r for r in answer["rows"] if (r["surrogate"], r["precision"]) == (surrogate, "double")]
    return [r for r in rows if r["basis"] != "enriched"][-1]


def enriched(answer, surrogate):
    """Return the rows of a surrogate on modes of both, by their number."""
    rows = [
        r for r in answer["rows"] if (r["surrogate"], r["basis"], r["precision"]) == (surrogate, "enriched", "double")
    ]
    return {r["modes"]: r for r in rows}


def test_on_all_modes_of_both_hermite_is_hermite_on_the_snapshots_themselves(wavy):
    answer = compare(wavy, ["position.x"], [0.008], ["hermite", "raw-hermite"])
    on_modes, m = enriched(answer, "hermite"), 6
    assert max(on_modes) == 2 * m - 1
    raw = row(answer, "raw-hermite")
    assert on_modes[2 * m - 1]["rmse"] == pytest.approx(raw["rmse"], rel=1e-9)
    assert on_modes[2 * m - 1]["worst_rmse"] == pytest.approx(raw["worst_rmse"], rel=1e-9)
    # and takes more: as many modes as there are snapshots and velocities but one, the mean, and coefficients
    assert on_modes[2 * m - 1]["storage_bytes"] > raw["storage_bytes"]


def test_its_floor_lies_below_that_of_as_many_modes_of_positions_or_of_all_of_them(wavy):
    answer = compare(wavy, ["position.x"], [0.008], ["hermite"])
    on_modes, plain = enriched(answer, "hermite"), row(answer, "hermite")
    assert on_modes[11]["projection_rmse"] < plain["projection_rmse"]
    assert on_modes[11]["ratio_to_floor"] >= 1.0


def test_a_surrogate_that_knows_no_rates_is_compared_on_as_many_modes_as_positions_have_and_on_no_more(wavy):
    answer = compare(wavy, ["position.x"], [0.008], ["spline", "hermite"])
    assert list(enriched(answer, "spline")) == [5]
    assert {5, 11} <= set(enriched(answer, "hermite"))


def test_storage_counts_modes_mean_coefficients_rates_and_times(wavy):
    answer = compare(wavy, ["position.x"], [0.008], ["hermite"])
    rows, m, n = 40, 6, 11
    assert enriched(answer, "hermite")[n]["storage_bytes"] == 8 * (rows * (n + 1) + 2 * m * n + m + 3)


def test_the_least_modes_are_those_that_hold_the_energy_of_the_positions(wavy):
    W, V = wavy.variable("position.x")[:], wavy.variable("velocity.x")[:]
    training = np.arange(0, 42, 4)
    case = Case(W, V, wavy.times, training, np.setdiff1d(np.arange(41), training))
    reduced = reduce_enriched(case, 0.9)
    apart = W[:, training] - W[:, training].mean(axis=1, keepdims=True)
    held = [np.square(reduced.basis.modes[:, :n].T @ apart).sum() / np.square(apart).sum() for n in range(22)]
    assert reduced.basis.n_lr == next(n for n, share in enumerate(held) if share >= 0.9)


def test_no_unseen_snapshot_takes_part_in_the_modes(wavy):
    W, V = wavy.variable("position.x")[:], wavy.variable("velocity.x")[:]
    training = np.arange(0, 42, 4)
    unseen = np.setdiff1d(np.arange(41), training)
    other = W.copy()
    other[:, unseen] += 1.0
    one, two = (reduce_enriched(Case(x, V, wavy.times, training, unseen), 0.999).basis for x in (W, other))
    np.testing.assert_allclose(one.modes, two.modes, atol=1e-10)


def test_velocities_have_no_such_basis_and_neither_do_networks(wavy):
    assert {r["basis"] for r in compare(wavy, ["velocity.x"], [0.004], ["spline"])["rows"]} == {"plain"}
    answer = compare(wavy, ["position.x"], [0.004], ["lstm"], training_seconds=1.0)
    assert {base["basis"] for base in answer["bases"]} == {"plain"}
