"""Runs as files of other formats, read back by VTK and by numpy."""

import numpy as np
import pytest

from suffice.exporting import export_run
from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.store import Run


def test_vtk_finds_in_an_export_what_the_run_holds(tmp_path, write_stirred):
    pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLUnstructuredGridReader

    with Run(write_stirred(tmp_path / "run.h5")) as run:
        export_run(run, tmp_path / "out", "vtu")
        for k in (0, run.n_snapshots - 1):
            values = run.snapshot(k).values
            reader = vtkXMLUnstructuredGridReader()
            reader.SetFileName(str(tmp_path / "out" / f"particles.{k:06}.vtu"))
            reader.Update()
            data = reader.GetOutput()
            assert data.GetNumberOfCells() == run.n_particles
            assert data.GetCell(5).GetPointId(0) == 5
            assert np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), values["position"])
            assert np.array_equal(vtk_to_numpy(data.GetPointData().GetArray("velocity")), values["velocity"])
            assert np.array_equal(vtk_to_numpy(data.GetPointData().GetArray("radius")), run.radius)
            assert data.GetFieldData().GetArray("TimeValue").GetValue(0) == run.times[k]
            reader = vtkXMLImageDataReader()
            reader.SetFileName(str(tmp_path / "out" / f"fluid.{k:06}.vti"))
            reader.Update()
            data = reader.GetOutput()
            assert data.GetDimensions() == tuple(n + 1 for n in reversed(run.grid.shape))
            pressure = vtk_to_numpy(data.GetCellData().GetArray("pressure"))
            assert np.array_equal(pressure, values["fluid.pressure"].ravel())


@pytest.mark.parametrize("format", ["vtu", "npz"])
def test_an_export_comes_back_as_the_same_run(tmp_path, write_stirred, format):
    if format == "vtu":
        pytest.importorskip("vtkmodules.vtkIOXML")
    with Run(write_stirred(tmp_path / "run.h5")) as run:
        made = export_run(run, tmp_path / "out", format)
        assert made.files == {"vtu": 2 * run.n_snapshots + 2, "npz": run.n_snapshots}[format]
        files = [*made.folder.glob("*.pvd"), *made.folder.glob("*.npz")]
        import_run(files, tmp_path / "again.h5", precision="double")
        with Run(tmp_path / "again.h5") as again:
            assert (again.variables, again.grid) == (run.variables, run.grid)
            assert np.array_equal(again.times, run.times)
            for name in ("ids", "radius", "species"):
                assert np.array_equal(getattr(again, name), getattr(run, name))
            for name in run.variables:
                assert np.array_equal(again.variable(name)[:], run.variable(name)[:])


def test_an_export_that_is_interrupted_leaves_nothing(tmp_path, write_run):
    def stop(done, _of):
        if done == 3:
            raise KeyboardInterrupt

    with Run(write_run(tmp_path / "run.h5")) as run, pytest.raises(KeyboardInterrupt):
        export_run(run, tmp_path / "out", "npz", stop)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "run.particles.vtkhdf"]


def test_an_export_never_writes_into_a_folder_that_holds_something(tmp_path, write_run, suffice):
    run = write_run(tmp_path / "run.h5", n_snapshots=3)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    said = suffice("export", run, "--format", "vtu", "-o", tmp_path / "out")
    assert said.code == 2
    assert "exists and is not an empty folder; name another one" in said.err
    assert suffice("export", run, "--format", "stl", "-o", tmp_path / "new").code == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["mine.txt"]
    said = suffice("export", run, "--format", "npz", "-o", tmp_path / "new", "--json", "-")
    assert said.code == 0
    assert len(list((tmp_path / "new").glob("*.npz"))) == 3


def test_a_folder_left_by_a_killed_export_is_not_taken_for_ours(tmp_path, write_run):
    (tmp_path / "out.part").mkdir()
    with (
        Run(write_run(tmp_path / "run.h5")) as run,
        pytest.raises(Refusal, match=r"left from an export that was killed"),
    ):
        export_run(run, tmp_path / "out", "npz")
    assert (tmp_path / "out.part").exists()
