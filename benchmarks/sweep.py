"""One pass over the snapshots against nine singular value decompositions with direct projections.

    python benchmarks/sweep.py [--rows 50000] [--snapshots 1000] [--noise 1e-3] [--flowtorch-python PATH]
    python benchmarks/sweep.py --out-of-core [--rows 1500000] [--snapshots 500] [--state FOLDER]

All find R_c(n), n_c and n_lr of nine Δτ from the same array with the same number of threads. Two direct ways, both on
LAPACK's thin SVD of the centred training snapshots:
- every n: the error of every n from its own residual vectors (paper eqs. (31)-(35) as they stand), downdated mode by
  mode on blocks of rows that stay in the cache;
- tail sums: one residual at full rank and Σ_{i>n} c_i², the fewest operations that a direct way can do with.
Beside them flowTorch, by the Python that has it (`sweep_flowtorch.py`), left out where none has. `--out-of-core` sweeps
a run of beads on disk instead (`sweep_run.py`).
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHOSEN_BY_HAND = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
if any(name in os.environ for name in CHOSEN_BY_HAND):  # they slow one library down; start again before it is loaded
    os.execve(
        sys.executable, [sys.executable, *sys.argv], {k: v for k, v in os.environ.items() if k not in CHOSEN_BY_HAND}
    )

import numpy as np  # noqa: E402 (the environment first)
import scipy.linalg  # noqa: E402
import torch  # noqa: E402
from scipy.linalg.blas import dger  # noqa: E402

from pod import SnapshotMatrix  # noqa: E402
from selection import consistent_mode, least_reconstructable_mode, sweep  # noqa: E402

STRIDES = range(10, 1, -1)


def falling_amplitudes(rows, snapshots, noise, seed=0):
    """Motion of 300 frequencies whose amplitudes fall over three decades, with noise on every value."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, snapshots)
    frequency = np.arange(1, 301)
    signals = np.cos(np.pi * frequency[:, None] * t + rng.uniform(0, 2 * np.pi, (300, 1)))
    amplitudes = 10.0 ** (-3 * frequency / 300)
    W = rng.standard_normal((rows, 300)) @ (amplitudes[:, None] * signals)
    W += noise * rng.standard_normal((rows, snapshots))
    return W + rng.standard_normal((rows, 1))


def decompose(X, library):
    """Thin SVD, gesdd, of X (rows, m): modes and singular values."""
    if library == "torch":
        U, sigma, _ = torch.linalg.svd(torch.from_numpy(X), full_matrices=False)
        return U.numpy(), sigma.numpy()
    U, sigma, _ = scipy.linalg.svd(X, full_matrices=False, overwrite_a=True, check_finite=False, lapack_driver="gesdd")
    return U, sigma


def split(W, stride, library):
    """Centred testing snapshots D, modes U, and coefficients c = UᵀD of one Δτ."""
    training = np.arange(0, W.shape[1], stride)
    D = W[:, : training[-1] + 1] - W[:, training].mean(axis=1, keepdims=True)
    U, sigma = decompose(np.array(D[:, training], order="F"), library)
    return D, U, sigma, U.T @ D


def by_tail_sums(W, stride, library):
    """R_c(n), n_c and n_lr of one Δτ, the error of n modes as ‖r‖² + Σ_{i>n} c_i²."""
    D, U, sigma, c = split(W, stride, library)
    D -= U @ c
    tail = np.vstack([np.square(c)[::-1].cumsum(axis=0)[::-1], np.zeros(c.shape[1])]) + np.einsum("ij,ij->j", D, D)
    return judged(tail, sigma, stride, len(W))


def by_every_n(W, stride, library):
    """R_c(n), n_c and n_lr of one Δτ, the error of n modes as the norm of its own residual."""
    D, U, sigma, c = split(W, stride, library)
    square = np.zeros((len(sigma) + 1, D.shape[1]))
    for start in range(0, len(D), 256):
        left = np.asfortranarray(D[start : start + 256].T)  # (testing, rows): half a megabyte a thousand snapshots
        square[0] += np.einsum("ij,ij->i", left, left)
        for n, u in enumerate(U[start : start + 256].T):
            left = dger(-1.0, c[n], u, a=left, overwrite_a=True)
            square[n + 1] += np.einsum("ij,ij->i", left, left)
    return judged(square, sigma, stride, len(W))


def judged(square, sigma, stride, rows):
    """R_c(n), n_c and n_lr from squared errors (n, testing)."""
    error = np.sqrt(square / rows)
    ratio = error.mean(axis=1) / error[:, ::stride].mean(axis=1)
    return ratio, consistent_mode(ratio, 1.05).n_c, least_reconstructable_mode(sigma**2, 0.999)


def timed(work, repeats=1):
    """Return result and seconds, the least of some repeats: what disturbs a timing only ever adds to it."""
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - start)
    return result, min(seconds)


def compare(name, way, W, table, one_pass):
    """Time a direct way and print how much slower it is and how much it differs."""
    show(f"nine SVDs, {name}", *timed(lambda: [way(W, k) for k in STRIDES]), table, one_pass)


def show(name, found, seconds, table, one_pass):
    """Print how much slower a way is and how much what it found differs."""
    pairs = list(zip(found, table.candidates, strict=True))
    # two ratios to almost nothing may differ by much; the difference is relative where R_c is above 1
    worst = max((np.abs(r[: len(c.curves.R_c)] / c.curves.R_c - 1)).max() for (r, _, _), c in pairs)
    same = all((n_c, n_lr) == (c.n_c, c.n_lr) for (_, n_c, n_lr), c in pairs)
    print(f"{name:39}{seconds:8.2f} s   ratio {seconds / one_pass:6.1f}", end="   ")
    print(f"max |ΔR_c|/R_c {worst:.1e}, n_c and n_lr {'equal' if same else 'DIFFERENT'}", flush=True)


def beside_flowtorch(python, W, table, one_pass):
    """Let a Python that has flowTorch sweep the same snapshots, and print how much slower it is."""
    with tempfile.TemporaryDirectory() as folder:
        data, answer = Path(folder, "W.npy"), Path(folder, "answer.npz")
        np.save(data, W)
        peer = [python, str(Path(__file__).with_name("sweep_flowtorch.py")), data, answer, torch.get_num_threads()]
        done = subprocess.run([str(x) for x in peer], capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"flowTorch left out: {(done.stderr.strip().splitlines() or ['it ended without a word'])[-1]}")
            return
        seconds = json.loads(done.stdout.splitlines()[-1])
        with np.load(answer) as arrays:
            pairs = [(arrays[f"r_{k}"], arrays[f"s_{k}"]) for k in STRIDES]
    found = [(r, consistent_mode(r, 1.05).n_c, least_reconstructable_mode(s**2, 0.999)) for r, s in pairs]
    show("flowTorch, nine SVD()", found, seconds["R_c"], table, one_pass)
    own = seconds["own sweep"]
    print(f"{'flowTorch, its own sweep of strides':39}{own:8.2f} s   ratio {own / one_pass:6.1f}   other figures")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int)
    parser.add_argument("--snapshots", type=int)
    parser.add_argument("--noise", type=float, default=1e-3, help="added to a motion of about 4")
    parser.add_argument("--flowtorch-python", help="Python that has flowTorch, default this one")
    parser.add_argument("--out-of-core", action="store_true", help="sweep a run on disk, by suffice.selecting")
    parser.add_argument("--state", type=Path, help="folder where that run is kept; default a temporary one")
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure is not None or options.out_of_core:
        on_disk(options)
    else:
        in_memory(options)


def on_disk(options):
    """Sweep a run that does not fit in memory."""
    from sweep_run import measure, out_of_core

    if options.measure is not None:
        measure(options.measure)
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.state or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        out_of_core(folder, (options.rows or 1_500_000) // 3, options.snapshots or 500)


def in_memory(options):
    """Sweep an array by one pass, by direct ways and by flowTorch."""
    options.rows, options.snapshots = options.rows or 50_000, options.snapshots or 1000
    W = falling_amplitudes(options.rows, options.snapshots, options.noise)
    times = np.arange(options.snapshots) * 1e-3
    print(f"{options.rows} x {options.snapshots}, double precision, {torch.get_num_threads()} threads, Δτ 10 … 2 ms")
    sweep(W[:2000], times, groups=None)  # libraries start their threads
    table, one_pass = timed(lambda: sweep(SnapshotMatrix(W), times, groups=None), repeats=3)
    _, resampled = timed(lambda: sweep(SnapshotMatrix(W), times), repeats=3)
    print(f"one pass                               {one_pass:8.2f} s")
    print(f"one pass and an interval for K_f       {resampled:8.2f} s", flush=True)
    peer = options.flowtorch_python or (sys.executable if importlib.util.find_spec("flowtorch") else None)
    if peer is None:
        print("flowTorch left out: this Python has none; name one by --flowtorch-python")
    else:
        beside_flowtorch(peer, W, table, one_pass)
    compare("tail sums, scipy", lambda W, k: by_tail_sums(W, k, "scipy"), W, table, one_pass)
    compare("tail sums, torch", lambda W, k: by_tail_sums(W, k, "torch"), W, table, one_pass)
    compare("every n, torch", lambda W, k: by_every_n(W, k, "torch"), W, table, one_pass)


if __name__ == "__main__":
    main()
