"""Runs of one scene with physics left out of it, or solved more coarsely, beside the scene itself."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

from pydantic import Field, model_validator

from sim import InputError, LimitError, Scene, simulation_of
from suffice.changes import changed_text, toml_value
from suffice.door import write_json
from suffice.explain import explain
from suffice.omissions_compare import compare_omissions
from suffice.omissions_means import Outcome, check_names, means_of
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.results import OMISSIONS, read_json
from suffice.run import Run
from suffice.simulating import changed_scene
from suffice.stages import Settings, Stage, scene_in, simulation_stage
from suffice.starting import read_start

REFERENCE = "reference"
SLUG = str.maketrans(" ", "_", ",")


class Variant(Settings):
    """The scene with something left out or changed."""

    name: str = Field(pattern=r"^\w[\w ,.-]*$", description="its own; of letters, digits, spaces and , . - _")
    without: list[str] = Field(default=[], description="places in the scene that are left out: 'fluid'")
    changes: dict[str, Any] = Field(default={}, description="of the scene, by place: 'time.step' = 1e-6")

    @model_validator(mode="after")
    def _differs(self) -> "Variant":
        if not self.without and not self.changes:
            raise ValueError("nothing is left out; give without or changes")
        return self

    @property
    def left_out(self) -> str:
        """What it leaves out and changes, in words."""
        without = [f"no {where}" for where in self.without]
        return ", ".join([*without, *(f"{where} = {toml_value(value)}" for where, value in self.changes.items())])


class Omissions(Settings):
    """What is left out of a scene, and which observables must not mind."""

    variants: list[Variant] = Field(min_length=1)
    seeds: int = Field(default=3, ge=2, description="packings of the scene itself; their scatter tells what is noise")
    start_up: float = Field(default=0.0, ge=0.0, description="that is not averaged, s")
    variable: str = Field(default="position.x", description="whose feasibility index is asked for")
    interval: float = Field(gt=0.0, description="Δτ of that index, s")
    observables: list[str] = Field(min_length=1, description="that matter")
    max_difference: float = Field(gt=0.0, description="of those, as a share of the reference's value: 0.1")
    changes: dict[str, Any] = Field(default={}, description="of the scene in every run, by place")

    @model_validator(mode="after")
    def _names_are_told_apart(self) -> "Omissions":
        names = [variant.name.translate(SLUG) for variant in self.variants]
        taken = [REFERENCE, *(f"{REFERENCE}_{k}" for k in range(self.seeds))]
        for k, name in enumerate(names):
            if name in names[:k] or name in taken:
                raise ValueError(f"variants.{k}.name = {self.variants[k].name!r} is taken; give another")
        return self


class Case(NamedTuple):
    """One run of the study."""

    name: str
    left_out: str
    text: str  # of its scene
    seed: int
    run: Path

    @property
    def cost(self) -> Path:
        """File of what the run cost, or of why it was refused."""
        return self.run.with_suffix(".cost.json")


def omission_stages(
    wish: Omissions, scene: str, seed: int | None, home: Path, folder: Path, reporter: Reporter
) -> list[Stage]:
    """Return the stages that run a scene several times, each variant once, and compare what they amount to.

    Raises Refusal or InputError for a scene, a change or an observable that there cannot be.
    """
    check_names(wish.observables)
    cases = list(_cases(wish, scene, seed, home, folder))
    _check_asked(wish, changed_scene(cases[0].text, scene, home=(home / scene).parent))
    runs = [_running(case, scene, home, reporter) for case in cases]

    def compared() -> str:
        with ExitStack() as opened, reporter.stage("average", "runs") as advance:
            found: list[Outcome] = []
            for done, case in enumerate(cases):
                advance(done, len(cases))
                found.append(_outcome(case, wish, found, opened))
            advance(len(cases), len(cases))
        reference, variants = found[: wish.seeds], found[wish.seeds :]
        answer = compare_omissions(reference, variants, wish.observables, wish.max_difference)
        write_json(answer | _asked(wish, cases), str(folder / OMISSIONS))
        return str(answer["choice"]["sentence"])

    return [*runs, Stage("compare omissions", wish.model_dump(), (folder / OMISSIONS,), compared)]


def _check_asked(wish: Omissions, setting: Scene) -> None:
    """Raise Refusal for what runs of a scene cannot answer, before they take their time."""
    counted = [name for name in wish.observables if name.startswith("impacts.")]
    if counted and not setting.output.impacts:
        raise Refusal(f"observables: {counted[0]} needs output.impacts = true; set it in [omissions.changes]")
    dense, duration = setting.output.interval, setting.time.duration
    if duration - wish.start_up < 2.0 * dense * (1.0 - 1e-9):
        raise Refusal(
            f"start_up = {wish.start_up:g} s leaves less than two intervals of output.interval = {dense:g} s until "
            f"time.duration = {duration:g} s; lower it, or lengthen the run"
        )
    if abs(wish.interval / dense - round(wish.interval / dense)) > 1e-6 or wish.interval < dense * (1.0 - 1e-6):
        raise Refusal(f"interval = {wish.interval:g} s is no multiple of output.interval = {dense:g} s; give one")


def _cases(wish: Omissions, scene: str, seed: int | None, home: Path, folder: Path) -> Iterator[Case]:
    """Yield the scene itself with every seed, then its variants with the first."""
    original = scene_in(scene, home)
    text = changed_text(original, scene, wish.changes, head=f"{scene}, reference")
    first = changed_scene(text, scene, seed=seed, home=(home / scene).parent).seed
    for k in range(wish.seeds):
        yield Case(f"{REFERENCE} {k}", "", text, first + k, folder / f"{REFERENCE}_{k}.h5")
    for variant in wish.variants:
        own = changed_text(text, scene, variant.changes, variant.without, head=f"{scene}, {variant.name}")
        yield Case(variant.name, variant.left_out, own, first, folder / f"{variant.name.translate(SLUG)}.h5")


def _running(case: Case, scene: str, home: Path, reporter: Reporter) -> Stage:
    """Return the stage that runs a case and keeps what it cost; of a variant, or why it was refused."""
    name = f"simulate {case.name}"
    plain = simulation_stage(name, case.text, scene, case.seed, case.run, home, reporter, case.cost)
    setting = changed_scene(case.text, scene, seed=case.seed, home=(home / scene).parent)

    def make() -> str:
        try:
            predicted = _predicted_seconds(setting)
            began = process_time()
            detail = plain.make()
        except (InputError, LimitError) as error:
            if not case.left_out:
                raise
            write_json({"refused": str(error)}, str(case.cost))
            reporter.warn("variant refused", f"{case.name}: {error}")
            return f"refused: {error}"
        own = {"predicted_seconds": predicted, "processor_seconds": process_time() - began}
        write_json({**read_json(case.cost), **own}, str(case.cost))
        return detail

    return plain._replace(make=make)


def _predicted_seconds(setting: Scene) -> float:
    """Seconds that `--explain` foresees, less the share in which this process waited for the machine.

    Afterwards all that the run needs is compiled, and no part of its time.
    """
    trial = simulation_of(setting, read_start(setting))
    trial.advance_to(1)
    trial.snapshot()
    began, worked = perf_counter(), process_time()
    foreseen = float(explain(setting)["cost"]["seconds"])
    return foreseen * min((process_time() - worked) / (perf_counter() - began), 1.0)


def _outcome(case: Case, wish: Omissions, before: list[Outcome], opened: ExitStack) -> Outcome:
    """Return what a case amounts to, in the bins of the first one."""
    cost: Mapping[str, Any] = read_json(case.cost)
    if "refused" in cost:
        return Outcome(case.name, case.left_out, None, None, str(cost["refused"]))
    run = opened.enter_context(Run(case.run))
    like = before[0].means if before else None
    return Outcome(case.name, case.left_out, cost, means_of(run, wish.start_up, wish.variable, wish.interval, like))


def _asked(wish: Omissions, cases: list[Case]) -> dict[str, Any]:
    return {
        "runs": [str(case.run) for case in cases],
        "seeds": [case.seed for case in cases[: wish.seeds]],
        "start_up": wish.start_up,
        "variable": wish.variable,
        "interval": wish.interval,
    }
