"""Impacts by energy: kept in a run, and summed up."""

import numpy as np
import pytest

from sim.collisions import BINS, impact_energy_edges
from suffice.impacts import impact_facts
from suffice.store import Run, RunWriter


@pytest.fixture
def counted(tmp_path):
    """A run of one particle, whose pair impacts all have 1e-7 J: a thousand a second, then three thousand."""
    edges = impact_energy_edges()
    place = int(np.searchsorted(edges, 1.1e-7)) - 1
    particles = {"ids": [0], "radius": [1.0], "species": [0]}
    path, kind = tmp_path / "run.h5", {"variables": ["position"], "provenance": {}}
    with RunWriter(path, **particles, n_snapshots=3, **kind, impact_energy=edges) as run:
        for k, rate in enumerate((0.0, 1e3, 3e3)):
            impacts = np.zeros((2, BINS))
            impacts[0, place] = rate
            run.append(0.1 * k, {"position": np.zeros((1, 3))}, impacts=impacts)
    return path, place


def test_impacts_are_read_as_they_were_counted(counted):
    path, place = counted
    with Run(path) as run:
        assert np.array_equal(run.impacts.energy, impact_energy_edges())
        assert run.impacts.rate[:, 0, place].tolist() == [0.0, 1e3, 3e3]
        assert run.impacts.rate.sum() == 4e3
        assert impact_facts(run)["impacts.walls"] == "none"
        # 2000 a second of about 1e-7 J, to the width of a bin: 10^(1/5)
        said = impact_facts(run)["impacts.pairs"]
        assert said.startswith("2000 1/s, half of them below")
        power = float(said.split("; ")[1].split(" W")[0])
        assert power == pytest.approx(2000 * 1.26e-7, rel=0.02)


def test_a_resumed_run_goes_on_counting(counted):
    path, place = counted
    with RunWriter.resume(path, 2) as run:
        run.append(0.2, {"position": np.zeros((1, 3))}, impacts=np.ones((2, BINS)))
    with Run(path) as run:
        assert run.impacts.rate[2].tolist() == np.ones((2, BINS)).tolist()
        assert run.impacts.rate[1, 0, place] == 1e3


def test_a_run_that_counts_no_impacts_says_nothing_of_them(write_run, tmp_path):
    with Run(write_run(tmp_path / "run.h5")) as run:
        assert run.impacts is None
        assert impact_facts(run) == {}


def test_bins_are_fifths_of_decades():
    edges = impact_energy_edges()
    assert len(edges) == BINS + 1
    assert edges[5::5] / edges[:-5:5] == pytest.approx(10.0, rel=1e-12)
