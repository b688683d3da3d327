"""Averages over the rotor's phase: exact on what only the phase moves, with an error that noise has."""

import numpy as np
import pytest

from suffice.phases import FIELDS, averages, schedule
from suffice.refusal import Refusal
from suffice.rotor import Rotor
from suffice.run import Run

ROTOR = Rotor("rotor", 600.0, 2)  # a period of 0.05 s


def test_the_average_of_a_field_that_turns_with_the_rotor_is_that_field(tmp_path, write_stirred):
    with Run(write_stirred(tmp_path / "run.h5", 600.0)) as run:
        found = averages(run, bins=8, start_up=0.5)
    assert (found.periods, found.snapshots) == (3, 24)
    np.testing.assert_allclose(found.phase, np.arange(8) / 8, atol=1e-9)
    flux = found.fields["fluid_flux"].reshape(8, 3, 4, 4, 3)
    z, y, _ = np.meshgrid(*[(np.arange(k) + 0.5) / k for k in (3, 4, 4)], indexing="ij")
    turned = 2.0 * np.pi * found.phase
    way = np.stack([np.cos(turned), np.sin(turned), np.ones(8)], axis=-1)
    expected = ((0.5 + 0.06 * z) * 0.6 * y)[None, ..., None] * way[:, None, None, None, :]
    np.testing.assert_allclose(flux, expected, atol=1e-12)
    agitation, solid = found.fields["agitation"], found.fields["solid_flux"].reshape(8, -1, 3)
    held = np.abs(solid).max(axis=(0, 2)) > 0.0
    # two beads of every place, at ± a/2 in each direction about the mean
    share = solid[..., 2] / 0.6
    np.testing.assert_allclose(agitation[:, held], share[:, held] * 0.3**2, atol=1e-12)
    for name in FIELDS:
        scale = np.abs(found.fields[name]).max()
        np.testing.assert_allclose(found.error(name), 0.0, atol=1e-9 * scale)


def test_the_mean_over_time_is_the_mean_over_phases(tmp_path, write_stirred):
    with Run(write_stirred(tmp_path / "run.h5", 600.0)) as run:
        found = averages(run, bins=8, start_up=0.5)
    mean = found.over_time()
    across = mean.fields["fluid_flux"].reshape(-1, 3)[:, :2]
    np.testing.assert_allclose(across, 0.0, atol=1e-12)  # what turns
    assert mean.phase.shape == (1,)
    np.testing.assert_allclose(mean.fields["pressure"][0], found.fields["pressure"].mean(axis=0))


def test_a_bin_takes_all_snapshots_of_its_phases(tmp_path, write_stirred):
    with Run(write_stirred(tmp_path / "run.h5", 600.0)) as run:
        found = averages(run, bins=4, start_up=0.5)
    np.testing.assert_allclose(found.phase, (np.arange(4) + 0.25) / 4, atol=1e-9)


def test_the_error_of_the_average_is_that_of_independent_noise(tmp_path, write_stirred):
    with Run(write_stirred(tmp_path / "run.h5", 600.0, periods=33, noise=0.4)) as run:
        found = averages(run, bins=8, start_up=0.5)
    with Run(write_stirred(tmp_path / "quiet.h5", 600.0)) as run:
        quiet = averages(run, bins=8, start_up=0.5)
    for name in ("void_fraction", "fluid_flux", "pressure", "solid_flux"):
        said = np.sqrt((found.error(name) ** 2).mean())
        made = np.sqrt(((found.fields[name] - quiet.fields[name]) ** 2).mean())
        assert said == pytest.approx(made, rel=0.2), name


def test_snapshots_on_the_edge_of_a_bin_fall_into_it_in_spite_of_rounding():
    times = np.arange(0, 8 * 12 + 1) * (ROTOR.period / 8) * (1.0 + 1e-12)
    plan = schedule(ROTOR, times, ROTOR.turn, 8)
    assert plan.periods == 10
    np.testing.assert_array_equal(np.bincount(plan.bin), np.full(8, 10))
    np.testing.assert_array_equal(np.bincount(plan.half), [40, 40])


def test_what_does_not_fill_a_period_at_the_start_is_left_out():
    times = np.linspace(0.0, 0.2, 401)  # four periods, of which half of the first is start-up
    plan = schedule(ROTOR, times, 0.025, 10)
    assert plan.periods == 3
    assert times[plan.snapshots[0]] > 0.05
    assert len(plan.snapshots) == 300


def test_a_run_too_short_or_too_coarse_for_averages_is_refused():
    with pytest.raises(Refusal, match=r"600 rpm: 1 whole periods of 0.05 s after the start-up of 0.1 s; .*longer"):
        schedule(ROTOR, np.linspace(0.0, 0.19, 400), 0.1, 8)
    with pytest.raises(Refusal, match="8 bins of phase: some hold no snapshot; use fewer bins"):
        schedule(ROTOR, np.linspace(0.0, 0.4, 33), 0.1, 8)
