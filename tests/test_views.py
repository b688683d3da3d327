import os
import shutil
import signal
import subprocess
import sys
import time
from typing import NamedTuple

import h5py
import numpy as np
import pytest

import suffice.store
from suffice.quantities import Grid
from suffice.store import Run, RunWriter
from suffice.views import view_paths

N, STEPS = 30, 12
GRID = Grid((4, 3, 5), (0.1, 0.2, 0.3), (0.01, 0.02, 0.03))
TIMES = 0.001 * np.arange(STEPS)
MOTION = ("position", "velocity", "angular_velocity")
FIELDS = ("fluid.velocity", "fluid.pressure", "fluid.void_fraction")


def motion(k):
    """What the particles do in snapshot k, so that what is read can be told from what was written."""
    particle = np.arange(N)[:, None] + np.array([0.0, 0.25, 0.5])
    return {"position": np.sin(particle + k), "velocity": np.cos(particle + k), "angular_velocity": particle * k}


def fields(k):
    z, y, x = (GRID.origin[2 - i] + GRID.spacing[2 - i] * (np.arange(GRID.shape[i]) + 0.5) for i in range(3))
    z, y, x = np.meshgrid(z, y, x, indexing="ij")
    velocity = np.stack([x + k, y - k, z * k], axis=-1)
    return {"fluid.velocity": velocity, "fluid.pressure": 1000 * k + 9810 * z, "fluid.void_fraction": x * y}


def writer(path, n_snapshots=STEPS, **options):
    radius = 1e-3 + 1e-5 * np.arange(N)
    particles = {"ids": 7 * np.arange(N) + 3, "radius": radius, "species": np.arange(N) % 2}
    return RunWriter(path, **particles, n_snapshots=n_snapshots, provenance={}, **options)


def write(path, snapshots=STEPS):
    with writer(path, variables=MOTION + FIELDS, grid=GRID) as run:
        for k in range(snapshots):
            run.append(TIMES[k], motion(k) | fields(k))
    return view_paths(path)


class Scene(NamedTuple):
    """What VTK's own reader shows at one time."""

    data: object
    points: dict[str, np.ndarray]
    cells: dict[str, np.ndarray]


class View:
    """A view, opened by VTK's own reader."""

    def __init__(self, path):
        from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
        from vtkmodules.vtkIOHDF import vtkHDFReader

        self.reader = vtkHDFReader()
        self.reader.SetFileName(str(path))
        self.reader.UpdateInformation()
        steps = self.reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
        self.times = steps or (0.0,)  # VTK reports no time for a single step

    def at(self, time):
        from vtkmodules.util.numpy_support import vtk_to_numpy

        assert self.reader.UpdateTimeStep(time)
        data = self.reader.GetOutputDataObject(0)

        def arrays(attributes):
            found = [attributes.GetArray(i) for i in range(attributes.GetNumberOfArrays())]
            return {array.GetName(): vtk_to_numpy(array).copy() for array in found}

        points = arrays(data.GetPointData())
        if data.IsA("vtkPolyData"):
            points["position"] = vtk_to_numpy(data.GetPoints().GetData()).copy()
        return Scene(data, points, arrays(data.GetCellData()))


FORWARD_AND_BACK = [*range(STEPS), 3, 0, STEPS - 1]


def test_vtk_finds_every_particle_at_every_time(tmp_path):
    view = View(write(tmp_path / "run.h5")[0])
    assert np.array_equal(view.times, TIMES)
    for k in FORWARD_AND_BACK:
        scene = view.at(TIMES[k])
        for name, values in motion(k).items():
            assert np.array_equal(scene.points[name], values.astype(np.float32))
        assert np.array_equal(scene.points["id"], 7 * np.arange(N) + 3)
        assert np.array_equal(scene.points["radius"], 1e-3 + 1e-5 * np.arange(N))
        assert np.array_equal(scene.points["species"], np.arange(N) % 2)


def test_vtk_draws_one_vertex_per_particle(tmp_path):
    data = View(write(tmp_path / "run.h5")[0]).at(TIMES[5]).data
    assert (data.GetNumberOfCells(), data.GetNumberOfVerts()) == (N, N)
    assert [data.GetCell(i).GetPointId(0) for i in range(N)] == list(range(N))


def test_vtk_finds_the_fields_of_the_fluid_in_their_cells_at_every_time(tmp_path):
    view = View(write(tmp_path / "run.h5")[1])
    assert np.array_equal(view.times, TIMES)
    for k in FORWARD_AND_BACK:
        scene = view.at(TIMES[k])
        for name, values in fields(k).items():
            shown = scene.cells[name.removeprefix("fluid.")]
            assert np.array_equal(shown, values.astype(np.float32).reshape(shown.shape))


def test_the_cells_lie_where_the_grid_has_them(tmp_path):
    scene = View(write(tmp_path / "run.h5")[1]).at(TIMES[0])
    assert scene.data.GetDimensions() == (6, 4, 5)  # points along x, y, z
    assert np.allclose(scene.data.GetOrigin(), GRID.origin, rtol=1e-15)
    # at step 0 the velocity is the x and y of the cell centre; single precision
    for i in (0, 17, 59):
        low_x, high_x, low_y, high_y, *_ = scene.data.GetCell(i).GetBounds()
        assert np.allclose(scene.cells["velocity"][i, :2], [(low_x + high_x) / 2, (low_y + high_y) / 2], rtol=1e-6)


def test_a_run_without_fluid_has_no_fluid_view(tmp_path):
    with writer(tmp_path / "run.h5") as run:
        run.append(0.0, motion(0))
    particles, fluid = view_paths(tmp_path / "run.h5")
    assert particles.exists()
    assert not fluid.exists()


def test_a_view_holds_no_copy_of_the_data_and_moves_with_the_run(tmp_path):
    view, _ = write(tmp_path / "run.h5")
    with h5py.File(view) as file:
        link = file["VTKHDF"].get("Points", getlink=True)
        assert (link.filename, link.path) == ("run.h5", "particles/position")
    (tmp_path / "elsewhere").mkdir()
    for path in (tmp_path / "run.h5", view):
        shutil.move(path, tmp_path / "elsewhere" / path.name)
    scene = View(tmp_path / "elsewhere" / view.name).at(TIMES[2])
    assert np.array_equal(scene.points["position"], motion(2)["position"].astype(np.float32))


def test_a_view_opens_while_the_run_is_written_with_as_many_times_as_snapshots(tmp_path, monkeypatch):
    monkeypatch.setattr(suffice.store, "SECONDS_BETWEEN_VIEWS", 0.0)
    view, _ = view_paths(tmp_path / "run.h5")
    with writer(tmp_path / "run.h5") as run:
        for k in range(4):
            run.append(TIMES[k], motion(k))
            assert np.array_equal(View(view).times, TIMES[: k + 1])
        scene = View(view).at(TIMES[3])
        assert np.array_equal(scene.points["velocity"], motion(3)["velocity"].astype(np.float32))


def test_views_are_not_rewritten_at_every_snapshot_but_show_all_at_the_end(tmp_path):
    view, _ = view_paths(tmp_path / "run.h5")
    with writer(tmp_path / "run.h5") as run:
        run.append(TIMES[0], motion(0))
        first = view.stat().st_ino
        run.append(TIMES[1], motion(1))
        assert view.stat().st_ino == first
    assert np.array_equal(View(view).times, TIMES[:2])


@pytest.mark.physics
def test_vtk_finds_what_models_predict_of_particles_and_fluid(tmp_path, suffice):
    write(tmp_path / "run.h5")
    folders = []
    for variable in ("position", "fluid.velocity", "fluid.pressure"):
        folders.append(tmp_path / variable)
        said = suffice("train", tmp_path / "run.h5", "--variable", variable, "--interval", "0.002", "--surrogate",
                       "spline", "-o", folders[-1])  # fmt: skip
        assert said.code == 0, said.err
    for group, side in ((folders[:1], 0), (folders[1:], 1)):
        made = tmp_path / f"made.{side}.h5"
        said = suffice("predict", *group, "--times", "0:0.01:0.0005", "-o", made)
        assert said.code == 0, said.err
        view = View(view_paths(made)[side])
        with Run(made) as run:
            assert np.array_equal(view.times, run.times)
            for k in (0, 7, 20):
                scene, values = view.at(run.times[k]), run.snapshot(k).values
                assert {name.removeprefix("fluid.") for name in values} <= {*scene.points, *scene.cells}
                for name, rows in values.items():
                    shown = (scene.cells if side else scene.points)[name.removeprefix("fluid.")]
                    assert np.array_equal(shown, rows.reshape(shown.shape))


def test_the_view_of_the_fluid_begins_with_the_second_snapshot(tmp_path):
    assert [path.exists() for path in write(tmp_path / "one.h5", snapshots=1)] == [True, False]
    assert np.array_equal(View(write(tmp_path / "two.h5", snapshots=2)[1]).times, TIMES[:2])


def test_views_of_a_replaced_run_do_not_outlive_it(tmp_path):
    particles, fluid = write(tmp_path / "run.h5")
    with writer(tmp_path / "run.h5"):
        assert not particles.exists()
        assert not fluid.exists()


def write_until_killed(path, seconds_between_views):
    suffice.store.SECONDS_BETWEEN_VIEWS = float(seconds_between_views)
    print("begins", flush=True)
    with writer(path, n_snapshots=100_000, series=["index"]) as run:
        for k in range(100_000):
            run.append(0.001 * k, motion(k), {"index": k})


def killed_writer(path, after, seconds_between_views):
    """Write a run in another process and kill it `after` seconds."""
    command = [sys.executable, __file__, str(path), str(seconds_between_views)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(after)
        os.kill(process.pid, signal.SIGKILL)


def check_counted(run):
    """Every counted snapshot is what was written."""
    assert np.array_equal(run.times, 0.001 * np.arange(run.n_snapshots))
    assert np.array_equal(run.series["index"], np.arange(run.n_snapshots))
    for k in range(run.n_snapshots):
        for name, values in motion(k).items():
            assert np.array_equal(run.snapshot(k).values[name], values.astype(np.float32))


def check_view(path, counted):
    view = View(path)
    assert 1 <= len(view.times) <= counted
    for k in {0, len(view.times) // 2, len(view.times) - 1}:
        shown = view.at(view.times[k]).points
        for name, values in motion(k).items():
            assert np.array_equal(shown[name], values.astype(np.float32))


@pytest.mark.physics
def test_twenty_killed_writers_leave_every_counted_snapshot_and_views_that_open(tmp_path):
    chance = np.random.default_rng(20)
    counts = []
    for trial in range(20):
        path = tmp_path / f"{trial}.h5"
        killed_writer(path, chance.uniform(0.0, 0.5), seconds_between_views=trial % 2)
        if not path.exists():  # killed before all datasets were allocated
            continue
        with Run(path) as run:
            check_counted(run)
            counts.append(run.n_snapshots)
        if counts[-1] > 1:  # the first snapshot is counted before its view is written
            check_view(view_paths(path)[0], counts[-1])
    assert sum(count > 10 for count in counts) >= 10, counts  # most were killed while they wrote


if __name__ == "__main__":
    write_until_killed(*sys.argv[1:])
