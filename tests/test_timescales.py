"""Own intervals and ranks against one interval for all: bytes, errors, and whether dx/dt agrees with v."""

import json

import numpy as np
import pytest

from selection.intervals import candidates
from suffice.alternatives import alternatives
from suffice.compare import compare
from suffice.condensed import condense, triangular_factor
from suffice.run import Run
from suffice.store import RunWriter
from suffice.timescales import ALIKE, BY_RULE, COSTS, DERIVED, FINEST, OWN, compare_timescales

DENSE, COUNT, BEADS = 0.001, 121, 40


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Write a run whose x is slow and whose y is fast, with some noise that no mode holds."""
    place, rng = tmp_path_factory.mktemp("run") / "run.h5", np.random.default_rng(4)
    t = DENSE * np.arange(COUNT)
    position, velocity = np.zeros((2, COUNT, BEADS, 3))
    for axis, band in enumerate((8.0, 80.0, 20.0)):
        pace, phase = 2 * np.pi * rng.uniform(0.1, 1.0, (8, 1)) * band, rng.uniform(0, 6, (8, 1))
        weight = rng.normal(size=(BEADS, 8)) * 1e-3
        position[..., axis] = (weight @ np.sin(pace * t + phase)).T
        velocity[..., axis] = (weight @ (pace * np.cos(pace * t + phase))).T
    position += 1e-6 * rng.normal(size=position.shape)
    particles = {"ids": np.arange(BEADS), "radius": np.full(BEADS, 5e-4), "species": np.zeros(BEADS, int)}
    with RunWriter(
        place, **particles, n_snapshots=COUNT, variables=("position", "velocity"), provenance={}, precision="double"
    ) as run:
        for k in range(COUNT):
            run.append(t[k], {"position": position[k], "velocity": velocity[k]})
    return place


@pytest.fixture(scope="module")
def answer(path):
    with Run(path) as run:
        return compare_timescales(run, intervals=[0.008, 0.004, 0.002])


def test_few_rows_have_the_inner_products_of_all():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 5000, 12)) * np.logspace(0, -7, 12)
    factor = triangular_factor([one + 1e3, other])
    whole = np.hstack([one - one[:, :1], other])
    assert factor.shape == (24, 24)
    np.testing.assert_allclose(factor.T @ factor, whole.T @ whole, rtol=1e-9, atol=1e-12)
    # smallest motion to full relative accuracy: orthogonal steps do not square the condition number
    last = np.linalg.norm(factor[:, 23])
    assert last == pytest.approx(np.linalg.norm(other[:, 11]), rel=1e-12)


@pytest.mark.parametrize("surrogate", ["hermite", "spline", "rbf"])
def test_errors_and_bytes_are_those_that_compare_measures_on_all_rows(path, surrogate):
    with Run(path) as run:
        found = compare(run, ["position.y"], [0.004, 0.002], [surrogate])
        table = alternatives(
            condense(run, "position.y"), run.times, candidates(run.times, [0.004, 0.002]), surrogate, 0.999
        )
    rows = [row for row in found["rows"] if (row["basis"], row["precision"]) == ("plain", "double")]
    assert len(rows) >= 4
    for row in rows:
        (i,) = np.flatnonzero((table.interval == row["interval"]) & (table.modes == row["modes"]))
        assert table.rmse[i] == pytest.approx(row["rmse"], rel=1e-6)
        assert table.model_bytes[i] == row["storage_bytes"]
    assert table.by_rule.sum() == 2


def test_velocity_errors_of_every_number_of_modes_are_those_of_the_derivative_itself(path):
    with Run(path) as run:
        table = alternatives(condense(run, "position.y"), run.times, candidates(run.times, [0.004]), "hermite", 0.999)
        x, v, times = run.variable("position.y")[:], run.variable("velocity.y")[:], run.times
    training = np.arange(0, 121, 4)
    unseen = np.setdiff1d(np.arange(121), training)
    mean = x[:, training].mean(axis=1, keepdims=True)
    modes = np.linalg.svd(x[:, training] - mean, full_matrices=False)[0]
    i = np.searchsorted(times[training], times[unseen], side="right") - 1
    s, h = (times[unseen] - times[training][i]) / 0.004, 0.004
    for n in (1, 5, 20):
        P = modes[:, :n]
        c, r = P.T @ (x[:, training] - mean), P.T @ v[:, training]
        slope = 6 * s * (1 - s) / h * (c[:, i + 1] - c[:, i]) + (1 - s) * (1 - 3 * s) * r[:, i]
        slope += s * (3 * s - 2) * r[:, i + 1]
        error = np.sqrt(np.square(P @ slope - v[:, unseen]).mean(axis=0)).mean()
        assert table.velocity_rmse[n - 1] == pytest.approx(error, rel=1e-6)


def row(level, way, **wanted):
    (found,) = (
        r for r in level["rows"] if r["strategy"] == way and all(r[key] == value for key, value in wanted.items())
    )
    return found


def test_own_intervals_never_take_more_than_one_and_own_ranks_no_more_than_the_rule(answer):
    for level in answer["levels"]:
        for cost in COSTS:
            for ending in ("", DERIVED):
                own, alike = row(level, OWN + ending, cost=cost), row(level, ALIKE + ending, cost=cost)
                finest = row(level, FINEST + ending, cost=cost)
                assert own[cost] <= alike[cost] <= finest[cost]
                assert own["kept"]
        assert row(level, ALIKE, cost=COSTS[0])[COSTS[0]] <= row(level, BY_RULE)[COSTS[0]]
        for found in level["rows"]:
            if found["cost"] is not None:
                assert all(found["errors"][q] <= limit * (1 + 1e-9) for q, limit in level["limits"].items())
            if ALIKE in found["strategy"]:
                assert len({part["interval"] for part in found["parts"].values()}) == 1


def test_at_equal_bytes_own_intervals_err_no_more_in_sum(answer):
    for level in answer["levels"]:
        sums = {}
        for found in level["rows"]:
            if found["equal_bytes"] is not None:
                assert found["model_bytes"] <= found["equal_bytes"]
                sums[found["strategy"]] = sum((found["errors"][q] / e) ** 2 for q, e in level["limits"].items())
        assert sums[OWN] <= sums[ALIKE] * (1 + 1e-9)
        assert sums[OWN + DERIVED] <= sums[ALIKE + DERIVED] * (1 + 1e-9)


def test_the_slow_direction_is_sampled_less_than_the_fast_one(answer):
    found = row(answer["levels"][-1], OWN + DERIVED, cost="snapshot_bytes")["parts"]
    assert found["position.x"]["interval"] > found["position.y"]["interval"]
    alike = row(answer["levels"][-1], ALIKE + DERIVED, cost="snapshot_bytes")
    own = row(answer["levels"][-1], OWN + DERIVED, cost="snapshot_bytes")
    assert own["snapshot_bytes"] < 0.8 * alike["snapshot_bytes"]


def test_derived_velocities_agree_with_their_positions_and_own_ones_less(answer):
    for level in answer["levels"]:
        derived, own = (row(level, way, cost=COSTS[0])["contradiction"] for way in (OWN + DERIVED, OWN))
        assert derived < own


def test_the_contradiction_of_the_run_is_that_of_all_its_rows(path, answer):
    with Run(path) as run:
        x, v = run.variable("position")[:], run.variable("velocity")[:]
    left = (x[:, 2:] - x[:, :-2]) / (2 * DENSE) - v[:, 1:-1]
    direct = np.sqrt(np.square(left).mean(axis=0)).mean()
    assert answer["contradiction_of_truth"] == pytest.approx(direct, rel=1e-9)


def test_whole_vectors_are_variables_like_their_components(path):
    with Run(path) as run:
        found = compare_timescales(run, ["position", "velocity"], [0.004], None, ["1e-4m,0.2m/s"])
    assert found["surrogates"] == {"position": "hermite", "velocity": "spline"}
    assert row(found["levels"][0], OWN + DERIVED, cost=COSTS[0])["derived"].keys() == {"velocity"}


def test_the_command_prints_tables_and_writes_json(path, tmp_path, suffice):
    words = ("compare", path, "--task", "timescales", "--interval", "0.004,0.002", "--max-error", "0.05d,0.05m/s")
    told = suffice(*words)
    assert told.code == 0, told.err
    assert "own Δτ instead of the best one for all:" in told.out
    assert suffice(*words, "--json", tmp_path / "answer.json").code == 0
    (level,) = json.loads((tmp_path / "answer.json").read_text())["levels"]
    assert level["limits"] == {"position": pytest.approx(5e-5), "velocity": 0.05}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--max-error", "0.05d"), "velocity.x is in m/s and no limit is"),
        (("--surrogate", "lstm"), "is not known without training it"),
        (("--surrogate", "spline", "--surrogate", "rbf"), "takes one --surrogate"),
        (("--interval", "0.0015"), "multiple"),
        (("--interval", "0.001"), "leaves no snapshot to predict"),
    ],
)
def test_questions_without_an_answer_are_refused(path, suffice, options, says):
    told = suffice("compare", path, "--task", "timescales", *options)
    assert told.code == 2
    assert says in told.err
