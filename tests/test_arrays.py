"""Runs in named arrays: npz of numpy, HDF5 of any code, VTKHDF by VTK's own writer and by ours."""

import io
import os
import zipfile

import h5py
import numpy as np
import pytest

from suffice.readers import import_run
from suffice.refusal import Refusal
from suffice.store import Run

S, N = 5, 7
IDS = np.array([9, 4, 2, 8, 5, 7, 3])
TIMES = 0.002 * np.arange(S)


def motion():
    place = np.sin(IDS[:, None] + np.arange(3) + 0.1 * np.arange(S)[:, None, None])
    return {"position": place, "velocity": np.cos(place)}


def arrays(**changed):
    known = {**motion(), "time": TIMES, "id": IDS, "radius": 1e-3 + 1e-4 * IDS}
    return {name: rows for name, rows in (known | changed).items() if rows is not None}


def imported(sources, output, **options):
    import_run(sources, output, precision="double", **options)
    return Run(output)


def check(run, digits=0.0):
    order = np.argsort(IDS)
    assert np.array_equal(run.ids, np.sort(IDS))
    assert np.allclose(run.times, TIMES, rtol=digits, atol=0.0)
    assert np.array_equal(run.radius, 1e-3 + 1e-4 * np.sort(IDS))
    for k in range(S):
        for name, rows in motion().items():
            assert np.array_equal(run.snapshot(k).values[name], rows[k][order])


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_npz_of_all_snapshots_comes_in_whole(tmp_path, save):
    save(tmp_path / "a.npz", **arrays(other=np.zeros(3)))
    with imported(tmp_path / "a.npz", tmp_path / "run.h5") as run:
        check(run)
        assert run.provenance["ignored"] == "other"


def test_an_npz_for_each_snapshot_is_put_in_the_order_of_time(tmp_path):
    for k in range(S):
        mixed = np.random.default_rng(k).permutation(N)
        own = {name: rows[k][mixed] for name, rows in motion().items()}
        once = {"id": IDS[mixed], "radius": (1e-3 + 1e-4 * IDS)[mixed], "time": TIMES[k]}
        np.savez(tmp_path / f"part_{(3 * k) % S}.npz", **own, **once)
    with imported(sorted(tmp_path.glob("part_*.npz")), tmp_path / "run.h5") as run:
        check(run)


def test_h5md_is_read_by_mapping_its_datasets(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, rows in motion().items():
            file[f"particles/beads/{name}/value"] = rows
        file["particles/beads/position/time"] = TIMES
        file["particles/beads/velocity/time"] = h5py.SoftLink("/particles/beads/position/time")
        file["particles/beads/id/value"], file["particles/beads/size"] = IDS, 2 * (1e-3 + 1e-4 * IDS)
    inside = {"position": "position/value", "velocity": "velocity/value", "time": "velocity/time", "id": "id/value"}
    maps = [f"{what}=/particles/beads/{path}" for what, path in (inside | {"diameter": "size"}).items()]
    with imported(tmp_path / "a.h5", tmp_path / "run.h5", maps=maps) as run:
        check(run)
    with pytest.raises(Refusal, match=r"has no array position .*, it has particles; say which one .* --map position="):
        import_run(tmp_path / "a.h5", tmp_path / "run2.h5")


def grouped(path, digits=0):
    """A group for each snapshot, as many codes write: particles in another order each time."""
    with h5py.File(path, "w") as file:
        for k in range(S):
            mixed = np.random.default_rng(k).permutation(N)
            group = file.create_group(f"data/step_{4 * k:0{digits}}/beads")
            for name, rows in motion().items():
                group[name] = rows[k][mixed]
            group["id"], group["size"] = IDS[mixed], (1e-3 + 1e-4 * IDS)[mixed]
            group.attrs["time"], group["t"] = TIMES[k], [TIMES[k]]
        file["data/mesh/x"] = np.arange(3)
    return path


GROUPED = {"position": "position", "velocity": "velocity", "id": "id", "radius": "size", "time": "t"}


def maps_of(names, pattern="/data/step_*/beads/"):
    return [f"{what}={pattern}{name}" for what, name in names.items()]


def test_hdf5_with_a_group_for_each_snapshot_is_read_in_the_order_of_their_numbers(tmp_path):
    source = grouped(tmp_path / "a.h5")  # step_0, step_12, step_16, step_4, step_8 by their letters
    with imported(source, tmp_path / "run.h5", maps=maps_of(GROUPED)) as run:
        check(run)
    attribute = [
        *maps_of({what: name for what, name in GROUPED.items() if what != "time"}),
        "time=/data/step_*/beads@time",
    ]
    with imported(source, tmp_path / "run.h5", maps=attribute) as run:
        check(run)


def lost(path):
    with h5py.File(grouped(path), "r+") as file:
        del file["data/step_8/beads/id"]


def shrunk(path):
    with h5py.File(grouped(path), "r+") as file:
        group = file["data/step_8/beads"]
        for name in ("position", "velocity", "id", "size"):
            rows = group[name][:-1]
            del group[name]
            group[name] = rows


@pytest.mark.parametrize(
    ("make", "maps", "says"),
    [
        (grouped, {}, r"has no array position .* with a group for each snapshot NAME is /\*/"),
        (lost, GROUPED, r"/data/step_8/beads has no id; name the groups of the snapshots alone"),
        (shrunk, GROUPED, r"/data/step_8/beads/position has shape \(6, 3\), /data/step_0/beads/position has \(7, 3\)"),
        (grouped, GROUPED | {"time": "no"}, r"/data/step_0/beads has no no; name the groups"),
        (grouped, GROUPED | {"position": "position@no"}, r"has no number /data/step_0/beads/position@no"),
    ],
)
def test_groups_that_do_not_hold_the_same_are_refused(tmp_path, make, maps, says):
    make(tmp_path / "a.h5")
    with pytest.raises(Refusal, match=says):
        import_run(tmp_path / "a.h5", tmp_path / "run.h5", maps=maps_of(maps))


def test_datasets_of_other_snapshots_are_not_taken_together(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(S):
            file[f"place/{k}"] = motion()["position"][k]
            file[f"speed/{k if k < 3 else k + 1}"] = motion()["velocity"][k]
    maps = ["position=/place/*", "velocity=/speed/*"]
    with pytest.raises(Refusal, match=r"3 is in one of /place/\* and /speed/\* alone"):
        import_run(tmp_path / "a.h5", tmp_path / "run.h5", maps=maps, interval=0.002)


def test_arrays_without_ids_keep_their_rows_and_say_so(tmp_path):
    np.savez(tmp_path / "a.npz", **arrays(id=None))
    with imported(tmp_path / "a.npz", tmp_path / "run.h5") as run:
        assert np.array_equal(run.snapshot(2).values["position"], motion()["position"][2])
        assert "particle i is row i" in run.provenance["notes"]


def test_fields_on_a_grid_come_in_without_particles(tmp_path):
    shape = (2, 3, 4)
    wave = np.sin(np.arange(S)[:, None, None, None] + np.arange(24).reshape(shape))
    grid = {"grid.origin": np.zeros(3), "grid.spacing": np.array([0.1, 0.2, 0.3])}
    np.savez(tmp_path / "a.npz", time=TIMES, **{"fluid.pressure": wave, **grid})
    with imported(tmp_path / "a.npz", tmp_path / "run.h5") as run:
        assert (run.n_particles, run.grid.shape, run.variables) == (0, shape, ["fluid.pressure"])
        assert np.array_equal(run.snapshot(3).values["fluid.pressure"], wave[3])
    assert not (tmp_path / "run.particles.vtkhdf").exists()
    assert (tmp_path / "run.fluid.vtkhdf").exists()


def npz_of(**members):
    """The bytes of an archive of members that are bytes."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        for name, raw in members.items():
            archive.writestr(f"{name}.npy", raw)
    return target.getvalue()


def npy(header, data=b""):
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def truncated(path):
    np.savez(path, **arrays())
    path.write_bytes(path.read_bytes()[:-200])


def damaged(path):
    np.savez_compressed(path, **arrays())
    raw = bytearray(path.read_bytes())
    raw[200:260] = b"\x00" * 60
    path.write_bytes(raw)


def pickled(path):
    class Bomb:
        def __reduce__(self):
            return os.system, (f"touch {path}.ran",)

    np.savez(path, **arrays(position=np.array([Bomb()], dtype=object)))


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (truncated, r"a.npz cannot be read to its end"),
        (damaged, r"a.npz cannot be read to its end"),
        (pickled, r"position.npy holds object, not numbers"),
        (
            lambda path: path.write_bytes(
                npz_of(position=npy("{'descr': '<f8', 'fortran_order': False, 'shape': (9, 99999999999, 3)}"))
            ),
            r"position.npy declares 21599999999784 bytes and holds 0",
        ),
        (
            lambda path: path.write_bytes(npz_of(position=npy("{'descr': '<f8', 'shape': __import__('os').getcwd()}"))),
            r"a.npz cannot be read to its end",
        ),
        (lambda path: path.write_bytes(npz_of(position=npy("(" * 100))), r"a.npz cannot be read to its end"),
        (
            lambda path: np.savez_compressed(path, position=np.zeros((1, 6 * 10**6, 3), np.float32), time=np.zeros(1)),
            r"position unpacks to over 100 times its size",
        ),
        (lambda path: path.write_bytes(b"PK\x05\x06" + bytes(18)), r"has no array position"),
        (lambda path: np.savez(path, **arrays(position=np.zeros((S, N, 2)))), r"position has shape \(5, 7, 2\)"),
        (lambda path: np.savez(path, **arrays(velocity=np.zeros((S, N + 1, 3)))), r"velocity has shape \(5, 8, 3\)"),
        (lambda path: np.savez(path, **arrays(time=TIMES[:-1])), r"time has shape \(4,\), time needs \(5,\)"),
        (lambda path: np.savez(path, **arrays(time=TIMES[::-1])), r"time .* does not come after"),
        (lambda path: np.savez(path, **arrays(time=None)), r"give .* --interval SECONDS"),
        (lambda path: np.savez(path, **arrays(id=IDS + 0.5)), r"id holds numbers that are no integers"),
        (lambda path: np.savez(path, **arrays(id=np.full(N, 4))), r"particle id 4 stands there twice"),
        (
            lambda path: np.savez(path, **arrays(position=np.where(np.arange(S)[:, None, None] == 3, np.nan, 1.0)
                                                 * np.ones((S, N, 3)))),
            r"snapshot 3: particle id 2 has position = nan",
        ),
        (lambda path: np.savez(path, **arrays(id=IDS + (np.arange(S) == 2)[:, None])), r"snapshot 2: particle id 2 is"),
        (lambda path: np.savez(path, **arrays(**{"fluid.pressure": np.zeros((S, 2, 3, 4))})), r"no grid.origin"),
    ],
)  # fmt: skip
def test_arrays_that_do_not_fit_or_cannot_be_read_are_refused(tmp_path, spoil, says):
    source, output = tmp_path / "a.npz", tmp_path / "out"
    output.mkdir()
    spoil(source)
    with pytest.raises(Refusal, match=says) as refusal:
        import_run(source, output / "run.h5")
    assert "\n" not in str(refusal.value)
    assert list(output.iterdir()) == []
    assert not (tmp_path / "a.npz.ran").exists()


def test_an_absurd_dataset_of_hdf5_is_refused_before_it_is_read(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("position", (9, 10**11, 3), "f4", chunks=(1, 1000, 3))
    with pytest.raises(Refusal, match=r"/position declares 10800000000000 bytes and holds 0"):
        import_run(tmp_path / "a.h5", tmp_path / "run.h5", interval=1.0)


def linked_to_another(path):
    with h5py.File(path.parent / "secret.h5", "w") as other:
        other["position"] = motion()["position"]
    with h5py.File(path, "w") as file:
        file["position"] = h5py.ExternalLink("secret.h5", "position")


def stored_elsewhere(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("position", (S, N, 3), "f8", external=[(str(path.parent / "raw"), 0, S * N * 24)])


def virtual(path):
    linked_to_another(path)
    layout = h5py.VirtualLayout((S, N, 3), "f8")
    layout[...] = h5py.VirtualSource(str(path.parent / "secret.h5"), "position", (S, N, 3))
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("position", layout)


def in_circles(path):
    with h5py.File(path, "w") as file:
        file["position"], file["b"] = h5py.SoftLink("/b"), h5py.SoftLink("/position")


@pytest.mark.parametrize("make", [linked_to_another, stored_elsewhere, virtual, in_circles])
def test_hdf5_that_leads_out_of_itself_is_refused(tmp_path, make):
    make(tmp_path / "a.h5")
    with pytest.raises(Refusal, match=r"leads out of the file|lies in another file"):
        import_run(tmp_path / "a.h5", tmp_path / "run.h5", interval=1.0)


def test_a_run_is_not_imported_as_foreign(tmp_path, write_run):
    with pytest.raises(Refusal, match=r"is a run already"):
        import_run(write_run(tmp_path / "a.h5"), tmp_path / "run.h5")


def test_the_views_beside_a_run_give_the_run_again(tmp_path, write_stirred):
    source = write_stirred(tmp_path / "a.h5")
    views = [tmp_path / "a.particles.vtkhdf", tmp_path / "a.fluid.vtkhdf"]
    with Run(source) as run, imported(views, tmp_path / "b.h5") as again:
        assert again.variables == run.variables
        assert again.grid == run.grid
        assert np.array_equal(again.times, run.times)
        for name in run.variables:
            assert np.array_equal(again.variable(name)[:], run.variable(name)[:])


def test_a_view_that_links_to_a_file_elsewhere_is_refused(tmp_path, write_run):
    write_run(tmp_path / "a.h5")
    view = tmp_path / "a.particles.vtkhdf"
    (tmp_path / "other").mkdir()
    (tmp_path / "a.h5").rename(tmp_path / "other" / "a.h5")
    for path in ("other/a.h5", str(tmp_path / "other" / "a.h5"), "../a.h5"):
        with h5py.File(view, "r+") as file:
            del file["VTKHDF/Points"]
            file["VTKHDF/Points"] = h5py.ExternalLink(path, "particles/position")
        with pytest.raises(Refusal, match=r"is a link that leads out of the file"):
            import_run(view, tmp_path / "b.h5")


def test_vtkhdf_by_the_writer_of_vtk_is_read_at_all_its_times(tmp_path):
    pytest.importorskip("vtkmodules.vtkIOHDF")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
    from vtkmodules.vtkIOHDF import vtkHDFWriter

    class Moving(VTKPythonAlgorithmBase):
        def __init__(self):
            VTKPythonAlgorithmBase.__init__(self, nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")

        def RequestInformation(self, request, inputs, outputs):  # noqa: ARG002, N802
            info = outputs.GetInformationObject(0)
            info.Set(Pipeline.TIME_STEPS(), TIMES, len(TIMES))
            info.Set(Pipeline.TIME_RANGE(), [TIMES[0], TIMES[-1]], 2)
            return 1

        def RequestData(self, request, inputs, outputs):  # noqa: ARG002, N802
            info = outputs.GetInformationObject(0)
            k = int(np.argmin(np.abs(TIMES - info.Get(Pipeline.UPDATE_TIME_STEP()))))
            data, points = vtkPolyData.GetData(outputs), vtkPoints()
            points.SetData(numpy_to_vtk(motion()["position"][k], deep=True))
            data.SetPoints(points)
            data.GetInformation().Set(data.DATA_TIME_STEP(), TIMES[k])
            for name, rows in (("velocity", motion()["velocity"][k]), ("id", IDS), ("radius", 1e-3 + 1e-4 * IDS)):
                array = numpy_to_vtk(rows, deep=True)
                array.SetName(name)
                data.GetPointData().AddArray(array)
            return 1

    source, writer = Moving(), vtkHDFWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetFileName(str(tmp_path / "a.vtkhdf"))
    writer.SetWriteAllTimeSteps(True)
    writer.Write()
    with imported(tmp_path / "a.vtkhdf", tmp_path / "run.h5") as run:
        check(run, 1e-7)  # VTK writes times in single precision
