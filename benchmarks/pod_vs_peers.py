"""Lanczos POD beside its peers: the same snapshots, time, memory and accuracy, every method in a process of its own.

    python benchmarks/pod_vs_peers.py [--deck tall|taller|steep|all] [--peers pymor bare ...] [--all-peers]
        [--repeats 5] [--rows N] [--snapshots N] [--modes p] [--threads N] [--state FOLDER] [--break-even]

The snapshots lie far from the origin, and all methods decompose them about their mean. Peers that do not centre get
them centred, in the layout they like best, outside their time, but for "pymor-raw": it is given what ours is, and the
mean is taken away in place, within its time. Methods take turns, each turn in a fresh process that has loaded its
libraries and, if it does not take long, has run once at full size. Memory is the peak above snapshots and libraries,
modes included. "bare Gram" is a symmetric product, `eigh` and a product for the modes with nothing checked, each by the
fastest of numpy, scipy and torch, chosen outside its time.
`--break-even` times block Lanczos on the rows against the Gram matrix instead.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import NamedTuple

CHOSEN_BY_HAND = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
if any(name in os.environ for name in CHOSEN_BY_HAND):  # they slow one library down; start again before it is loaded
    os.execve(
        sys.executable, [sys.executable, *sys.argv], {k: v for k, v in os.environ.items() if k not in CHOSEN_BY_HAND}
    )

import numpy as np  # noqa: E402 (the environment first)
import scipy.linalg  # noqa: E402
from known_spectrum import KnownSnapshots, granular, steep  # noqa: E402
from peak_memory import PeakMemory  # noqa: E402
from pod_peers import METHODS, centred  # noqa: E402
from threadpoolctl import threadpool_limits  # noqa: E402

HEIGHT = 8192  # rows that are judged at once
SPECTRUM_KEPT = 600  # singular values of the snapshots that are used for the break-even


class Deck(NamedTuple):
    """Snapshots to decompose, the modes wanted, and where the arrays lie."""

    name: str
    rows: int
    snapshots: int
    modes: int
    dtype: str
    folder: Path = Path()

    @property
    def files(self):
        """Files of the snapshots and of their singular values."""
        stem = f"{self.name}_{self.rows}x{self.snapshots}_{self.modes}"
        return self.folder / f"{stem}.npy", self.folder / f"{stem}_sigma.npy"

    def make(self):
        """Write both files, unless they are there."""
        values, spectrum = self.files
        if spectrum.exists():
            return
        count = self.snapshots - 1
        sigma = steep(count) if self.name == "steep" else granular(count, self.modes)
        W = KnownSnapshots(self.rows, self.snapshots, sigma).filled(self.dtype)
        np.save(values, W)
        if self.dtype == "float32":  # rounding is part of these data
            R = scipy.linalg.qr(centred(W.astype(np.float64)), mode="r", overwrite_a=True, check_finite=False)[0]
            sigma = scipy.linalg.svdvals(R[: self.snapshots])
        np.save(spectrum, sigma)


DECKS = [
    Deck("tall", 100_000, 500, 100, "float64"),
    Deck("taller", 200_000, 400, 20, "float64"),
    Deck("steep", 100_000, 500, 100, "float32"),
]


def turn(name, deck, judge):
    """One turn of a method in a fresh process: what it found, or the reason why it found nothing."""
    task = [sys.executable, __file__, "--turn", name, *deck, *["judge"] * judge]
    ours = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [str(x) for x in task], capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": ours}
    )
    if done.returncode:
        return {"absent": (done.stderr.strip().splitlines() or [f"ended by {done.returncode}"])[-1]}
    return json.loads(done.stdout.splitlines()[-1])


def take_turn(name, *words):
    """Do what `turn` asks for in this process, and print it."""
    deck = Deck(words[0], *map(int, words[1:4]), words[4], Path(words[5]))
    W, sigma = (np.load(file) for file in deck.files)
    method = METHODS[name]
    method.prepare(W[: 4 * deck.snapshots].copy(), deck.modes)()  # libraries are loaded and start their threads
    work = method.prepare(W, deck.modes)
    if method.turns > 1:  # once at full size for nothing: the bare ways were chosen so
        work()
    peak = PeakMemory()
    start, processor = time.perf_counter(), time.process_time()
    modes, values = work()
    found = {"seconds": time.perf_counter() - start, "processor": time.process_time() - processor}
    found["extra"] = peak.extra()
    if "judge" in words:
        found |= judged(np.asarray(modes), np.asarray(values), np.load(deck.files[0]), sigma)
    print(json.dumps(found))


def judged(modes, values, W, sigma):
    """Errors of the values, orthogonality, and what the modes leave of W, over what the best ones would."""
    p, inner, coefficients = modes.shape[1], 0.0, 0.0
    blocks = [slice(low, low + HEIGHT) for low in range(0, len(W), HEIGHT)]
    for rows in blocks:
        U = modes[rows].astype(np.float64)
        inner, coefficients = inner + U.T @ U, coefficients + U.T @ centred(W[rows].astype(np.float64))
    left = sum(
        np.square(centred(W[rows].astype(np.float64)) - modes[rows].astype(np.float64) @ coefficients).sum()
        for rows in blocks
    )
    return {
        "modes": p,
        "error": float(np.abs(values / sigma[: len(values)] - 1).max()),
        "orthogonality": float(np.abs(inner - np.eye(p)).max()),
        "projection": float(np.sqrt(left / np.square(sigma[p:]).sum())),
    }


def in_turns(names, deck, repeats):
    """Return what each method found in every turn, all methods in each round."""
    found = {name: [] for name in names}
    for r in range(repeats):
        print(f"{deck.name}: round {r + 1} of {repeats}", file=sys.stderr, flush=True)
        for name, turns in found.items():
            if r < METHODS[name].turns and not any("absent" in t for t in turns):
                turns.append(turn(name, deck, judge=r == 0))
    return found


def table(found, deck):
    print(f"\n{deck.name}: {deck.rows} x {deck.snapshots}, {deck.modes} modes, {deck.dtype}, {os.cpu_count()} cores")
    print(f"{'':50}{'s, best (worst)':>16}{'/ ours':>8}{'cpu s':>8}{'/ ours':>8}", end="")
    print(f"{'extra MB':>10}{'|Δσ|/σ':>9}{'|φᵀφ-1|':>9}  left/optimal")
    ran = {name: turns for name, turns in found.items() if "absent" not in turns[-1]}
    best = {name: min(t["seconds"] for t in turns) for name, turns in ran.items()}
    processor = {name: min(t["processor"] for t in turns) for name, turns in ran.items()}
    for name, turns in found.items():
        title = f"{name:18}{METHODS[name].call}"
        if name not in best:
            print(f"{title:50} did not run: {turns[-1]['absent']}")
            continue
        wall, cpu = (f"{x[name] / x['ours']:8.2f}" if "ours" in best else f"{'':8}" for x in (best, processor))
        slowest, extra = max(t["seconds"] for t in turns), max(t["extra"] for t in turns) / 1e6
        span = f"{best[name]:.2f} ({slowest:.2f})"
        print(f"{title:50}{span:>16}{wall}{processor[name]:8.2f}{cpu}{extra:10.0f}", end="")
        few = f"  only {turns[0]['modes']} modes" if turns[0]["modes"] < deck.modes else ""
        print(f"{turns[0]['error']:9.0e}{turns[0]['orthogonality']:9.0e}  {turns[0]['projection']:.6f}{few}")
    if "ours" in best:
        against_goals(found, best, deck)


def against_goals(found, best, deck):
    """Say what the goals say: faster than pyMOR, at most 1.1 times the bare Gram; accurate on the steep spectrum."""
    first = found["ours"][0]
    if deck.name == "steep":
        goal = first["projection"] <= 1.001 and first["orthogonality"] <= 1e-6
        print(f"left at most 1.001 of optimal and orthogonal to 1e-6: {'met' if goal else 'MISSED'}")
        return
    bare = min((name for name in best if name.startswith("bare")), key=best.get, default="bare")
    for name, limit in (("pymor", 1.0), (bare, 1.1)):
        if name in best:
            each = median(a["seconds"] / b["seconds"] for a, b in zip(found["ours"], found[name], strict=False))
            ratio = best["ours"] / best[name]
            print(f"ours / {name}: {ratio:.2f}, median of the rounds {each:.2f}, ", end="")
            print(f"goal {limit}: {'met' if ratio <= limit else 'MISSED'}")


def versions(names):
    found = []
    for package in dict.fromkeys(["numpy", *(METHODS[name].package for name in names)]):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} absent (pip install {package})")
    print(", ".join(found), flush=True)


def break_even(repeats, values=40_000_000):
    """Seconds of both routes over N_t and modes; where block Lanczos stops being the faster one."""
    from pod import InputError

    print(f"block Lanczos on the rows / Gram matrix, s, {values:.0e} numbers in memory, best of {repeats}")
    for snapshots in (250, 500, 1000, 2000, 4000):
        rows = values // snapshots
        sigma = granular(snapshots - 1, 100)[:SPECTRUM_KEPT]
        W = KnownSnapshots(rows, snapshots, sigma).filled("float64")
        try:
            print(f"{rows:7} x {snapshots:<5}", end=" ", flush=True)
            ratios = [(p, ratio_of_routes(W, p, repeats)) for p in (5, 10, 20, 40, 80, 160) if p < snapshots]
        except InputError as refusal:
            print(f"skipped: {refusal}")
            return
        print(f"  break-even {crossing(ratios)}", flush=True)


def ratio_of_routes(W, p, repeats):
    from pod import lanczos_pod

    seconds = {"block": [], "gram": []}
    for _ in range(repeats):
        for route, each in seconds.items():
            start = time.perf_counter()
            steps = lanczos_pod(W, modes=p, route=route).steps
            each.append(time.perf_counter() - start)
            if route == "block":
                block_steps = steps
    block, gram = min(seconds["block"]), min(seconds["gram"])
    print(f"p {p}: {block:.2f} / {gram:.2f} ({block_steps} vectors)", end="  ", flush=True)
    return block / gram


def crossing(ratios):
    """Modes at which the ratio is one, between the last p below and the next by logarithms."""
    below = [p for p, ratio in ratios if ratio < 1]
    if not below:
        return f"below {ratios[0][0]} modes"
    last = [p for p, _ in ratios].index(below[-1])
    if last == len(ratios) - 1:
        return f"above {ratios[-1][0]} modes"
    (p, low), (q, high) = ratios[last : last + 2]
    return f"{p * (q / p) ** (np.log(1 / low) / np.log(high / low)):.0f} modes"


def limit_threads(threads):
    """Threads of every library in this process and in those that it starts."""
    os.environ.update({"OMP_NUM_THREADS": str(threads), "OPENBLAS_NUM_THREADS": str(threads)})
    threadpool_limits(threads)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--deck", choices=[*(deck.name for deck in DECKS), "all"], default="all")
    parser.add_argument("--peers", nargs="+", choices=METHODS, help="beside ours; default all that take under a minute")
    parser.add_argument("--all-peers", action="store_true", help="also those that take over a minute")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--rows", type=int)
    parser.add_argument("--snapshots", type=int)
    parser.add_argument("--modes", type=int)
    parser.add_argument("--threads", type=int, help="of every library; default as many as there are cores")
    parser.add_argument("--state", type=Path, help="folder where the snapshots are kept; default a temporary one")
    parser.add_argument("--break-even", action="store_true")
    options = parser.parse_args()
    if options.threads is not None:
        limit_threads(options.threads)
    if options.break_even:
        break_even(options.repeats)
        return
    names = options.peers or [name for name, method in METHODS.items() if options.all_peers or not method.slow]
    names = list(dict.fromkeys(["ours", *names]))
    versions(names)
    changed = {k: v for k in ("rows", "snapshots", "modes") if (v := getattr(options, k)) is not None}
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.state or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for deck in DECKS:
            if options.deck in (deck.name, "all"):
                asked = deck._replace(folder=folder, **changed)
                asked.make()
                table(in_turns(names, asked, options.repeats), asked)
                sys.stdout.flush()


if __name__ == "__main__":
    take_turn(*sys.argv[2:]) if sys.argv[1:2] == ["--turn"] else main()
