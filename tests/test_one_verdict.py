"""One run of LAMMPS, brought in by every format that holds it whole, gets one verdict: the same numbers of modes."""

import lzma

import h5py
import numpy as np
import pytest

from suffice.exporting import export_run
from suffice.readers import import_run
from suffice.selecting import select_run
from suffice.store import Run
from suffice.views import view_paths

VARIABLES = ["position.x", "velocity.z"]


def verdict(path):
    """What was decided at every Δτ."""
    with Run(path) as run:
        table = select_run(run, VARIABLES)
        return {
            name: [(c.interval, c.n_snapshots, c.n_lr, c.n_lr_paper, c.n_c, c.verdict) for c in table[name].candidates]
            for name in VARIABLES
        }


@pytest.fixture
def original(unpacked, tmp_path):
    """The run as it came from LAMMPS, and its verdict."""
    import_run(unpacked("lammps", "sheared") / "scaled.dump.gz", tmp_path / "run.h5", precision="double")
    return tmp_path / "run.h5"


def values_of(run, k):
    """One snapshot with its particles shuffled."""
    mixed = np.random.default_rng(k).permutation(run.n_particles)
    once = {"id": run.ids, "radius": run.radius, "type": run.species}
    return {name: np.asarray(rows)[mixed] for name, rows in (run.snapshot(k).values | once).items()}


def as_text(run, folder):
    columns = "id type x y z vx vy vz radius"
    for k in range(run.n_snapshots):
        values = values_of(run, k)
        rows = np.column_stack([values[name] for name in ("id", "type", "position", "velocity", "radius")])
        head = f"ITEM: TIME\n{float(run.times[k])!r}\nITEM: TIMESTEP\n{k}\nITEM: NUMBER OF ATOMS\n{len(rows)}\n"
        lines = [f"{int(i)} {int(t)} {' '.join(repr(float(x)) for x in rest)}" for i, t, *rest in rows]
        box = "ITEM: BOX BOUNDS ff ff ff\n" + 3 * "0 1\n"
        text = f"{head}{box}ITEM: ATOMS {columns}\n" + "\n".join(lines) + "\n"
        (folder / f"a.{k}.dump.xz").write_bytes(lzma.compress(text.encode()))
    return [*folder.iterdir()], {}


def as_mfix(run, folder):
    """Text as the source of MFiX writes it (write_des_data.f), in more digits: no MFiX runs here."""
    named = {"Diameter": "radius", "Velocity": "velocity", "ID": "id"}
    sets = []
    for k in range(run.n_snapshots):
        values = values_of(run, k)
        values["radius"] = 2 * values["radius"]

        def array(name, rows):
            text = " ".join(repr(float(x)) for x in np.ravel(rows))
            of = f'type="Float64" Name="{name}" NumberOfComponents="{2 * np.ndim(rows) - 1}" format="ascii"'
            return f"<DataArray {of}>{text}</DataArray>"

        inside = "".join(array(name, values[what]) for name, what in named.items())
        points = f"<Points>{array('Position', values['position'])}</Points>"
        counts = f'NumberOfPoints="{run.n_particles:010}" NumberOfVerts="0" NumberOfLines="0"'
        piece = f'<Piece {counts} NumberOfStrips="0" NumberOfPolys="0"><PointData>{inside}</PointData>{points}</Piece>'
        head = f'<?xml version="1.0"?>\n<!-- Time ={run.times[k]:12.6f}s -->\n'
        text = f'{head}<VTKFile type="PolyData" version="0.1"><PolyData>{piece}</PolyData></VTKFile>'
        (folder / f"BED_DES_{k:05}.vtp").write_text(text)
        sets.append(f'<DataSet timestep="{float(run.times[k])!r}" file="BED_DES_{k:05}.vtp"/>')
    text = f'<VTKFile type="Collection"><Collection>{"".join(sets)}</Collection></VTKFile>'
    (folder / "BED_DES.pvd").write_text(text)
    return [folder / "BED_DES.pvd"], {}


def as_h5md(run, folder):
    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("particles/all")
        for name in ("position", "velocity"):
            group[f"{name}/value"] = np.stack([run.snapshot(k).values[name] for k in range(run.n_snapshots)])
        group["time"], group["id"], group["size"] = run.times, run.ids, 2 * run.radius
    names = {"position": "position/value", "velocity": "velocity/value", "time": "time", "id": "id", "diameter": "size"}
    return [folder / "a.h5"], {"maps": [f"{what}=/particles/all/{name}" for what, name in names.items()]}


def as_groups(run, folder):
    with h5py.File(folder / "a.h5", "w") as file:
        for k in range(run.n_snapshots):
            for name, rows in values_of(run, k).items():
                file[f"t{k}/{name}"] = rows
            file[f"t{k}"].attrs["time"] = run.times[k]
    names = {"position": "position", "velocity": "velocity", "id": "id", "radius": "radius", "species": "type"}
    return [folder / "a.h5"], {"maps": ["time=/t*@time", *(f"{what}=/t*/{name}" for what, name in names.items())]}


def exported(run, folder, format):
    made = export_run(run, folder / "out", format)
    return [*made.folder.glob("*.pvd"), *made.folder.glob("*.npz")], {}


FORMATS = {
    "dumps of LAMMPS, xz": as_text,
    "export to npz": lambda run, folder: exported(run, folder, "npz"),
    "export to vtu": lambda run, folder: exported(run, folder, "vtu"),
    "vtp as MFiX": as_mfix,
    "HDF5, mapped": as_h5md,
    "HDF5 in groups": as_groups,
    "view in VTKHDF": lambda run, _: ([view_paths(run.path)[0]], {}),
}
OF_VTK = {"export to vtu", "vtp as MFiX"}


@pytest.mark.physics
@pytest.mark.parametrize("format", FORMATS)
def test_one_run_in_any_format_gets_one_verdict(original, tmp_path, format):
    if format in OF_VTK:
        pytest.importorskip("vtkmodules.vtkIOXML")
    (tmp_path / "made").mkdir()
    with Run(original) as run:
        sources, options = FORMATS[format](run, tmp_path / "made")
    import_run(sources, tmp_path / "again.h5", precision="double", **options)
    expected = verdict(original)
    assert len(expected["position.x"]) >= 8
    assert len({modes for *_, modes, _ in expected["position.x"]}) > 1  # they are not all alike
    assert verdict(tmp_path / "again.h5") == expected
