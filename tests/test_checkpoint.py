"""A run that goes on after an interruption is bitwise the run that was not interrupted."""

import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from sim import Simulation, parse_scene, scene_text
from sim.checkpoint import restore_, state_of
from suffice.checkpoint import checkpoint_path, read_checkpoint, write_checkpoint
from suffice.refusal import Refusal
from suffice.store import Run
from suffice.summary import read_summary

# the command line, with a checkpoint after every snapshot
COMMAND = "import suffice.simulating as s; s.SECONDS_BETWEEN_CHECKPOINTS = 0.0; import suffice.__main__ as m; m.main()"


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert np.asarray(values).tobytes() == np.asarray(other[name]).tobytes(), name


def halved(scene, steps):
    """Advance one simulation in two halves and another from the first one's state; return both."""
    through = Simulation(scene)
    through.advance_to(steps)
    state = state_of(through)
    again = Simulation(scene)
    restore_(again, state)
    for run in (through, again):
        run.advance_to(2 * steps)
    return through, again


def test_a_restored_run_is_bitwise_the_run_itself(beads):
    through, again = halved(parse_scene(beads), 1500)
    assert_same(state_of(through), state_of(again))
    assert again.snapshot().series == through.snapshot().series


def test_a_restored_mill_of_several_chunks_is_bitwise_the_mill_itself():
    through, again = halved(parse_scene(scene_text("mini_mill")), 700)
    assert len(through.listed.chunks) > 2
    assert_same(state_of(through), state_of(again))


def test_the_state_of_a_run_is_a_copy(beads):
    run = Simulation(parse_scene(beads))
    run.advance_to(100)
    state = state_of(run)
    kept = {name: values.copy() for name, values in state.items()}
    run.advance_to(200)
    assert_same(state, kept)


def test_a_state_of_another_kind_of_scene_is_not_taken(beads):
    frictionless = Simulation(parse_scene(beads.replace("friction = 0.3", "friction = 0.0")))
    with pytest.raises(KeyError, match="spin"):
        restore_(Simulation(parse_scene(beads)), state_of(frictionless))


def test_a_checkpoint_comes_back_from_the_disk_as_it_was(beads, tmp_path):
    run = Simulation(parse_scene(beads))
    run.advance_to(300)
    assert read_checkpoint(tmp_path / "run.h5") is None
    write_checkpoint(tmp_path / "run.h5", state_of(run))
    assert_same(read_checkpoint(tmp_path / "run.h5"), state_of(run))
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5.checkpoint"]


def test_a_damaged_checkpoint_is_refused_with_the_remedy(tmp_path):
    checkpoint_path(tmp_path / "run.h5").write_bytes(b"no")
    with pytest.raises(Refusal, match=r"run\.h5\.checkpoint cannot be read .* remove it and start the run anew"):
        read_checkpoint(tmp_path / "run.h5")


def content(path):
    """Every dataset of a run but the moment it was made at, and how fast."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, node: found.update({name: node[()]} if isinstance(node, h5py.Dataset) else {}))
    del found["suffice/provenance/made"], found["suffice/pace"]
    return found


def started(folder, scene, *options):
    arguments = [sys.executable, "-c", COMMAND, "simulate", scene, "-o", "run.h5", "--threads", "1", *options]
    return subprocess.Popen(arguments, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def finished(folder, scene, *options):
    process = started(folder, scene, *options)
    assert process.wait(timeout=120) == 0, process.stderr.read()
    process.stderr.close()


def killed(folder, scene, delay, *options):
    """Kill a run some seconds after it has begun to write; return whether it was still running."""
    process = started(folder, scene, *options)
    views = folder / "run.particles.vtkhdf"
    before = views.stat().st_mtime_ns if views.exists() else 0
    while process.poll() is None and not (views.exists() and views.stat().st_mtime_ns != before):
        time.sleep(0.005)
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stderr.close()
    return process.returncode == -signal.SIGKILL


def kill_and_resume(beads, folder, times, *wishes):
    """Kill one run again and again, each time resuming it, and compare it with one that was let alone."""
    scene = beads.replace("interval = 0.001", "interval = 0.0001")  # 201 snapshots, each brought to the disk
    for name in ("whole", "broken"):
        (folder / name).mkdir()
        (folder / name / "scene.toml").write_text(scene)
    finished(folder / "whole", "scene.toml", *wishes)
    rng = np.random.default_rng(times)
    options, reached = [], []
    for _ in range(times):
        was_running = killed(folder / "broken", "scene.toml", rng.uniform(0.0, 1.0 / times), *options, *wishes)
        with Run(folder / "broken" / "run.h5") as run:
            assert np.isfinite(run.snapshot(run.n_snapshots - 1).values["position"]).all()
            reached.append((was_running, run.n_snapshots))
        options = ["--resume"]
    finished(folder / "broken", "scene.toml", "--resume", *wishes)
    assert sum(was_running for was_running, _ in reached) >= times // 2, reached
    assert_same(content(folder / "broken" / "run.h5"), content(folder / "whole" / "run.h5"))
    names = sorted(path.name for path in (folder / "broken").iterdir())
    assert names == ["run.h5", "run.particles.vtkhdf", "scene.toml"]


def test_a_run_killed_five_times_and_resumed_ends_bitwise_like_one_that_was_not(beads, tmp_path):
    kill_and_resume(beads, tmp_path, 5)


@pytest.mark.physics
def test_a_run_killed_twenty_times_and_resumed_ends_bitwise_like_one_that_was_not(beads, tmp_path):
    kill_and_resume(beads, tmp_path, 20)


@pytest.mark.physics
def test_a_watched_and_thinned_run_killed_and_resumed_ends_bitwise_like_one_that_was_not(beads, tmp_path):
    wishes = ("--until-sufficient", "--variable", "position", "--keep-error", "0.0005d")
    kill_and_resume(beads.replace("count = 12", "count = 30"), tmp_path, 6, *wishes)


def test_an_interrupted_run_says_how_to_go_on_and_does(beads, tmp_path):
    scene = beads.replace("interval = 0.001", "interval = 0.0001")
    (tmp_path / "scene.toml").write_text(scene)
    process = started(tmp_path, "scene.toml")
    while not checkpoint_path(tmp_path / "run.h5").exists():
        assert process.poll() is None
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "run.h5 keeps" in said
    assert "of 201 snapshots, the same command goes on from there" in said.replace("\n", " ")
    assert "--resume" in said
    assert "Traceback" not in said
    assert "run.h5: interrupted at t = " in said
    with Run(tmp_path / "run.h5") as run:
        before = read_summary(run)
        assert (before.outcome, before.time) == ("interrupted", run.times[-1])
    finished(tmp_path, "scene.toml", "--resume")
    with Run(tmp_path / "run.h5") as run:
        assert run.n_snapshots == 201
        after = read_summary(run)
    assert after.outcome == "done"
    assert after.pace.seconds > before.pace.seconds  # the whole run's, not those of its last part
    assert not checkpoint_path(tmp_path / "run.h5").exists()
