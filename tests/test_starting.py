"""A run that starts from a snapshot of another, through the command line."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from suffice.store import Run


@pytest.fixture
def settled(suffice, beads, tmp_path, monkeypatch):
    """A folder with a run of the beads, and a scene in a folder beside it that starts there."""
    monkeypatch.chdir(tmp_path)
    beads = re.sub("motion = .*", "", beads)  # a start keeps no pose of the walls: they begin anew
    Path("scene.toml").write_text(beads)
    assert suffice("simulate", "scene.toml", "-o", "first.h5", "--until", 0.01).code == 0
    Path("later").mkdir()

    def later(line='run = "../first.h5"', change=("", "")):
        Path("later/scene.toml").write_text(beads.replace(*change) + f"\n[start]\n{line}\n")
        return suffice("simulate", "later/scene.toml", "-o", "second.h5", "--until", 0.004, "--json", "-")

    return later


@pytest.mark.parametrize(("line", "k"), [("", 10), ("time = 0.006", 6)])
def test_a_run_goes_on_from_the_last_snapshot_of_another_or_the_one_asked_for(settled, line, k):
    answer = settled(f'run = "../first.h5"\n{line}')
    assert answer.code == 0, answer.err
    with Run("first.h5") as first, Run("second.h5") as second:
        there, here = first.snapshot(k).values, second.snapshot(0).values
        for name in ("position", "velocity", "angular_velocity"):
            assert np.array_equal(there[name], here[name])
        assert len(json.loads(second.provenance["settings"])["start"]) == 64
        assert second.provenance["start"].endswith("first.h5")


def test_a_run_that_starts_from_another_is_not_resumed_once_that_one_has_changed(settled, suffice):
    assert settled().code == 0
    resumed = ("simulate", "later/scene.toml", "-o", "second.h5", "--until", 0.004, "--resume")
    assert suffice(*resumed).code == 0
    longer = suffice(*resumed[:-2], 0.006, "--resume")
    assert "was made with another end (0.004 s, now 0.006 s)" in longer.err.replace("\n", " ")
    assert suffice("simulate", "scene.toml", "-o", "first.h5", "--seed", 5, "--until", 0.01).code == 0
    refused = suffice(*resumed)
    assert refused.code == 2
    assert "was made with another start" in refused.err.replace("\n", " ")


@pytest.mark.parametrize(
    ("line", "change", "says"),
    [
        ('run = "nowhere.h5"', ("", ""), "run later/nowhere.h5 is missing"),
        ('run = "../first.h5"\ntime = 0.0065', ("", ""), "has no snapshot then, the nearest is at 0.006 s"),
        ('run = "../first.h5"', ("count = 12", "count = 13"), "start.run has 12; give count = 12"),
        ('run = "../first.h5"', ("diameter = 2e-3", "diameter = 1e-3"), "start.run has a sphere of 0.002 m"),
    ],
)
def test_a_start_that_cannot_be_is_refused_and_leaves_nothing(settled, line, change, says):
    answer = settled(line, change)
    assert answer.code == 2
    assert says in answer.err.replace("\n", " ")
    assert not Path("second.h5").exists()
