"""Decomposition, surrogates, the rule and the file of a run at their extremes."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from extremes_case import Case

from pod import SnapshotMatrix, lanczos_pod
from selection import sweep
from suffice.run import Run
from suffice.store import RunWriter
from surrogates import SURROGATES

TIMES = np.linspace(0.0, 1.0, 61)
CURVES = np.stack([np.sin(6 * TIMES) + 0.2 * np.cos(11 * TIMES), np.cos(9 * TIMES), TIMES**2], axis=1)
RATES = np.stack([6 * np.cos(6 * TIMES) - 2.2 * np.sin(11 * TIMES), -9 * np.sin(9 * TIMES), 2 * TIMES], axis=1)


def spectrum(decades: float, scale: float = 1.0) -> float:
    """Snapshots whose 20 singular values fall over so many decades: relative error of the first five eigenvalues."""
    rng = np.random.default_rng(0)
    left = np.linalg.qr(rng.normal(size=(400, 20)))[0]
    right = rng.normal(size=(60, 20))
    right = np.linalg.qr(right - right.mean(axis=0))[0]
    sigma = scale * 10.0 ** -np.linspace(0.0, decades, 20)
    basis = lanczos_pod(SnapshotMatrix((left * sigma) @ right.T), modes=5)
    return float(np.max(np.abs(basis.values * 60 / sigma[:5] ** 2 - 1.0)))


def snapshots(count: int, alike: bool = False) -> float:
    """POD of so many snapshots, of two different ones their one mode: relative error of its eigenvalue |Δ|²/4."""
    W = np.random.default_rng(0).normal(size=(30, 1 if alike else count))
    found = lanczos_pod(SnapshotMatrix(np.tile(W, (1, count)) if alike else W), energy=0.999)
    assert len(found.values) == 1
    return abs(float(found.values[0] * 4 / ((W[:, 1] - W[:, 0]) ** 2).sum()) - 1.0)


def coefficients(scale: float) -> float:
    """A spline through coefficients of a scale: relative error between the snapshots of a sine."""
    times = np.linspace(0.0, 1.0, 201)
    found = SURROGATES["spline"]().fit(times, scale * np.sin(6 * times)[:, None]).predict([0.3333])
    return abs(float(found[0, 0]) / (scale * np.sin(6 * 0.3333)) - 1.0)


def scaled(name: str, scale: float) -> float:
    """A surrogate of coefficients of a scale, over it, against that of scale 1: largest difference."""
    settings: dict[str, Any] = {"steps": 20} if name in ("mlp", "lstm") else {}
    surrogate = SURROGATES[name]
    asked = TIMES[10:20:3] + (0.005 if surrogate.bridges else 0.0)
    one, other = (surrogate(**settings).fit(TIMES, s * CURVES, s * RATES).predict(asked) for s in (1.0, scale))
    return float(np.abs(other / scale - one).max() / np.abs(one).max())


def every_surrogate(scale: float) -> tuple[float, str]:
    """The largest difference of all surrogates."""
    return max(scaled(name, scale) for name in SURROGATES), f"all {len(SURROGATES)} of them"


def judged(scale: float) -> float:
    """The rule on snapshots of a scale: how many of its indices and verdicts are other than at scale 1."""
    chance = np.random.default_rng(2)
    phase = chance.normal(size=(70, 1))
    W = sum(chance.normal(size=(70, 1)) * np.sin(5 * k * (TIMES + phase)) / k**2 for k in range(1, 20))
    one, other = (sweep(s * W, TIMES, [2 / 60, 4 / 60]).candidates for s in (1.0, scale))
    assert all(c.K_f is not None for c in one)
    return float(sum((a.n_lr, a.n_c, a.K_f, a.verdict) != (b.n_lr, b.n_c, b.K_f, b.verdict)
                     for a, b in zip(one, other, strict=True)))  # fmt: skip


def at_round_off() -> float:
    """The rule on snapshots of rank one, where E_train is nothing but round-off: how many Δτ it does not leave open."""
    W = np.random.default_rng(2).standard_normal((300, 1)) * np.cos(40.0 * TIMES) + 5.0
    found = sweep(W, TIMES).candidates
    return float(sum(c.verdict != "undecidable" or c.n_lr != 1 for c in found)) if found else 1.0


def stored(precision: str) -> float:
    """Positions written and read back in a precision: largest relative error."""
    position = np.random.default_rng(0).uniform(1.0, 2.0, (50, 3))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        with RunWriter(path, ids=np.arange(50), radius=np.full(50, 0.1), species=np.zeros(50), n_snapshots=1,
                       provenance={}, variables=("position",), precision=precision) as run:  # fmt: skip
            run.append(0.0, {"position": position})
        with Run(path) as back:
            return float(np.max(np.abs(back.snapshot(0).values["position"] / position - 1.0)))


def many_snapshots(count: int) -> float:
    """Write a run of so many snapshots and read it back, all times and the last positions."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        with RunWriter(path, ids=[0], radius=[0.1], species=[0], n_snapshots=count, provenance={},
                       variables=("position",), precision="double", beside=True) as run:  # fmt: skip
            for k in range(count):
                run.append(1e-3 * k, {"position": np.full((1, 3), float(k))})
        with Run(path) as back:
            lost = count - back.n_snapshots + abs(float(back.variable("position.x")[0:1][0, -1]) - (count - 1))
            return lost + float(np.abs(back.times - 1e-3 * np.arange(count)).max())


CASES = [
    Case("POD", "flat spectrum", lambda: spectrum(0.0)),
    Case("POD", "singular values over 8 decades", lambda: spectrum(8.0)),
    Case("POD", "singular values over 16 decades", lambda: spectrum(16.0), 1e-9),
    Case("POD", "snapshots of 1e-12 m", lambda: spectrum(2.0, 1e-12)),
    Case("POD", "snapshots of 1e12 m", lambda: spectrum(2.0, 1e12)),
    Case("POD", "1 snapshot", lambda: snapshots(1), says="a decomposition needs at least 2"),
    Case("POD", "2 snapshots", lambda: snapshots(2)),
    Case("POD", "9 snapshots, all the same", lambda: snapshots(9, True), says="nothing moves, all are the same"),
    Case("surrogates", "spline, coefficients of 1e-12", lambda: coefficients(1e-12), 1e-8),
    Case("surrogates", "spline, coefficients of 1e12", lambda: coefficients(1e12), 1e-8),
    Case("surrogates", "coefficients 2⁻⁴⁰ ≈ 1e-12 times as large", lambda: every_surrogate(2.0**-40), 0.0),
    Case("surrogates", "coefficients 2⁴⁰ ≈ 1e12 times as large", lambda: every_surrogate(2.0**40), 0.0),
    Case("surrogates", "rbf, coefficients 1e12 times as large", lambda: scaled("rbf", 1e12)),
    Case("surrogates", "mlp, coefficients 1e-12 times as large", lambda: scaled("mlp", 1e-12)),
    Case("surrogates", "lstm, coefficients 1e12 times as large", lambda: scaled("lstm", 1e12), 1e-6),
    Case("rule", "snapshots of 1e-12 m", lambda: judged(1e-12), 0.0),
    Case("rule", "snapshots of 1e12 m", lambda: judged(1e12), 0.0),
    Case("rule", "E_train at round-off is undecidable", at_round_off, 0.0),
    Case("run", "single precision", lambda: stored("single"), 6e-8),
    Case("run", "double precision", lambda: stored("double"), 0.0),
    Case("run", "5,000 snapshots", lambda: many_snapshots(5000)),
]
