"""Somebody else's run as the first stage of a study."""

from pathlib import Path
from typing import Any

from pydantic import Field

from suffice.progress import Reporter
from suffice.readers import import_run
from suffice.readers.series import entries_of
from suffice.refusal import Refusal
from suffice.stages import Settings, Stage


class Source(Settings):
    """Somebody else's run, instead of a scene."""

    files: list[str] = Field(
        min_length=1,
        description="files of one run, or an OpenFOAM case, relative to the study's folder; * as in a shell",
    )
    interval: float | None = Field(default=None, gt=0, description="between snapshots, s")
    timestep: float | None = Field(default=None, gt=0, description="of the other code, s")
    diameter: float | None = Field(default=None, gt=0, description="of the particles, m")
    map: dict[str, str] = Field(default={}, description="what the source calls things, such as velocity = 'U.air'")


def reading_stage(source: Source, home: Path, run: Path, reporter: Reporter) -> Stage:
    """Return the stage that imports a source into a run. Raises Refusal for files that are not there."""
    files = [path for name in source.files for path in _named(name, home)]

    def make() -> str:
        with reporter.stage("import", "snapshots") as advance:
            made = import_run(
                files,
                run,
                interval=source.interval,
                timestep=source.timestep,
                diameter=source.diameter,
                maps=[f"{what}={name}" for what, name in source.map.items()],
                progress=advance,
            )
        for found in made.warnings:
            reporter.warn("particles jump", found)
        return f"{made.n_particles} particles, {made.n_snapshots} snapshots read"

    stamps = [_stamp(path) for file in files for path in _behind(file)]
    # an option that is not used leaves studies that were made before as they are
    wished = source.model_dump(exclude={"map"}) | ({"map": source.map} if source.map else {})
    return Stage("import", [wished, stamps], (run,), make)


def _named(name: str, home: Path) -> list[Path]:
    path = home / name
    top = Path(path.anchor)  # of a path that is absolute; else none
    found = sorted(top.glob(str(path.relative_to(top)))) if "*" in name else [path]
    if not found or not found[0].exists():
        kind = "no file matches" if "*" in name else "there is no file or folder"
        raise Refusal(f"source.files: {kind} {path}; a path that is not absolute begins at the study's folder")
    return found


def _behind(file: Path) -> list[Path]:
    """Return a file, and those that it lists."""
    return [file, *(entry.path for entry in entries_of(file))] if file.suffix in (".pvd", ".series") else [file]


def _stamp(path: Path) -> Any:
    """Return what tells that a file, or anything in a folder, has changed."""
    if path.is_dir():
        return [str(path.resolve()), *(_stamp(file) for file in sorted(path.rglob("*")) if file.is_file())]
    return (str(path.resolve()), path.stat().st_size, path.stat().st_mtime_ns)
