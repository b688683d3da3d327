"""The rule: consistent modes against modes that must be reconstructed, and when neither can be told."""

import numpy as np
import pytest

from selection import Thresholds, consistent_mode, feasibility_index, least_reconstructable_mode
from selection.feasibility import Crossing, Evidence, verdict


def evidence(**changes):
    settled = Evidence(
        n_snapshots=100,
        unseen=200,
        n_lr=10,
        crossing=Crossing(25, 25.4, True),
        K_f=2.5,
        K_f_interval=(2.3, 2.7),
        R_a=1.02,
        resampled=True,
    )
    return settled._replace(**changes)


@pytest.mark.parametrize(("energy", "n_lr"), [(0.5, 1), (0.51, 2), (0.75, 2), (0.9, 4), (0.9375, 4), (1.0, 5)])
def test_least_reconstructable_mode_is_the_first_to_reach_the_energy(energy, n_lr):
    eigenvalues = np.array([8.0, 4.0, 2.0, 1.0, 1.0])
    assert least_reconstructable_mode(eigenvalues, energy) == n_lr


def test_the_papers_denominator_reaches_the_energy_sooner():
    eigenvalues = 1.0 / np.arange(1, 101)
    assert least_reconstructable_mode(eigenvalues, 0.999) > least_reconstructable_mode(eigenvalues, 0.999, 80)
    assert least_reconstructable_mode(eigenvalues, 0.999, 80) == 80


def test_without_motion_there_is_nothing_to_reconstruct():
    assert least_reconstructable_mode(np.zeros(0), 0.999) == 0
    assert feasibility_index(3, 0) is None


@pytest.mark.parametrize(
    ("ratio", "n_c"),
    [
        ([1.0, 1.01, 1.02, 1.06, 1.0], 2),
        ([1.0, 1.06, 1.0], 0),
        ([2.0, 1.0, 1.05, 1.0500001], 2),
        ([1.0, 1.0, np.inf], 1),
    ],
)
def test_consistent_mode_is_the_last_before_the_ratio_first_exceeds(ratio, n_c):
    crossing = consistent_mode(np.array(ratio), 1.05)
    assert (crossing.n_c, crossing.exceeded) == (n_c, True)
    assert n_c <= crossing.position <= n_c + 1


@pytest.mark.parametrize(("ratio", "n_c"), [([1.0, 1.0, 1.04], 2), ([1.0], 0), ([], 0)])
def test_a_ratio_that_never_exceeds_gives_the_last_mode_evaluated(ratio, n_c):
    assert consistent_mode(np.array(ratio), 1.05) == (n_c, n_c, False)


def test_enough_modes_and_a_resolved_time_axis_are_sufficient():
    assert verdict(evidence(), Thresholds()).verdict == "sufficient"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"K_f": 0.656, "K_f_interval": (0.64, 0.67)}, "K_f 0.66 below 2"),
        ({"R_a": 1.31}, "R_a 1.31 above 1.25"),
        ({"K_f": 0.0, "R_a": None, "K_f_interval": None, "crossing": Crossing(0, 0.0, True)}, "no consistent mode"),
    ],
)
def test_a_threshold_missed_is_insufficient_and_named(changes, reason):
    found = verdict(evidence(**changes), Thresholds())
    assert found.verdict == "insufficient"
    assert any(reason in r for r in found.reasons)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"unseen": 0}, "Δτ equals the dense interval"),
        ({"n_lr": 0, "K_f": None}, "nothing moves"),
        ({"crossing": Crossing(25, 25.0, False)}, "E_train at round-off"),
        ({"crossing": Crossing(98, 98.0, False)}, "R_c never exceeds 1.05"),
        ({"n_snapshots": 9}, "too few snapshots: 9"),
        ({"resampled": False}, "too few particles"),
        ({"K_f_interval": (1.9, 3.1)}, "too few particles: K_f between 1.90 and 3.10"),
        ({"K_f": 1.95, "K_f_interval": (1.8, 2.1)}, "either side of 2"),
    ],
)
def test_what_the_data_cannot_tell_is_undecidable_with_its_reason(changes, reason):
    found = verdict(evidence(**changes), Thresholds())
    assert found.verdict == "undecidable"
    assert any(reason in r for r in found.reasons)
