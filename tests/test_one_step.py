"""One step of a reduced order model: what is timed is the snapshot itself, at times not asked for before."""

import numba
import numpy as np
import pytest
import torch

from pod import lanczos_pod
from selection import sweep
from sim import parse_scene, simulation_of
from suffice.one_step import rom_speed, timing_of
from suffice.refusal import Refusal
from suffice.rom import Component, Rom, components_of
from suffice.run import Run
from suffice.stretch import timed_stretch
from surrogates import SURROGATES

BEADS, MODES = 90, (3, 5, 4)
TIMES = np.linspace(0.0, 1.0, 21)  # s


@pytest.fixture
def components():
    """Return three components of waves that travel past beads, about places of their own."""
    chance = np.random.default_rng(0)
    made = []
    for n in MODES:
        place, phase = chance.normal(size=(2, BEADS, 1))
        W = place + sum(np.cos(k * (5 * TIMES + phase)) / k for k in range(1, 5))
        basis = lanczos_pod(W, modes=n)
        made.append((basis, SURROGATES["spline"]().fit(TIMES, basis.project(W))))
    return made


def rom_of(made, copies=1):
    return Rom([Component(basis.mean, basis.modes, surrogate) for basis, surrogate in made], copies, device="cpu")


@pytest.mark.parametrize("count", [1, 7])
def test_a_snapshot_is_mean_and_modes_of_every_component_to_single_precision(components, count):
    asked = np.random.default_rng(1).uniform(0.0, 1.0, count)
    rom = rom_of(components)
    found = rom.empty(count)
    rom.fill_(found, asked)
    for k, (basis, surrogate) in enumerate(components):
        exact = basis.reconstruct(surrogate.predict(asked)).T
        assert np.abs(found[:, k].numpy() - exact).max() < 2e-6 * np.abs(exact).max()


def test_copies_of_beads_beside_each_other_move_alike_and_cost_as_many_rows(components):
    once, four = rom_of(components), rom_of(components, copies=4)
    one, many = once.empty(3), four.empty(3)
    once.fill_(one, [0.11, 0.52, 0.93])
    four.fill_(many, [0.11, 0.52, 0.93])
    assert many.shape == (3, 3, 4 * BEADS)
    assert four.bytes_read == 4 * once.bytes_read
    for part in many.view(3, 3, 4, BEADS).unbind(dim=2):
        torch.testing.assert_close(part, one, rtol=0.0, atol=5e-6)


def test_copies_leave_every_index_of_the_rule_as_it_is():
    chance = np.random.default_rng(2)
    times, phase = np.linspace(0.0, 1.0, 61), chance.normal(size=(70, 1))
    W = sum(chance.normal(size=(70, 1)) * np.sin(5 * k * (times + phase)) / k**2 for k in range(1, 20))
    one, five = (sweep(rows, times, [2 / 60, 4 / 60]) for rows in (W, np.tile(W, (5, 1))))
    for a, b in zip(one.candidates, five.candidates, strict=True):
        assert (a.n_lr, a.n_c, a.K_f) == (b.n_lr, b.n_c, b.K_f)
        assert a.K_f is not None
    modes, tiled = (lanczos_pod(rows, modes=6).modes for rows in (W, np.tile(W, (5, 1))))
    np.testing.assert_allclose(np.abs(tiled), np.abs(np.tile(modes, (5, 1)) / np.sqrt(5.0)), atol=1e-10)


def test_no_time_is_asked_for_twice(components, monkeypatch):
    asked = []
    for _, surrogate in components:
        predict = surrogate.predict
        monkeypatch.setattr(surrogate, "predict", lambda t, p=predict: (asked.append(tuple(t)), p(t))[1])
    found = rom_speed(rom_of(components), buffer=5 * 3 * BEADS * 4, singles=4, batches=3)
    by_component = asked[::3]
    assert len(by_component) == 5 + 5 + 4
    drawn = [time for times in by_component for time in times]
    assert len(set(drawn)) == len(drawn)
    assert found.batch_size == 5
    assert max(map(len, asked)) == 5


def test_one_step_says_on_what_it_was_measured_and_how_much_memory_it_moved(components):
    found = rom_speed(rom_of(components), buffer=10**5, singles=5, batches=3)
    assert (found.device, found.fetch, found.precision) == ("CPU", None, "single")
    assert found.threads == torch.get_num_threads()
    assert found.n_modes == list(MODES)
    assert found.beads == BEADS
    assert found.bytes_moved == 4 * BEADS * (sum(MODES) + 3 + 3)  # modes and means read, a snapshot written
    assert found.flops == 2 * BEADS * (sum(MODES) + 3)
    assert 0.0 < found.regression.seconds < found.single.high
    assert found.single.low <= found.single.seconds <= found.single.high
    assert found.seconds == found.single.seconds
    assert found.bytes_per_second * found.single.seconds == pytest.approx(found.bytes_moved)


def test_the_median_of_one_measurement_is_that_measurement():
    assert timing_of([0.5])[:3] == (0.5, 0.5, 0.5)
    assert timing_of([3.0, 1.0, 2.0])[:3] == (2.0, 1.5, 2.5)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
def test_a_gpu_gives_the_snapshots_of_the_cpu_and_is_named(components):
    parts = [Component(basis.mean, basis.modes, surrogate) for basis, surrogate in components]
    there, here = Rom(parts, 3), rom_of(components, copies=3)
    a, b = there.empty(4), here.empty(4)
    for rom, room in ((there, a), (here, b)):
        rom.fill_(room, [0.1, 0.4, 0.7, 0.9])
    torch.testing.assert_close(a.cpu(), b, rtol=0.0, atol=5e-6)
    found = rom_speed(there, buffer=10**6, singles=5, batches=3)
    assert found.device == torch.cuda.get_device_name()
    assert found.fetch is not None
    assert found.seconds == found.single.seconds + found.fetch.seconds


def test_a_run_gives_modes_up_to_consistency_of_each_component(tmp_path, write_run):
    with Run(write_run(tmp_path / "run.h5")) as run:
        found = components_of(run, 0.002, "spline")
        assert len(found) == 3
        rom = Rom(found, device="cpu")
        room = rom.empty(1)
        for one in found:
            assert one.modes.shape == (24, max(one.n_lr, one.n_c))
        k = 20  # a training snapshot: what is left is what the modes beyond n leave out
        rom.fill_(room, run.times[[k]])
        truth = run.snapshot(k).values["position"].T
        left = np.sqrt(np.square(room[0].numpy() - truth).mean())
        assert left < 0.05 * truth.std()
        with pytest.raises(Refusal, match="dense interval"):
            components_of(run, 0.001, "spline")


WET = """[[particles]]
diameter = 1e-3
density = 6050.0
count = 40

[contact]
stiffness = 1e3
restitution = 0.9
friction = 0.1

[gravity]
acceleration = [0.0, 0.0, -9.81]

[fluid]
density = 998.2
viscosity = 1e-3
lowest = [0.0, 0.0, 0.0]
highest = [0.008, 0.008, 0.008]
cells = [6, 6, 6]
largest_step = 5e-5

[drag]

[time]
duration = 0.01

[output]
interval = 0.001

[[walls]]
name = "box"
[[walls.shapes]]
shape = "box"
lowest = [0.0, 0.0, 0.0]
highest = [0.008, 0.008, 0.008]
particles = "inside"
"""


@pytest.mark.physics
def test_an_interval_is_its_steps_times_those_measured_and_fluid_has_its_share():
    run = simulation_of(parse_scene(WET))
    found = timed_stretch(run, warm_up=10, steps=60)
    per_fluid = run.steps_to_next_flow()
    assert found.steps_per_interval == run.steps_per_snapshot
    assert found.interval_seconds == pytest.approx(run.steps_per_snapshot * found.seconds / found.steps, rel=1e-12)
    assert found.steps >= 60
    assert found.steps == found.pieces * per_fluid  # whole steps of the fluid, as long as in an undisturbed run
    assert found.step.repeats == found.pieces
    assert run.step == 1 + 10 + found.steps
    assert (found.end - found.begin) == pytest.approx(found.steps * run.dt)
    assert found.beads == 40
    assert found.interval == pytest.approx(0.001)
    assert 0.0 < sum(found.seconds_of.values()) < found.seconds


@pytest.mark.physics
def test_a_timed_stretch_leaves_the_run_where_an_untimed_one_comes_to(beads):
    timed, plain = (simulation_of(parse_scene(beads)) for _ in range(2))
    found = timed_stretch(timed, warm_up=20, steps=100)
    plain.advance_to(timed.step)
    np.testing.assert_array_equal(timed.particles.position, plain.particles.position)
    assert found.threads == numba.get_num_threads()
    assert found.share == found.steps / found.steps_per_interval
