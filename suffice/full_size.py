"""One step at full size: the solver on all beads of a scene, beside a model with modes of a smaller run repeated."""

from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field

from pod.gram import compute_device
from sim import Scene, parse_scene, simulation_of
from sim.simulation import Simulation
from suffice.changes import changed_text
from suffice.developed import Developed, developed
from suffice.door import write_json
from suffice.one_step import OneStep, Timing, rom_speed
from suffice.progress import Reporter
from suffice.quantities import AXES
from suffice.refusal import Refusal
from suffice.results import ONE_STEP
from suffice.rom import Component, Rom, components_of
from suffice.run import Run
from suffice.selecting import select_run
from suffice.simulating import changed_scene
from suffice.stages import Settings, Stage, scene_in, simulation_stage
from suffice.starting import read_start
from suffice.stretch import Stretch, timed_stretch
from suffice.training import check_wish
from suffice.variables import mean_diameter
from suffice.wording import seconds_text, threads_text

SOURCE = "source.h5"
GOALS = {"single": 1500.0, "batch": 10_000.0}
PAPER = "over 1500 times' reduction of computational time (Table 7; 500,000 particles, sequential)"


class FullSize(Settings):
    """How one step is measured on a scene that is too large to be run through."""

    source: str = Field(description="a scene, or the file of a run (.h5), whose beads and modes are repeated")
    changes: dict[str, Any] = Field(default={}, description="of the source's scene, by place: 'time.duration' = 0.1")
    interval: float | None = Field(default=None, gt=0.0, description="Δτ of the model, s; absent: what suffices")
    surrogate: str = Field(default="rbf", description="of the coefficients; the paper's is rbf")
    steps: int = Field(default=2000, ge=1, description="of the solver that are timed, in whole steps of the fluid")


class Chosen(NamedTuple):
    """A snapshot interval Δτ, and why it was taken."""

    interval: float  # s
    reason: str


def full_size_stages(
    wish: FullSize, scene: str, seed: int | None, home: Path, folder: Path, reporter: Reporter
) -> list[Stage]:
    """Return the stages that make the source, where it is a scene, and measure one step of the solver and of a model.

    Raises Refusal or InputError for a scene or a run that cannot be used, before anything is written.
    """
    check_wish(wish.surrogate)
    text = scene_in(scene, home)
    setting = changed_scene(text, scene, seed=seed, home=(home / scene).parent)
    made, run, stamp = _source(wish, setting, seed, home, folder, reporter)

    def measured() -> str:
        with Run(run) as source:
            answer = {"scene": scene, **measure(setting, source, wish, reporter)}
        write_json(answer, str(folder / ONE_STEP))
        return str(answer["sentence"])

    inputs = [wish.model_dump(), setting.model_dump(), stamp]
    return [*made, Stage("one step", inputs, (folder / ONE_STEP,), measured)]


def _source(
    wish: FullSize, setting: Scene, seed: int | None, home: Path, folder: Path, reporter: Reporter
) -> tuple[list[Stage], Path, list[Any]]:
    """Stage that runs the source, if it is a scene; its file, and what tells it from another."""
    if not wish.source.endswith(".h5"):
        text = changed_text(
            scene_in(wish.source, home), wish.source, wish.changes, head=f"{wish.source}, to be repeated"
        )
        stage = simulation_stage("simulate source", text, wish.source, seed, folder / SOURCE, home, reporter)
        _copies(setting, _beads(parse_scene(text, wish.source)))
        return [stage], folder / SOURCE, []
    run = (home / wish.source).resolve()
    if wish.changes:
        raise Refusal("changes: the source is a run that stands already; name a scene, or leave changes out")
    with Run(run) as source:
        _copies(setting, source.n_particles)
    return [], run, [str(run), run.stat().st_size, run.stat().st_mtime_ns]


def _beads(setting: Scene) -> int:
    """Return how many beads a scene says that it has. Raises Refusal where the vessel decides."""
    numbers = [table.number for table in setting.particles]
    if None in numbers or not numbers:
        raise Refusal("particles: how many there are is not said; give every species of scene and source a count")
    return sum(number or 0 for number in numbers)


def _copies(setting: Scene, beads: int) -> int:
    """Return how often the beads of the source make up those of the scene. Raises Refusal where they do not."""
    total = _beads(setting)
    if not beads or total % beads:
        raise Refusal(
            f"source: {beads} beads do not make up the {total} of the scene by repetition; take a source whose number "
            "divides it"
        )
    return total // beads


def measure(setting: Scene, source: Run, wish: FullSize, reporter: Reporter) -> dict[str, Any]:
    """Time the solver and a model of as many beads, one after the other; plain types, ready for JSON.

    Both run on the processor, whose seconds `ratio` compares; where there is a GPU the model is timed there as well.
    """
    with reporter.stage("one step", "parts") as advance:
        advance(0, 3)
        late = developed(source)
        advance(1, 3)
        stretch = _timed(setting, wish.steps)
        advance(2, 3)
        chosen = chosen_interval(source, wish.interval)
        components = components_of(source, chosen.interval, wish.surrogate)
        copies = _copies(setting, source.n_particles)
        speed = rom_speed(Rom(components, copies, device="cpu"))  # the processor that the solver has
        gpu = compute_device(None).type != "cpu"
        faster = rom_speed(Rom(components, copies)) if gpu else None
        advance(3, 3)
    ratio = ratios(stretch, speed, late)
    return {
        "solver": _told(stretch) | {"interval_seconds": stretch.interval_seconds, "share": stretch.share},
        "developed": None if late is None else _about_late(late),
        "rom": _about_rom(speed),
        "source": _about_source(source, components, chosen, copies, wish.surrogate),
        "ratio": ratio,
        "gpu": None if faster is None else {"rom": _about_rom(faster), "ratio": ratios(stretch, faster, late)},
        "goals": GOALS,
        "paper": PAPER,
        "sentence": sentence_of(stretch, speed, ratio),
    }


def _timed(setting: Scene, steps: int) -> Stretch:
    simulation = simulation_of(setting, read_start(setting))
    if not isinstance(simulation, Simulation):
        raise Refusal("scene: it has no particles; one step is timed of beads")
    return timed_stretch(simulation, 1, steps)


def chosen_interval(run: Run, asked: float | None) -> Chosen:
    """Return the Δτ asked for, else the largest that suffices for all components of the position, or for x alone.

    The paper judges x (its section 3.3). Raises Refusal where none suffices for x either.
    """
    if asked is not None:
        return Chosen(asked, "asked for")
    table = select_run(run, [f"position.{axis}" for axis in AXES])
    enough = [{c.interval for c in found.candidates if c.sufficient} for found in table.values()]
    if everywhere := set.intersection(*enough):
        return Chosen(max(everywhere), "the largest that suffices for x, y and z")
    if enough[0]:
        return Chosen(max(enough[0]), "the largest that suffices for x, the paper's variable; none does for x, y and z")
    raise Refusal(f"{run.path}: no Δτ considered suffices for position.x; give interval, or a longer source")


def ratios(stretch: Stretch, speed: OneStep, late: Developed | None) -> dict[str, Any]:
    """Return how many times faster the model is, with the range that the quartiles of both span.

    `developed` is what is to be expected of the solver in developed flow: the same, times the factor of the source.
    """
    fetch = speed.fetch.seconds if speed.fetch else 0.0
    found: dict[str, Any] = {}
    for name, timing in (("single", speed.single), ("batch", speed.batch)):
        per_interval = stretch.steps_per_interval
        low, high = (per_interval * step / (rom + fetch) for step, rom in _extremes(stretch.step, timing))
        found[name] = stretch.interval_seconds / (timing.seconds + fetch)
        found[f"{name}_range"] = [low, high]
        found[f"{name}_reached"] = found[name] > GOALS[name]
        found[f"{name}_developed"] = None if late is None else late.factor * found[name]
    return found


def _extremes(step: Timing, rom: Timing) -> tuple[tuple[float, float], tuple[float, float]]:
    return (step.low, rom.high), (step.high, rom.low)


def sentence_of(stretch: Stretch, speed: OneStep, ratio: dict[str, Any]) -> str:
    """Say in one line what one step takes, and whether the goals are reached."""
    reached = {name: "reached" if ratio[f"{name}_reached"] else "missed" for name in GOALS}
    verdicts = [
        f"{ratio[name]:,.0f} times faster {words} (goal {goal:,.0f}, {reached[name]})"
        for (name, goal), words in zip(GOALS.items(), ("for one snapshot alone", "in batch"), strict=True)
    ]
    return (
        f"{stretch.beads:,} beads, {seconds_text(stretch.interval)}: solver {seconds_text(stretch.interval_seconds)} "
        f"on {threads_text(stretch.threads)}, model {seconds_text(speed.seconds)} on {speed.device}, "
        f"{threads_text(speed.threads)}: {verdicts[0]}, {verdicts[1]}"
    )


def _told(stretch: Stretch) -> dict[str, Any]:
    return {**stretch._asdict(), "step": stretch.step._asdict()}


def _about_late(late: Developed) -> dict[str, Any]:
    return {"time": late.time, "factor": late.factor, "start": _told(late.start), "late": _told(late.late)}


def _about_rom(speed: OneStep) -> dict[str, Any]:
    timings = {name: value._asdict() if isinstance(value, Timing) else value for name, value in speed._asdict().items()}
    own = ("seconds", "batch_seconds", "bytes_per_second", "flops_per_second")
    return timings | {name: getattr(speed, name) for name in own}


def _about_source(run: Run, components: list[Component], chosen: Chosen, copies: int, surrogate: str) -> dict[str, Any]:
    diameter = mean_diameter(run)
    errors = [one.rmse for one in components]
    return {
        "run": str(run.path.resolve()),
        "beads": run.n_particles,
        "copies": copies,
        "n_snapshots": run.n_snapshots,
        "interval": chosen.interval,
        "interval_reason": chosen.reason,
        "surrogate": surrogate,
        "n_lr": [one.n_lr for one in components],
        "n_c": [one.n_c for one in components],
        "n_modes": [one.modes.shape[1] for one in components],
        "rmse": errors,
        "rmse_diameters": [e / diameter if diameter and e is not None else None for e in errors],
    }
