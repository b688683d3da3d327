"""The flows on which the rule is tried: five flows, three violences each, and two more seeds of one.

    python benchmarks/rule_flows.py --runs DIR [NAME ...]

Each run is a built-in scene with a few tables changed. Its snapshot interval is fixed in the flow's own unit (degrees
of turn, parts of a period, travel of the gas), so that a violent flow is not asked for finer snapshots merely because
its clock runs faster. The start-up is simulated and left out of the file. A run that stands is not made again.
"""

import argparse
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from sim.reading import scene_text
from suffice.changes import toml_value
from suffice.progress import Reporter
from suffice.simulating import simulate_to
from suffice.store import Run, RunWriter

SNAPSHOTS = 301
# N/m; at the most violent of each flow beads overlap by less than a tenth of a radius
BOX_STIFFNESS, MILL_STIFFNESS, BED_STIFFNESS = 2e4, 8e3, 200.0


class Flow(NamedTuple):
    """One run: which scene, how it is changed, and when it is recorded."""

    name: str
    flow: str
    violence: str  # as printed
    scale: float  # of velocity, m/s: what the violence means in numbers
    unit: str  # in which an interval is told
    units_per_second: float
    interval: float  # s
    start_up: int  # intervals that are left out
    tables: dict[str, Any]  # the scene
    seed: int
    snapshots: int = SNAPSHOTS


def flow_tables(scene: str) -> dict[str, Any]:
    """Tables of a built-in scene, to be changed."""
    return tomllib.loads(scene_text(scene))


def shaken_box(name: str, amplitude: float, seed: int = 3) -> Flow:
    """576 glass spheres, 20 Hz; the amplitude (m) sets the peak acceleration."""
    tables = flow_tables("shaken_box")
    tables["walls"][0]["motion"]["amplitude"] = [0.0, 0.0, amplitude]
    tables["contact"]["stiffness"] = BOX_STIFFNESS
    peak = amplitude * (2 * 3.141592653589793 * 20.0) ** 2 / 9.81
    speed = amplitude * 2 * 3.141592653589793 * 20.0
    return Flow(name, "shaken box", f"{peak:.1f} g", speed, "% of period", 2000.0, 5e-4, 200, tables, seed)


def drum(name: str, rpm: float) -> Flow:
    """1300 glass beads in a drum 8 mm long; 2° of turn from snapshot to snapshot."""
    tables = flow_tables("drum")
    tables["walls"][0]["motion"]["rpm"] = rpm
    tables["walls"][0]["shapes"][0]["length"] = 0.008
    tables["contact"]["stiffness"] = tables["walls"][0]["contact"]["stiffness"] = 500.0  # slow flow: longer steps
    speed = rpm * 6.0
    return Flow(name, "drum", f"{rpm:g} rpm", speed / 57.29578 * 0.03, "°", speed, 2.0 / speed, 60, tables, 1)


def mill(name: str, rpm: float, wet: bool) -> Flow:
    """1500 zirconia beads, eight pins; 2° of turn from snapshot to snapshot, after half a turn."""
    tables = flow_tables("mini_mill")
    tables["particles"][0]["count"] = 1500
    tables["contact"]["stiffness"] = MILL_STIFFNESS
    tables["walls"][1]["motion"]["rpm"] = rpm
    if not wet:
        del tables["fluid"], tables["drag"]
        for wall in tables["walls"]:
            del wall["immersed"]
    speed = rpm * 6.0
    what = "wet mill" if wet else "dry mill"
    return Flow(name, what, f"{rpm:g} rpm", speed / 57.29578 * 0.0078, "°", speed, 2.0 / speed, 90, tables, 1)


def bed(name: str, gas_speed: float) -> Flow:
    """2000 beads in a box half as wide as the built-in one; the gas travels 1.32 mm per interval."""
    tables = flow_tables("fluidised_bed")
    tables["particles"][0]["count"] = 2000
    for place, key in (
        (tables["filling"], "highest"),
        (tables["fluid"], "highest"),
        (tables["walls"][0]["shapes"][0], "highest"),
    ):
        place[key][0] = 0.0216
    tables["filling"]["highest"][1] = 0.018
    tables["contact"]["stiffness"] = BED_STIFFNESS
    del tables["time"]["step"]
    tables["fluid"]["cells"] = [6, 26, 1]
    tables["fluid"]["faces"]["-y"]["speed"] = gas_speed
    interval = 1.32e-3 / gas_speed
    return Flow(
        name, "fluidised bed", f"{gas_speed:g} m/s", gas_speed, "mm of gas", 1e3 * gas_speed, interval, 100, tables, 1
    )


def gentle_box(name: str) -> Flow:
    """Shake the box at 0.8 g, so that the beads go with the floor; 1 s with a snapshot every 2 ms, after 0.2 s."""
    return shaken_box(name, 0.0005)._replace(interval=2e-3, start_up=100, snapshots=501)


FLOWS: dict[str, Callable[[], Flow]] = {
    "box_mild": lambda: shaken_box("box_mild", 0.002),
    "box_medium": lambda: shaken_box("box_medium", 0.004),
    "box_violent": lambda: shaken_box("box_violent", 0.008),
    "dry_mild": lambda: mill("dry_mild", 500.0, wet=False),
    "dry_medium": lambda: mill("dry_medium", 1000.0, wet=False),
    "dry_violent": lambda: mill("dry_violent", 2000.0, wet=False),
    "drum_mild": lambda: drum("drum_mild", 20.0),
    "drum_medium": lambda: drum("drum_medium", 40.0),
    "drum_violent": lambda: drum("drum_violent", 80.0),
    "bed_mild": lambda: bed("bed_mild", 0.66),
    "bed_medium": lambda: bed("bed_medium", 1.0),
    "bed_violent": lambda: bed("bed_violent", 1.5),
    "wet_mild": lambda: mill("wet_mild", 500.0, wet=True),
    "wet_medium": lambda: mill("wet_medium", 1000.0, wet=True),
    "wet_violent": lambda: mill("wet_violent", 2000.0, wet=True),
    "box_medium_seed_4": lambda: shaken_box("box_medium_seed_4", 0.004, seed=4),
    "box_medium_seed_5": lambda: shaken_box("box_medium_seed_5", 0.004, seed=5),
    "box_gentle": lambda: gentle_box("box_gentle"),
}
SEEDS = ("box_medium_seed_4", "box_medium_seed_5")  # other packings of one flow: scatter, not evidence
PROVOKED = "box_gentle"  # made to deceive the rule, and not counted with the others


def scene_of(flow: Flow) -> str:
    """Return the TOML text of a flow's scene, as long as it is recorded."""
    tables = {**flow.tables, "seed": flow.seed}
    tables["time"] = {**tables["time"], "duration": (flow.start_up + flow.snapshots - 1) * flow.interval}
    tables["output"] = {"interval": flow.interval}
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in tables.items())


def make(flow: Flow, folder: Path) -> None:
    """Simulate a flow, keep what comes after its start-up, and touch NAME.done; nothing where that stands."""
    done = folder / f"{flow.name}.done"
    if done.exists():
        return
    began = time.monotonic()
    with tempfile.TemporaryDirectory(dir=folder) as work:
        whole = Path(work) / "whole.h5"
        simulate_to(scene_of(flow), flow.name, whole, Reporter(), threads=1)
        with Run(whole) as run:
            crop(run, flow.start_up, folder / f"{flow.name}.h5")
    done.touch()
    print(f"{flow.name}: {time.monotonic() - began:.0f} s", flush=True)


def crop(run: Run, first: int, path: Path) -> None:
    """Write a run again without its first snapshots; times stay as they are, so that moving walls stand right."""
    variables = list(run.quantities)
    with RunWriter(
        path,
        ids=run.ids,
        radius=run.radius,
        species=run.species,
        n_snapshots=run.n_snapshots - first,
        provenance=run.provenance,
        variables=variables,
        grid=run.grid,
        series=sorted(run.series),
        beside=True,
    ) as writer:
        for k in range(first, run.n_snapshots):
            now = run.snapshot(k)
            writer.append(now.time, now.values, {name: float(values[k]) for name, values in run.series.items()})


def main() -> None:
    """Make the runs that are missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=Path, required=True, metavar="DIR")
    parser.add_argument("names", nargs="*", help="default: all")
    options = parser.parse_args()
    options.runs.mkdir(parents=True, exist_ok=True)
    for name in options.names or FLOWS:
        if name not in FLOWS:
            sys.exit(f"flow {name!r} is not known; there are {', '.join(FLOWS)}")
        make(FLOWS[name](), options.runs)


if __name__ == "__main__":
    main()
