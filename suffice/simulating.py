"""From a scene to a run on disk."""

import time
from math import inf, prod
from pathlib import Path
from typing import Any

import numba

from sim import AnyRun, LimitError, Scene, parse_scene, simulation_of
from sim.assembly import walls_of
from sim.collisions import impact_energy_edges
from sim.filling import solid_fraction
from sim.kernel import most_threads
from suffice.checkpoint import read_checkpoint, remove_checkpoint, write_checkpoint
from suffice.door import InterruptedRunError
from suffice.interrupt import asked_to_stop
from suffice.lock import only_writer
from suffice.logbook import compiling_seconds
from suffice.progress import Reporter
from suffice.provenance import made_otherwise, provenance_of
from suffice.recording import Recorder, reserved_of, values_of
from suffice.refusal import Refusal
from suffice.starting import read_start
from suffice.store import Run, RunWriter, check_place
from suffice.summary import Outcome, read_summary
from suffice.summary_text import summary_text
from suffice.thinning import finest_halving
from suffice.watching import UNWATCHED, Watching, grid_of_file

SECONDS_BETWEEN_CHECKPOINTS = 20.0


def changed_scene(
    text: str, source: str, until: float | None = None, seed: int | None = None, home: Path | None = None
) -> Scene:
    """Return the scene of a text, with the end (s) and the seed of its packing replaced where given.

    The path of a run that it starts from, relative to `home` or to the scene's own folder, becomes one from here.
    """
    if not (until is None or 0.0 < until < inf):
        raise Refusal(f"--until is {until:g} s; it must be a positive time")
    if not (seed is None or seed >= 0):
        raise Refusal(f"--seed is {seed}; it must not be negative")
    scene = parse_scene(text, source)
    tables = scene.model_dump()
    if until is not None:
        tables["time"]["duration"] = until
    if seed is not None:
        tables["seed"] = seed
    if scene.start is not None:
        tables["start"]["run"] = str((home or Path(source).parent) / scene.start.run)
    return Scene.model_validate(tables)


def simulate_to(
    text: str,
    source: str,
    path: Path,
    reporter: Reporter,
    *,
    until: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    resume: bool = False,
    home: Path | None = None,
    watching: Watching = UNWATCHED,
) -> dict[str, Any]:
    """Run a scene and write it to `path`; return what it cost, in plain types, and what watching it found.

    A checkpoint stands beside the run while it is not finished, and `resume` goes on from it, bitwise as if nothing had
    happened. Raises InputError or Refusal before anything is written, LimitError when a limit is violated on the way,
    InterruptedRunError when the user stops it; what was written stays readable.
    """
    scene = changed_scene(text, source, until, seed, home)
    check_place(path)
    use_threads(threads)
    with only_writer(path):
        return _simulate(text, scene, path, reporter, resume, watching)


def _simulate(
    text: str, scene: Scene, path: Path, reporter: Reporter, resume: bool, watching: Watching
) -> dict[str, Any]:
    """Run a scene into a file that nobody else writes."""
    state = read_checkpoint(path) if resume else None
    stands, found, told = _what_stands(path, text, scene, watching) if resume else (0, {}, {})
    began = time.monotonic()
    with compiling_seconds() as compiled:  # packing and the first snapshot need most of the kernels
        simulation = simulation_of(scene, read_start(scene))
        if found or (watching == UNWATCHED and state is None and stands == simulation.snapshots):
            return _cost(path, simulation, 0, time.monotonic() - began) | found | told
        if state is None:
            record = _new_record(path, text, simulation, watching)
        else:
            watch, tolerance = watching.by(simulation, _names_in(path)), watching.tolerance(simulation)
            record = Recorder.resume(simulation, path, watch, tolerance, state)
    record.logbook.compiling += sum(compiled)
    first = simulation.step
    with record.writer:
        try:
            _run(record, path, reporter)
        except (LimitError, InterruptedRunError) as error:
            _summed_up(record, "limit" if isinstance(error, LimitError) else "interrupted", reporter)
            raise
        with asked_to_stop():  # there is nothing left to stop
            told = _summed_up(record, "done", reporter)
            found = record.finish()
    remove_checkpoint(path)
    answer = _cost(path, simulation, simulation.step - first, time.monotonic() - began)
    answer["seconds_of"] |= record.seconds_of()
    return answer | found | told


def _summed_up(record: Recorder, outcome: Outcome, reporter: Reporter) -> dict[str, Any]:
    """Tell and write what a run says about itself; return it in plain types, under its name in the answer."""
    summary = record.sum_up(outcome, reporter.warned)
    reporter.warned.clear()  # they are in the summary
    answer = {"summary": summary.as_dict()}
    reporter.tell({"stage": "simulate", **answer}, summary_text(str(record.writer.path), summary))
    return answer


def _cost(path: Path, simulation: AnyRun, steps: int, seconds: float) -> dict[str, Any]:
    """Say what a run holds, and the speed of the steps done now, in plain types."""
    particle_steps = len(simulation.particles.radius) * steps
    with Run(path) as run:
        times = run.times
    return {
        "run": str(path),
        "n_particles": len(simulation.particles.radius),
        "n_snapshots": len(times),
        "steps": round(float(times[-1]) / simulation.dt),
        "time_step": simulation.dt,
        "volume_fraction": solid_fraction(simulation.scene, walls_of(simulation.scene), simulation.particles.radius),
        "seconds": seconds,
        "particle_steps_per_second": particle_steps / seconds if seconds else 0.0,
        "threads": numba.get_num_threads(),
        "seconds_of": {name: round(taken, 3) for name, taken in simulation.term_seconds().items()},
    }


def use_threads(threads: int | None) -> None:
    """Compute on so many threads from now on; Refusal where this machine has fewer."""
    most = most_threads()
    if threads is not None:
        if not 1 <= threads <= most:
            raise Refusal(f"--threads is {threads}; this machine allows 1 to {most}")
        numba.set_num_threads(threads)


def _what_stands(path: Path, text: str, scene: Scene, watching: Watching) -> tuple[int, dict[str, Any], dict[str, Any]]:
    """Return how many snapshots a run has, and what was found in it and told when it ended.

    Raises Refusal for another run.
    """
    with Run(path) as past:
        other = made_otherwise(past, text, scene) or watching.differs(past)
        if other:
            raise Refusal(f"--resume: {path} was made with another {other}; give the same, or leave out --resume")
        summary = read_summary(past)
        return past.n_snapshots, past.found, {} if summary is None else {"summary": summary.as_dict()}


def _names_in(path: Path) -> tuple[str, ...]:
    with Run(path) as past:
        return past.quantities


def _new_record(path: Path, text: str, simulation: AnyRun, watching: Watching) -> Recorder:
    first = simulation.snapshot()
    names = list(values_of(first))
    watch, tolerance = watching.by(simulation, names), watching.tolerance(simulation)
    finest = 0 if tolerance is None else finest_halving(simulation.steps_per_snapshot)
    order = simulation.particles.id.argsort()
    remove_checkpoint(path)
    writer = RunWriter(
        path,
        ids=simulation.particles.id[order],
        radius=simulation.particles.radius[order],
        species=simulation.particles.species[order],
        n_snapshots=((simulation.snapshots - 1) << finest) + 1,
        variables=names,
        grid=grid_of_file(simulation.scene),
        precision=simulation.scene.output.precision,
        series=sorted(first.series),
        impact_energy=None if first.impacts is None else impact_energy_edges(),
        provenance=provenance_of(text, simulation.scene) | watching.provenance(),
        reserved=reserved_of(simulation, watch, tolerance is not None),
    )
    record = Recorder(simulation, writer, watch, tolerance)
    record.record(simulation.snapshot())
    return record


def _run(record: Recorder, path: Path, reporter: Reporter) -> None:
    simulation = record.simulation
    n, unit = len(simulation.particles.radius), "particle-steps"
    if not n and simulation.scene.fluid is not None:
        n, unit = prod(simulation.scene.fluid.cells), "cell-steps"
    work = n * simulation.steps_per_snapshot
    saved = time.monotonic()
    with reporter.stage("simulate", unit, work) as advance, asked_to_stop() as asked:
        advance(record.seen, simulation.snapshots)
        while not record.ended:
            try:
                record.advance()
            except LimitError as error:
                raise LimitError(f"{error}; {path} keeps {record.writer.n_complete} snapshots") from None
            advance(record.seen, simulation.snapshots)
            if asked or time.monotonic() - saved > SECONDS_BETWEEN_CHECKPOINTS:
                write_checkpoint(path, record.state(reporter.warned))
                saved = time.monotonic()
            if asked and not record.ended:
                raise InterruptedRunError(
                    f"stopped at t = {simulation.time:g} s; {path} keeps {record.writer.n_complete} of "
                    f"{simulation.snapshots} snapshots, the same command goes on from there (simulate: with --resume)",
                    *asked[:1],
                )
