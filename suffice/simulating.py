"""From a scene to a run on disk."""

import json
import platform
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from math import inf, prod
from pathlib import Path
from typing import Any

import numba
from numpy.typing import NDArray

from sim import AnyRun, LimitError, Scene, parse_scene, simulation_of
from sim.assembly import walls_of
from sim.checkpoint import restore_, state_of
from sim.collisions import impact_energy_edges
from sim.filling import solid_fraction
from sim.grid import grid_of
from sim.kernel import most_threads
from sim.state import Snapshot
from suffice.checkpoint import read_checkpoint, remove_checkpoint, write_checkpoint
from suffice.door import InterruptedRunError
from suffice.lock import only_writer
from suffice.progress import Reporter
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.starting import read_start, start_digest
from suffice.store import Run, RunWriter, check_place

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


def git_revision() -> str:
    """Return the revision of the checkout that runs, or 'unknown' outside of one."""
    try:
        found = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
        )
    except OSError:
        return "unknown"
    return found.stdout.strip() or "unknown"


def provenance_of(text: str, scene: Scene) -> dict[str, str]:
    """Return what made a run: the scene as written and as run, versions and machine."""
    start = {} if scene.start is None else {"start": scene.start.run}
    return {
        "scene": text,
        "settings": _settings(scene),
        **start,
        "suffice": version("suffice"),
        "numba": numba.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "git": git_revision(),
        "made": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


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
) -> dict[str, Any]:
    """Run a scene and write it to `path`; return what it cost, in plain types.

    A checkpoint stands beside the run while it is not finished, and `resume` goes on from it, bitwise as if nothing had
    happened. Raises InputError or Refusal before anything is written, LimitError when a limit is violated on the way,
    InterruptedRunError when the user stops it; what was written stays readable.
    """
    scene = changed_scene(text, source, until, seed, home)
    check_place(path)
    use_threads(threads)
    with only_writer(path):
        return _simulate(text, scene, path, reporter, resume)


def _simulate(text: str, scene: Scene, path: Path, reporter: Reporter, resume: bool) -> dict[str, Any]:
    """Run a scene into a file that nobody else writes."""
    state = read_checkpoint(path) if resume else None
    stands = _snapshots_that_stand(path, text, scene) if resume else 0
    began = time.monotonic()
    simulation = simulation_of(scene, read_start(scene))
    if state is None and stands == simulation.snapshots:
        return _cost(path, simulation, 0, time.monotonic() - began)
    if state is None:
        writer = _new_writer(path, text, simulation)
    else:
        try:
            restore_(simulation, state)
        except KeyError as error:
            raise Refusal(f"checkpoint of {path} lacks {error}; remove it and start the run anew") from None
        writer = RunWriter.resume(path, simulation.step // simulation.steps_per_snapshot + 1)
    first = simulation.step
    with writer:
        _run(simulation, writer, path, reporter)
    remove_checkpoint(path)
    return _cost(path, simulation, simulation.step - first, time.monotonic() - began)


def _cost(path: Path, simulation: AnyRun, steps: int, seconds: float) -> dict[str, Any]:
    """Say what a run holds, and the speed of the steps done now, in plain types."""
    particle_steps = len(simulation.particles.radius) * steps
    return {
        "run": str(path),
        "n_particles": len(simulation.particles.radius),
        "n_snapshots": simulation.snapshots,
        "steps": (simulation.snapshots - 1) * simulation.steps_per_snapshot,
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


def _settings(scene: Scene) -> str:
    settings: dict[str, Any] = {"until": scene.time.duration, "seed": scene.seed}
    start = read_start(scene)
    if start is not None:
        settings["start"] = start_digest(start)
    return json.dumps(settings)


def made_otherwise(past: Run, text: str, scene: Scene) -> str:
    """Name what a run was made with that differs from this scene, `scene` or `settings`; empty if nothing does."""
    now = {"scene": text, "settings": _settings(scene)}
    return next((what for what, value in now.items() if past.provenance.get(what) != value), "")


def _snapshots_that_stand(path: Path, text: str, scene: Scene) -> int:
    with Run(path) as past:
        if other := made_otherwise(past, text, scene):
            raise Refusal(f"--resume: {path} was made with another {other}; give the same, or leave out --resume")
        return past.n_snapshots


def _new_writer(path: Path, text: str, simulation: AnyRun) -> RunWriter:
    first = simulation.snapshot()
    order = simulation.particles.id.argsort()
    grid = None if first.fluid is None else grid_of_file(simulation.scene)
    remove_checkpoint(path)
    writer = RunWriter(
        path,
        ids=simulation.particles.id[order],
        radius=simulation.particles.radius[order],
        species=simulation.particles.species[order],
        n_snapshots=simulation.snapshots,
        variables=list(values_of(first)),
        grid=grid,
        precision=simulation.scene.output.precision,
        series=sorted(first.series),
        impact_energy=None if first.impacts is None else impact_energy_edges(),
        provenance=provenance_of(text, simulation.scene),
    )
    _append(writer, simulation)
    return writer


def _append(writer: RunWriter, simulation: AnyRun) -> None:
    now = simulation.snapshot()
    writer.append(now.time, values_of(now), now.series, now.impacts)


def values_of(snapshot: Snapshot) -> dict[str, NDArray[Any]]:
    """Return what a run stores of a moment, by the names of its variables."""
    values = {}
    if len(snapshot.position):
        values = {name: getattr(snapshot, name) for name in ("position", "velocity", "angular_velocity")}
    if snapshot.fluid is not None:
        values |= {f"fluid.{name}": rows for name, rows in snapshot.fluid._asdict().items()}
    return {name: rows for name, rows in values.items() if rows is not None}


def grid_of_file(scene: Scene) -> Grid | None:
    """Return the cells of the fluid as a run stores them, None in a dry scene."""
    if scene.fluid is None:
        return None
    box = grid_of(scene.fluid, scene.repeats)
    x, y, z = box.cells
    return Grid((z, y, x), box.lowest, box.spacing)


@contextmanager
def _asked_to_stop() -> Iterator[list[bool]]:
    """Collect Ctrl-C instead of raising it in the middle of a step; a second one stops at once."""
    asked: list[bool] = []

    def ask(_signal: int, _frame: object) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(True)

    try:
        before = signal.signal(signal.SIGINT, ask)
    except ValueError:  # not in the main thread: nobody sends signals here
        yield asked
        return
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def _run(simulation: AnyRun, writer: RunWriter, path: Path, reporter: Reporter) -> None:
    n, unit = len(simulation.particles.radius), "particle-steps"
    if not n and simulation.scene.fluid is not None:
        n, unit = prod(simulation.scene.fluid.cells), "cell-steps"
    work = n * simulation.steps_per_snapshot
    saved = time.monotonic()
    with reporter.stage("simulate", unit, work) as advance, _asked_to_stop() as asked:
        advance(writer.n_complete, simulation.snapshots)
        while writer.n_complete < simulation.snapshots:
            try:
                simulation.advance_to(writer.n_complete * simulation.steps_per_snapshot)
            except LimitError as error:
                raise LimitError(f"{error}; {path} keeps {writer.n_complete} snapshots") from None
            _append(writer, simulation)
            advance(writer.n_complete, simulation.snapshots)
            if asked or time.monotonic() - saved > SECONDS_BETWEEN_CHECKPOINTS:
                write_checkpoint(path, state_of(simulation))
                saved = time.monotonic()
            if asked and writer.n_complete < simulation.snapshots:
                raise InterruptedRunError(
                    f"stopped at t = {simulation.time:g} s; {path} keeps {writer.n_complete} of "
                    f"{simulation.snapshots} snapshots, the same command goes on from there (simulate: with --resume)"
                )
