"""The foreign run through the commands, as a user would: every figure of the independent script, to the integer."""

import json
import lzma

import pytest

IN_TIME = ("spline", "rbf", "hermite")
NETWORKS = ("mlp", "lstm")
LEARNT = ("dmd", "rbf-map", "lstm", "mlp", "gp")


@pytest.fixture
def shake(suffice, reference, tmp_path):
    """Return the foreign run as the command imports it."""
    dump, run = tmp_path / "shake.dump", tmp_path / "shake.h5"
    dump.write_bytes(lzma.decompress((reference / "shake.dump.xz").read_bytes()))
    assert suffice("import", str(dump), "--interval", "0.001", "-o", str(run)).code == 0
    return run


@pytest.mark.physics
def test_between_snapshots_surrogates_stay_near_the_floor_of_their_modes(suffice, shake):
    words = [word for name in (*IN_TIME, *NETWORKS) for word in ("--surrogate", name)]
    answer = suffice("compare", shake, "--variable", "position.z", "--interval", "0.003", *words, "--json", "-")
    assert answer.code == 0
    found = json.loads(answer.out)
    base = next(base for base in found["bases"] if base["basis"] == "plain")
    assert (base["n_lr"], base["n_c"]) == (17, 37)
    rows = [row for row in found["rows"] if (row["basis"], row["precision"]) == ("plain", "single")]
    ratio = {(row["surrogate"], row["modes"]): row["ratio_to_floor"] for row in rows}
    assert max(ratio[name, 17] for name in IN_TIME) <= 1.005
    assert max(ratio[name, 37] for name in IN_TIME) <= 1.03
    assert max(ratio[name, 17] for name in NETWORKS) <= 1.02
    assert max(ratio[name, 37] for name in NETWORKS) <= 1.12


@pytest.mark.physics
def test_one_snapshot_ahead_all_that_learns_beats_standing_still(suffice, shake):
    words = [word for name in LEARNT for word in ("--surrogate", name)]
    where = ("--task", "beyond", "--variable", "position.z", "--interval", "0.003")
    answer = suffice("compare", shake, *where, *words, "--json", "-")
    assert answer.code == 0
    rows = [row for row in json.loads(answer.out)["rows"] if row["surrogate"] in LEARNT]
    assert {row["surrogate"] for row in rows} == set(LEARNT)
    assert max(row["from_end"]["over_persistence"] for row in rows) < 0.5
    assert (
        max(row["over_persistence"] for row in rows) < 0.8
    )  # of state maps from later starts, where the modes are older
    assert all(row["floor"][-1] > 3 * row["floor"][0] for row in rows)  # beyond the window it rises


@pytest.mark.physics
def test_import_and_select_find_every_integer_of_an_independent_script(suffice, reference, shake):
    run = shake
    answer = suffice("select", str(run), "--json", "-")
    assert answer.code == 0
    found = json.loads(answer.out)["variables"]
    expected = json.loads((reference / "shake.expected.json").read_text())
    assert set(found) == set(expected)
    for variable, by_interval in expected.items():
        candidates = {str(round(c["interval"] * 1e3)): c for c in found[variable]["candidates"]}
        assert set(candidates) == set(by_interval)
        for milliseconds, figures in by_interval.items():
            for name, value in figures.items():
                ours = candidates[milliseconds][name]
                assert ours == value if name != "K_f" else ours == pytest.approx(value, rel=1e-14)
