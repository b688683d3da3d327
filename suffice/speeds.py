"""Runs of one scene at several rotor speeds, some of them unseen."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from sim import parse_scene
from suffice.changes import changed_text
from suffice.door import write_json
from suffice.progress import Reporter
from suffice.results import UNSEEN
from suffice.rotor import rotor_of
from suffice.run import Run
from suffice.stages import Settings, Stage, scene_in, simulation_stage
from suffice.unseen import compare_unseen, known_competitors


class Speeds(Settings):
    """Which speeds are run, for how long, and which are unseen. All runs turn equally often."""

    rpm: list[float] = Field(min_length=3, description="speeds of the rotor, 1/min")
    held_out: list[float] = Field(min_length=1, description="those that no surrogate is shown, 1/min")
    start_up: int = Field(default=1, ge=0, description="turns before anything is averaged")
    turns: int = Field(default=3, ge=1, description="that are averaged")
    bins: int = Field(default=8, ge=1, description="of the rotor's phase within its period")
    snapshots_per_bin: int = Field(default=2, ge=1, description="in every period")
    seeds: int = Field(default=3, ge=1, description="of what is random in training")
    surrogates: list[str] | None = None
    changes: dict[str, Any] = Field(default={}, description="of the scene, by place: 'particles.0.count' = 1000")

    @model_validator(mode="after")
    def _held_out_are_run(self) -> "Speeds":
        if len(set(self.rpm)) < len(self.rpm) or min(self.rpm) <= 0.0:
            raise ValueError(f"rpm = {self.rpm} 1/min: give different speeds above 0")
        for speed in self.held_out:
            if speed not in self.rpm or not min(self.rpm) < speed < max(self.rpm):
                raise ValueError(f"held_out = {speed:g} 1/min is not among rpm, or at their end; take one inside")
        return self


def speed_stages(
    speeds: Speeds, scene: str, seed: int | None, home: Path, folder: Path, reporter: Reporter
) -> list[Stage]:
    """Return the stages that run a scene at every speed and predict the unseen ones.

    Raises Refusal or InputError for a scene that cannot be used or has not one rotor, or an unknown surrogate.
    """
    known_competitors(speeds.surrogates)
    text = scene_in(scene, home)
    runs = [folder / f"{rpm:g}_rpm.h5" for rpm in speeds.rpm]
    simulations = [
        simulation_stage(f"simulate {rpm:g} rpm", scene_at(text, scene, rpm, speeds), scene, seed, run, home, reporter)
        for rpm, run in zip(speeds.rpm, runs, strict=True)
    ]

    def compared() -> str:
        with ExitStack() as opened, reporter.stage("unseen", "fits") as advance:
            answer = compare_unseen(
                [opened.enter_context(Run(run)) for run in runs], speeds.held_out, seed or 0, advance,
                surrogates=speeds.surrogates, seeds=speeds.seeds, bins=speeds.bins, start_up=speeds.start_up,
            )  # fmt: skip
        write_json(answer, str(folder / UNSEEN))
        return f"{len(answer['cases'])} cases, {sum(len(case['rows']) for case in answer['cases'])} surrogates measured"

    settings = [speeds.model_dump(), seed]
    return [*simulations, Stage("compare unseen", settings, (folder / UNSEEN,), compared)]


def scene_at(text: str, source: str, rpm: float, speeds: Speeds) -> str:
    """Return the TOML text of a scene whose rotor turns at a speed, with whole periods and snapshots in them.

    Raises Refusal where the scene has not one rotor, or a change names no place in it.
    """
    scene = parse_scene(text, source)
    rotor = rotor_of(scene, source)._replace(rpm=rpm)
    place = next(k for k, wall in enumerate(scene.walls) if wall.name == rotor.name)
    interval = rotor.period / (speeds.bins * speeds.snapshots_per_bin)
    intervals = round((speeds.start_up + speeds.turns) * rotor.turn / interval)
    ours = {f"walls.{place}.motion.rpm": rpm, "time.duration": intervals * interval, "output.interval": interval}
    return changed_text(text, source, {**speeds.changes, **ours}, head=f"{source} at {rpm:g} rpm")
