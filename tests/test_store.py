import errno
import itertools
import os
import signal

import h5py
import numpy as np
import pytest

from suffice import store
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.store import Run, RunWriter
from suffice.views import view_paths

N, STEPS = 30, 12
GRID = Grid((4, 3, 5), (0.1, 0.2, 0.3), (0.01, 0.02, 0.03))
TIMES = 0.001 * np.arange(STEPS)


def motion(k, n=N):
    """Positions and velocities of snapshot k, so that what is read can be told from what was written."""
    particle = np.arange(n)[:, None] + np.array([0.0, 0.25, 0.5])
    return {"position": np.sin(particle + k), "velocity": np.cos(particle + k)}


def fields(k):
    cells = np.arange(np.prod(GRID.shape)).reshape(GRID.shape)
    return {
        "fluid.velocity": np.stack([cells + k, cells - k, cells * (k + 1.0)], axis=-1),
        "fluid.pressure": 1000.0 * k + cells,
    }


def writer(path, n_snapshots=STEPS, **options):
    particles = {"ids": np.arange(N) + 7, "radius": np.full(N, 5e-4), "species": np.ones(N, int)}
    options = {"variables": ("position", "velocity"), "provenance": {}, **options}
    return RunWriter(path, **particles, n_snapshots=n_snapshots, **options)


def write(path, snapshots=STEPS, **options):
    with writer(path, **options) as run:
        for k in range(snapshots):
            run.append(TIMES[k], motion(k))
    return path


@pytest.fixture
def run(tmp_path):
    with Run(write(tmp_path / "run.h5")) as opened:
        yield opened


@pytest.fixture
def flow(tmp_path):
    path = tmp_path / "flow.h5"
    names = ("position", "velocity", "fluid.velocity", "fluid.pressure")
    with writer(path, variables=names, grid=GRID, precision="double") as written:
        for k in range(STEPS):
            written.append(TIMES[k], motion(k) | fields(k))
    with Run(path) as opened:
        yield opened


def test_a_run_gives_back_its_particles_and_times(run):
    assert np.array_equal(run.times, TIMES)
    assert (run.n_snapshots, run.n_particles, run.interval) == (STEPS, N, 0.001)
    assert np.array_equal(run.ids, np.arange(N) + 7)
    assert np.array_equal(run.radius, np.full(N, 5e-4))
    assert run.variables == ["position.x", "position.y", "position.z", "velocity.x", "velocity.y", "velocity.z"]


def test_a_component_is_a_matrix_of_one_row_per_particle(run):
    expected = np.array([motion(k)["velocity"][:, 1] for k in range(STEPS)], np.float32).T
    rows = run.variable("velocity.y")
    assert (rows.shape, rows.rows_per_particle, rows.unit, rows.dtype) == ((N, STEPS), 1, "m/s", np.float32)
    assert np.array_equal(rows[0:N], expected)
    assert np.array_equal(rows[5:17], expected[5:17])
    assert rows[9:9].shape == (0, STEPS)


def test_a_vector_has_the_three_rows_of_a_particle_together(run):
    expected = np.array([motion(k)["position"].ravel() for k in range(STEPS)], np.float32).T
    rows = run.variable("position")
    assert (rows.shape, rows.rows_per_particle) == ((3 * N, STEPS), 3)
    for start, stop in [(0, 3 * N), (4, 17), (5, 6), (80, 400)]:
        assert np.array_equal(rows[start:stop], expected[start:stop])


@pytest.mark.parametrize("shape", [(4, 3, 5), (1, 3, 20), (1, 1, 60)], ids=["3-D", "one cell deep", "a line"])
def test_a_field_is_a_matrix_of_one_row_per_cell_whatever_planes_a_block_cuts(tmp_path, shape):
    grid = GRID._replace(shape=shape)
    names = ("position", "velocity", "fluid.velocity", "fluid.pressure")
    stored = [{name: f.reshape(shape + f.shape[3:]) for name, f in fields(k).items()} for k in range(STEPS)]
    with writer(tmp_path / "flow.h5", variables=names, grid=grid, precision="double") as written:
        for k in range(STEPS):
            written.append(TIMES[k], motion(k) | stored[k])
    with Run(tmp_path / "flow.h5") as flow:
        pressure = np.array([f["fluid.pressure"].ravel() for f in stored]).T
        upward = np.array([f["fluid.velocity"][..., 2].ravel() for f in stored]).T
        whole = np.array([f["fluid.velocity"].ravel() for f in stored]).T
        for start, stop in [(0, 60), (7, 44), (14, 15), (59, 60)]:
            assert np.array_equal(flow.variable("fluid.pressure")[start:stop], pressure[start:stop])
            assert np.array_equal(flow.variable("fluid.velocity.z")[start:stop], upward[start:stop])
            assert np.array_equal(flow.variable("fluid.velocity")[start:stop], whole[start:stop])


def test_a_snapshot_holds_every_variable_at_one_time(flow):
    snapshot = flow.snapshot(5)
    assert snapshot.time == TIMES[5]
    for name, values in (motion(5) | fields(5)).items():
        assert np.array_equal(snapshot.values[name], values)
    assert flow.grid == GRID
    with pytest.raises(IndexError):
        flow.snapshot(STEPS)


def test_single_precision_is_the_default_and_double_keeps_every_digit(tmp_path):
    write(tmp_path / "single.h5")
    write(tmp_path / "double.h5", precision="double")
    with Run(tmp_path / "single.h5") as single, Run(tmp_path / "double.h5") as double:
        exact = motion(3)["position"][:, 0]
        assert np.array_equal(double.variable("position.x")[0:N][:, 3], exact)
        assert np.array_equal(single.variable("position.x")[0:N][:, 3], exact.astype(np.float32))


def test_what_made_the_run_and_its_diagnostics_come_back(tmp_path):
    scene = '[particles]\ndiameter = 1e-3  # "µ" = 0.3\n'
    with writer(tmp_path / "run.h5", provenance={"scene": scene, "seed": ""}, series=["kinetic", "overlap"]) as run:
        for k in range(3):
            run.append(TIMES[k], motion(k), {"kinetic": 2.0 * k, "overlap": 0.1})
    with Run(tmp_path / "run.h5") as run:
        assert run.provenance == {"scene": scene, "seed": ""}
        assert np.array_equal(run.series["kinetic"], [0, 2, 4])
        assert np.array_equal(run.series["overlap"], [0.1, 0.1, 0.1])


def test_uneven_times_have_no_dense_interval(tmp_path):
    with writer(tmp_path / "run.h5") as run:
        for k, t in enumerate([0.0, 0.001, 0.003]):
            run.append(t, motion(k))
    with Run(tmp_path / "run.h5") as run:
        assert run.interval is None


def test_times_written_with_six_digits_are_even(tmp_path):
    with writer(tmp_path / "run.h5") as run:
        for k in range(STEPS):
            run.append(float(f"{0.9 + 0.00333333333 * k:.6f}"), motion(k))
    with Run(tmp_path / "run.h5") as run:
        assert run.interval == pytest.approx(0.00333333, abs=1e-7)


def test_fewer_snapshots_than_announced_are_a_shorter_run(tmp_path):
    with Run(write(tmp_path / "run.h5", snapshots=4)) as run:
        assert run.n_snapshots == len(run.times) == 4
        assert run.variable("position.x").shape == (N, 4)


def test_the_file_has_its_full_size_from_the_start(tmp_path):
    with writer(tmp_path / "run.h5", n_snapshots=1000):
        assert (tmp_path / "run.h5").stat().st_size > 1000 * N * 6 * 4


@pytest.mark.parametrize(
    ("time", "values", "says"),
    [
        (0.0, motion(1), "does not follow"),
        (np.nan, motion(1), "does not follow"),
        (1.0, {"position": motion(1)["position"]}, "stores"),
        (1.0, motion(1, N + 1), "shape"),
    ],
    ids=["time", "NaN time", "missing", "shape"],
)
def test_a_snapshot_that_does_not_fit_is_not_counted(tmp_path, time, values, says):
    with writer(tmp_path / "run.h5") as run:
        run.append(0.0, motion(0))
        with pytest.raises(ValueError, match=says):
            run.append(time, values)
    with Run(tmp_path / "run.h5") as run:
        assert run.n_snapshots == 1


def test_more_snapshots_than_announced_do_not_fit(tmp_path):
    with writer(tmp_path / "run.h5", n_snapshots=1) as run:
        run.append(0.0, motion(0))
        with pytest.raises(ValueError, match="all 1 snapshots"):
            run.append(1.0, motion(1))


def test_a_run_that_fails_keeps_what_it_had(tmp_path):
    def failing():
        with writer(tmp_path / "run.h5") as run:
            run.append(0.0, motion(0))
            raise RuntimeError("overlap")

    with pytest.raises(RuntimeError, match="overlap"):
        failing()
    with Run(tmp_path / "run.h5") as run:
        assert run.n_snapshots == 1


@pytest.mark.parametrize("kind", [OSError, RuntimeError])
def test_a_disk_that_fills_up_is_told_with_the_run_and_what_to_do(tmp_path, monkeypatch, kind):
    """HDF5 raises either of them, as whatever call it is that finds the disk full."""
    path = tmp_path / "run.h5"

    def full(*_):
        raise kind("Unable to synchronously flush file (unable to extend file properly, errno = 28)")

    def fill():
        with writer(path) as out:
            out.append(0.0, motion(0))
            with monkeypatch.context() as patched:
                patched.setattr(h5py.File, "flush", full)
                out.append(1.0, motion(1))

    with pytest.raises(OSError, match=r"run .*run\.h5 cannot be written \(No space left on device\); make room"):
        fill()
    with Run(path) as found:
        assert found.n_snapshots >= 1


def test_a_file_written_beside_appears_only_when_it_is_whole(tmp_path):
    def failing():
        with writer(tmp_path / "run.h5", beside=True) as run:
            run.append(0.0, motion(0))
            raise Refusal("lost")

    with pytest.raises(Refusal, match="lost"):
        failing()
    assert list(tmp_path.iterdir()) == []
    write(tmp_path / "run.h5", beside=True)
    assert {path.name for path in tmp_path.iterdir()} == {"run.h5", "run.particles.vtkhdf"}


def test_a_refused_import_leaves_the_run_that_stood_there(tmp_path):
    write(tmp_path / "run.h5", snapshots=5)

    def failing():
        with writer(tmp_path / "run.h5", beside=True) as run:
            run.append(0.0, motion(9))
            raise Refusal("lost")

    with pytest.raises(Refusal, match="lost"):
        failing()
    with Run(tmp_path / "run.h5") as run:
        assert run.n_snapshots == 5
    assert view_paths(tmp_path / "run.h5")[0].exists()


def test_an_unknown_variable_is_refused_naming_those_there_are(run):
    for name in ("position.w", "pressure", "fluid.velocity", ".x", "velocity.y.z", ""):
        with pytest.raises(Refusal, match=r"no variable .* it has position\.x, .*velocity\.z"):
            run.variable(name)


def test_an_output_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "thesis.txt").write_text("mine")
    for name, says in [("folder", "folder"), ("none/run.h5", "no folder"), ("thesis.txt", "not a run")]:
        with pytest.raises(Refusal, match=says):
            writer(tmp_path / name)
    assert (tmp_path / "thesis.txt").read_text() == "mine"
    with pytest.raises(Refusal, match=r"needs .* GB and its disk has .* GB free"):
        writer(tmp_path / "run.h5", n_snapshots=10**13)


def test_a_disk_without_room_for_hdf5_itself_is_refused_before_it_begins(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = write(tmp_path / "run.h5").read_bytes()
    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(Refusal, match="No space left on device"):
        writer(tmp_path / "run.h5")
    assert (tmp_path / "run.h5").read_bytes() == before
    assert not (tmp_path / "run.h5.part").exists()


WRITES = ((h5py.Dataset, "__setitem__"), (h5py.Group, "__setitem__"), (h5py.File, "flush"), (h5py.File, "close"),
          (os, "fsync"), (os, "replace"), (os, "unlink"))  # fmt: skip


def killed_before(call, work):
    """Do some work in a process that is killed before this of its calls of HDF5 and the system.

    Return whether it was killed, and the number that it has told: that of the snapshots it was done with.
    """
    told, tells = os.pipe()
    pid = os.fork()
    if pid == 0:
        count = itertools.count(1)

        def dying(original):
            def called(*arguments, **options):
                if next(count) == call:
                    os.kill(os.getpid(), signal.SIGKILL)
                return original(*arguments, **options)

            return called

        for place, name in WRITES:
            setattr(place, name, dying(getattr(place, name)))
        try:
            work(lambda: os.write(tells, b"."))
        finally:
            os._exit(0)
    os.close(tells)
    with open(told, "rb") as pipe:
        done = len(pipe.read())
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL, done


def assert_bitwise(path, count):
    with Run(path) as run:
        assert run.n_snapshots == count
        for k in range(count):
            for name, values in motion(k).items():
                assert np.array_equal(run.snapshot(k).values[name], values.astype(np.float32)), (k, name)


@pytest.mark.physics
def test_a_run_killed_before_any_call_of_hdf5_keeps_every_counted_snapshot_bitwise_and_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "SECONDS_BETWEEN_VIEWS", np.inf)  # one after the first snapshot, one at the end
    path, last = tmp_path / "run.h5", 3

    def work(tell):
        with writer(path, n_snapshots=last) as run:
            for k in range(last):
                run.append(TIMES[k], motion(k))
                tell()

    kept = []
    for call in itertools.count(1):
        path.unlink(missing_ok=True)
        killed, done = killed_before(call, work)
        if path.exists():
            with Run(path) as run:
                kept.append(run.n_snapshots)
                assert done <= run.n_snapshots <= done + 1, call
            assert_bitwise(path, kept[-1])
            if kept[-1] not in kept[:-1]:
                with RunWriter.resume(path, kept[-1]) as again:
                    for k in range(kept[-1], last):
                        again.append(TIMES[k], motion(k))
                assert_bitwise(path, last)
        else:
            assert done == 0
        if not killed:
            break
    assert set(kept) == {0, 1, 2, 3}
    assert call > 100  # HDF5 is called seven times for a snapshot, forty times for a view
