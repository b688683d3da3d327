"""The paper's experiment: one case calibrates, another validates the decision of sufficient training data."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field, model_validator

from suffice.changes import changed_text
from suffice.compare import known_surrogates
from suffice.door import write_json
from suffice.doubts import warn_of_comparisons, warn_of_verdicts
from suffice.paper import paper_of
from suffice.paper_measures import Wish, measure_case
from suffice.progress import Reporter
from suffice.refusal import Refusal
from suffice.results import PAPER, case_files, read_json
from suffice.run import Run
from suffice.selecting import select_curves, select_json, select_run
from suffice.stages import Settings, Stage, scene_in, simulation_stage
from surrogates import SURROGATES


class Cases(Settings):
    """Two scenes and what is asked of both."""

    scenes: list[str] = Field(min_length=2, max_length=2, description="the first calibrates, the second validates")
    variable: str = Field(default="position.x", description="of the paper's tables; all are judged")
    intervals: list[float] | None = Field(default=None, min_length=1, description="Δτ, s")
    trained: list[str] | None = Field(default=None, description="variables of which surrogates are trained")
    surrogates: list[str] = Field(
        default=["rbf", "hermite", "raw-hermite"], min_length=1, description="trained; the first is the ROM's"
    )
    changes: dict[str, Any] = Field(default={}, description="of both scenes, by place: 'particles.0.count' = 1000")

    @model_validator(mode="after")
    def _can_be(self) -> "Cases":
        if self.trained is not None and self.variable not in self.trained:
            raise ValueError(f"trained: {self.variable} is missing, which is the variable of the tables; add it")
        first = self.surrogates[0]
        if first in SURROGATES and SURROGATES[first].raw:
            raise ValueError(f"surrogates: {first} is no reduced order model; put one first that uses modes, as rbf")
        return self


class Case(NamedTuple):
    """One of the two."""

    name: str  # in words
    scene: str
    text: str  # of the scene
    run: Path
    cost: Path  # JSON, what simulating took
    selection: Path  # JSON, verdicts and curves
    measured: Path  # JSON, what surrogates trained on it err and take


def case_stages(wish: Cases, seed: int | None, home: Path, folder: Path, reporter: Reporter) -> list[Stage]:
    """Return the stages that simulate both cases, judge every Δτ, measure the surrogates, and write the paper's tables.

    Raises Refusal or InputError for scenes, changes or surrogates that there cannot be.
    """
    known_surrogates(wish.surrogates)
    cases = [_case(k, wish, home, folder) for k in range(len(wish.scenes))]
    asked = Wish(wish.variable, wish.trained or [wish.variable], wish.intervals, wish.surrogates, seed or 0)
    settings = [wish.model_dump(), seed]

    def written() -> str:
        paper = paper_of([_found(case) for case in cases], wish.variable)
        write_json(paper, str(folder / PAPER))
        return str(paper["verdicts"][-1]["sentence"]).removesuffix(".")

    return [
        *(_simulating(case, seed, home, reporter) for case in cases),
        *(_selecting(case, wish, reporter) for case in cases),
        *(_measuring(case, asked, settings, reporter) for case in cases),
        Stage("tables", settings, (folder / PAPER,), written),
    ]


def _case(k: int, wish: Cases, home: Path, folder: Path) -> Case:
    scene, name = wish.scenes[k], f"Case {k + 1}"
    text = scene_in(scene, home)
    if wish.changes:
        text = changed_text(text, scene, wish.changes, head=f"{scene}, {name}")
    return Case(name, scene, text, *case_files(folder, k))


def _simulating(case: Case, seed: int | None, home: Path, reporter: Reporter) -> Stage:
    return simulation_stage(
        f"simulate {case.name}", case.text, case.scene, seed, case.run, home, reporter, case.cost
    )  # fmt: skip


def _selecting(case: Case, wish: Cases, reporter: Reporter) -> Stage:
    def make() -> str:
        with Run(case.run) as run, reporter.stage("select", "variables") as advance:
            if wish.variable not in run.variables:
                raise Refusal(
                    f"cases.variable = {wish.variable!r}: {case.name} has no such variable; it has "
                    f"{', '.join(run.variables)}"
                )
            table = select_run(run, None, wish.intervals, None, advance)
            answer = {"select": select_json(run, table), "curves": select_curves(table)}
        write_json(answer, str(case.selection))
        warn_of_verdicts(reporter, answer["select"]["variables"])
        chosen = table[wish.variable].chosen_interval
        return f"{len(table)} variables; {wish.variable}: " + (
            "no Δτ suffices" if chosen is None else f"Δτ = {chosen:g} s suffices"
        )

    return Stage(f"select {case.name}", wish.model_dump(), (case.selection,), make)


def _measuring(case: Case, wish: Wish, settings: list[Any], reporter: Reporter) -> Stage:
    def make() -> str:
        judged: Mapping[str, Any] = read_json(case.selection)["select"]["variables"]
        with Run(case.run) as run, reporter.stage("measure", "cases") as advance:
            answer = measure_case(run, wish, judged, advance)
        write_json(answer, str(case.measured))
        warn_of_comparisons(reporter, answer["compare"])
        return f"{len(answer['compare']['rows'])} surrogates trained and measured"

    return Stage(f"measure {case.name}", settings, (case.measured,), make)


def _found(case: Case) -> dict[str, Any]:
    """Return all that the stages before have found of a case."""
    with Run(case.run) as run:
        text = run.provenance["scene"]
    found = {name: read_json(path) for name, path in zip(("cost", "selected", "measured"), case[4:], strict=True)}
    return {
        "name": case.name,
        "scene": case.scene,
        "text": text,
        "run": case.run.name,
        "cost": found["cost"],
        **found["selected"],
        **found["measured"],
    }
