"""A study: simulate or read, select, compare, report; each stage a function from files to files.

A stage is skipped when its outputs stand and it was made from the same inputs: every stage's digest covers its own
settings and the digest of the stage before it.
"""

import hashlib
import json
import time
import tomllib
from collections.abc import Callable
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, model_validator

from suffice.comparing import Comparing, compare_as_wished
from suffice.door import refusals, write_json
from suffice.doubts import warn_of_comparisons, warn_of_verdicts
from suffice.full_size import FullSize, full_size_stages
from suffice.lock import only_writer
from suffice.omissions import Omissions, omission_stages
from suffice.paper_cases import Cases, case_stages
from suffice.paper_pictures import pictures_of
from suffice.player import player_of
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.report import write_report
from suffice.results import COMPARISON, LOG, RUN, SELECTION, case_files, gather, played, read_json
from suffice.run import Run
from suffice.section import Section
from suffice.selecting import select_curves, select_json, select_run, thresholds_of
from suffice.source import Source, reading_stage
from suffice.speeds import Speeds, speed_stages
from suffice.stages import Positive, Settings, Stage, scene_in, simulation_stage
from suffice.study_faults import faults_text

LOGGED = {"digest", "outputs", "seconds", "detail", "made"}  # of each stage


class Selecting(Settings):
    """What is judged."""

    variables: list[str] | None = Field(default=None, description="such as position.x; absent: all components")
    intervals: list[Positive] | None = Field(default=None, description="Δτ, s; absent: ten to two dense intervals")
    thresholds: dict[str, float] = Field(
        default={}, description="energy of n_lr modes, consistency R_c, feasibility K_f, resolution R_a"
    )


class Study(Settings):
    """One question to one run."""

    scene: str | None = Field(default=None, description="built-in name, or path relative to the study's folder")
    source: Source | None = None
    seed: int | None = Field(default=None, ge=0, description="of packing and training; absent: the scene's")
    select: Selecting = Selecting()
    compare: Comparing = Comparing()
    unseen: Speeds | None = Field(default=None, description="instead of one run, several rotor speeds, some unseen")
    omissions: Omissions | None = Field(default=None, description="instead of one run, variants with less physics")
    one_step: FullSize | None = Field(default=None, description="instead of a run, one step of a scene at full size")
    cases: Cases | None = Field(default=None, description="instead of one run, the paper's two cases")

    @model_validator(mode="after")
    def _one_origin(self) -> "Study":
        if self.cases is not None:
            if self.model_fields_set - {"cases", "seed"}:
                raise ValueError("[cases] names its own scenes; give no scene, [source] or other question beside it")
            return self
        if (self.scene is None) == (self.source is None):
            raise ValueError("give either a scene or a table [source]")
        others = {"select", "compare", "unseen", "one_step"} & self.model_fields_set
        if self.omissions is not None and (self.scene is None or others):
            raise ValueError("[omissions] runs variants of a scene; give it a scene, and no other question beside it")
        if self.unseen is not None and (self.scene is None or {"select", "compare"} & self.model_fields_set):
            raise ValueError("[unseen] runs a scene at several speeds; give it a scene, and no [select] or [compare]")
        if self.one_step is not None and (
            self.scene is None or {"select", "compare", "unseen"} & self.model_fields_set
        ):
            raise ValueError("[one_step] times a scene; give it a scene, and no other question beside it")
        return self


def built_in_studies() -> dict[str, str]:
    """Names and TOML texts of the studies that come with the program."""
    folder = resources.files("suffice") / "studies"
    return {Path(f.name).stem: f.read_text() for f in sorted(folder.iterdir(), key=str) if f.name.endswith(".toml")}


def load_study(name_or_path: str) -> tuple[str, Study, Path]:
    """Return name, settings and folder of a study.

    Raises Refusal for a file that is missing or not a study, naming the fields at fault.
    """
    built_in = built_in_studies()
    path = Path(name_or_path)
    try:
        text = built_in.get(name_or_path) or path.read_text(encoding="utf-8")
        study = Study.model_validate(tomllib.loads(text))
    except (OSError, UnicodeDecodeError) as error:
        raise Refusal(
            f"study {name_or_path!r}: no such file or not a text ({error}); give a TOML file or one of the built-in "
            f"studies: {', '.join(built_in)}"
        ) from None
    except ValidationError as error:
        raise Refusal(f"study {name_or_path}: {faults_text(error, Study)}") from None
    except (ValueError, RecursionError) as error:  # no TOML; numbers or nesting beyond what Python reads
        raise Refusal(f"study {name_or_path}: not valid TOML: {error}") from None
    return (name_or_path, study, Path()) if name_or_path in built_in else (path.stem, study, path.parent)


def run_study(name_or_path: str, folder: Path | None, reporter: Reporter, say: Callable[[str], None]) -> Path:
    """Run a study in a folder, `./NAME` by default, and return its report; finished stages are not run again.

    Raises Refusal or InputError for input that cannot be used, LimitError when a run goes wrong.
    """
    name, study, home = load_study(name_or_path)
    folder = folder or Path(name)
    stages = stages_of(name, study, home, folder, reporter)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refusal(f"--output {folder} cannot be made ({error}); name a folder you may write to") from None
    chain = version("suffice")
    with only_writer(folder):
        for stage in stages:
            chain = _digest([chain, stage.name, stage.inputs])
            _run_stage(stage, chain, folder, say, reporter)
    return folder / "report.html"


def _run_stage(stage: Stage, digest: str, folder: Path, say: Callable[[str], None], reporter: Reporter) -> None:
    """Run a stage unless its outputs stand and were made from the same inputs; keep what it warned of."""
    log = read_log(folder / LOG)
    done = log.pop(stage.name, {})
    if done.get("digest") == digest and done.get("outputs") == _stamps(stage.outputs):
        say(f"{stage.name}: nothing changed, kept from {done['made']} ({done['detail']})")
        return
    began = time.monotonic()
    write_json(log, str(folder / LOG))  # a stage that fails must run again
    detail = stage.make()
    seconds = round(time.monotonic() - began, 3)
    made = time.strftime("%Y-%m-%d %H:%M:%S")
    stamps = _stamps(stage.outputs)
    warned = reporter.warned.taken()
    log[stage.name] = {"digest": digest, "outputs": stamps, "seconds": seconds, "detail": detail, "made": made}
    log[stage.name]["warnings"] = warned.plain()
    write_json(log, str(folder / LOG))
    several = f", {warned.count} warnings" if warned.count > 1 else ", 1 warning" if warned else ""
    say(f"{stage.name}: {detail}, {seconds:.1f} s{several}")


def read_log(path: Path) -> dict[str, Any]:
    """Return what is known of the stages that are done. Raises Refusal for a log that is no such list."""
    log = read_json(path) or {}
    entries = log.values() if isinstance(log, dict) else [None]
    if not all(isinstance(entry, dict) and set(entry) >= LOGGED for entry in entries):
        raise Refusal(f"{path} is no list of stages as a study writes it; remove it, then every stage runs again")
    return dict(log)


def _stamps(outputs: tuple[Path, ...]) -> list[list[int] | None]:
    """Return size and time of change of every output: one that another hand changed must be made again."""
    stats = [path.stat() if path.exists() else None for path in outputs]
    return [None if stat is None else [stat.st_size, stat.st_mtime_ns] for stat in stats]


def stages_of(name: str, study: Study, home: Path, folder: Path, reporter: Reporter) -> list[Stage]:
    """Return the stages of a study in the data's order.

    Raises Refusal or InputError for a scene, files or settings that cannot be used, before anything is written.
    """
    thresholds_of("", study.select.thresholds)
    study.compare.check()
    if study.cases is not None:
        return [*case_stages(study.cases, study.seed, home, folder, reporter), _reporting(name, folder)]
    if study.unseen is not None and study.scene is not None:
        return [*speed_stages(study.unseen, study.scene, study.seed, home, folder, reporter), _reporting(name, folder)]
    if study.omissions is not None and study.scene is not None:
        variants = omission_stages(study.omissions, study.scene, study.seed, home, folder, reporter)
        return [*variants, _reporting(name, folder)]
    if study.one_step is not None and study.scene is not None:
        timed = full_size_stages(study.one_step, study.scene, study.seed, home, folder, reporter)
        return [*timed, _reporting(name, folder)]
    if study.scene is None:
        first = _reading(study, home, folder, reporter)
    else:
        text = scene_in(study.scene, home)
        first = simulation_stage("simulate", text, study.scene, study.seed, folder / RUN, home, reporter)
    select, against = folder / SELECTION, folder / COMPARISON
    comparing = [study.compare.model_dump(), study.seed]
    return [
        first,
        Stage("select", study.select.model_dump(), (select,), lambda: _select(study.select, folder, reporter)),
        Stage("compare", comparing, (against,), lambda: _compare(study, folder, reporter)),
        _reporting(name, folder),
    ]


def _reporting(name: str, folder: Path) -> Stage:
    outputs = (folder / "report.html", folder / "results.json")
    return Stage("report", name, outputs, lambda: make_report(folder, name))


def _reading(study: Study, home: Path, folder: Path, reporter: Reporter) -> Stage:
    assert study.source is not None  # the model's validator gave one or the other
    return reading_stage(study.source, home, folder / RUN, reporter)


def _select(settings: Selecting, folder: Path, reporter: Reporter) -> str:
    with Run(folder / RUN) as run, reporter.stage("select", "variables") as advance:
        table = select_run(run, settings.variables, settings.intervals, settings.thresholds, advance)
        answer = {"select": select_json(run, table), "curves": select_curves(table)}
    write_json(answer, str(folder / SELECTION))
    warn_of_verdicts(reporter, answer["select"]["variables"])
    return f"{len(table)} variables, {len(next(iter(table.values())).candidates)} intervals each"


def _compare(study: Study, folder: Path, reporter: Reporter) -> str:
    with Run(folder / RUN) as run:
        answer = compare_as_wished(run, study.compare, study.select.thresholds, study.seed or 0, reporter)
    write_json(answer, str(folder / COMPARISON))
    warn_of_comparisons(reporter, answer, *answer["observables"], *answer["beyond"])
    return f"{len(answer['rows'])} surrogates trained and measured"


def make_report(folder: Path, name: str) -> str:
    """Gather what a folder holds into results.json and report.html; return a few words.

    Raises Refusal where what it holds is not what a study writes.
    """
    try:
        results = gather(folder, name)
        player = player_of(*played(folder, results))
        # the frames are in the run already, and in the page
        write_json(results | ({} if player is None else {"player": player.facts}), str(folder / "results.json"))
        write_report(results | {"player": player, "pictures": _pictures(folder, results)}, folder / "report.html")
    except refusals():
        raise
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise Refusal(
            f"{folder} holds results that cannot be shown ({type(error).__name__}: {error}): something else than this "
            f"version of suffice wrote them; remove {folder / LOG} and run the study again"
        ) from error
    return "one page"


def _pictures(folder: Path, results: dict[str, Any]) -> dict[int, Section]:
    """Draw the figures in space of a study of cases; none of others."""
    cases = results.get("cases") or []
    runs = [case_files(folder, k).run for k in range(len(cases))]
    return pictures_of(runs, cases, results["paper"]["variable"]) if cases else {}


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
