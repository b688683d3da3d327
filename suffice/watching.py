"""What `simulate` is asked to watch, and to keep."""

import json
from collections.abc import Sequence
from typing import NamedTuple

from sim import AnyRun, Scene
from sim.grid import grid_of
from suffice.in_situ import InSitu, rows_of
from suffice.quantities import Grid
from suffice.refusal import Refusal
from suffice.run import Run
from suffice.store import DTYPES

WATCHING = "watching"  # its name in the provenance of a run


class Watching(NamedTuple):
    """Variables that must suffice before a run ends; none of them: it runs its time."""

    variables: tuple[str, ...] = ()

    def by(self, simulation: AnyRun, quantities: Sequence[str]) -> InSitu | None:
        """Return who watches a simulation that stores these quantities, None where nobody does. Raises Refusal."""
        if not self.variables:
            return None
        scene, n = simulation.scene, len(simulation.particles.radius)
        rows = {name: rows_of(name, quantities, n, grid_of_file(scene)) for name in self.variables}
        return InSitu(rows, simulation.snapshots, DTYPES[scene.output.precision])

    def provenance(self) -> dict[str, str]:
        """Return these wishes as a run keeps them, empty where there are none."""
        return {} if self == UNWATCHED else {WATCHING: json.dumps(self._asdict())}

    def differs(self, past: Run) -> str:
        """Name what a run was made with that differs from these wishes, empty if nothing does."""
        return "" if past.provenance.get(WATCHING) == self.provenance().get(WATCHING) else WATCHING


UNWATCHED = Watching()


def grid_of_file(scene: Scene) -> Grid | None:
    """Return the cells of the fluid as a run stores them, None in a dry scene."""
    if scene.fluid is None:
        return None
    box = grid_of(scene.fluid, scene.repeats)
    x, y, z = box.cells
    return Grid((z, y, x), box.lowest, box.spacing)


def wished(until_sufficient: bool, variables: Sequence[str] | None, engine: str) -> Watching:
    """Return what the options of `simulate` wish for. Raises Refusal for one without the other."""
    if variables and not until_sufficient:
        raise Refusal(f"--variable {variables[0]} says what must suffice; add --until-sufficient, or leave it out")
    if until_sufficient and not variables:
        raise Refusal("--until-sufficient: say what must suffice, such as --variable position.x; several are allowed")
    if until_sufficient and engine != "numba":
        raise Refusal(f"--until-sufficient: --engine {engine} shows no snapshot before its end; use --engine numba")
    return Watching(tuple(dict.fromkeys(variables or ())))
