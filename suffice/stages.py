"""Stages of a study: functions from files to files."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from sim import Scene, built_in_scenes, scene_text
from suffice.checkpoint import checkpoint_path
from suffice.door import write_json
from suffice.progress import Reporter
from suffice.provenance import made_otherwise
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.simulating import changed_scene, simulate_to
from suffice.starting import read_start, start_digest
from suffice.wording import number

Positive = Annotated[float, Field(gt=0.0)]


class Settings(BaseModel):
    """A table of a study: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Stage(NamedTuple):
    """A function from files to files."""

    name: str
    inputs: Any  # everything its outputs depend on, ready for JSON
    outputs: tuple[Path, ...]
    make: Callable[[], str]  # returns what it did in a few words


def scene_in(scene: str, home: Path) -> str:
    """Return the TOML text of a built-in scene, or of a file whose path is relative to a study's folder."""
    return built_in_scenes().get(scene) or scene_text(str(home / scene))


def simulation_stage(
    name: str,
    text: str,
    scene: str,
    seed: int | None,
    run: Path,
    home: Path,
    reporter: Reporter,
    cost_file: Path | None = None,
) -> Stage:
    """Return the stage that runs a scene of this text into a file, or goes on where it stopped.

    cost_file: where what the run cost is kept as JSON, as `simulate_to` says it; default nowhere.
    Raises InputError or Refusal for a scene that cannot be used.
    """
    beside = (home / scene).parent
    setting = changed_scene(text, scene, seed=seed, home=beside)

    def make() -> str:
        unfinished = checkpoint_path(run).exists() and _made_of(run, text, setting)
        cost = simulate_to(text, scene, run, reporter, seed=seed, resume=unfinished, home=beside)
        if cost_file is not None:
            write_json(cost, str(cost_file))
        pace = cost["summary"]["pace"]
        kind = "cell" if pace["particle_steps_per_second"] is None else "particle"
        speed = f"{number(pace[f'{kind}_steps_per_second'] / 1e6)} million {kind}-steps/s"
        return f"{cost['n_particles']} particles, {cost['summary']['steps']} steps, {speed}"

    start = read_start(setting)
    stamp = {} if start is None else {"start_digest": start_digest(start)}
    outputs = (run,) if cost_file is None else (run, cost_file)
    return Stage(name, setting.model_dump() | stamp, outputs, make)


def _made_of(run: Path, text: str, scene: Scene) -> bool:
    """Tell whether an unfinished run is of this scene, so that it can go on."""
    try:
        with Run(run) as past:
            return not made_otherwise(past, text, scene)
    except Refusal:
        return False
