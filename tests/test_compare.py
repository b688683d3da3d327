"""Error and cost of every surrogate between the snapshots, against closed forms and a dense recomputation."""

import json
import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from suffice import baselines, variables
from suffice.choice import parse_bytes
from suffice.compare import compare
from suffice.making import is_trained
from suffice.precision import PRECISIONS, extent_of, read_back
from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.selecting import select_run
from suffice.store import RunWriter
from surrogates import SURROGATES

KNOWN = [name for name, member in SURROGATES.items() if member.bridges]
IN_TIME = [name for name in KNOWN if not is_trained(name)]

N, INTERVAL, DIAMETER = 40, 0.001, 2e-3


def write(path, positions, velocities=None, radius=DIAMETER / 2):
    """Store (snapshots, n, 3) positions in double precision, one every millisecond."""
    n = positions.shape[1]
    variables = ("position",) if velocities is None else ("position", "velocity")
    with RunWriter(
        path,
        ids=np.arange(n),
        radius=np.full(n, radius),
        species=np.ones(n, int),
        n_snapshots=len(positions),
        variables=variables,
        precision="double",
        provenance={},
    ) as run:
        for k, position in enumerate(positions):
            values = {"position": position}
            if velocities is not None:
                values["velocity"] = velocities[k]
            run.append(k * INTERVAL, values)
    return path


def polynomial_motion(snapshots, degree, seed=0):
    """Make every coordinate its own polynomial in time, so that interpolation errors are known: x, v, coefficients."""
    t = np.arange(snapshots) * INTERVAL
    a = np.random.default_rng(seed).standard_normal((degree + 1, N, 3))
    position = sum(a[k] * t[:, None, None] ** k for k in range(degree + 1))
    velocity = sum(k * a[k] * t[:, None, None] ** (k - 1) for k in range(1, degree + 1))
    return position, velocity, a


def wavy_motion(snapshots, seed=0):
    """Sums of waves fast enough that neither modes nor splines are exact."""
    rng = np.random.default_rng(seed)
    t = np.arange(snapshots) * INTERVAL
    frequency, phase = rng.uniform(50, 900, (8, N, 3)), rng.uniform(0, 6, (8, N, 3))
    angle = frequency * t[:, None, None, None] + phase
    return 1e-3 * np.sin(angle).sum(axis=1), 1e-3 * (frequency * np.cos(angle)).sum(axis=1)


@pytest.fixture(scope="module")
def wavy(tmp_path_factory):
    with Run(write(tmp_path_factory.mktemp("wavy") / "wavy.h5", *wavy_motion(42))) as run:
        yield run


def row(answer, surrogate, modes="all", variable="position.x", basis="plain", precision="double"):
    """Return the one row of this surrogate: without modes, or with n_lr or all of them."""
    rows = [r for r in answer["rows"] if r["surrogate"] == surrogate and r["variable"] == variable]
    rows = [r for r in rows if r["precision"] == precision and r["basis"] in (basis, None)]
    return rows[0 if modes == "n_lr" else -1]


def test_the_spline_on_modes_errs_as_a_dense_recomputation_says(wavy):
    answer = compare(wavy, ["position.x"], [0.004], ["spline"], energy=0.9)
    W = wavy.variable("position.x")[:]
    training = np.arange(0, 42, 4)
    unseen = np.setdiff1d(np.arange(41), training)  # 41 ms lies beyond the last training snapshot, at 40 ms
    mean = W[:, training].mean(axis=1, keepdims=True)
    u, s, _ = np.linalg.svd(W[:, training] - mean, full_matrices=False)
    n_lr = int(np.argmax(np.cumsum(s**2) >= 0.9 * (s**2).sum())) + 1
    assert n_lr < 10
    for n, modes in ((n_lr, "n_lr"), (10, "all")):
        c = u[:, :n].T @ (W - mean)
        predicted = mean + u[:, :n] @ CubicSpline(wavy.times[training], c[:, training], axis=1)(wavy.times[unseen])
        errors = np.sqrt(((predicted - W[:, unseen]) ** 2).mean(axis=0))
        floor = np.sqrt(((mean + u[:, :n] @ c[:, unseen] - W[:, unseen]) ** 2).mean(axis=0)).mean()
        found = row(answer, "spline", modes)
        assert found["modes"] == n
        # both are double precision; the projection is 0.1 to 1 of the motion, so nothing cancels
        assert found["rmse"] == pytest.approx(errors.mean(), rel=1e-10)
        assert found["worst_rmse"] == pytest.approx(errors.max(), rel=1e-10)
        assert found["worst_time"] == wavy.times[unseen[errors.argmax()]]
        assert found["projection_rmse"] == pytest.approx(floor, rel=1e-10)


def test_consistent_modes_between_the_least_and_all_are_a_level_of_their_own(tmp_path):
    rng = np.random.default_rng(2)
    times, k = 0.001 * np.arange(121), np.arange(1, 31)
    size = np.exp(-k / 3.0)
    phase = 2 * np.pi * (2.0 * k * times[:, None, None] + rng.uniform(size=(40, 30)))
    position = np.repeat((size * np.sin(phase)).sum(axis=-1)[:, :, None], 3, axis=2)
    with Run(write(tmp_path / "run.h5", position, np.zeros_like(position))) as run:
        answer = compare(run, ["position.x"], [0.005], ["spline"])
        (judged,) = select_run(run, ["position.x"], [0.005])["position.x"].candidates
    base = next(b for b in answer["bases"] if b["basis"] == "plain")
    assert base["n_lr"] == judged.n_lr < base["n_c"] == judged.n_c < base["modes"]
    plain = [r["modes"] for r in answer["rows"] if (r["basis"], r["precision"]) == ("plain", "double")]
    assert plain == [base["n_lr"], base["n_c"], base["modes"]]


def test_several_seeds_of_a_network_are_averaged_and_shown(wavy):
    answer = compare(wavy, ["position.x"], [0.004], ["lstm"], seeds=2, training_seconds=5.0)
    for found in answer["rows"]:
        assert len(found["seeds"]) == 2
        assert found["rmse"] == pytest.approx(np.mean(found["seeds"]))
        assert found["remark"]
    with pytest.raises(Refusal, match="seeds is 0"):
        compare(wavy, ["position.x"], [0.004], ["lstm"], seeds=0)


def test_no_surrogate_of_modes_beats_the_projection_on_them(wavy):
    answer = compare(wavy, ["position.x", "velocity.y"], [0.005, 0.002])
    on_modes = [r for r in answer["rows"] if r["modes"] is not None]
    assert {r["surrogate"] for r in on_modes} == {name for name in IN_TIME if not SURROGATES[name].raw}
    assert all(r["ratio_to_floor"] >= 1 - 1e-12 for r in on_modes if r["precision"] == "double")


def test_hermite_on_stored_velocities_is_exact_for_cubic_motion_with_modes_and_without(tmp_path):
    position, velocity, _ = polynomial_motion(31, 3)
    with Run(write(tmp_path / "run.h5", position, velocity)) as run:
        answer = compare(run, ["position.x"], [0.005], ["hermite", "raw-hermite"])
    # positions are of order 1 m: a few hundred roundings
    assert row(answer, "raw-hermite")["rmse"] < 1e-13
    assert row(answer, "hermite")["rmse"] < 1e-13


def test_straight_lines_miss_a_parabola_by_its_sagitta(tmp_path):
    position, velocity, a = polynomial_motion(31, 2)
    with Run(write(tmp_path / "run.h5", position, velocity)) as run:
        answer = compare(run, ["position.z"], [0.002], ["raw-linear"])
    # half way between snapshots Δτ apart a t² lies a Δτ²/4 below its chord; positions of 1 m are rounded at 1e-16 m
    sagitta = np.sqrt((a[2, :, 2] ** 2).mean()) * 0.002**2 / 4
    assert row(answer, "raw-linear", variable="position.z")["rmse"] == pytest.approx(sagitta, rel=1e-9)


def test_storage_is_the_modes_the_mean_and_the_series_or_the_snapshots_themselves(wavy):
    answer = compare(wavy, ["position.x"], [0.004])
    m, n, extra = 11, 10, 8 * (11 + 2 + 1)  # a model also keeps its m times, its window and its interval
    assert row(answer, "raw-linear")["storage_bytes"] == 8 * (m * N + m)
    assert row(answer, "raw-hermite")["storage_bytes"] == 8 * (2 * m * N + m)
    assert row(answer, "spline")["storage_bytes"] == 8 * (N * (n + 1) + m * n) + extra
    assert row(answer, "hermite")["storage_bytes"] == 8 * (N * (n + 1) + 2 * m * n) + extra


def test_errors_of_positions_are_also_in_diameters_and_those_of_velocities_are_not(wavy):
    answer = compare(wavy, ["position.x", "velocity.x"], [0.004], ["spline"])
    assert answer["diameter"] == pytest.approx(DIAMETER)
    assert row(answer, "spline")["rmse_diameters"] == pytest.approx(row(answer, "spline")["rmse"] / DIAMETER)
    assert row(answer, "spline", variable="velocity.x")["rmse_diameters"] is None


def test_a_run_without_radii_has_errors_in_metres_only(tmp_path):
    with Run(write(tmp_path / "run.h5", *wavy_motion(21), radius=math.nan)) as run:
        answer = compare(run, ["position.x"], [0.002], ["linear"])
        assert answer["diameter"] is None
        assert row(answer, "linear")["rmse_diameters"] is None
        with pytest.raises(Refusal, match="does not know its particle diameters"):
            compare(run, ["position.x"], [0.002], ["linear"], max_error=0.05, error_unit="d")


def test_what_cannot_be_compared_is_left_out_with_its_reason(tmp_path):
    position, velocity = wavy_motion(21)
    position[:, :, 2] = 0.01
    with Run(write(tmp_path / "run.h5", position, velocity)) as run:
        answer = compare(run, ["velocity.x", "position.z"], [0.002])
    left = {(o["variable"], o["surrogate"]): o["reason"] for o in answer["left_out"]}
    assert "needs the derivative of velocity.x" in left["velocity.x", "hermite"]
    assert "needs the derivative of velocity.x" in left["velocity.x", "raw-hermite"]
    assert "nothing moves" in left["position.z", None]
    assert {r["surrogate"] for r in answer["rows"]} == {n for n in IN_TIME if not SURROGATES[n].needs_rates}


def test_reading_the_run_in_small_blocks_changes_no_error(wavy, monkeypatch):
    held = compare(wavy, ["position.x"], [0.005, 0.003])
    monkeypatch.setattr(variables, "HELD_BYTES", 0)
    monkeypatch.setattr(baselines, "BLOCK_VALUES", 7 * 42)  # 7 of the 40 rows
    streamed = compare(wavy, ["position.x"], [0.005, 0.003])
    for one, other in zip(held["rows"], streamed["rows"], strict=True):
        assert (one["surrogate"], one["modes"]) == (other["surrogate"], other["modes"])
        assert one["rmse"] == pytest.approx(other["rmse"], rel=1e-12)
        assert one["storage_bytes"] == other["storage_bytes"]


def test_the_answer_is_plain_json_and_says_what_was_asked(wavy):
    seen = []
    answer = compare(wavy, progress=lambda done, total: seen.append((done, total)))
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    assert (answer["task"], answer["kind"]) == ("between", "time")
    assert {r["interval"] for r in answer["rows"]} == {k / 1000 for k in range(2, 11)}
    assert {r["variable"] for r in answer["rows"]} == {f"{v}.{a}" for v in ("position", "velocity") for a in "xyz"}
    assert seen == [(k, 54) for k in range(55)]
    assert all(r[key] > 0 for r in answer["rows"] for key in ("single_seconds", "batch_seconds", "storage_bytes"))


def test_the_front_of_each_variable_holds_its_most_accurate_and_its_cheapest_row(wavy):
    answer = compare(wavy, ["position.x", "velocity.x"], [0.005, 0.002])
    for variable in ("position.x", "velocity.x"):
        rows = [r for r in answer["rows"] if r["variable"] == variable]
        for cost in ("single_seconds", "storage_bytes"):
            assert min(rows, key=lambda r, cost=cost: (r["rmse"], r[cost]))["on_front"][cost]
            assert min(rows, key=lambda r, cost=cost: (r[cost], r["rmse"]))["on_front"][cost]


def test_with_a_limit_the_cheapest_row_that_keeps_it_is_chosen(wavy):
    answer = compare(wavy, ["position.x"], [0.004, 0.002], max_error=0.2, error_unit="d")
    kept = [r for r in answer["rows"] if r["rmse"] <= 0.2 * DIAMETER]
    choice = answer["choice"]["position.x"]
    assert 0 < len(kept) < len(answer["rows"])
    assert choice["kept"]
    as_fast = [r for r in kept if r["single_seconds"] <= 1.5 * min(r["single_seconds"] for r in kept)]
    assert choice["fastest"]["storage_bytes"] == min(r["storage_bytes"] for r in as_fast)
    assert choice["smallest"]["storage_bytes"] == min(r["storage_bytes"] for r in kept)
    as_true = [r for r in kept if r["rmse"] <= 1.01 * min(r["rmse"] for r in kept)]
    assert choice["most_accurate"]["storage_bytes"] == min(r["storage_bytes"] for r in as_true)
    assert "an error of at most 0.0004 m (0.2 d) is kept fastest by" in choice["sentence"]


def test_where_none_keeps_the_limit_the_sentence_says_so_and_names_the_closest(wavy):
    choice = compare(wavy, ["position.x"], [0.004, 0.002], max_error=1e-9)["choice"]["position.x"]
    assert not choice["kept"]
    assert choice["fastest"] is None
    assert "none keeps an error of at most 1e-09 m; the closest is" in choice["sentence"]
    assert choice["closest"]["interval"] == 0.002


def test_a_limit_in_seconds_names_the_most_accurate_within_it(wavy):
    answer = compare(wavy, ["velocity.x"], [0.004, 0.002], max_seconds=10.0)
    choice = answer["choice"]["velocity.x"]
    assert choice["most_accurate"]["rmse"] <= 1.01 * min(r["rmse"] for r in answer["rows"])
    assert "within at most 10 s per snapshot the most accurate is" in choice["sentence"]


def test_a_limit_in_metres_is_not_applied_to_a_velocity(wavy):
    answer = compare(wavy, ["position.x", "velocity.x"], [0.004], max_error=1e-4)
    assert "does not apply to m/s" in answer["choice"]["velocity.x"]["sentence"]


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"surrogates": ["spline", "magic"]}, f"surrogate 'magic' is not known here; use {', '.join(KNOWN)}"),
        ({"surrogates": []}, "none is named"),
        ({"variables": ["position.w"]}, "no variable 'position.w'; it has position.x"),
        ({"intervals": [0.0015]}, "interval: 0.0015 s is not a multiple of the dense interval 0.001 s"),
        ({"intervals": [0.001]}, "leaves no snapshot to predict; take at least 0.002 s"),
        ({"intervals": [0.05]}, "longer than the run"),
        ({"max_error": -1.0}, "max_error is -1 m; it must be a positive number"),
        ({"energy": 1.5}, "energy is 1.5; it must be a share above 0"),
        ({"max_seconds": math.nan}, "max_seconds is nan s"),
        ({"max_bytes": 0.0}, "max_bytes is 0 B; it must be a positive number"),
        ({"precisions": ["quarter"]}, "precision 'quarter'"),
        ({"variables": ["velocity.x"], "max_error": 0.1}, "the variables are in m/s; give the limit in one of these"),
        ({"max_error": 0.1, "error_unit": "mm"}, "the limit in one of these, or compare a variable in mm"),
    ],
)
def test_what_cannot_be_asked_is_refused_with_the_remedy(wavy, asked, says):
    with pytest.raises(Refusal, match=says.replace("(", r"\(")):
        compare(wavy, **asked)


def test_a_run_of_one_snapshot_is_refused(tmp_path):
    with Run(write(tmp_path / "one.h5", *wavy_motion(1))) as run, pytest.raises(Refusal, match="needs at least 2"):
        compare(run)


def test_a_run_of_two_snapshots_leaves_nothing_to_predict(tmp_path):
    with Run(write(tmp_path / "two.h5", *wavy_motion(2))) as run, pytest.raises(Refusal, match="run is too short"):
        compare(run)


@pytest.mark.physics
def test_between_snapshots_of_a_shaken_bed_stored_velocities_beat_every_reduced_model_of_positions(reference, tmp_path):
    import_run(reference / "shake.dump.xz", tmp_path / "shake.h5", interval=INTERVAL)
    with Run(tmp_path / "shake.h5") as run:
        answer = compare(run, ["position.x", "position.z"], [0.005, 0.003])
    for variable in ("position.x", "position.z"):
        for interval in (0.005, 0.003):
            rows = [r for r in answer["rows"] if (r["variable"], r["interval"]) == (variable, interval)]
            # on all modes of both Hermite is the same, but for rounding, and takes more
            rows = [r for r in rows if r["basis"] != "enriched"]
            assert min(rows, key=lambda r: r["rmse"])["surrogate"] == "raw-hermite"
            # what the models buy is storage: with n_lr modes less than the snapshots and velocities take
            assert min(rows, key=lambda r: r["storage_bytes"])["modes"] is not None


def test_every_row_names_its_interval_snapshots_modes_surrogate_basis_and_precision_with_errors_and_costs(wavy):
    answer = compare(wavy, ["position.x"], [0.004], max_error=1.0)
    axes = ("interval", "n_snapshots", "modes", "surrogate", "basis", "precision")
    figures = ("rmse", "rmse_diameters", "storage_bytes", "single_seconds", "batch_seconds", "fit_seconds")
    assert all(set(axes + figures) <= set(r) for r in answer["rows"])
    places = [tuple(r[axis] for axis in axes) for r in answer["rows"]]
    assert len(places) == len(set(places))
    assert {r["basis"] for r in answer["rows"]} == {"plain", "enriched", None}
    assert {r["precision"] for r in answer["rows"]} == {"double", "int16", "int8"}
    assert set(axes) <= set(answer["choice"]["position.x"]["smallest"])
    assert answer["limits"]["max_bytes"] is None


def test_fewer_bits_err_more_and_take_less_whatever_is_kept(wavy):
    answer = compare(wavy, ["position.x"], [0.004], precisions=["single", "half", "int16", "int8"])
    ways = {}
    for r in answer["rows"]:
        ways.setdefault((r["surrogate"], r["basis"], r["modes"]), {})[r["precision"]] = r
    for by in ways.values():
        sizes = [by[name]["storage_bytes"] for name in ("double", "single", "half", "int8")]
        assert sizes == sorted(sizes, reverse=True)
        assert by["half"]["storage_bytes"] == by["int16"]["storage_bytes"]
        # what rounding adds is independent of the error, all but: 2^-24, 2^-11 and half of 1/32767 of a motion that
        # errs by a hundredth of itself at least
        assert by["single"]["rmse"] == pytest.approx(by["double"]["rmse"], rel=1e-4)
        assert by["int16"]["rmse"] == pytest.approx(by["double"]["rmse"], rel=1e-3)
        assert by["int8"]["rmse"] > 0.99 * by["double"]["rmse"]
        assert by["int8"]["single_seconds"] == by["double"]["single_seconds"]


@pytest.mark.parametrize("precision", ["double", "single", "half", "int16", "int8"])
def test_the_error_of_rounded_snapshots_is_that_of_interpolating_what_is_read_back(wavy, precision):
    answer = compare(wavy, ["position.x"], [0.004], ["raw-linear"], precisions=[precision])
    W, training = wavy.variable("position.x")[:], np.arange(0, 42, 4)
    unseen = np.setdiff1d(np.arange(41), training)
    kept = W[:, training]
    kept = read_back(kept, precision, extent_of([kept]))
    predicted = np.stack([np.interp(wavy.times[unseen], wavy.times[training], x) for x in kept])
    expected = np.sqrt(np.square(predicted - W[:, unseen]).mean(axis=0)).mean()
    assert row(answer, "raw-linear", precision=precision)["rmse"] == pytest.approx(expected, rel=1e-12)


def test_a_limit_on_storage_names_the_most_accurate_that_keeps_it_with_basis_and_precision(wavy):
    answer = compare(wavy, ["position.x"], [0.004, 0.002], max_bytes=2000)
    kept = [r for r in answer["rows"] if r["storage_bytes"] <= 2000]
    choice = answer["choice"]["position.x"]
    assert 0 < len(kept) < len(answer["rows"])
    assert choice["most_accurate"]["rmse"] <= 1.01 * min(r["rmse"] for r in kept)
    assert choice["most_accurate"]["storage_bytes"] <= 2000
    assert "within at most 2 kB to keep the most accurate is" in choice["sentence"]
    assert PRECISIONS[choice["most_accurate"]["precision"]].text in choice["sentence"]
    both = (choice["most_accurate"]["basis"] == "enriched") == ("of positions and velocities" in choice["sentence"])
    assert both


def test_where_storage_for_none_is_left_the_smallest_is_named(wavy):
    answer = compare(wavy, ["position.x"], [0.004], max_bytes=10)
    choice = answer["choice"]["position.x"]
    assert not choice["kept"]
    assert choice["closest"]["storage_bytes"] == min(r["storage_bytes"] for r in answer["rows"])
    assert "none keeps at most 0.01 kB to keep" in choice["sentence"]


@pytest.mark.parametrize(
    ("text", "size"), [("500kB", 5e5), ("2MB", 2e6), ("1.5 GB", 1.5e9), ("200000", 2e5), ("300 B", 300.0)]
)
def test_sizes_are_read_as_they_are_written(text, size):
    assert parse_bytes(text) == size


@pytest.mark.parametrize("text", ["much", "5 apples", "kB", ""])
def test_what_is_no_size_is_refused(text):
    with pytest.raises(Refusal, match="not a size"):
        parse_bytes(text)


def test_in_eight_bits_mean_coefficients_and_leading_modes_take_sixteen(wavy):
    answer = compare(wavy, ["position.x"], [0.004], ["spline"])
    found = row(answer, "spline", precision="int8")
    m, n, fine, window = 11, 10, found["finer_modes"], 8 * (11 + 2 + 1)
    columns = (1 + n) + n  # mean, modes and coefficients, each with its shift and its scale
    assert found["storage_bytes"] == N * (2 * (1 + fine) + (n - fine)) + 2 * m * n + 16 * columns + window
    assert row(answer, "spline", precision="int16")["finer_modes"] == 0
