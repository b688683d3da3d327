"""The foreign run through the commands, as a user would: every figure of the independent script, to the integer."""

import json
import lzma

import pytest


@pytest.mark.physics
def test_import_and_select_find_every_integer_of_an_independent_script(suffice, reference, tmp_path):
    dump = tmp_path / "shake.dump"
    dump.write_bytes(lzma.decompress((reference / "shake.dump.xz").read_bytes()))
    run = tmp_path / "shake.h5"
    assert suffice("import", str(dump), "--interval", "0.001", "-o", str(run)).code == 0
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
