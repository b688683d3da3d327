"""Speed of our coupled solver beside OpenFOAM's DPMFoam, on its tutorial Goldschmidt, a bubbling bed of 24,750 spheres.

    python benchmarks/coupled_vs_dpmfoam.py [--time 0.01] [--threads 1 2] [--settle 0] [--state FOLDER] [--foam FOLDER]
                                            [--tutorial FOLDER] [--etc FOLDER] [--impact-speed 0.1]

DPMFoam runs on one core; a finished run is read from `--foam` instead. Both start from the tutorial's lattice of
spheres, or with `--settle` from where they are after so many seconds of ours, put to rest (kept in `--state`, as the
run of DPMFoam is). Ours runs three times, on the first of `--threads` (and the first setting on the others):
- the scene's stiffness, fifty steps a contact;
- a stiffness whose contacts last as long as those of DPMFoam's Hertzian pair model at `--impact-speed`;
- the same with the largest step allowed (33 a contact; DPMFoam takes 15 to 30).
All that both solvers know comes from the tutorial's dictionaries; `scene_of` says what they make of it.
"""

import argparse
import gzip
import os
import re
import shutil
import subprocess
import time
from math import exp, pi, sqrt
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np

from sim import Scene, parse_scene, scene_text, simulation_of
from sim.fluid_series import HEIGHT
from sim.law import contact_time
from sim.timestep import time_limits

TUTORIAL = Path("/usr/share/doc/openfoam-examples/examples/lagrangian/DPMFoam/Goldschmidt")
CORNER = np.array([0.075, 0.0075, 0.0])  # m, of our box, from the middle of the tutorial's bottom
UNIT = 0.01  # s, simulated, that costs are given for
OUTPUTS = 5  # bed heights of a run


class Material(NamedTuple):
    """What the tutorial says of one kind of contact, in the terms of Tsuji et al. (1992)."""

    youngs: float  # Pa, E* of both
    radius: float  # m, R*
    mass: float  # kg, m*
    alpha: float
    friction: float
    tangential: float  # k_t / k, 8 √(R δ) G* over 2 E* √(R δ)

    def contact_time(self, speed: float) -> float:
        """Duration (s) of an elastic impact at a speed (m/s): 2.943 δ/v, δ = (15 m* v² / (16 E* √R*))^(2/5)."""
        return 2.943 * (15.0 * self.mass / (16.0 * self.youngs * sqrt(self.radius))) ** 0.4 * speed**-0.2

    @property
    def restitution(self) -> float:
        """At any speed, ln e = −π α / sqrt(5 − α²) (Antypov and Elliott 2011, doi 10.1209/0295-5075/94/50004)."""
        return exp(-pi * self.alpha / sqrt(5.0 - self.alpha**2))


class Run(NamedTuple):
    """A run of either solver."""

    name: str
    times: np.ndarray  # (m,) s, zero first
    height: np.ndarray  # (m,) m, that 99 % of the centres are below
    rise: np.ndarray  # (m,) m, of the mean height of all centres
    wall: np.ndarray  # (m,) s since the first step
    cpu: np.ndarray  # (m,) s
    terms: dict[str, float]  # s of processor time
    note: str

    @property
    def cost(self) -> float:
        """Processor seconds for a hundredth of a second."""
        return float(self.cpu[-1] / self.times[-1] * UNIT)


def text_of(path: Path) -> str:
    packed = path.with_name(path.name + ".gz")
    return gzip.decompress(packed.read_bytes()).decode() if packed.exists() else path.read_text()


def number(text: str, name: str, block: str = "") -> float:
    """Value of an entry of a dictionary, after the name of a block."""
    return float(re.search(rf"^\s*{name}\s+([-+.\de]+);", text[text.index(block) :], re.MULTILINE)[1])


def lattice() -> np.ndarray:
    """Centres (n, 3) m of the tutorial in our box: its x is across the thin side, from the middle of the bottom."""
    rows = text_of(OPTIONS.tutorial / "constant/kinematicCloudPositions").split("//", 2)[-1]
    theirs = np.array(re.findall(r"\(([-\d.e]+) ([-\d.e]+) ([-\d.e]+)\)", rows), dtype=float)
    return theirs[:, [1, 0, 2]] + CORNER


def materials() -> tuple[Material, Material]:
    """Contacts between particles and with walls; those with front and back are `rebound` at the centre."""
    said = text_of(OPTIONS.tutorial / "constant/kinematicCloudProperties")
    density, diameter = number(said, "rho0"), number(said, "value")
    e, nu = number(said, "youngsModulus"), number(said, "poissonsRatio")
    if number(said, "b", "pairSpring") != 1.5 or number(said, "cohesionEnergyDensity", "pairSpring"):
        raise ValueError("the pair model is not Hertz's")
    mass = density * pi * diameter**3 / 6.0

    def contact(block: str, other_e: float, other_nu: float, share: float) -> Material:
        star = 1.0 / ((1.0 - nu**2) / e + (1.0 - other_nu**2) / other_e)
        shear = 0.5 / ((2.0 + nu - nu**2) / e + (2.0 + other_nu - other_nu**2) / other_e)
        alpha, mu = number(said, "alpha", block), number(said, "mu", block)
        return Material(star, share * diameter / 2.0, share * mass, alpha, mu, 4.0 * shear / star)

    wall = "wallSpringSliderDashpotCoeffs"
    wall_e, wall_nu = number(said, "youngsModulus", wall), number(said, "poissonsRatio", wall)
    return contact("pairSpringSliderDashpotCoeffs", e, nu, 0.5), contact(wall, wall_e, wall_nu, 1.0)


def scene_of(position: np.ndarray, stiffness: float | None, duration: float, longest: bool = False) -> Scene:
    """Return our scene, as the tutorial has it: contacts, walls and start.

    Front and back are planes of symmetry there, without springs: centres are reflected on them. Here the particles'
    walls stand a radius behind, less the largest overlap, as a centre must stay within the fluid's box.
    """
    tables = parse_scene(scene_text("goldschmidt")).model_dump(exclude_unset=True)
    pair, wall = materials()
    stiffness = stiffness or tables["contact"]["stiffness"]
    radius = tables["particles"][0]["diameter"] / 2.0
    low, high, behind = tables["fluid"]["lowest"], tables["fluid"]["highest"], 0.9 * radius
    box = {"shape": "box", "lowest": low, "highest": high, "particles": "inside", "open": ["-y", "+y"]}
    apart = box | {
        "lowest": [low[0], low[1] - behind, low[2]], "highest": [high[0], high[1] + behind, high[2]],
        "open": ["-x", "+x", "-z", "+z"],
    }  # fmt: skip
    rebound = {"stiffness": stiffness, "restitution": 0.97, "friction": 0.09}
    particles = {k: v for k, v in tables["particles"][0].items() if k != "count"} | {"position": position.tolist()}
    law = [
        {"stiffness": stiffness, "restitution": m.restitution, "friction": m.friction,
         "tangential_stiffness_ratio": m.tangential} for m in (pair, wall)
    ]  # fmt: skip
    scene = Scene.model_validate(
        tables | {
            "particles": [particles], "contact": law[0], "wall_contact": law[1],
            "walls": [{"name": "box", "shapes": [box]}, {"name": "sides", "shapes": [apart], "contact": rebound}],
            "time": {"duration": duration}, "output": {"interval": duration / OUTPUTS},
        }
    )  # fmt: skip
    if longest:
        step = min(limit.largest for limit in time_limits(scene))
        return scene.model_copy(update={"time": scene.time.model_copy(update={"step": step})})
    return scene


def ours(name: str, scene: Scene) -> Run:
    """Run a scene; processor time of the terms is their share of the wall clock."""
    run = simulation_of(scene)
    first, wall, cpu = run.term_seconds(), time.perf_counter(), time.process_time()
    rows = []
    for k in range(OUTPUTS + 1):
        run.advance_to(k * run.steps_per_snapshot)
        spent = time.perf_counter() - wall, time.process_time() - cpu
        rows.append((run.time, np.quantile(run.places()[:, 2], HEIGHT), run.places()[:, 2].mean(), *spent))
    columns = np.array(rows).T
    share = columns[4, -1] / columns[3, -1]
    terms = {part: share * (spent - first[part]) for part, spent in run.term_seconds().items() if part != "immersed"}
    terms = {"contact and motion": columns[4, -1] - sum(terms.values())} | terms
    _, contacts, overlap = run.ledger()
    duration = contact_time(scene.contact.stiffness, scene.contact.restitution, materials()[0].mass)
    note = (
        f"{run.step} steps of {run.dt * 1e6:.3g} µs, {duration / run.dt:.0f} a contact of {duration * 1e6:.0f} µs; "
        f"{run.fluid_steps} of the fluid; at the end {contacts:.2f} contacts a particle, overlaps to {overlap:.1%}"
    )
    return Run(name, columns[0], columns[1], columns[2] - columns[2, 0], columns[3], columns[4], terms, note)


def settled(position: np.ndarray, stiffness: float) -> np.ndarray:
    """Where ours puts the spheres in `--settle` seconds."""
    path = OPTIONS.state / f"settled_{OPTIONS.settle:g}s.npy"
    if not path.exists():
        run = simulation_of(scene_of(position, stiffness, OPTIONS.settle, longest=True))
        run.advance_to(OUTPUTS * run.steps_per_snapshot)
        np.save(path, run.snapshot().position)
    return np.load(path)


def run_foam(position: np.ndarray) -> Path:
    """Run the tutorial from these positions (ours) in a new folder."""
    folder = OPTIONS.state / f"dpmfoam_{OPTIONS.settle:g}s"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(OPTIONS.tutorial, folder)
    control = folder / "system/controlDict"
    said = re.sub(r"^endTime.*", f"endTime {OPTIONS.time};", control.read_text(), flags=re.MULTILINE)
    said = re.sub(r"^writeInterval.*", f"writeInterval {OPTIONS.time / OUTPUTS};", said, flags=re.MULTILINE)
    control.write_text(said.replace("timePrecision   6", "timePrecision   9"))
    place = folder / "constant/kinematicCloudPositions"
    head = text_of(place).split("\n(\n")[0]
    place.with_name(place.name + ".gz").unlink(missing_ok=True)
    rows = (position - CORNER)[:, [1, 0, 2]]
    place.write_text(head + "\n(\n" + "".join(f"({x:.9f} {y:.9f} {z:.9f})\n" for x, y, z in rows) + ")\n")
    environment = os.environ | {"WM_PROJECT_DIR": str(OPTIONS.etc)}
    for program in ("blockMesh", "DPMFoam"):
        with (folder / f"log.{program}").open("w") as log:
            subprocess.run([program], cwd=folder, env=environment, stdout=log, stderr=log, check=True)
    return folder


def heights_of(folder: Path) -> np.ndarray:
    """Heights (n,) m of the centres in a folder of one time: a bracket, three doubles, the cell, a bracket, a line."""
    said = (folder / "lagrangian/kinematicCloud/positions").read_bytes()
    found = re.search(rb"\n(\d+)\n\(\n", said)
    row = np.dtype({"names": ["z"], "formats": ["<f8"], "offsets": [17], "itemsize": 31})
    return np.frombuffer(said, row, int(found[1]), found.end())["z"]


def foam(folder: Path, position: np.ndarray) -> Run:
    """Read a finished run: costs are of all steps but the first, which makes the particles."""
    log = (folder / "log.DPMFoam").read_text()
    clock = re.findall(r"^Time = (\S+)$.*?ExecutionTime = (\S+) s  ClockTime = (\S+) s", log, re.MULTILINE | re.DOTALL)
    at, cpu, wall = np.array(clock, dtype=float).T
    kept = sorted((float(p.name), p) for p in folder.iterdir() if (p / "lagrangian").exists() and p.name != "0")
    times = np.array([0.0, *(t for t, _ in kept)])
    heights = [position[:, 2], *(heights_of(path) for _, path in kept)]
    mean = np.array([h.mean() for h in heights])
    step = at[1] - at[0]
    whole = [np.interp(times, at, spent - spent[0]) * times / np.maximum(times - step, step) for spent in (wall, cpu)]
    cycles = [int(n) for n in re.findall(r"(\d+) move-collide", log)]
    note = f"{len(at)} steps of {step * 1e6:.3g} µs, each in {np.mean(cycles):.2f} of the particles in the mean"
    height = np.array([np.quantile(h, HEIGHT) for h in heights])
    return Run("DPMFoam, 1 core", times, height, mean - mean[0], *whole, {}, note)


def shown(runs: list[Run], peer: Run | None) -> None:
    """Print costs, ratios and terms for a hundredth of a second, then heights."""
    print(f"\n{f'for {UNIT} s:':40} processor s   wall s   ratio by processor   by wall clock")
    for run in [peer, *runs] if peer else runs:
        per = UNIT / run.times[-1]
        slower = [peer.cost / run.cost, peer.wall[-1] / peer.times[-1] * UNIT / run.wall[-1] / per] if peer else []
        ratio = "".join(f"{r:20.1f}" for r in slower)
        print(f"{run.name:40}{run.cost:12.2f} {run.wall[-1] * per:8.2f}{ratio}\n    {run.note}")
        parts = [f"{part} {spent * per:.2f} ({spent / run.cpu[-1]:.0%})" for part, spent in run.terms.items()]
        print(f"    {', '.join(parts)}\n" if parts else "", end="")
    print("\nheight that 99 % of the centres are below, mm; rise of the mean height, µm")
    columns = [peer, *runs] if peer else runs
    print("time, ms  " + "".join(f"{run.name:>38}" for run in columns))
    for t in runs[0].times:
        cells = [(1e3 * np.interp(t, r.times, r.height), 1e6 * np.interp(t, r.times, r.rise)) for r in columns]
        print(f"{t * 1e3:8.3g}  " + "".join(f"{height:27.4f} {rise:10.2f}" for height, rise in cells))


def main() -> None:
    if not OPTIONS.tutorial.exists():
        raise SystemExit(f"no tutorial at {OPTIONS.tutorial}; apt-get install openfoam-examples, or --tutorial")
    pair, _ = materials()
    wanted = pair.contact_time(OPTIONS.impact_speed)
    stiff = pair.mass * (pi**2 + np.log(pair.restitution) ** 2) / wanted**2
    print(
        f"Hertz at {OPTIONS.impact_speed:g} m/s: contacts of {wanted * 1e6:.1f} µs, as ours at {stiff:.0f} N/m; "
        f"restitution {pair.restitution:.4f}"
    )
    OPTIONS.state.mkdir(parents=True, exist_ok=True)
    numba.set_num_threads(OPTIONS.threads[0])
    position = settled(lattice(), stiff) if OPTIONS.settle else lattice()
    ours("compiles", scene_of(position, None, 2e-4))
    settings = [
        ("default stiffness", None, False), ("equal contact time", stiff, False),
        ("equal time, longest step", stiff, True),
    ]  # fmt: skip
    runs = []
    for threads in OPTIONS.threads:
        numba.set_num_threads(threads)
        for name, stiffness, longest in settings if threads == OPTIONS.threads[0] else settings[:1]:
            scene = scene_of(position, stiffness, OPTIONS.time, longest)
            runs.append(ours(f"{name}, {threads} thread{'s' * (threads > 1)}", scene))
            print(f"{runs[-1].name}: {runs[-1].cost:.2f} s", flush=True)
    folder, peer = OPTIONS.foam, None
    if folder is None and not shutil.which("DPMFoam"):
        print("DPMFoam is skipped: it is not on the path; apt-get install openfoam, or --foam")
    else:
        peer = foam(folder or run_foam(position), position)
    shown(runs, peer)


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--time", type=float, default=0.01, help="s, simulated")
    parser.add_argument("--threads", type=int, nargs="+", default=[1], help="of ours; the first for all settings")
    parser.add_argument("--settle", type=float, default=0.0, help="s of ours before; 0: the tutorial's lattice")
    parser.add_argument("--impact-speed", type=float, default=0.1, help="m/s, at which contact times are equal")
    parser.add_argument("--state", type=Path, default=Path("coupled_vs_dpmfoam"), help="folder of starts and runs")
    parser.add_argument("--foam", type=Path, help="folder of a finished run of DPMFoam from the same start")
    parser.add_argument("--tutorial", type=Path, default=TUTORIAL, help="folder of the tutorial")
    parser.add_argument("--etc", type=Path, default=Path("/usr/share/openfoam"), help="folder with OpenFOAM's etc")
    return parser.parse_args()


if __name__ == "__main__":
    OPTIONS = options()
    main()
