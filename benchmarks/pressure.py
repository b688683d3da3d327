"""Time of one pressure solve against the number of cells, ours beside conjugate gradients with PyAMG and SciPy's LU.

    python benchmarks/pressure.py [--cells 16 32 64 128] [--direct-up-to 16] [--amg-up-to 64]

Coefficients 1 + ½ sin 6x cos 5y sin 4z in a closed cube, right-hand sides at random, residual 1e-8 of the largest
right-hand side, from a guess of zero. "setup" is what new coefficients cost. The best of three runs counts.
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

import numpy as np  # noqa: E402 (the environment first)
from scipy import sparse  # noqa: E402
from scipy.sparse.linalg import cg, splu  # noqa: E402

from sim.pressure import PressureSolver  # noqa: E402

try:
    import pyamg
except ImportError:
    pyamg = None

RELATIVE = 1e-8


def coefficients(n):
    cells, faces = (np.arange(n) + 0.5) / n, np.arange(n + 1) / n
    found = []
    for axis in range(3):
        x, y, z = (faces if axis == a else cells for a in range(3))
        a = 1.0 + 0.5 * np.sin(6 * x) * np.cos(5 * y)[:, None] * np.sin(4 * z)[:, None, None]
        ends = np.moveaxis(a, 2 - axis, 0)
        ends[0] = ends[-1] = 0.0
        found.append(a)
    return found


def matrix(faces, n):
    number, parts = np.arange(n**3).reshape(n, n, n), []
    for axis, a in enumerate(faces):
        w, c = np.moveaxis(a, 2 - axis, 0)[1:-1].ravel() * n**2, np.moveaxis(number, 2 - axis, 0)
        low, high = c[:-1].ravel(), c[1:].ravel()
        pair = sparse.coo_array((-w, (low, high)), shape=(n**3, n**3))
        parts.append(pair + pair.T)
    off = sum(parts).tocsr()
    return (sparse.diags_array(-off.sum(axis=1)) + off).tocsr()


def best(call, times=3):
    seconds = []
    for _ in range(times):
        begin = time.perf_counter()
        result = call()
        seconds.append(time.perf_counter() - begin)
    return min(seconds), result


def ours(n, faces, rhs):
    solver = PressureSolver((n, n, n), (1.0 / n,) * 3, (False,) * 3)
    setup, _ = best(lambda: solver.set_coefficients(*faces))
    pressure = np.zeros_like(rhs)

    def solve():
        pressure[:] = 0.0
        return solver.solve_(pressure, rhs, RELATIVE * np.abs(rhs).max())

    seconds, solution = best(solve)
    if solution.residual > RELATIVE * np.abs(rhs).max():
        raise RuntimeError(f"not converged at {n}³: {solution}")
    return setup, seconds, solution.iterations


def with_amg(faces, n, rhs):
    system, b = matrix(faces, n), -rhs.ravel()
    setup, preconditioner = best(lambda: pyamg.ruge_stuben_solver(system).aspreconditioner(), 1)
    count = 0

    def counted(_):
        nonlocal count
        count += 1

    begin = time.perf_counter()
    x, _ = cg(system, b, rtol=RELATIVE, M=preconditioner, callback=counted)
    seconds = time.perf_counter() - begin
    if np.abs(system @ x - b).max() > 10 * RELATIVE * np.abs(b).max():
        raise RuntimeError(f"PyAMG did not converge at {n}³")
    return setup, seconds, count


def with_lu(faces, n, rhs):
    system, b = matrix(faces, n).tocsc(), -rhs.ravel()
    setup, factors = best(lambda: splu(system[1:, 1:]), 1)  # the first pressure is zero
    seconds, _ = best(lambda: factors.solve(b[1:]), 1)
    return setup, seconds, 1


def table(name, rows):
    print(f"\n{name}\n  cells   setup ms   solve ms  iterations  ns/cell  ns/cell/iteration")
    for n, (setup, seconds, iterations) in rows.items():
        each = seconds / n**3 * 1e9
        print(
            f"{n:>5}³ {setup * 1e3:10.2f} {seconds * 1e3:10.2f} {iterations:11d} {each:8.0f} {each / iterations:18.0f}"
        )
    if len(rows) > 1:
        exponent = np.polyfit([3 * np.log(n) for n in rows], [np.log(seconds) for _, seconds, _ in rows.values()], 1)[0]
        print(f"cost of a solve ~ cells^{exponent:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[16, 32, 64, 128], help="along each edge of the cube")
    parser.add_argument("--direct-up-to", type=int, default=16)
    parser.add_argument("--amg-up-to", type=int, default=64)
    chosen = parser.parse_args()
    problems = {}
    for n in chosen.cells:
        rhs = np.random.default_rng(n).standard_normal((n, n, n))
        problems[n] = coefficients(n), rhs - rhs.mean()
    ours(8, coefficients(8), problems[chosen.cells[0]][1][:8, :8, :8])  # compiles
    table("ours", {n: ours(n, faces, rhs) for n, (faces, rhs) in problems.items()})
    if pyamg is None:
        print("\nPyAMG is absent (pip install pyamg)")
    else:
        rows = {n: with_amg(faces, n, rhs) for n, (faces, rhs) in problems.items() if n <= chosen.amg_up_to}
        table(f"scipy.sparse.linalg.cg with PyAMG {pyamg.__version__} (Ruge–Stüben)", rows)
    rows = {n: with_lu(faces, n, rhs) for n, (faces, rhs) in problems.items() if n <= chosen.direct_up_to}
    table("scipy.sparse.linalg.splu", rows)


if __name__ == "__main__":
    main()
