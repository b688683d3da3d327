"""The snapshot of another run that a scene starts from."""

import hashlib

import numpy as np

from sim import Scene
from sim.start import StartState
from suffice.refusal import Refusal
from suffice.run import Run


def read_start(scene: Scene) -> StartState | None:
    """Return the particles that a scene starts with, in order of their species, None where it packs its own.

    Raises Refusal where the run lacks positions, velocities, radii or that moment.
    """
    if scene.start is None:
        return None
    with Run(scene.start.run) as run:
        lacking = [name for name in ("position", "velocity") if name not in run.quantities]
        if lacking or not run.n_snapshots or not np.isfinite(run.radius).all():
            what = " and ".join(lacking) or ("radii" if run.n_snapshots else "snapshots")
            raise Refusal(f"start.run = {scene.start.run!r}: has no {what}; give a run made by `suffice simulate`")
        values = run.snapshot(_moment(run, scene.start.time)).values
        order = np.argsort(run.species, kind="stable")
        rows = {name: np.asarray(values[name], np.float64)[order] for name in values if name in StartState._fields}
        spin = rows.get("angular_velocity")
        return StartState(
            rows["position"], rows["velocity"], spin, run.radius[order], np.asarray(run.species[order], np.int64)
        )


def _moment(run: Run, time: float | None) -> int:
    """Return the number of the snapshot at a time (s), of the last one by default."""
    if time is None:
        return run.n_snapshots - 1
    nearest = int(np.abs(run.times - time).argmin())
    spacing = float(np.diff(run.times).min()) if run.n_snapshots > 1 else 0.0
    if abs(run.times[nearest] - time) > 1e-3 * spacing:
        raise Refusal(
            f"start.time = {time:g} s: {run.path} has no snapshot then, the nearest is at {run.times[nearest]:.9g} s; "
            "give that, or leave it out for the last"
        )
    return nearest


def start_digest(state: StartState) -> str:
    """Return what tells one start from another: the SHA-256 of its numbers."""
    digest = hashlib.sha256()
    for rows in state:
        if rows is not None:
            digest.update(np.ascontiguousarray(rows).tobytes())
    return digest.hexdigest()
