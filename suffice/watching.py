"""What `simulate` is asked to watch, and to keep."""

import json
from collections.abc import Sequence
from math import isfinite, nan
from typing import NamedTuple

from sim import AnyRun, Scene
from sim.grid import grid_of
from suffice.in_situ import InSitu, rows_of
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import DTYPES

DIAMETERS = "d"
WATCHING = "watching"  # its name in the provenance of a run


class Watching(NamedTuple):
    """Variables that must suffice before a run ends, none: it runs its time; and which snapshots it keeps."""

    variables: tuple[str, ...] = ()
    keep_error: tuple[float, str] | None = None  # RMSE of interpolated positions, in "d" diameters or "m"; None: all

    def by(self, simulation: AnyRun, quantities: Sequence[str]) -> InSitu | None:
        """Return who watches a simulation that stores these quantities, None where nobody does. Raises Refusal."""
        if not self.variables:
            return None
        scene, n = simulation.scene, len(simulation.particles.radius)
        rows = {name: rows_of(name, quantities, n, grid_of_file(scene)) for name in self.variables}
        thinned = self.keep_error is not None
        return InSitu(rows, simulation.snapshots, DTYPES[scene.output.precision], thinned=thinned)

    def tolerance(self, simulation: AnyRun) -> float | None:
        """Return the RMSE (m) that interpolation between kept snapshots may have, None where all are kept.

        Raises Refusal where there are no particles.
        """
        if self.keep_error is None:
            return None
        radius = simulation.particles.radius
        if not len(radius):
            raise Refusal("--keep-error is the error of positions, and this scene has no particles; leave it out")
        value, unit = self.keep_error
        return value * 2.0 * float(radius.mean()) if unit == DIAMETERS else value

    def provenance(self) -> dict[str, str]:
        """Return these wishes as a run keeps them, empty where there are none."""
        return {} if self == UNWATCHED else {WATCHING: json.dumps(self._asdict())}

    def differs(self, past: Run) -> str:
        """Name what a run was made with that differs from these wishes, empty if nothing does."""
        same = past.provenance.get(WATCHING) == self.provenance().get(WATCHING)
        return "" if same else "--until-sufficient, --variable or --keep-error"


UNWATCHED = Watching()


def grid_of_file(scene: Scene) -> Grid | None:
    """Return the cells of the fluid as a run stores them, None in a dry scene."""
    if scene.fluid is None:
        return None
    box = grid_of(scene.fluid, scene.repeats)
    x, y, z = box.cells
    return Grid((z, y, x), box.lowest, box.spacing)


def wished(until_sufficient: bool, variables: Sequence[str] | None, keep_error: str | None, engine: str) -> Watching:
    """Return what the options of `simulate` wish for. Raises Refusal for what they cannot mean."""
    if variables and not until_sufficient:
        raise Refusal(f"--variable {variables[0]} says what must suffice; add --until-sufficient, or leave it out")
    if until_sufficient and not variables:
        raise Refusal("--until-sufficient: say what must suffice, such as --variable position.x; several are allowed")
    if (until_sufficient or keep_error) and engine != "numba":
        option = "--until-sufficient" if until_sufficient else "--keep-error"
        raise Refusal(f"{option}: --engine {engine} shows no snapshot before its end; use --engine numba")
    return Watching(tuple(dict.fromkeys(variables or ())), None if keep_error is None else parse_keep_error(keep_error))


def parse_keep_error(text: str) -> tuple[float, str]:
    """Return value and unit of a length such as `0.02d` (diameters) or `2e-5` (m). Raises Refusal for anything else."""
    number = text.strip().removesuffix(DIAMETERS).removesuffix("m").strip()
    try:
        value = float(number)
    except ValueError:
        value = nan
    if not (isfinite(value) and value > 0.0):
        raise Refusal(f"--keep-error {text!r}: not an error; give diameters such as 0.02d, or m such as 2e-5")
    return value, DIAMETERS if text.strip().endswith(DIAMETERS) else "m"
