"""Commands that bring in somebody else's run, and give ours away."""

from pathlib import Path
from typing import Annotated

import typer

from suffice.options import Json, RunFile, tell


def import_(
    context: typer.Context,
    sources: Annotated[
        list[Path], typer.Argument(metavar="SOURCE...", help="files of one run, in any order; or an OpenFOAM case")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN", help="such as run.h5")],
    format: Annotated[
        str | None, typer.Option(help="lammps, liggghts, vtk, openfoam, npz, hdf5; default: as the content tells")
    ] = None,
    interval: Annotated[float | None, typer.Option(help="between snapshots, s")] = None,
    timestep: Annotated[float | None, typer.Option(help="of the other code, s; times are its steps times this")] = None,
    diameter: Annotated[float | None, typer.Option(help="of the particles, m, if the source does not say")] = None,
    maps: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="WHAT=NAME", help="what the source calls it: velocity=U.air; fluid=none"),
    ] = None,
    double: Annotated[bool, typer.Option("--double", help="store double precision instead of single")] = False,
    json: Json = None,
) -> None:
    """Read somebody else's run: LAMMPS and LIGGGHTS dumps, VTK files, an OpenFOAM case, npz, HDF5."""
    from suffice.readers import import_run
    from suffice.tables import show_facts

    with context.obj.stage("import", "snapshots") as advance:
        made = import_run(
            list(sources),
            output,
            format=format,
            interval=interval,
            timestep=timestep,
            diameter=diameter,
            maps=maps or (),
            precision="double" if double else "single",
            progress=advance,
        )
    for found in made.warnings:
        context.obj.warn("particles jump", found)
    answer = {**made._asdict(), "path": str(made.path), "times": [float(made.times[0]), float(made.times[-1])]}
    del answer["warnings"]  # they are among the notes
    if tell(answer, json):
        show_facts(str(output), answer)


def export(
    context: typer.Context,
    run_file: RunFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="a new folder")],
    format: Annotated[str, typer.Option(help="vtu, with a .pvd that lists the times, or npz")],
    json: Json = None,
) -> None:
    """Write a run as other files, a snapshot each."""
    from suffice.exporting import export_run
    from suffice.run import Run
    from suffice.tables import show_facts

    with Run(run_file) as run, context.obj.stage("export", "snapshots") as advance:
        made = export_run(run, output, format, advance)
    answer = made._asdict() | {"folder": str(made.folder)}
    if tell(answer, json):
        show_facts(str(output), answer)
