"""VTK files as their writers make them, and as damage and malice make them."""

import json
import os
import re
import struct
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest

from suffice.quantities import Grid
from suffice.readers import import_run, vtk_process
from suffice.readers.vtkhdf import VtkHdf
from suffice.refusal import Refusal
from suffice.store import Run
from suffice.xml_vtk import write_fields, write_list, write_particles

pytest.importorskip("vtkmodules.vtkIOLegacy")

N = 6
GRID = Grid((2, 3, 4), (0.1, 0.2, 0.3), (0.01, 0.02, 0.03))


def beads(k):
    """Positions, ids in another order each time, and velocities of snapshot k."""
    ids = np.random.default_rng(k).permutation(N) + 3
    place = np.sin(ids[:, None] + np.arange(3) + 0.1 * k)
    return place, {"id": ids, "velocity": np.cos(place), "radius": 1e-3 + 1e-4 * ids}


def vtu_files(folder, snapshots=4, **changed):
    files = []
    for k in range(snapshots):
        place, arrays = beads(k)
        files.append(folder / f"beads_{100 * k}.vtu")
        write_particles(files[-1], 0.01 * k, place, arrays | changed)
    return files


def legacy_files(folder, snapshots=3, binary=False):
    """Files as LIGGGHTS's older versions write them, without any time."""
    files = []
    for k in range(snapshots):
        place, arrays = beads(k)
        files.append(folder / f"dump{100 * k}.vtk")
        kind = "BINARY" if binary else "ASCII"
        parts = [f"# vtk DataFile Version 3.0\nmade up\n{kind}\nDATASET POLYDATA\nPOINTS {N} double\n".encode()]

        def numbers(values, kind=">f8"):
            return (
                np.asarray(values).astype(kind).tobytes()
                if binary
                else (" ".join(repr(float(x)) if kind == ">f8" else str(int(x)) for x in np.ravel(values)).encode())
            )

        parts += [numbers(place), f"\nVERTICES {N} {2 * N}\n".encode()]
        parts += [numbers([[1, i] for i in range(N)], ">i4"), f"\nPOINT_DATA {N}\n".encode()]
        parts += [b"SCALARS id int 1\nLOOKUP_TABLE default\n", numbers(arrays["id"], ">i4")]
        parts += [b"\nSCALARS radius double 1\nLOOKUP_TABLE default\n", numbers(arrays["radius"])]
        parts += [b"\nVECTORS v double\n", numbers(arrays["velocity"]), b"\n"]
        files[-1].write_bytes(b"".join(parts))
    return files


def check(run, snapshots):
    assert (run.n_snapshots, run.n_particles) == (snapshots, N)
    for k in range(snapshots):
        place, arrays = beads(k)
        order, values = np.argsort(arrays["id"]), run.snapshot(k).values
        assert np.array_equal(values["position"], place[order])
        assert np.array_equal(values["velocity"], arrays["velocity"][order])
        assert np.array_equal(run.radius, np.sort(arrays["radius"]))


def imported(sources, output, **options):
    import_run(sources, output, precision="double", **options)
    return Run(output)


@pytest.mark.parametrize("binary", [False, True], ids=["ascii", "binary"])
def test_legacy_files_are_put_in_the_order_of_their_numbers(tmp_path, binary):
    files = legacy_files(tmp_path, binary=binary)
    with imported(files[::-1], tmp_path / "run.h5", timestep=1e-4) as run:
        check(run, 3)
        assert np.allclose(run.times, [0, 0.01, 0.02], rtol=1e-15)


def test_xml_files_may_say_their_times_themselves_or_in_a_list(tmp_path):
    files = vtu_files(tmp_path)
    with imported(files, tmp_path / "run.h5") as run:
        check(run, 4)
        assert np.allclose(run.times, [0, 0.01, 0.02, 0.03], rtol=1e-15)
    write_list(tmp_path / "a.pvd", [file.name for file in files], [0.5, 0.75, 1.0, 1.5])
    with imported(tmp_path / "a.pvd", tmp_path / "run.h5") as run:
        check(run, 4)
        assert run.times.tolist() == [0.5, 0.75, 1.0, 1.5]
    named = [{"name": file.name, "time": 2.0 * k} for k, file in enumerate(files)]
    (tmp_path / "a.vtu.series").write_text(json.dumps({"file-series-version": "1.0", "files": named}))
    with imported(tmp_path / "a.vtu.series", tmp_path / "run.h5") as run:
        assert run.times.tolist() == [0.0, 2.0, 4.0, 6.0]


def test_vtp_as_mfix_writes_it_is_read_with_its_list(tmp_path):
    files = []
    for k in range(3):
        place, arrays = beads(k)
        rows = {"Diameter": 2 * arrays["radius"], "Velocity": arrays["velocity"], "ID": arrays["id"]}
        text = "".join(
            f'<DataArray type="Float32" Name="{name}" NumberOfComponents="{np.ndim(rows[name]) * 2 - 1}" '
            f'format="ascii">{" ".join(f"{x:14.6E}" for x in np.ravel(rows[name]))}</DataArray>'
            for name in rows
        )
        points = " ".join(f"{x:14.6E}" for x in place.ravel())
        files.append(tmp_path / f"BED_DES_{k:05}.vtp")
        files[-1].write_text(
            '<?xml version="1.0"?>\n<!-- Time =  0.5s -->\n'
            '<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian">\n<PolyData>'
            f'<Piece NumberOfPoints="{N:010}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0">'
            f'<Points><DataArray type="Float32" Name="Position" NumberOfComponents="3" format="ascii">{points}'
            f'</DataArray></Points><PointData Scalars="Diameter" Vectors="Velocity">{text}</PointData>'
            "<CellData></CellData><Verts></Verts><Lines></Lines><Strips></Strips><Polys></Polys>"
            "</Piece></PolyData></VTKFile>"
        )
    write_list(tmp_path / "BED_DES.pvd", [file.name for file in files], [0.0, 0.1, 0.2])
    with imported(tmp_path / "BED_DES.pvd", tmp_path / "run.h5") as run:
        place, arrays = beads(2)
        order = np.argsort(arrays["id"])
        assert np.allclose(run.snapshot(2).values["position"], place[order], rtol=1e-6)
        assert np.allclose(run.radius, np.sort(arrays["radius"]), rtol=1e-6)


def fields(k):
    z, y, x = np.meshgrid(*[np.arange(n) for n in GRID.shape], indexing="ij")
    return {
        "velocity": np.stack([x + k, y - k, z * k], axis=-1).astype(float),
        "pressure": x + 10.0 * y + 100.0 * z + k,
    }


def test_particles_and_fields_of_the_same_times_make_one_run(tmp_path):
    vtu_files(tmp_path)
    for k in range(4):
        write_fields(tmp_path / f"air_{k}.vti", 0.01 * k, GRID, fields(k))
    sources = [*tmp_path.glob("*.vtu"), *tmp_path.glob("*.vti")]
    with imported(sources, tmp_path / "run.h5") as run:
        check(run, 4)
        assert run.grid == GRID
        for k in range(4):
            assert np.array_equal(run.snapshot(k).values["fluid.velocity"], fields(k)["velocity"])
            assert np.array_equal(run.snapshot(k).values["fluid.pressure"], fields(k)["pressure"])
    (tmp_path / "air_3.vti").unlink()
    with pytest.raises(Refusal, match="4 snapshots of particles and 3 of fields; give the files of the same times"):
        import_run([*tmp_path.glob("*.vtu"), *tmp_path.glob("*.vti")], tmp_path / "other.h5")


def hexahedra(edges):
    """The text of an unstructured mesh of the boxes between edges along x, y, z, its cells in reverse order."""
    nx, ny, nz = (len(edge) for edge in edges)
    points = [(x, y, z) for z in edges[2] for y in edges[1] for x in edges[0]]
    cells = [
        [i + nx * (j + ny * k) + c for c in (0, 1, 1 + nx, nx, nx * ny, 1 + nx * ny, 1 + nx + nx * ny, nx + nx * ny)]
        for k in range(nz - 1) for j in range(ny - 1) for i in range(nx - 1)
    ][::-1]  # fmt: skip
    middles = [np.mean([points[i] for i in cell], axis=0) for cell in cells]
    lines = ["# vtk DataFile Version 3.0", "mesh", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(points)} double"]
    lines += [" ".join(map(str, point)) for point in points] + [f"CELLS {len(cells)} {9 * len(cells)}"]
    lines += [" ".join(map(str, [8, *cell])) for cell in cells] + [f"CELL_TYPES {len(cells)}", *["12"] * len(cells)]
    lines += [f"CELL_DATA {len(cells)}", "VECTORS U double", *(" ".join(map(str, middle)) for middle in middles)]
    return "\n".join(lines) + "\n"


def test_hexahedra_that_fill_a_box_are_a_grid_whatever_their_order(tmp_path):
    vtu_files(tmp_path, 1)
    (tmp_path / "mesh.vtk").write_text(hexahedra([np.linspace(0, 1, 5), np.linspace(2, 3, 4), np.linspace(0, 3, 3)]))
    with imported([tmp_path / "beads_0.vtu", tmp_path / "mesh.vtk"], tmp_path / "run.h5", interval=1.0) as run:
        assert run.grid.shape == (2, 3, 4)
        assert np.allclose(run.grid.spacing, (0.25, 1 / 3, 1.5), rtol=1e-12)
        velocity = run.snapshot(0).values["fluid.velocity"]  # the middle of each cell
        assert np.allclose(velocity[0, 0, :, 0], [0.125, 0.375, 0.625, 0.875])
        assert np.allclose(velocity[0, :, 0, 1], 2 + np.array([1, 3, 5]) / 6)
        assert np.allclose(velocity[:, 0, 0, 2], [0.75, 2.25])


def test_a_graded_mesh_is_refused_with_the_reason_and_can_be_left_out(tmp_path):
    vtu_files(tmp_path, 1)
    (tmp_path / "mesh.vtk").write_text(hexahedra([[0.0, 1.0, 3.0], [0.0, 1.0], [0.0, 1.0]]))
    sources = [tmp_path / "beads_0.vtu", tmp_path / "mesh.vtk"]
    with pytest.raises(Refusal, match=r"cells are not all alike, from 1 to 2 m along x; .* --map fluid=none"):
        import_run(sources, tmp_path / "run.h5", interval=1.0)
    with imported(sources, tmp_path / "run.h5", interval=1.0, maps=["fluid=none"]) as run:
        assert run.grid is None


def test_an_array_of_another_name_is_mapped(tmp_path):
    place, arrays = beads(0)
    renamed = {"number": arrays["id"], "w": arrays["velocity"], "u": -arrays["velocity"]}
    write_particles(tmp_path / "a_0.vtu", 0.0, place, renamed)
    with pytest.raises(Refusal, match=r"none is the id of the particles; write the ids, or say .* --map id=NAME"):
        import_run(tmp_path / "a_0.vtu", tmp_path / "run.h5")
    with imported(tmp_path / "a_0.vtu", tmp_path / "run.h5", maps=["id=number", "velocity=w"]) as run:
        assert np.array_equal(run.snapshot(0).values["velocity"], arrays["velocity"][np.argsort(arrays["id"])])


def test_particles_that_jump_across_a_periodic_face_are_told(tmp_path):
    for k in range(5):
        place, arrays = beads(0)
        at = np.argsort(arrays["id"])
        place[at, 0] = (0.12 + 0.15 * np.arange(N) + 0.04 * k) % 1.0  # id 8 is at 0.87, 0.91, 0.95, 0.99 m
        write_particles(tmp_path / f"beads_{k}.vtu", 0.01 * k, place, arrays)
    made = import_run([*tmp_path.glob("*.vtu")], tmp_path / "run.h5")
    told = r"1 times a particle jumps by over half of the extent of all, first id 8 along x to .*beads_4.vtu: unwrap"
    assert re.search(told, made.notes[-1])
    with Run(tmp_path / "run.h5") as run:
        assert run.provenance["notes"].splitlines()[-1] == made.notes[-1]
    assert not any("jumps" in note for note in import_run(vtu_files(tmp_path), tmp_path / "run.h5").notes)


def without_ids(folder):
    place, arrays = beads(3)
    write_particles(folder / "beads_300.vtu", 0.03, place[:-1], {name: rows[:-1] for name, rows in arrays.items()})


def without_particles(folder):
    for k in range(4):
        none = {name: rows[:0] for name, rows in beads(k)[1].items()} if k == 2 else beads(k)[1]
        write_particles(folder / f"beads_{100 * k}.vtu", 0.01 * k, beads(k)[0][: len(none["id"])], none)


def with_a_nan(folder):
    place, arrays = beads(1)
    arrays["velocity"][2, 1] = np.nan
    write_particles(folder / "beads_100.vtu", 0.01, place, arrays)


def without_velocity(folder):
    place, arrays = beads(1)
    write_particles(folder / "beads_100.vtu", 0.01, place, {name: arrays[name] for name in ("id", "radius")})


def cut(folder, at=0.7):
    file = folder / "beads_200.vtu"
    file.write_bytes(file.read_bytes()[: int(at * file.stat().st_size)])


def entities(folder):
    """A billion laughs, a thousand of them."""
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 4))
    file = folder / "beads_200.vtu"
    text = file.read_bytes().replace(
        b'<?xml version="1.0"?>', f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY l0 "ha">{laughs}]>'.encode()
    )
    file.write_bytes(text)


def entities_behind_a_comment(folder):
    file = folder / "beads_200.vtu"
    comment = b'<!-- <VTKFile type="UnstructuredGrid"> -->'
    hidden = comment + b'<!DOCTYPE x [<!ENTITY l SYSTEM "/etc/passwd">]>'
    first = b'<?xml version="1.0"?>'
    file.write_bytes(file.read_bytes().replace(first, first + hidden))


def absurd_number_of_points(folder):
    file = folder / "beads_200.vtu"
    file.write_bytes(file.read_bytes().replace(b'NumberOfPoints="6"', b'NumberOfPoints="600000000000"'))


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (without_ids, r"beads_300.vtu: particle id \d is missing \(1 of 6 lost since .*beads_0.vtu\)"),
        (without_particles, r"beads_200.vtu holds no particles; leave snapshots without particles out"),
        (with_a_nan, r"beads_100.vtu: particle id \d has velocity = nan, not a finite number"),
        (without_velocity, r"beads_100.vtu has no array velocity, which the first snapshot has"),
        (cut, r"beads_200.vtu (cannot be read to its end|stops VTK's reader)"),
        (lambda folder: cut(folder, 0.2), r"beads_200.vtu (cannot be read to its end|stops VTK's reader)"),
        (entities, r"beads_200.vtu declares a document type, which may hold entities"),
        (entities_behind_a_comment, r"beads_200.vtu declares a document type, which may hold entities"),
        (absurd_number_of_points, r"beads_200.vtu (cannot be read to its end|stops VTK's reader)"),
    ],
)
def test_vtk_files_that_cannot_be_followed_are_refused_and_leave_nothing(tmp_path, spoil, says):
    vtu_files(tmp_path)
    spoil(tmp_path)
    (tmp_path / "out").mkdir()
    with pytest.raises(Refusal, match=says) as refusal:
        import_run([*tmp_path.glob("*.vtu")], tmp_path / "out" / "run.h5")
    assert "\n" not in str(refusal.value)
    assert list((tmp_path / "out").iterdir()) == []


def test_a_block_that_declares_an_exabyte_gives_the_numbers_it_holds(tmp_path):
    files = vtu_files(tmp_path)
    head, mark, data = files[2].read_bytes().partition(b'encoding="raw">_')
    files[2].write_bytes(head + mark + struct.pack("<Q", 1 << 60) + data[8:])
    with imported(files, tmp_path / "run.h5") as run:
        check(run, 4)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text[:-30],
        lambda text: text.replace(b"POINTS 6", b"POINTS 600000000000"),
        lambda text: text.replace(b"POINT_DATA 6", b"POINT_DATA 6000000000"),
        lambda text: text.replace(b"VERTICES 6 12", b"VERTICES 6 1200000000000"),
        lambda text: text.replace(b"DATASET POLYDATA", b"DATASET NONSENSE"),
    ],
    ids=["half", "end", "points", "point data", "vertices", "kind"],
)
@pytest.mark.parametrize("binary", [False, True], ids=["ascii", "binary"])
def test_a_damaged_legacy_file_is_refused(tmp_path, spoil, binary):
    files = legacy_files(tmp_path, binary=binary)
    files[1].write_bytes(spoil(files[1].read_bytes()))
    with pytest.raises(Refusal, match=r"dump100.vtk"):
        import_run(files, tmp_path / "run.h5", timestep=1e-4)
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('<DataSet timestep="0" file="../secret.vtu"/>', r"outside its folder; move the files beside it"),
        ('<DataSet timestep="0" file="/etc/passwd"/>', r"outside its folder"),
        ('<DataSet timestep="0" file="none.vtu"/>', r"none.vtu is missing"),
        ('<DataSet timestep="soon" file="beads_0.vtu"/>', r"no whole list of files with their times"),
        ('<DataSet file="beads_0.vtu"/>', r"no whole list"),
        ('<DataSet timestep="0" file="beads_0.vtu">', r"no whole list"),
        ("", r"lists no files"),
        (
            '<DataSet timestep="0" file="beads_0.vtu"/><DataSet timestep="0" file="beads_100.vtu"/>',
            r"beads_0.vtu: particle id 3 stands there twice",
        ),
        ('<DataSet timestep="0" file="a.pvd"/>', r"a.pvd is a VTK file of type Collection"),
        ('<DataSet timestep="nan" file="beads_0.vtu"/>', r"time of snapshot 0 is nan s"),
    ],
)
def test_a_list_that_names_no_files_of_its_folder_is_refused(tmp_path, text, says):
    vtu_files(tmp_path)
    (tmp_path / "a.pvd").write_text(f'<VTKFile type="Collection"><Collection>{text}</Collection></VTKFile>')
    with pytest.raises(Refusal, match=says):
        import_run(tmp_path / "a.pvd", tmp_path / "run.h5")


def in_parts(folder, ghosts):
    """Particles of every snapshot in two files; with ghosts, each of them also holds one of the other's."""
    parts = []
    for k in range(4):
        place, arrays = beads(k)
        for part, rows in enumerate((np.arange(N) < 2, np.arange(N) >= 2)):
            hidden = ~rows & (np.arange(N) == (5 if part == 0 else 0)) & ghosts
            held = {name: values[rows | hidden] for name, values in arrays.items()}
            held |= {"vtkGhostType": hidden[rows | hidden].astype(np.uint8)} if ghosts else {}
            parts.append(f"parts/beads_{k}_{part}.vtu")
            (folder / "parts").mkdir(exist_ok=True)
            write_particles(folder / parts[-1], 0.01 * k, place[rows | hidden], held)
    return parts


def list_of_parts(path, parts):
    pieces = "".join(f'<Piece Source="{part}"/>' for part in parts)
    path.write_text(f'<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>')


def test_files_at_one_time_of_a_list_are_the_parts_of_one_snapshot_without_their_ghosts(tmp_path):
    parts = in_parts(tmp_path, ghosts=True)
    write_list(tmp_path / "a.pvd", parts, [0.01 * (i // 2) for i in range(len(parts))])
    with imported(tmp_path / "a.pvd", tmp_path / "run.h5") as run:
        check(run, 4)
    for k in range(4):
        list_of_parts(tmp_path / f"beads_{k}.pvtu", parts[2 * k : 2 * k + 2])
    with imported([*tmp_path.glob("*.pvtu")], tmp_path / "run.h5") as run:
        check(run, 4)
        assert np.allclose(run.times, [0, 0.01, 0.02, 0.03], rtol=1e-15)


@pytest.mark.parametrize(
    ("named", "says"),
    [
        (["parts/beads_0_0.vtu", "../parts/beads_0_1.vtu"], r"lists '../parts/beads_0_1.vtu', outside its folder"),
        (["parts/beads_0_0.vtu", "/etc/passwd"], r"lists '/etc/passwd', outside its folder"),
        (["parts/beads_0_0.vtu", "parts/none.vtu"], r"none.vtu is missing"),
        (["parts/beads_0_0.vtu"] * 2, r"a_0.pvtu: particle id \d stands there twice"),
        (["parts/beads_0_0.vtu"], r"a_1.pvtu: particle id \d is new"),
        (["a_0.pvtu"], r"a_0.pvtu is a VTK file of type PUnstructuredGrid"),
        (["parts/beads_0_0.vtu", "air.vti"], r"is made of image and particles in 2 parts; give the files of the"),
    ],
)
def test_a_list_of_parts_that_are_not_those_of_one_snapshot_is_refused(tmp_path, named, says):
    parts = in_parts(tmp_path, ghosts=False)
    write_fields(tmp_path / "air.vti", 0.0, GRID, fields(0))
    list_of_parts(tmp_path / "a_0.pvtu", named)
    list_of_parts(tmp_path / "a_1.pvtu", parts[2:4])
    with pytest.raises(Refusal, match=says):
        import_run([tmp_path / "a_0.pvtu", tmp_path / "a_1.pvtu"], tmp_path / "run.h5")


def test_the_parts_of_a_mesh_fill_one_box(tmp_path):
    x = np.linspace(0, 1, 5)
    (tmp_path / "left.vtk").write_text(hexahedra([x[:3], np.linspace(2, 3, 4), np.linspace(0, 3, 3)]))
    (tmp_path / "right.vtk").write_text(hexahedra([x[2:], np.linspace(2, 3, 4), np.linspace(0, 3, 3)]))
    write_list(tmp_path / "a.pvd", ["left.vtk", "right.vtk"], [0.5, 0.5])
    with imported(tmp_path / "a.pvd", tmp_path / "run.h5") as run:
        assert run.grid.shape == (2, 3, 4)
        velocity = run.snapshot(0).values["fluid.velocity"]  # the middle of each cell
        assert np.allclose(velocity[0, 0, :, 0], [0.125, 0.375, 0.625, 0.875])
        assert np.allclose(velocity[0, :, 0, 1], 2 + np.array([1, 3, 5]) / 6)


def test_files_told_apart_by_their_folder_are_put_in_the_order_of_the_times_in_them(tmp_path):
    for k in (10, 9, 8):  # as foamToVTK writes fields: case_1000/internal.vtu
        (tmp_path / f"case_{k}").mkdir()
        place, arrays = beads(10 - k)
        write_particles(tmp_path / f"case_{k}" / "internal.vtu", 0.01 * (10 - k), place, arrays)
    with imported(sorted(tmp_path.glob("case_*/internal.vtu")), tmp_path / "run.h5") as run:
        check(run, 3)


def test_parcels_of_openfoam_are_told_apart_by_the_processor_where_they_were_born(tmp_path):
    for k in range(2):
        place, arrays = beads(k)
        born = {"origId": arrays["id"] // 2, "origProcId": arrays["id"] % 2, "U": arrays["velocity"]}
        write_particles(tmp_path / f"cloud_{k}.vtu", 0.01 * k, place, born)
    with imported([*tmp_path.glob("*.vtu")], tmp_path / "run.h5") as run:
        ids = np.arange(N) + 3
        assert np.array_equal(run.ids, np.sort(ids // 2 + (ids % 2) * 2**32))
        order = np.argsort(ids // 2 + (ids % 2) * 2**32)
        place, arrays = beads(1)
        there = place[np.argsort(arrays["id"])][order]
        assert np.array_equal(run.snapshot(1).values["position"], there)


def test_files_without_any_time_need_the_timestep_or_the_interval(tmp_path):
    with pytest.raises(Refusal, match=r"--timestep SECONDS, or .* --interval SECONDS"):
        import_run(legacy_files(tmp_path), tmp_path / "run.h5")


def test_two_kinds_of_particles_are_told_apart_and_refused(tmp_path):
    files = vtu_files(tmp_path, 2)
    place, arrays = beads(0)
    write_particles(tmp_path / "others_0.vtu", 0.0, place, arrays)
    with pytest.raises(Refusal, match=r"hold particles of 2 kinds, such as .*beads_0.vtu and .*others_0.vtu"):
        import_run([*files, tmp_path / "others_0.vtu"], tmp_path / "run.h5")


def test_without_vtk_the_command_says_how_to_install_it(tmp_path, monkeypatch):
    (tmp_path / "vtkmodules.py").write_text("raise ModuleNotFoundError('vtkmodules')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(Refusal, match="pip install vtk"):
        import_run(vtu_files(tmp_path, 2), tmp_path / "run.h5")


def readers_running():
    """The processes of ours that read with VTK."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # those that end meanwhile
            parent = (place / "stat").read_text().rpartition(")")[2].split()[1]
            if int(parent) == os.getpid() and b"vtk_program.py" in (place / "cmdline").read_bytes():
                found.append(place.name)
    return found


def test_no_reader_is_left_behind_where_an_import_is_refused_in_the_middle(tmp_path):
    files = vtu_files(tmp_path)
    cut(tmp_path)
    with pytest.raises(Refusal):
        import_run(files, tmp_path / "run.h5")
    assert readers_running() == []


def test_an_import_that_is_interrupted_leaves_neither_a_file_nor_a_reader(tmp_path):
    running = []

    def stop(done, _of):
        running.extend(readers_running())
        if done == 2:
            raise KeyboardInterrupt

    files = vtu_files(tmp_path)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt):
        import_run(files, tmp_path / "run.h5", progress=stop)
    assert running
    assert readers_running() == []
    assert sorted(tmp_path.iterdir()) == before


def test_a_reader_that_wants_more_memory_than_it_may_have_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(vtk_process, "MEMORY_OF_VTK", 200 << 20)  # less than VTK takes by itself
    monkeypatch.setattr(vtk_process, "MEMORY_PER_BYTE", 0)
    with pytest.raises(Refusal, match=r"beads_0.vtu (cannot be read to its end|stops VTK's reader)"):
        import_run(vtu_files(tmp_path), tmp_path / "run.h5")


def test_a_vtkhdf_whose_group_is_none_is_refused(tmp_path):
    with h5py.File(tmp_path / "odd.vtkhdf", "w") as file:
        file["VTKHDF"] = np.zeros(3)
    with pytest.raises(Refusal, match="VTKHDF is no group in it; write it again"):
        VtkHdf(tmp_path / "odd.vtkhdf")
