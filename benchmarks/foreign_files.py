"""Small good files of other programs: those of `tests/reference`, and what VTK and numpy write of them."""

import shutil
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

REFERENCE = Path(__file__).parents[1] / "tests" / "reference"  # files that the programs themselves wrote


def unpacked(archive: str, inside: Path, chosen: Callable[[str], str]) -> None:
    """Unpack those files of an archive for which `chosen` gives a place in a folder, not an empty text."""
    with tarfile.open(REFERENCE / f"{archive}.tar.xz") as tar:
        for member in tar.getmembers():
            if member.isfile() and (place := chosen(member.name)):
                (inside / place).parent.mkdir(parents=True, exist_ok=True)
                (inside / place).write_bytes(tar.extractfile(member).read())


def foreign_files(folder: Path, made: Callable[..., None]) -> None:
    """Put two snapshots of each program into a folder, and what VTK and numpy make of such; `made` runs a command."""
    inside = folder / "in"
    vtk = {"shaken_300.vtk": "vtk/a300.vtk", "shaken_600.vtk": "vtk/a600.vtk", "shaken.dump": "liggghts/shaken.dump"}
    unpacked("liggghts/shaken", inside, lambda name: vtk.get(Path(name).name, ""))
    dump = inside / "liggghts" / "shaken.dump"
    dump.write_bytes(b"ITEM: TIMESTEP".join(dump.read_bytes().split(b"ITEM: TIMESTEP")[:4]))
    vtu = {"shaken-spheres.9600.vtu": "vtu/a1.vtu", "shaken-spheres.10500.vtu": "vtu/a2.vtu"}
    unpacked("yade/shaken", inside, lambda name: vtu.get(Path(name).name, ""))
    kept = ("0.005", "0.01", "constant", "system")
    unpacked("openfoam/box", inside, lambda name: f"foam/{name[4:]}" if name.split("/")[1] in kept else "")
    made(["--version"], folder, lambda: written_by_vtk(inside))  # in a child: VTK's threads would not survive a fork
    made(["export", "in/run.h5", "--format", "vtu", "-o", "in/pvd"], folder)
    (inside / "vtkhdf").mkdir()
    for path in inside.glob("run.*"):
        shutil.copy(path, inside / "vtkhdf")
    rng = np.random.default_rng(1)
    x, v = rng.normal(size=(3, 12, 3)), rng.normal(size=(3, 12, 3))
    np.savez(inside / "other.npz", position=x, velocity=v, time=np.arange(3.0), radius=np.full(12, 0.1),
             id=np.arange(12))  # fmt: skip
    with h5py.File(inside / "other.h5", "w") as file:
        file["group/x"], file["group/v"], file["t"], file["radius"] = x, v, np.arange(3.0), 0.1
        file["id"] = np.arange(12)


def written_by_vtk(inside: Path) -> None:
    """Write the formats of VTK that no program gave us: legacy binary, .vtp, .vti and VTKHDF."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOHDF import vtkHDFWriter
    from vtkmodules.vtkIOLegacy import vtkDataSetReader, vtkDataSetWriter
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLPolyDataWriter

    def write(writer: Any, data: Any, place: str) -> None:
        (inside / place).parent.mkdir(exist_ok=True)
        writer.SetFileName(str(inside / place))
        writer.SetInputData(data)
        writer.Write()

    for k, step in ((1, 300), (2, 600)):
        reader = vtkDataSetReader()
        reader.SetFileName(str(inside / "vtk" / f"a{step}.vtk"))
        for what in ("Scalars", "Vectors", "Fields"):
            getattr(reader, f"ReadAll{what}On")()
        reader.Update()
        beads, binary, text = reader.GetOutput(), vtkDataSetWriter(), vtkXMLPolyDataWriter()
        binary.SetFileTypeToBinary()
        write(binary, beads, f"vtk_binary/a{k}.vtk")
        text.SetDataModeToAscii() if k == 1 else text.SetDataModeToBinary()
        write(text, beads, f"vtp/a{k}.vtp")
        image, pressure = vtkImageData(), numpy_to_vtk(np.linspace(0, 1, 24), deep=True)
        image.SetDimensions(5, 4, 3)
        image.SetSpacing(0.01, 0.01, 0.01)
        pressure.SetName("p")
        image.GetCellData().AddArray(pressure)
        write(vtkXMLImageDataWriter(), image, f"vtp/f{k}.vti")
        if k == 1:
            write(vtkHDFWriter(), beads, "vtkhdf_of_vtk/a.vtkhdf")
