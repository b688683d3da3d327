"""From a scene to a run on disk, the steps done by LAMMPS."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sim import LimitError, Scene, Simulation
from sim.state import Particles, reordered
from suffice.engine.deck import DATA, DECK, DUMP, deck_of, write_data
from suffice.engine.expressible import check_expressible
from suffice.engine.lammps import Program, find_lammps, run_deck, version_of
from suffice.engine.observed import SERIES, series_of
from suffice.lock import only_writer
from suffice.progress import Reporter
from suffice.provenance import provenance_of
from suffice.readers.dump import Dump
from suffice.readers.trajectory import Frame, followed
from suffice.refusal import Refusal
from suffice.simulating import changed_scene
from suffice.store import RunWriter, check_place

ENGINES = ("numba", "lammps")


def check_options(engine: str, threads: int | None, ranks: int | None, resume: bool) -> None:
    """Refuse an engine that there is not, and options that belong to another one (Refusal)."""
    if engine not in ENGINES:
        raise Refusal(f"--engine is {engine!r}; there are {' and '.join(ENGINES)}")
    if engine == "numba" and ranks is not None:
        raise Refusal(f"--ranks is {ranks}: they are processes of --engine lammps; --threads are ours")
    if engine == "lammps" and threads is not None:
        raise Refusal(f"--threads is {threads}: --engine lammps runs on processes; give --ranks {threads}")
    if engine == "lammps" and resume:
        raise Refusal("--resume: a run of --engine lammps keeps no checkpoint; start it anew")
    if ranks is not None and ranks < 1:
        raise Refusal(f"--ranks is {ranks}; there must be one at least")


def simulate_on_lammps(
    text: str,
    source: str,
    path: Path,
    reporter: Reporter,
    *,
    until: float | None = None,
    seed: int | None = None,
    ranks: int = 1,
) -> dict[str, Any]:
    """Run a scene on LAMMPS and write it to `path`, where it appears when it is whole; return what it cost.

    Particles start where our own solver starts them and keep the scene's order; time step and snapshots are ours too.
    Deck, data, log and dump stand in a folder beside the run, which is kept when LAMMPS fails. Raises InputError or
    Refusal for what cannot be run, LimitError for an overlap in a snapshot beyond the limit, ChildProcessError when
    LAMMPS stops early.
    """
    scene = changed_scene(text, source, until, seed)
    check_expressible(scene)
    check_place(path)
    program = find_lammps(ranks)
    with only_writer(path):
        folder = _fresh_folder(path)
        try:
            answer = _simulate(text, Simulation(scene), path, folder, reporter, program, ranks)
        except ChildProcessError:
            raise
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        shutil.rmtree(folder)
    return answer


def _fresh_folder(path: Path) -> Path:
    """Make the working folder beside a run; one that an earlier failure left is replaced."""
    folder = path.with_name(path.name + ".lammps")
    if (folder / DECK).exists():
        shutil.rmtree(folder)
    try:
        folder.mkdir()
    except OSError as error:
        raise Refusal(f"output {path}: its working folder {folder} cannot be made ({error}); remove it") from None
    return folder


def _simulate(
    text: str, start: Simulation, path: Path, folder: Path, reporter: Reporter, program: Program, ranks: int
) -> dict[str, Any]:
    began = time.monotonic()
    n, every = len(start.particles.radius), start.steps_per_snapshot
    write_input(start, folder, ranks)
    with reporter.stage("simulate", "particle-steps", n * every) as advance:
        run_deck(program, folder, ranks, lambda step: advance(step // every + 1, start.snapshots))
    seconds = time.monotonic() - began
    steps, version = (start.snapshots - 1) * every, version_of(folder)
    made_by = {"engine": "lammps", "lammps": version, "ranks": str(ranks)}
    _write_run(start, path, folder, provenance_of(text, start.scene) | made_by)
    return {
        "run": str(path),
        "engine": f"LAMMPS ({version})",
        "n_particles": n,
        "n_snapshots": start.snapshots,
        "steps": steps,
        "time_step": start.dt,
        "seconds": seconds,
        "particle_steps_per_second": n * steps / seconds,
        "ranks": ranks,
    }


def in_order(start: Simulation) -> Particles:
    """Return the particles of a run that has just started in the scene's order."""
    return reordered(start.particles, np.argsort(start.particles.id))


def write_input(start: Simulation, folder: Path, ranks: int) -> None:
    """Write deck and data file of a run into a folder. Raises Refusal for walls that LAMMPS has no region for."""
    p, every = in_order(start), start.steps_per_snapshot
    steps = (start.snapshots - 1) * every
    (folder / DECK).write_text(deck_of(start.scene, start.walls, start.dt, every, steps, ranks))
    density = np.array([table.density for table in start.scene.particles])[p.species]
    write_data(folder / DATA, 2.0 * p.radius, density, p.species, p.position, p.velocity, p.spin)


def moments(start: Simulation, folder: Path) -> Iterator[tuple[float, Frame]]:
    """Yield the time (s) of every snapshot that LAMMPS dumped, and its particles in the scene's order."""
    dump = Dump([folder / DUMP])
    if len(dump.steps) != start.snapshots:
        raise ChildProcessError(f"LAMMPS wrote {len(dump.steps)} of {start.snapshots} snapshots; {folder} is kept")
    for step, frame in zip(dump.steps, followed(dump.frames()), strict=True):
        yield int(step) * start.dt, frame


def _write_run(start: Simulation, path: Path, folder: Path, provenance: dict[str, str]) -> None:
    """Turn the dump of a folder into a run of the same layout as our own."""
    particles, turning = in_order(start), ("angular_velocity",) if start.scene.turns else ()
    with RunWriter(
        path,
        ids=particles.id,
        radius=particles.radius,
        species=particles.species,
        n_snapshots=start.snapshots,
        variables=("position", "velocity", *turning),
        precision=start.scene.output.precision,
        series=SERIES,
        provenance=provenance,
        beside=True,
    ) as run:
        for moment, frame in moments(start, folder):
            spin = frame.values["angular_velocity"] if turning else None
            now = particles._replace(position=frame.values["position"], velocity=frame.values["velocity"], spin=spin)
            series = series_of(now, start.walls, start.gravity, moment)
            _check_overlap(start.scene, series["max_overlap"], moment)
            run.append(moment, {name: frame.values[name] for name in run.variables}, series)


def _check_overlap(scene: Scene, overlap: float, moment: float) -> None:
    limit = scene.limits.max_overlap
    if overlap > limit:
        raise LimitError(
            f"particles overlap by {overlap:.3g} radii (limits.max_overlap {limit:g}) in the snapshot at t = "
            f"{moment:.6g} s; raise contact.stiffness, or the limit"
        )
